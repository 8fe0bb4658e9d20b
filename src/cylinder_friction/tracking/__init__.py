"""MLflow: runs, lineage, registry and the promotion gate. No other package imports mlflow."""

import os

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # a laboratory's pipeline calls nobody unasked
os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")  # a bar for three small files is noise
