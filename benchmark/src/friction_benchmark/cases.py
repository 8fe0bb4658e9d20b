"""Tasks and evaluation cases: a labelled recording as a task shows it, and what only the scoring may know of it.

A task hides columns, adds sensor errors or moves the target; an estimator is given an ordinary labelled recording.
"""

import hashlib
import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.uncertainty import sensitivities
from cylinder_friction.recordings.columns import OIL_TEMPERATURE, PRESSURES, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import IdentifiedZero, Recording, SensorUncertainty
from cylinder_friction.signals.causal import ExponentialLowPass
from friction_benchmark.results import Reference

CampaignKind = Literal["campaign", "loaded"]

LEVELS = ("pressure_1_level_pa", "pressure_2_level_pa")
LEVEL_TIME_S = 1.0  # Interval over which a pressure is averaged to its level, which is then held for as long
LEVEL_STEP_PA = 250e5 / 4096  # Step to which a level is rounded: that of the transmitters' converter
OFFSET_PA = 1.25e5  # Largest offset of a transmitter: ±0.5 % of a span of 250 bar, as in the data sheet
DRIFT_PA_S = 1e3  # Largest drift of that offset: 0.3 bar within half a minute
CALIBRATED_PA = 3e3
"""Standard uncertainty of the zeros of the calibrated transmitters that labels are from, as in ``rig.yaml``."""
SENSOR_DRAWS = 4
"""How many pairs of sensors each validation and test recording was made with: one pair shows little of others."""


@dataclass(frozen=True)
class Task:
    """One task."""

    name: str  # In files and tables
    title: str  # In words
    explanation: str  # What is asked and why, in one sentence
    inputs: tuple[str, ...]  # Columns that estimators see; the oil's temperature only where it was measured
    baseline: str  # Name of the model to beat
    reference: Reference = "label"  # What errors are against
    # Where its recordings come from: the load cases, or those with an external load on the rod
    campaign: CampaignKind = "campaign"
    ahead_s: float = 0.0  # How far ahead the target lies [s]
    drifts: bool = False  # Whether the pressure sensors have an offset and drift
    tuned_as: str = ""  # Name of the task whose tuning is taken over; empty where it is tuned itself
    needs_truth: bool = False  # Whether it can only be scored where true friction is known

    def draws(self, name: str) -> list[str]:
        """Return the names of a recording's cases: its own first, then those with other sensors."""
        return [name, *(f"{name} sensors {draw}" for draw in range(1, SENSOR_DRAWS if self.drifts else 1))]


@dataclass(frozen=True, eq=False)
class LabelledRecording:
    """A recording as the pipeline labels it, and the truth at its rows, shape ``(n,)``, where it is known."""

    recording: Recording  # With a load cell's ``load_force_n`` where an external load works on the rod
    true_friction_n: Array | None  # Positive when it opposes positive velocity [N]
    true_load_n: Array | None  # External force that resists extension; zero where there is none [N]


@dataclass(frozen=True, eq=False)
class EvaluationCase:
    """A recording as a task shows it, and what only the scoring knows; arrays have shape ``(n,)``."""

    recording: Recording  # What an estimator is given: its target is ``friction_n``, columns it must not see are zero
    reference_n: Array  # What errors are against [N]
    true_friction_n: Array | None  # At the time of the target [N]; None where it is not known
    label_n: Array  # The off-line label at the time of the target [N]
    true_load_n: Array | None  # External force that resists extension [N]; None where there is none
    pressures_pa: Array  # As the sensors gave them [Pa], shape ``(n, 2)``
    velocity_m_s: Array  # From the off-line filter, at the time of the target [m/s]

    @property
    def usable(self) -> Mask:
        return self.recording.usable()


def evaluation_case(task: Task, labelled: LabelledRecording, seed: int, draw: int = 0) -> EvaluationCase:
    """Return a recording as the task shows it, made with the pair of sensors ``draw``, from 0."""
    recording, truth_n = labelled.recording, labelled.true_friction_n
    shift = round(task.ahead_s / recording.sample_time_s)
    rows = np.arange(len(recording))
    ahead = np.minimum(rows + shift, len(recording) - 1)
    usable = recording.usable() & recording.usable()[ahead] & (rows + shift < len(recording))
    label_n = recording.column("friction_n")[ahead]
    pressures_pa = recording.samples(SAMPLE_COLUMNS)[:, :2]
    if task.drifts:
        pressures_pa = pressures_pa + _sensor_errors(recording, seed, draw)
        stated = dict.fromkeys(PRESSURES, SensorUncertainty(OFFSET_PA / math.sqrt(3.0), 0.0, zeroed=True))
        recording = replace(recording, metadata=replace(recording.metadata, uncertainty=stated))
    known_truth_n = None if truth_n is None else truth_n[ahead]
    if task.reference == "truth" and known_truth_n is None:
        raise ValueError(f"task {task.name}: true friction of recording {recording.name!r} is not known")
    return EvaluationCase(
        _shown(task, recording, pressures_pa, label_n, usable),
        label_n if task.reference == "label" or known_truth_n is None else known_truth_n,
        known_truth_n,
        label_n,
        labelled.true_load_n if task.campaign == "loaded" else None,
        pressures_pa,
        recording.column("velocity_m_s")[ahead],
    )


