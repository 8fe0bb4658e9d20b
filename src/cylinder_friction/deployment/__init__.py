"""Estimators outside training: ONNX graphs, C, FMUs, served models. The only package that imports onnxruntime."""

import os

os.environ.setdefault("ORT_DISABLE_TELEMETRY", "1")  # a laboratory calls nobody unasked
