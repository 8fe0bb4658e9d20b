"""The pipeline: one thin module per stage of ``dvc.yaml``."""