def with_known_zeros(recording: Recording, cylinder: Cylinder) -> Recording:
    """Return a recording that states the zeros of its sensors and their drift, as its label shows them.

    The label is of calibrated sensors beside them, so that a straight line through the force balance less the label
    is what their zeros add; each sensor has the share of it that its stated zero makes likely.
    """
    usable, stated = recording.usable(), recording.metadata.uncertainty
    areas = sensitivities(recording, cylinder)
    variance = sum((area * stated[column].zero) ** 2 for column, area in areas.items())
    share = {column: area * stated[column].zero ** 2 / variance for column, area in areas.items()}
    since_s = recording.sample_time_s * np.arange(len(recording))
    added_n = sum(area * recording.column(column) for column, area in areas.items()) - recording.column("friction_n")
    drift_n_s, offset_n = np.polyfit(since_s[usable], added_n[usable], 1).tolist()
    zeros = {column: IdentifiedZero(offset_n * each, CALIBRATED_PA, drift_n_s * each) for column, each in share.items()}
    return replace(recording, metadata=replace(recording.metadata, identified_zero=zeros))


def shown_inputs(task: Task, recording: Recording) -> tuple[str, ...]:
    """Return what estimators see: the task's inputs without a temperature that was not measured."""
    return tuple(name for name in task.inputs if name != OIL_TEMPERATURE or OIL_TEMPERATURE in recording.columns)


def _shown(task: Task, recording: Recording, pressures_pa: Array, target_n: Array, usable: Mask) -> Recording:
    """Return the recording with nothing in it but what may be seen, and what ``fit`` may learn from."""
    columns = {"time_s": recording.column("time_s"), "position_m": recording.column("position_m")}
    for number, name in enumerate(SAMPLE_COLUMNS[:2]):
        columns[name] = pressures_pa[:, number] if name in task.inputs else np.zeros(len(recording))
        if LEVELS[number] in task.inputs:
            columns[LEVELS[number]] = slowly_logged(pressures_pa[:, number], recording.sample_time_s)
    if OIL_TEMPERATURE in shown_inputs(task, recording):
        columns[OIL_TEMPERATURE] = recording.column(OIL_TEMPERATURE)
    columns["velocity_m_s"] = recording.column("velocity_m_s")
    bare = recording.without_columns(*[name for name in recording.columns if name not in columns])
    return bare.with_columns(**columns, friction_n=target_n, usable=usable)


def low_passed(values: Array, sample_time_s: float, time_constant_s: float) -> Array:
    """Return values behind a causal low-pass of first order, shape ``(n,)``."""
    low_pass = ExponentialLowPass(1.0 - float(np.exp(-sample_time_s / time_constant_s)))
    return low_pass.advance(low_pass.new_state(), values[:, None])[:, 0]


def slowly_logged(pressure_pa: Array, sample_time_s: float) -> Array:
    """Return what a slow logger shows [Pa], shape ``(n,)``: the rounded mean of the last whole ``LEVEL_TIME_S``, held.

    Before the first interval is over it is the first sample. No filter, linear or not, can restore the samples.
    """
    rows = round(LEVEL_TIME_S / sample_time_s)
    whole = len(pressure_pa) // rows
    means_pa = pressure_pa[: whole * rows].reshape(whole, rows).mean(axis=1)
    logged_pa = LEVEL_STEP_PA * np.round(np.append(pressure_pa[0], means_pa) / LEVEL_STEP_PA)
    return np.repeat(logged_pa, rows)[: len(pressure_pa)]


def _sensor_errors(recording: Recording, seed: int, draw: int) -> Array:
    """Return what each sensor reads too much [Pa], shape ``(n, 2)``; other sensors for every recording and draw."""
    pair = f"{recording.name}/{draw}" if draw else recording.name
    digest = hashlib.sha256(f"{seed}/{pair}".encode()).digest()
    generator = np.random.default_rng(int.from_bytes(digest[:8], "big"))
    offset_pa = generator.uniform(-OFFSET_PA, OFFSET_PA, 2)
    rate_pa_s = generator.uniform(-DRIFT_PA_S, DRIFT_PA_S, 2)
    since_s = recording.column("time_s")[:, None] - recording.column("time_s")[0]
    return np.asarray(offset_pa + rate_pa_s * since_s)
