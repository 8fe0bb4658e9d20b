"""What is asked: each task puts recordings before an estimator in its own way, and the estimator notices nothing.

A task hides columns, adds faults or moves the target; what it gives is an ordinary labelled recording.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.signals.causal import ExponentialLowPass, LowPassState

if TYPE_CHECKING:
    from cylinder_friction.evaluation.bootstrap import Array, Mask
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.data import Case
    from friction_benchmark.results import Reference

CampaignKind = Literal["campaign", "loaded"]

TEMPERATURE = "oil_temperature_c"
LEVELS = ("pressure_1_level_pa", "pressure_2_level_pa")
LEVEL_TIME_S = 1.0
"""Time constant of the low-pass behind which a pressure is a level."""
OFFSET_PA = 1.25e5
"""Largest offset of a transmitter: ±0.5 % of a span of 250 bar, as in the data sheet."""
DRIFT_PA_S = 1e3
"""Largest drift of that offset: 0.3 bar within half a minute."""
SENSOR_DRAWS = 4
"""How many pairs of sensors each recording that chooses or is asked was made with: one pair tells little of others."""


@dataclass(frozen=True)
class Task:
    """One question.

    Attributes:
        name: In files and tables.
        title: In words.
        explanation: What is asked and why, in one sentence.
        inputs: Columns that estimators see; the oil's temperature only where it was measured.
        baseline: Name of the model to beat.
        reference: What errors are against.
        campaign: Where its recordings come from: the load tests, or those with an external load on the rod.
        ahead_s: How far ahead the target lies [s].
        drifts: Whether the pressure sensors have an offset and drift.
        tuned_as: Name of the task whose tuning is taken over; its own name where it is tuned itself.
        needs_truth: Whether it can only be judged where true friction is known.
    """

    name: str
    title: str
    explanation: str
    inputs: tuple[str, ...]
    baseline: str
    reference: Reference = "label"
    campaign: CampaignKind = "campaign"
    ahead_s: float = 0.0
    drifts: bool = False
    tuned_as: str = ""
    needs_truth: bool = False


@dataclass(frozen=True, eq=False)
class Exam:
    """A recording as a task puts it, and what only the examiner knows; arrays have shape ``(n,)``.

    Attributes:
        recording: What an estimator is given: its target is ``friction_n``, columns it must not see are zero.
        reference_n: What errors are against [N].
        true_friction_n: At the time of the target [N]; None where nobody knows it.
        label_n: The off-line label at the time of the target [N].
        true_load_n: External force that resists extension [N]; None where there is none.
        pressures_pa: As the sensors gave them [Pa], shape ``(n, 2)``.
        velocity_m_s: From the off-line filter, at the time of the target [m/s].
        oil_temperature_c: [°C]; None where it was not measured.
    """

    recording: Recording
    reference_n: Array
    true_friction_n: Array | None
    label_n: Array
    true_load_n: Array | None
    pressures_pa: Array
    velocity_m_s: Array
    oil_temperature_c: Array | None


_FORECASTS = tuple(
    Task(
        name=f"forecast_{milliseconds}ms",
        title=f"Forecast {milliseconds} ms ahead",
        explanation=(
            f"Friction {milliseconds} ms from now, from pressures and position until now; the baseline says that it "
            "stays as it is."
        ),
        inputs=SAMPLE_COLUMNS,
        baseline="hold",
        ahead_s=milliseconds / 1e3,
        tuned_as="forecast_100ms",
    )
    for milliseconds in (25, 50, 100, 250)
)

TASKS: tuple[Task, ...] = (
    Task(
        "identity",
        "Identity, the paper's task",
        "Friction now, from both pressures and the position: algebra on the inputs gives nearly the label, so this "
        "measures filtering more than learning.",
        SAMPLE_COLUMNS,
        baseline="low_pass",
    ),
    Task(
        "pressure_free",
        "Without pressures",
        "Friction now, from the position and the oil's temperature alone: no algebra leads to it, so that models of "
        "friction, given or learnt, are needed.",
        ("position_m", TEMPERATURE),
        baseline="constant_by_direction",
    ),
    Task(
        "pressure_level",
        "Pressure level only",
        "As without pressures, but the level of both pressures over the last second is known, which tells how hard the "
        "seals are pressed.",
        ("position_m", TEMPERATURE, *LEVELS),
        baseline="constant_by_direction",
    ),
    *_FORECASTS,
    Task(
        "sensor_drift",
        "Sensor offset and drift",
        "Friction now, from pressure sensors that each have an unknown offset within their data sheet's ±1.25 bar and "
        "drift: plain algebra carries an error of the size of friction.",
        SAMPLE_COLUMNS,
        baseline="constant_by_direction",
        reference="truth",
        drifts=True,
        needs_truth=True,
    ),
    Task(
        "external_load",
        "Unknown external load",
        "Friction now, while a load that nobody measures works on the rod, so that pressures give the sum of the two; "
        "a load cell was there for training alone.",
        SAMPLE_COLUMNS,
        baseline="constant_by_direction",
        reference="truth",
        campaign="loaded",
        needs_truth=True,
    ),
)


def task_named(name: str) -> Task:
    """Return a task.

    Raises:
        ValueError: There is no such task.
    """
    for task in TASKS:
        if task.name == name:
            return task
    raise ValueError(f"no task {name!r}; expected one of {', '.join(task.name for task in TASKS)}")


def exam_of(task: Task, case: Case, seed: int, draw: int = 0) -> Exam:
    """Return a recording as the task puts it.

    Args:
        task: Which.
        case: From a campaign.
        seed: Of the sensors' offsets and drifts, drawn anew for each recording.
        draw: Which pair of sensors it was made with, from 0.
    """
    recording, truth_n = case.recording, case.true_friction_n
    shift = round(task.ahead_s / recording.sample_time_s)
    rows = len(recording)
    ahead = np.minimum(np.arange(rows) + shift, rows - 1)
    usable = recording.usable() & recording.usable()[ahead] & (np.arange(rows) + shift < rows)
    label_n = recording.column("friction_n")[ahead]
    raw_pa = recording.samples(SAMPLE_COLUMNS)[:, :2]
    pressures_pa = raw_pa + (_sensor_errors(recording, seed, draw) if task.drifts else 0.0)
    temperature_c = recording.column(TEMPERATURE) if TEMPERATURE in recording.table.columns else None
    known_truth_n = None if truth_n is None else truth_n[ahead]
    reference_n = label_n
    if task.reference == "truth":
        if known_truth_n is None:
            raise ValueError(f"task {task.name}: true friction of recording {recording.name!r} is not known")
        reference_n = known_truth_n
    return Exam(
        _shown(task, recording, pressures_pa, label_n, usable),
        reference_n,
        known_truth_n,
        label_n,
        case.true_load_n if task.campaign == "loaded" else None,
        pressures_pa,
        recording.column("velocity_m_s")[ahead],
        temperature_c,
    )


def inputs_of(task: Task, recording: Recording) -> tuple[str, ...]:
    """Return what estimators see: the task's inputs without a temperature that was not measured."""
    return tuple(name for name in task.inputs if name != TEMPERATURE or TEMPERATURE in recording.table.columns)


