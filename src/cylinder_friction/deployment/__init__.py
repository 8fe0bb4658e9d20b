"""Estimators elsewhere: C, FMU and served models."""
