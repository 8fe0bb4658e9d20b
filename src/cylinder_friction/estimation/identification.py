"""Identify friction models from logger files: Stribeck curve, LuGre parameters, and files for simulators."""

import math
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.friction_of_logs import LabelledLogs
from cylinder_friction.estimation.identification_page import identification_page
from cylinder_friction.estimation.identified_model import (
    CONFIDENCE,
    DAMPING_RATIO,
    SLOW_PARAMETERS,
    FrictionModels,
    IdentifiedCurve,
    IdentifiedModel,
    OilTemperature,
    Zeros,
    determined,
    matlab_script,
    modelica_record,
    no_viscous_seen,
    pressure_problem,
    stribeck_points,
)
from cylinder_friction.estimation.results import load_left
from cylinder_friction.estimation.steady_intervals import (
    NOISE_MULTIPLE,
    lines_uncertain_n,
    odd_window,
    slope,
    slope_noise,
    steady_intervals,
    velocities_on_offer,
)
from cylinder_friction.estimators.lugre import condition_of_smallest_friction
from cylinder_friction.execution.progress import progress
from cylinder_friction.files.result_folder import ResultFolder
from cylinder_friction.files.whole_files import write_json, write_text
from cylinder_friction.friction_models.identification.procedure import SearchEffort, identify
from cylinder_friction.friction_models.identification.steady_points import undetermined
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.labelling.known_offset import VENT, mean_uncertainty_n
from cylinder_friction.recordings.checks.limits import GivenLoad
from cylinder_friction.recordings.columns import COVERAGE_FACTOR
from cylinder_friction.recordings.conversion import Quarantined, logged_files, none_usable, other_rates
from cylinder_friction.recordings.logs import ROWS_AT_ONCE, find_logs
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import STEADY_DURATION_S
from cylinder_friction.signals.noise import noise_deviation, quantisation_step, sensor_noise
from cylinder_friction.signals.smooth_signals import has_pressures

MODELS_FILE, PAGE_FILE = "friction_models.json", "friction_models.html"
POPULATION, GENERATIONS = 10, 50
AS_GOOD = 1.05
"""Largest ratio of the plain model's error to the pressure-scaled one's at which the plain model is as good."""
MOST_ROWS = 1 << 20
"""Most rows used of one log, because memory holds all of them. Of a longer log, evenly spread parts are used."""
SIMULATED_RECORDINGS, PIECE_S, POLISHED_PIECE_S = 16, 10.0, 60.0
"""Recordings and length of their pieces [s] in differential evolution; longest piece in the last local searches [s].
Pieces of fewer recordings are longer, so that they show as many speeds."""
FITS_ALIKE, LEAST_SHARE, SOFTENED = 0.01, 0.02, 2.0
"""A velocity fits as well as the best one if its error is greater by at most the first share of mean |friction|. Least
half-width of an interval, as a share of the value: the bias by smoothing of label and velocity; viscous friction's adds
to what steady sliding leaves. Bristles may be stiffer
by the last factor, because smoothing spreads a reversal over more travel."""
UNSEEN = "steady sliding of condition {} does not show it"
COARSE = "bristles may bend by {:.2g} m only, less than the position's step of {:.2g} m; record a finer position"
BENT_BY_A_LOSS = ("coulomb_n", "viscous_n_s_m", "retract_ratio", "pressure_slope_n_pa")
"""Parameters that a loss in a line changes: it grows with the square of speed, and the directions differ in speed."""
LARGE = 0.25
"""Share of mean |friction| above which the shift by the sensors' zeros is named as the reason for wide intervals."""
ZEROS = "state how exact the sensors are (--sensor-class, or sensor.accuracy_percent in the mapping)"
LOAD = (
    "map the load (a load cell, or computed from geometry), or weigh a constant one (--load NEWTONS); strokes do not "
    "tell it from asymmetric friction"
)


