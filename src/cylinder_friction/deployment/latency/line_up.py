"""Who is measured for which estimator."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cylinder_friction.deployment.c_export.compiled import OPTIMISED
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.deployment.latency.contender import PythonContender
from cylinder_friction.deployment.latency.floor import work_of
from cylinder_friction.deployment.latency.lugre_numpy import LugreInNumpy
from cylinder_friction.deployment.latency.native import NativeContender
from cylinder_friction.deployment.latency.spin import Spin
from cylinder_friction.deployment.latency.window import OnnxWindow, TorchWindow
from cylinder_friction.deployment.onnx_graphs.step import step_graph
from cylinder_friction.deployment.onnx_graphs.stream import open_step
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.from_hybrid import step_model
from cylinder_friction.realtime.stream import RealTimeStream

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.export import ExportedC
    from cylinder_friction.deployment.latency.contender import Contender
    from cylinder_friction.deployment.latency.floor import Work
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import StepModel

    Array = NDArray[np.float64]

MODERATE = ("-O2", "-ffp-contract=off")
NATIVE_OPTIONS = {"c": OPTIMISED, "c_o2": MODERATE, "c_float": OPTIMISED}
"""Compiler options of the contenders that are C; ratios are to ``c``."""
PUBLISHED = (4, 64, 64, 10)
"""Layers, nodes, trees and their depth in the paper."""


@dataclass(frozen=True)
class LineUp:
    """One model with everybody who runs it.

    Attributes:
        size: Of network and forest, in words.
        published: Whether it is of the paper's size.
        contenders: Fresh ones.
        work: What a step must at least do; None for LuGre.
        exported: Its C, in double precision.
    """

    size: str
    published: bool
    contenders: tuple[Contender, ...]
    work: Work | None
    exported: ExportedC


def line_up(estimator: FrictionEstimator, samples: Array, folder: Path) -> LineUp:
    """Return who runs a model.

    Args:
        estimator: A fitted hybrid, with or without its forest, or LuGre.
        samples: Raw, shape ``(n, 3)``; what the machine's own tail is set to the length of a step with.
        folder: For what is compiled.

    Raises:
        NoCompilerError: There is no C compiler.
        ValueError: The estimator is of another kind.
    """
    if isinstance(estimator, LugreEstimator):
        size = "LuGre, pressure-scaled" if estimator.pressure_scaled else "LuGre"
        numpy = PythonContender(
            "numpy", "LuGre in numpy, as written from its equations", "step", LugreInNumpy(estimator).step
        )
        native, exported = _native(estimator, samples, folder)
        return LineUp(size, False, (numpy, *native), None, exported)
    if not isinstance(estimator, HybridEstimator):
        raise ValueError(f"{estimator.kind}: cannot be measured here; expected a hybrid or LuGre")
    model = step_model(estimator)
    native, exported = _native(estimator, samples, folder)
    steps = {
        "onnx_step": ("ONNX Runtime, step graph", _friction_of(open_step(step_graph(model)))),
        "python": ("Python, estimator.real_time()", _friction_of(RealTimeStream(model))),
    }
    contenders: tuple[Contender, ...] = (
        PythonContender("torch_window", "PyTorch + scikit-learn, window of 40", "window", TorchWindow(model).step),
        PythonContender("onnx_window", "ONNX Runtime, the same converted", "window", OnnxWindow(model).step),
        *(PythonContender(name, title, "step", step) for name, (title, step) in steps.items()),
        *native,
    )
    numbers = _numbers(model)
    return LineUp(_in_words(numbers), numbers == PUBLISHED, contenders, work_of(model), exported)


def _native(estimator: FrictionEstimator, samples: Array, folder: Path) -> tuple[tuple[Contender, ...], ExportedC]:
    double = export_c(estimator, folder / "double")
    single = export_c(estimator, folder / "float", precision="float")
    titles = {
        "c": ("C, double filters, -O3 -march=native", double),
        "c_o2": ("C, double filters, -O2", double),
        "c_float": ("C, all single precision, -O3 -march=native", single),
    }
    native = {name: NativeContender(name, *titles[name], options) for name, options in NATIVE_OPTIONS.items()}
    spin = Spin(native["c"], samples, folder)
    native["c"].restart()
    return (*native.values(), spin), double


def _friction_of(stream: object) -> Callable[[float, float, float], float]:
    step = stream.step  # type: ignore[attr-defined]
    return lambda *sample: float(step(*sample)[0])


def _numbers(model: StepModel) -> tuple[int, int, int, int]:
    network = (0, 0) if model.network is None else (model.network.layers, model.network.nodes)
    return (*network, *((0, 0) if model.forest is None else (len(model.forest.roots), model.forest.depth)))


def _in_words(numbers: tuple[int, int, int, int]) -> str:
    layers, nodes, trees, depth = numbers
    forest = f", {trees} trees of depth {depth}" if trees else ""
    return f"{layers}x{nodes} LSTM{forest}"
