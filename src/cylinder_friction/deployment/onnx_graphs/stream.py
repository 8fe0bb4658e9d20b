"""Exported graphs run by ONNX Runtime: sample by sample, or a recording at once."""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
from numpy.typing import NDArray

from cylinder_friction.deployment.onnx_graphs.description import MODEL_HASH, session_options
from cylinder_friction.realtime.flags import Estimate
from cylinder_friction.realtime.sensor_offset import refuse_impossible
from cylinder_friction.realtime.stream import NO_OFFSET

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
        self._arrays = {
            port.name: np.zeros(port.shape, dtype=TYPES[port.type])
            for port in (*session.get_inputs(), *session.get_outputs())
        }
        self._sample = self._arrays["sample"]
        self._outputs = tuple(self._arrays[name] for name in ("friction_n", "lower_n", "upper_n", "flags"))
        states = [port.name for port in session.get_inputs() if port.name != "sample"]
        back = {name: self._arrays[f"{name}_out"] for name in states}
        back |= {f"{name}_out": self._arrays[name] for name in states}
        self._bindings = self._bound(self._arrays), self._bound({**self._arrays, **back})
        self.reset()

    def reset(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> None:
        """Forget everything; the next step is a first step, from this offset of the sensors (see ``RealTimeStream``).

        Raises:
            ValueError: An offset is given, but this graph learns none; or a number is impossible.
        """
        given = _given(self.session, offset_n, uncertainty_n)
        for array in self._arrays.values():
            array[...] = 0
        self._turn = 0
        for array in given.values():
            self._arrays["offset"][:, : array.shape[1]] = array
            self._arrays["offset_n"][...] = self._arrays["offset_uncertainty_n"][...] = np.nan

    @property
    def offset(self) -> tuple[float, float]:
        """Offset of the sensors' zeros in friction that the next step takes off, and its standard uncertainty [N].

        NaN before the first step; zeros of a graph that learns none.
        """
        if "offset" not in self._arrays:
            return 0.0, 0.0
        return self._arrays["offset_n"].item(), self._arrays["offset_uncertainty_n"].item()

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

    def run(
        self, samples: NDArray[np.float64], offset_n: float = 0.0, uncertainty_n: float | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return friction, lower and upper bound [N], shape ``(n, 3)``, and flags, shape ``(n,)``.

        Args:
            samples: Raw, shape ``(n, inputs)``; by default pressure 1 [Pa], pressure 2 [Pa], position [m].
            offset_n: Offset of the sensors' zeros in friction to start from, if known [N].
            uncertainty_n: Its standard uncertainty [N]; None: as the sensors' zeros were stated.

        Raises:
            ValueError: An offset is given, but this graph learns none; or a number is impossible.
        """
        *newtons, flags = self._outputs(["friction_n", "lower_n", "upper_n", "flags"], samples, offset_n, uncertainty_n)
        return np.stack(newtons, axis=1), flags

    def offsets(
        self, samples: NDArray[np.float64], offset_n: float = 0.0, uncertainty_n: float | None = None
    ) -> NDArray[np.float64]:
        """Return offset and standard uncertainty after each sample [N], shape ``(n, 2)``, of a graph that learns them.

        Arguments as for ``run``.
        """
        return np.stack(self._outputs(["offset_n", "offset_uncertainty_n"], samples, offset_n, uncertainty_n), axis=1)

    def _outputs(
        self, names: list[str], samples: NDArray[np.float64], offset_n: float, uncertainty_n: float | None
    ) -> list[NDArray[Any]]:
        feed = {"samples": np.ascontiguousarray(samples, dtype=np.float64)}
        outputs: list[NDArray[Any]] = self.session.run(names, feed | _given(self.session, offset_n, uncertainty_n))
        return outputs


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


def _given(
    session: onnxruntime.InferenceSession, offset_n: float, uncertainty_n: float | None
) -> dict[str, NDArray[np.float64]]:
    """Return what a graph that learns the offset is given before the first sample; nothing for one that learns none."""
    if all(port.name != "offset" for port in session.get_inputs()):
        if offset_n != 0.0 or uncertainty_n is not None:
            raise ValueError(NO_OFFSET)
        return {}
    refuse_impossible(offset_n, uncertainty_n)
    # 0 stands for none: an offset that is known exactly is as uncertain as the smallest number
    uncertainty_n = 0.0 if uncertainty_n is None else max(uncertainty_n, sys.float_info.min)
    return {"offset": np.array([[offset_n, uncertainty_n]])}
