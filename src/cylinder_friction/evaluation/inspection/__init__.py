"""Inspection of logger files: the findings of all checks and views, before anything is trained on them."""
