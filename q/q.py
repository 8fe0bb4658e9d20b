import logging,sys
import cylinder_friction.tracking
from pathlib import Path
import mlflow
from mlflow import MlflowClient
from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore
d=Path("/tmp/track/q/x.db"); d.unlink(missing_ok=True)
SqlAlchemyStore(f"sqlite:///{d}", "file:///tmp/track/q/a").engine.dispose()
print("made", file=sys.stderr)
for n in ("mlflow","alembic","sqlalchemy"): print(n, logging.getLogger(n).level, file=sys.stderr)