def identify_logs(
    files: str | Path | Iterable[str | Path],
    cylinder: Cylinder,
    into: str | Path = "friction_models",
    *,
    channels: str | Path | Mapping[str, Any] | None = None,
    load: GivenLoad | None = None,
    names: str | None = None,
    units: Mapping[str, str] | None = None,
    sensor_class: float | None = None,
    database: str | Path | None = None,
    generations: int = GENERATIONS,
    seed: int = 0,
) -> FrictionModels:
    """Identify Stribeck curve and LuGre parameters from logger files.

    Friction is the label that ``estimate_logs`` makes without a model. One LuGre model is identified in the condition
    of smallest friction. A second one, whose dry friction grows with the sum of both pressures, is identified in all
    conditions. The folder gets ``friction_models.json``, a page, and a Modelica record (``.mo``) and MATLAB script
    (``.m``) for each identified model. A parameter that the motion does not determine has a reason and no number.

    Args:
        files, channels, cylinder, load, names, units, sensor_class, database: As in ``read_recordings``.
        into: A new folder, or one that an earlier call wrote. Files that no earlier call wrote stay in it.
        generations, seed: Greatest number of generations of the global search, and its seed.

    Raises:
        ValueError: Fewer than one generation.
        RecordingError: No file is found or usable, or the mapping is wrong or cannot be guessed. Single files that
            cannot be used are listed in ``refused``.
        FileExistsError: The folder contains other files, overlaps with an input, or is being written by another call.

    Example:
        >>> logs = "data/raw/rig/condition1_*.csv"
        >>> models = cf.identify_logs(logs, cylinder, "friction_models", channels="conf/ingest/rig.yaml", generations=2)
        >>> [curve.condition for curve in models.curves]
        ['1']
        >>> len(models.curves[0].points) > 0  # friction at steady velocities, with intervals
        True
    """
    into = Path(into)
    if generations < 1:
        raise ValueError(f"generations: got {generations}, but expected at least 1")
    given: dict[str, Any] = {"names": names, "load": load, "units": units, "database": database}
    logs = find_logs(files, channels, cylinder, sensor_class=sensor_class, **given)
    with ResultFolder(into, MODELS_FILE, "cylinder-friction identify", logs.inputs).written() as folder:
        run = LabelledLogs(logs, logged_files(logs, ROWS_AT_ONCE), folder / ".scratch", None)
        read = run.recordings(MOST_ROWS)
        labelled = list(progress(read, "read and label", len(logs.files), unit="recording"))
        shutil.rmtree(run.scratch, ignore_errors=True)
        loads = [(each, load_left(run.friction.entry(each, load))) for each, load in labelled]
        others = {each.name: Quarantined(each.metadata.source_file, words, each.name) for each, words in loads if words}
        others |= other_rates([recording.metadata for recording, _ in labelled])
        refused = [*run.refused, *others.values()]
        recordings = [recording for recording, _ in labelled if recording.name not in others]
        if not recordings:
            raise none_usable(logs.root.as_posix(), len(logs.files), refused[0])
        search = ModelSearch(recordings, run, generations, seed)
        models = search.plain(), search.pressure_scaled()
        simulated = [(each, search.simulated(models, each)) for each in search.recordings]
        result = FrictionModels(
            into,
            tuple(recording.name for recording in recordings),
            search.curves,
            models,
            refused,
            list(run.offsets.values()),
            logs.guessed,
            run.loss_in_words(),
            simpler(models, simulated),
            search.zeros,
        )
        for model in models:
            if model.found is not None:
                write_text(folder / f"{model.name}.mo", modelica_record(model, cylinder))
                write_text(folder / f"{model.name}.m", matlab_script(model, cylinder))
        write_text(folder / PAGE_FILE, identification_page(result, simulated))
        write_json(folder / MODELS_FILE, result.to_dict())
    return result


