"""Models in commands: a folder, or a registered model."""

from pathlib import Path


def model_folder(given: str, scratch: Path) -> tuple[Path, str]:
    """Find the folder of a saved estimator, and its name: the path, or the version that an alias names.

    The folder of a registered model is copied below ``scratch``.
    """
    if not given.startswith("models:/"):
        return Path(given), str(Path(given).resolve())
    from cylinder_friction.tracking.lineage import estimator_folder  # MLflow: only for registered models

    return estimator_folder(given, Path(), scratch)
