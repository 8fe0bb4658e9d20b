"""The stages of the pipeline, one thin module each; ``dvc.yaml`` runs them."""
