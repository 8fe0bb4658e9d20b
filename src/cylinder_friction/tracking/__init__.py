"""MLflow: runs, lineage, registry and the promotion gate. No other package imports mlflow."""

import logging
import os

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")  # a laboratory's pipeline calls nobody unasked
os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")  # a bar for three small files is noise
os.environ.setdefault("MLFLOW_LOGGING_LEVEL", "WARNING")
# The only time limits for a server that does not respond: two tries of 8 s per request. MLflow would wait for minutes.
os.environ.setdefault("MLFLOW_HTTP_REQUEST_TIMEOUT", "8")  # [s] until the next byte, not for a whole file
os.environ.setdefault("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")
logging.getLogger("urllib3.connectionpool").setLevel(logging.ERROR)  # a retry needs no message