def of_the_present(task: Task) -> Task:
    """Return the task whose target is friction now: what a model that cannot look ahead is taught."""
    return replace(task, ahead_s=0.0)


def _shown(task: Task, recording: Recording, pressures_pa: Array, target_n: Array, usable: Mask) -> Recording:
    """Return the recording with nothing in it but what may be seen, and what ``fit`` may learn from."""
    columns = {"time_s": recording.column("time_s"), "position_m": recording.column("position_m")}
    for number, name in enumerate(SAMPLE_COLUMNS[:2]):
        columns[name] = pressures_pa[:, number] if name in task.inputs else np.zeros(len(recording))
        if LEVELS[number] in task.inputs:
            columns[LEVELS[number]] = _level(pressures_pa[:, number], recording.sample_time_s)
    if TEMPERATURE in inputs_of(task, recording):
        columns[TEMPERATURE] = recording.column(TEMPERATURE)
    columns["velocity_m_s"] = recording.column("velocity_m_s")
    bare = recording.without_columns(*[name for name in recording.table.columns if name not in columns])
    return bare.with_columns(**columns, friction_n=target_n, usable=usable)


def _level(pressure_pa: Array, sample_time_s: float) -> Array:
    low_pass = ExponentialLowPass(1.0 - float(np.exp(-sample_time_s / LEVEL_TIME_S)))
    return np.ascontiguousarray(low_pass.advance(LowPassState(), pressure_pa[:, None])[:, 0])


def _sensor_errors(recording: Recording, seed: int, draw: int) -> Array:
    """Return what each sensor reads too much [Pa], shape ``(n, 2)``; other sensors for every recording and draw."""
    pair = f"{recording.name}/{draw}" if draw else recording.name
    digest = hashlib.sha256(f"{seed}/{pair}".encode()).digest()
    generator = np.random.default_rng(int.from_bytes(digest[:8], "big"))
    offset_pa = generator.uniform(-OFFSET_PA, OFFSET_PA, 2)
    rate_pa_s = generator.uniform(-DRIFT_PA_S, DRIFT_PA_S, 2)
    since_s = recording.column("time_s")[:, None] - recording.column("time_s")[0]
    return np.asarray(offset_pa + rate_pa_s * since_s)
