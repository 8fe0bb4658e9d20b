"""The step graph in ONNX Runtime."""

from pathlib import Path

from cylinder_friction.deployment.onnx_graphs.export import export_model
from cylinder_friction.deployment.onnx_graphs.stream import OnnxStepStream, open_step
from cylinder_friction.realtime.model import StepModel


class OnnxStep:
    """One call per sample, the state fed back."""

    name = "onnx_step"

    def open(self, model: StepModel, folder: Path) -> OnnxStepStream:
        path = folder / "step.onnx"
        return open_step(path if path.exists() else export_model(model, folder).step)


RUNTIME = OnnxStep()
