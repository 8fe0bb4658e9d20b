"""Exported graphs run by ONNX Runtime: sample by sample, or a recording at once."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import onnx
import onnxruntime

from cylinder_friction.deployment.onnx_graphs.description import MODEL_HASH, session_options
from cylinder_friction.realtime.flags import Estimate

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TYPES = {"tensor(double)": np.float64, "tensor(float)": np.float32, "tensor(int32)": np.int32}


class OnnxStepStream:
    """One running estimate of a step graph.

    Every array is made once: two bindings take turns, the state that one writes is the state that the other reads.
    Streams on one session do not touch each other.

    Attributes:
        session: On a step graph.
    """

    def __init__(self, session: onnxruntime.InferenceSession) -> None:
        self.session = session
        self._arrays = {port.name: _array(port) for port in (*session.get_inputs(), *session.get_outputs())}
        self._sample = self._arrays["sample"]
        self._outputs = tuple(self._arrays[name] for name in ("friction_n", "lower_n", "upper_n", "flags"))
        states = [port.name for port in session.get_inputs() if port.name != "sample"]
        back = {name: self._arrays[f"{name}_out"] for name in states}
        back |= {f"{name}_out": self._arrays[name] for name in states}
        self._bindings = self._bound(self._arrays), self._bound({**self._arrays, **back})
        self._turn = 0

    def reset(self) -> None:
        """Forget everything; the next step is a first step."""
        for array in self._arrays.values():
            array[...] = 0

    def warm_up(self, *sample: float, steps: int) -> None:
        """Reset, then take ``steps`` steps on one and the same sample, so that the state comes to rest at it."""
        self.reset()
        for _ in range(steps):
            self.step(*sample)

    def step(self, *sample: float) -> Estimate:
        """Return the estimate at this sample, one number per input, whatever the sample is."""
        self._sample[0] = sample
        self.session.run_with_iobinding(self._bindings[self._turn])
        self._turn = 1 - self._turn
        friction, lower, upper, flags = self._outputs
        return Estimate(friction.item(), lower.item(), upper.item(), flags.item())

    def close(self) -> None:
        """Release nothing; present so that streams of every runtime are used alike."""

    def _bound(self, arrays: dict[str, NDArray[Any]]) -> Any:
        binding = self.session.io_binding()
        ports = {port.name: binding.bind_input for port in self.session.get_inputs()}
        ports |= {port.name: binding.bind_output for port in self.session.get_outputs()}
        for name, bind in ports.items():
            array = arrays[name]
            bind(name, "cpu", 0, array.dtype.type, array.shape, array.ctypes.data)
        return binding


class OnnxSequence:
    """Estimates of whole recordings by a sequence graph, each from a fresh state.

    Attributes:
        session: On a sequence graph.
    """

    def __init__(self, session: onnxruntime.InferenceSession) -> None:
        self.session = session

    def run(self, samples: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return friction, lower and upper bound [N], shape ``(n, 3)``, and flags, shape ``(n,)``.

        Args:
            samples: Raw, shape ``(n, inputs)``; by default pressure 1 [Pa], pressure 2 [Pa], position [m].
        """
        outputs = ["friction_n", "lower_n", "upper_n", "flags"]
        samples = np.ascontiguousarray(samples, dtype=np.float64)
        *newtons, flags = self.session.run(outputs, {"samples": samples})
        return np.stack(newtons, axis=1), flags

    def close(self) -> None:
        """Release nothing; present so that streams of every runtime are used alike."""


def open_step(source: Path | onnx.ModelProto) -> OnnxStepStream:
    """Return a fresh stream of an exported step graph, with the session options stored in it.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is not a step graph of this project.
    """
    return OnnxStepStream(open_session(source, "step", "sample"))


def open_sequence(source: Path | onnx.ModelProto) -> OnnxSequence:
    """Return an exported sequence graph, ready to run, with the session options stored in it.

    Raises:
        FileNotFoundError: There is no such file.
        ValueError: The file is not a sequence graph of this project.
    """
    return OnnxSequence(open_session(source, "sequence", "samples"))


def open_session(source: Path | onnx.ModelProto, kind: str, first_input: str) -> onnxruntime.InferenceSession:
    """Return a session on an exported graph, made as the graph itself asks."""
    name, model = ("model", source) if isinstance(source, onnx.ModelProto) else (str(source), onnx.load(source))
    metadata = {entry.key: entry.value for entry in model.metadata_props}
    inputs = [port.name for port in model.graph.input]
    if MODEL_HASH not in metadata or first_input not in inputs:
        raise ValueError(
            f"{name}: is not a {kind} graph, its inputs are {inputs}; expected {first_input!r} and the metadata that "
            "`cylinder-friction export onnx` writes"
        )
    content = model.SerializeToString(deterministic=True)
    return onnxruntime.InferenceSession(content, session_options(metadata), providers=["CPUExecutionProvider"])


def _array(port: Any) -> NDArray[Any]:
    return np.zeros(port.shape, dtype=TYPES[port.type])