class ModelSearch:
    """Identification on recordings with the same sample time."""

    def __init__(self, recordings: Sequence[Recording], run: LabelledLogs, generations: int, seed: int) -> None:
        self.run = run
        sample_time_s = recordings[0].sample_time_s
        positions = [recording.column("position_m") for recording in recordings]
        noise_m = max(map(sensor_noise, positions))
        steps_m = ((quantisation_step(each), noise_deviation(each)) for each in positions)
        self.step_m = max((step_m for step_m, noise_m in steps_m if noise_m < step_m), default=0.0)
        window = odd_window(STEADY_DURATION_S, sample_time_s)
        self.slowest_m_s = NOISE_MULTIPLE * slope_noise(window, noise_m, sample_time_s)
        smooth = slope(window, 0.0, 0.0)
        self.recordings = [recording.with_columns(velocity_m_s=smooth(recording)) for recording in recordings]
        self.velocities = velocities_on_offer(noise_m, sample_time_s)
        self.effort = SearchEffort(seed, POPULATION, generations, SIMULATED_RECORDINGS)

    @cached_property
    def curves(self) -> tuple[IdentifiedCurve, ...]:
        curves = []
        for condition in sorted({recording.metadata.condition for recording in self.recordings}):
            own = self._of(condition)
            points, zeros = stribeck_points(own, self.slowest_m_s, CONFIDENCE), self._zeros(own)
            curves.append(IdentifiedCurve.through(own, points, zeros, self.run.loss, self.run.cylinder))
        return tuple(curves)

    @property
    def zeros(self) -> str:
        """State what to do if zeros or load leave parameters of a condition without a number; else empty."""
        halves_n = [each.zeros.half_n for each in self.curves if each.zeros.why_not]
        if not halves_n:
            return ""
        if self.run.friction.labeller.load == "position":
            return LOAD
        return ZEROS if math.isinf(max(halves_n)) else VENT

    def plain(self) -> IdentifiedModel:
        return self._identified(LuGre(), self._of(condition_of_smallest_friction(self.recordings)))

    def pressure_scaled(self) -> IdentifiedModel:
        model = LuGre(pressure_scaled=True)
        if not all(has_pressures(recording) for recording in self.recordings):
            return _unidentified(model, self.recordings, "not every recording holds both pressures")
        problem = pressure_problem([_pressure(recording)[recording.usable()] for recording in self.recordings])
        return _unidentified(model, self.recordings, problem) if problem else self._identified(model, self.recordings)

    def simulated(self, models: Sequence[IdentifiedModel], recording: Recording) -> dict[str, Array]:
        """Simulate the friction of each identified model along a recording [N], by title."""
        lines = {}
        for each in models:
            if each.found is not None:
                model, velocity_m_s = LuGre(each.pressure_scaled), self.velocities[each.found.velocity](recording)
                pressure = _pressure(recording) if each.pressure_scaled else None
                values, state = each.found.parameters.packed(), model.new_state()
                lines[each.title] = model.simulate(values, velocity_m_s, recording.sample_time_s, state, pressure)
        return lines

    def _zeros(self, recordings: Sequence[Recording]) -> Zeros:
        """Return how far the sensors' zeros, or a load identified with them, may shift friction of these recordings.

        Files whose sessions nobody named may be of one. Zeros that nobody stated may be the same in all sessions, so
        their scatter shows nothing about them.
        """
        run = self.run
        known = [run.offsets[name] for name in sorted({each.metadata.session for each in recordings} & {*run.offsets})]
        halves_n, named = [each.uncertainty_n for each in known], run.logs.recipe.names.pattern is not None
        if run.friction.labeller.load == "position":  # Which has absorbed the zeros
            half_n = 0.0
        elif np.isfinite(halves_n).all():
            half_n = mean_uncertainty_n(known) if named else max(halves_n, default=0.0)
        else:
            half_n = math.inf
        half_n = math.hypot(half_n, run.load_uncertainty_n)
        why_not = f"zeros and load may shift friction by ± {half_n:.0f} N"
        if math.isinf(half_n):
            why_not = "the sensors' zeros are not stated, and strokes do not show them"
        return Zeros(half_n, why_not if half_n > LARGE * _level_n(recordings) else "")

    def _of(self, condition: str) -> list[Recording]:
        return [recording for recording in self.recordings if recording.metadata.condition == condition]

    def _identified(self, model: LuGre, recordings: Sequence[Recording]) -> IdentifiedModel:
        zeros, conditions = self._zeros(recordings), {each.metadata.condition for each in recordings}
        curves = [each for each in self.curves if each.condition in conditions]
        points = [point for each in curves for point in each.points]
        if problem := undetermined(points) if points else "":
            return _unidentified(model, recordings, problem)
        pressure = _pressure if model.pressure_scaled else None
        shift_n = min(zeros.half_n, _level_n(recordings))  # Unknown zeros may shift friction by as much as there is
        given: dict[str, Any] = {"mass_kg": self.run.cylinder.moving_mass_kg, "damping_ratio": DAMPING_RATIO}
        given |= {"dead_band_m_s": self.slowest_m_s, "confidence": CONFIDENCE, "alike": FITS_ALIKE}
        given["recordings_differ"] = True
        given["offset_n"] = shift_n / COVERAGE_FACTOR
        longer = max(1.0, SIMULATED_RECORDINGS / len(recordings))
        effort = replace(self.effort, piece_s=longer * PIECE_S, polished_piece_s=longer * POLISHED_PIECE_S)
        try:
            found = identify(model, recordings, self.velocities, pressure, effort, **given)
        except ValueError as error:  # too few points of steady sliding
            return _unidentified(model, recordings, str(error))
        steady = steady_intervals(recordings, self.run.cylinder, CONFIDENCE, shift_n, model.pressure_scaled)
        in_warm, in_cold = steady["viscous_n_s_m"]
        viscous = (1.0 - LEAST_SHARE) * in_warm, (1.0 + LEAST_SHARE) * in_cold
        intervals = found.intervals | {"viscous_n_s_m": viscous}
        for name, (lower, upper) in intervals.items():
            value = found.parameters.value(name)
            least = max(LEAST_SHARE * value, shift_n if name in ("coulomb_n", "static_n") else 0.0)
            most = SOFTENED * value if name == "bristle_stiffness_n_m" else value + least
            intervals[name] = _holding((lower, upper), value - least, most)
        intervals["coulomb_n"] = _holding(steady["coulomb_n"], *intervals["coulomb_n"])
        if len(conditions) == 1:  # The curve through points of several conditions mixes their pressures
            share = found.curve.retract_ratio / found.parameters.value("retract_ratio")
            other = [share * limit for limit in intervals["retract_ratio"]]
            intervals["retract_ratio"] = _holding(intervals["retract_ratio"], *other)
        found = replace(found, intervals=intervals)
        loss = "" if self.run.loss is None else self.run.loss.unknown_viscous
        seen = any("static_n" not in each.unknown for each in curves)
        unseen = "" if seen else UNSEEN.format(" or ".join(sorted(conditions)))
        why_not = dict.fromkeys(SLOW_PARAMETERS, unseen) | dict.fromkeys(BENT_BY_A_LOSS, loss)
        stiffest_n_m = intervals["bristle_stiffness_n_m"][1]
        why_not["bristle_stiffness_n_m"] = too_coarse(found.parameters.value("coulomb_n"), stiffest_n_m, self.step_m)
        lines_n = lines_uncertain_n(recordings[0], self.run.cylinder, np.ones(1))
        oil = OilTemperature.of(recordings)
        why_not["viscous_n_s_m"] = loss or no_viscous_seen(intervals["viscous_n_s_m"], lines_n, oil)
        parameters = determined(model, found, zeros, why_not, oil)
        names = tuple(recording.name for recording in recordings)
        return IdentifiedModel(model.name, model.title, names, "", parameters, found, oil)


