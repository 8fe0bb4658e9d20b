"""A small model registry and made campaigns for the benchmark's tests, in a module that other processes find."""

from __future__ import annotations

import os
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import pandas as pd

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.recordings.storage import write_recording
from friction_benchmark.cases import LabelledRecording
from friction_benchmark.datasets import TRUE_FRICTION, TRUE_LOAD, Kind, Sizes, Sources
from friction_benchmark.models.base import Model
from friction_benchmark.registry import BuildConfiguration, Float, Int, RegisteredModel, needs_raw_pressures

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from friction_benchmark.registry import Estimator
    from friction_benchmark.results import BenchmarkResults

CYLINDER = Cylinder(name="made", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
SIZES = Sizes(
    sessions_per_condition=3,
    recordings_per_session=1,
    duration_s=8.0,
    test_sessions=1,
    validation_sessions=1,
    unseen_sessions=1,
    twin_rigs=2,
)
MODULES = ("friction_benchmark_models",)


def made_recording(
    test: str, session: int, seed: int = 0, load_n: float = 0.0, seconds: float = 8.0
) -> LabelledRecording:
    """Return a recording whose label is true friction and 5 N more; oil of 20 °C and one more for each session."""
    name = f"condition{test}_session{session:02d}_recording01"
    generator = np.random.default_rng([seed, int(test), session])
    time_s = 0.005 * np.arange(round(seconds / 0.005))
    rate = 2.0 * np.pi * generator.uniform(0.2, 0.5)
    position_m = 0.125 + 0.03 * np.sin(rate * time_s)
    velocity_m_s = 0.03 * rate * np.cos(rate * time_s)
    pressure_2_pa = 9e5 * int(test) + 2e5 * np.sin(0.3 * time_s)
    friction_n = np.tanh(velocity_m_s / 2e-3) * (240.0 + 4e-5 * pressure_2_pa) + 1500.0 * velocity_m_s
    load = np.full(len(time_s), load_n)
    pressure_1_pa = (friction_n + load + pressure_2_pa * CYLINDER.annulus_area_m2) / CYLINDER.piston_area_m2
    usable = np.ones(len(time_s), dtype=bool)
    usable[:40] = False
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "pressure_1_pa": pressure_1_pa + generator.normal(0.0, 5e3, len(time_s)),
            "pressure_2_pa": pressure_2_pa + generator.normal(0.0, 5e3, len(time_s)),
            "position_m": position_m + generator.normal(0.0, 3e-5, len(time_s)),
            "oil_temperature_c": np.full(len(time_s), 20.0 + session),
            "velocity_m_s": velocity_m_s,
            "friction_n": friction_n + 5.0,
            "usable": usable,
        }
    )
    metadata = RecordingMetadata(name, test, f"condition{test}_session{session:02d}", 0.005, CYLINDER.name)
    return LabelledRecording(Recording(metadata, table), friction_n, load)


def write_campaign(sources: Sources, kind: Kind, seed: int, sessions: int = 3) -> None:
    """Write a made campaign where the benchmark would have simulated one, so that it simulates none."""
    for test in "1234":
        for session in range(1, sessions + 1):
            offset = 100 if kind.startswith("unseen") else 0
            case = made_recording(test, session, seed + offset, 500.0 if kind.endswith("loaded") else 0.0)
            known = {TRUE_FRICTION: case.true_friction_n, TRUE_LOAD: case.true_load_n}
            write_recording(sources.campaign_folder(kind, seed), case.recording.with_columns(**known))


def write_own(folder: Path) -> tuple[tuple[str, Path], ...]:
    """Write recordings as the stage ``label`` leaves them, and returns the folder of each role."""
    roles = {"train": 1, "validation": 2, "test": 3}
    for role, session in roles.items():
        for test in "1234":
            write_recording(folder / role, made_recording(test, session).recording)
    return tuple((role, folder / role) for role in roles)


def without_times(results: BenchmarkResults) -> dict[str, Any]:
    """Return results without what was measured of the processor."""
    content = asdict(results)
    for task in content["tasks"]:
        for entry in task["entries"]:
            for name in ("step_us", "training_s"):
                del entry[name]
    return content


class Constant(Model):
    """The mean label of its training, or a failure: for tests of what surrounds a model."""

    def __init__(self, inputs: Sequence[str], behaviour: str = "") -> None:
        super().__init__(inputs)
        self.behaviour, self.level_n = behaviour, 0.0

    def fit(self, recordings: Sequence[Recording]) -> Self:
        if self.behaviour == "raises":
            raise ValueError("cannot learn this")
        if self.behaviour == "dies":
            os._exit(3)
        self.level_n = float(np.mean([recording.column("friction_n").mean() for recording in recordings]))
        return self

    def estimate(self, recording: Recording) -> NDArray[np.float64]:
        return np.full(len(recording), np.nan if self.behaviour == "nan" else self.level_n)

    def multiply_adds(self) -> int:
        return 1


def _low_pass(build: BuildConfiguration) -> Estimator:
    return LowPassForceBalanceEstimator(build.cylinder)


def _ridge(build: BuildConfiguration) -> Estimator:
    return RidgeEstimator(build.whole("lags"), build.number("penalty"))


def constant(behaviour: str, build: BuildConfiguration) -> Estimator:
    return Constant(build.inputs, behaviour)


def _position(build: BuildConfiguration) -> Estimator:
    return Constant(("position_m",))


MODELS = (
    RegisteredModel("low_pass", "Low-pass", "baseline", "own", _low_pass, supports=needs_raw_pressures),
    RegisteredModel("hold", "Hold", "baseline", "own", partial(constant, "")),
    RegisteredModel("constant_by_direction", "Constant", "analytical", "own", _position),
    RegisteredModel(
        "ridge",
        "Ridge",
        "modern",
        "own",
        _ridge,
        space={"lags": (Int(2, 20), 5), "penalty": (Float(1e-2, 1e2, log=True), 1.0)},
        supports=needs_raw_pressures,
    ),
    RegisteredModel("raises", "Raises", "modern", "own", partial(constant, "raises")),
    RegisteredModel("nan", "Nan", "modern", "own", partial(constant, "nan")),
)
