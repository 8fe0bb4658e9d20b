"""Estimators elsewhere: C, FMU, ONNX, served models. No other imports onnxruntime."""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # a laboratory calls nobody unasked