def too_coarse(coulomb_n: float, stiffest_n_m: float, step_m: float) -> str:
    """State it if bristles may bend less than a step of the position; else empty.

    ``stiffest_n_m`` is the upper end of the stiffness's interval: a coarse position makes bristles
    seem soft.
    """
    bent_m = coulomb_n / stiffest_n_m
    return COARSE.format(bent_m, step_m) if bent_m < step_m else ""


def simpler(models: Sequence[IdentifiedModel], simulated: Sequence[tuple[Recording, Mapping[str, Array]]]) -> str:
    """State it if the plain model describes all recordings as well as the pressure-scaled one; else empty."""
    plain, scaled = (each.title for each in models)
    if any(each.found is None for each in models):
        return ""
    off_n = [
        [float(np.abs(lines[title] - each.column("friction_n"))[each.usable()].mean()) for title in (plain, scaled)]
        for each, lines in simulated
    ]
    errors = np.mean(off_n, axis=0).tolist()
    if errors[0] > AS_GOOD * errors[1]:
        return ""
    return (
        f"{plain} describes all recordings as well ({errors[0]:.1f} N) as {scaled} ({errors[1]:.1f} N), with one "
        "parameter fewer; use its parameters"
    )


def _level_n(recordings: Sequence[Recording]) -> float:
    return float(np.mean(np.abs(np.concatenate([each.column("friction_n")[each.usable()] for each in recordings]))))


def _pressure(recording: Recording) -> Array:
    return recording.column("pressure_1_pa") + recording.column("pressure_2_pa")


def _holding(interval: tuple[float, float], lower: float, upper: float) -> tuple[float, float]:
    """Widen an interval of a positive parameter to contain another one."""
    return max(min(interval[0], lower), 1e-9), max(interval[1], upper)


def _unidentified(model: LuGre, recordings: Sequence[Recording], problem: str) -> IdentifiedModel:
    return IdentifiedModel(model.name, model.title, tuple(recording.name for recording in recordings), problem)
