"""MLflow: runs, lineage, registry and the promotion gate. No other package imports mlflow."""

import os

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # a laboratory's pipeline calls nobody unasked
os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")  # a bar for three small files is noise
os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "20")  # [s]; MLflow would wait for a silent server for minutes
os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "2")
