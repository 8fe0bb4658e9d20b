"""Who gives the friction that is fed forward: trained as the servo rig's evaluation trains, and run inside the loop."""

import ctypes
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.compiled import OPTIMISED, CompiledEstimator, compile_shared
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.analytical import AnalyticalEstimator, scaled_effort
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.in_the_loop.closed_loop import EXPORTED_C, OBSERVER, SERIES, TRUTH, Controller
from friction_benchmark.models.disturbance_observer import DisturbanceObserver
from friction_benchmark.registry import BuildConfiguration
from friction_benchmark.servo_rig.evaluation import EvaluationPlan, prepared
from friction_benchmark.servo_rig.parameters import CYLINDER

CORNERS_HZ = (2.0, 5.0, 10.0, 20.0)  # Of the low-pass, to be tuned


@dataclass(frozen=True, eq=False)
class Trained:
    """What one campaign of recordings gives."""

    exported: dict[str, CompiledEstimator]
    hybrid: HybridEstimator
    observer: DisturbanceObserver
    lugre: Array  # Numbers of LuGre without pressure


def controller_library() -> ctypes.CDLL:
    """Compile ``controller.c``."""
    library = Path(mkdtemp()) / "controller.so"
    compile_shared((Path(__file__).with_name("controller.c"),), library, ("-std=c99", *OPTIMISED))
    loaded, real, pointer = ctypes.CDLL(str(library)), ctypes.c_double, ctypes.c_void_p
    loaded.loop_estimate.argtypes = (ctypes.c_size_t, ctypes.c_size_t, real, real, real, pointer)
    loaded.loop_estimate.restype = None
    loaded.loop_control.argtypes = (pointer, pointer, pointer, pointer, real)
    loaded.loop_control.restype = real
    return loaded


def train(plan: EvaluationPlan, effort: float) -> Trained:
    """Train hybrid, observer and LuGre on the rig's recordings, and export hybrid and low-passes as C.

    The rig's own controller moves it in the recordings. ``effort`` cuts the searches of observer and LuGre.
    """
    recordings, _, _ = prepared(plan, plan.sessions)
    seed, first = plan.sessions.seed, recordings[:1]
    hybrid = HybridEstimator(CYLINDER, plan=TrainingPlan(epochs=plan.epochs), seed=seed).fit(recordings)
    observer = DisturbanceObserver(BuildConfiguration(CYLINDER, SAMPLE_COLUMNS, seed, effort, {})).fit(recordings)
    lugre = AnalyticalEstimator(CYLINDER, LuGre(), effort=scaled_effort(effort)).fit(recordings)
    assert lugre.parameters is not None
    estimators: dict[str, FrictionEstimator] = {"hybrid": hybrid}
    for corner_hz in CORNERS_HZ:
        low_pass = LowPassForceBalanceEstimator(CYLINDER).fit(first)
        low_pass.weight = 1.0 - float(np.exp(-2.0 * np.pi * corner_hz * first[0].sample_time_s))
        estimators[f"low-pass {corner_hz:g} Hz"] = low_pass
    compiled = {name: CompiledEstimator(export_c(each, Path(mkdtemp()))) for name, each in estimators.items()}
    return Trained(compiled, hybrid, observer, lugre.parameters.packed())


@dataclass(frozen=True)
class Compensator:
    """A way to compensate friction, and the settings that its tuning tries, twelve for each."""

    title: str
    source: int = SERIES
    exported: str = "hybrid"
    tried: tuple[dict[str, Any], ...] = ({},)

    def tuned(self, gains: Controller, settings: dict[str, Any]) -> tuple[Self, Controller]:
        """Return the compensator and the controller's gains with these settings."""
        settings = {"exported": self.exported, "position_times": 1.0, **settings}
        exported, stiffer = settings.pop("exported"), settings.pop("position_times") * gains.position_n_m
        return replace(self, exported=exported), gains._replace(position_n_m=stiffer, **settings)


SHARES = tuple({"share": round(0.1 * tenth, 1)} for tenth in range(4, 16))
INTEGRALS = tuple({"integral_1_s": float(rate)} for rate in np.geomspace(0.5, 30.0, 12))
LOW_PASSES = tuple(
    {"exported": f"low-pass {corner:g} Hz", "share": share} for corner in CORNERS_HZ for share in (0.8, 1.0, 1.2)
)
TOGETHER = tuple({"integral_1_s": rate, "share": share} for rate in (1.0, 3.0, 9.0, 27.0) for share in (0.6, 0.8, 1.0))
COMPENSATORS = (
    Compensator("none"),
    Compensator("none, twice the position gain", tried=({"position_times": 2.0},)),
    Compensator("integral action", tried=INTEGRALS),
    Compensator("LuGre of the reference", tried=SHARES),
    Compensator("low-pass", EXPORTED_C, tried=LOW_PASSES),
    Compensator("Kalman observer", OBSERVER, tried=SHARES),
    Compensator("hybrid", EXPORTED_C, tried=SHARES),
    Compensator("integral and low-pass", EXPORTED_C, "low-pass 10 Hz", TOGETHER),
    Compensator("integral and hybrid", EXPORTED_C, tried=TOGETHER),
    Compensator("true friction", TRUTH, tried=SHARES),
)
BY_TITLE = {each.title: each for each in COMPENSATORS}
