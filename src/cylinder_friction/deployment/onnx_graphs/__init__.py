"""The whole estimator as ONNX graphs: raw sample in, newtons, bounds and flags out."""

from cylinder_friction.deployment.onnx_graphs.export import ExportedOnnx, export_model, export_onnx
from cylinder_friction.deployment.onnx_graphs.sequence import sequence_graph
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.onnx_graphs.stream import OnnxSequence, OnnxStepStream, open_sequence, open_step

__all__ = [
    "ExportedOnnx",
    "OnnxSequence",
    "OnnxStepStream",
    "export_model",
    "export_onnx",
    "open_sequence",
    "open_step",
    "sequence_graph",
    "step_graph",
]
