"""The whole estimator as ONNX graphs: raw sample in, newtons, bounds and flags out."""
