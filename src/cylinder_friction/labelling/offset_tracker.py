"""Fit of the tracker by which a real-time step learns a session's offset, from the friction of several sessions."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.polynomial import legendre

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.friction_quantities import POSITION_ORDER, FrictionQuantities
from cylinder_friction.labelling.offset_identification import OffsetModel, fit_offset_model
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, sensor_areas, zero_uncertainty_n
from cylinder_friction.realtime.bounds import causal_velocity, without_line_loss
from cylinder_friction.realtime.sensor_offset import (
    BALANCE,
    LOAD,
    POWERS,
    PRESSURE,
    QUANTITIES,
    UNLIKE,
    WARM,
    ZERO,
    OffsetSettings,
    OffsetTracker,
)
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, PRESSURES
from cylinder_friction.recordings.recording import Recording, RecordingError

UNLIMITED = 1e30
"""Limit of a quantity that is not an input, as JSON has no infinity."""
SLOWER, WORTHWHILE = 2.0 / 3.0, 1e-3
"""Alternative least speed in real time, as a share of the plan's, and the least gain for using it, as a share of mean
friction. Slower sliding adds errors from friction's history, but waiting for faster strokes leaves the offset in."""
LEAST_KNOWN = 0.75
"""Largest uncertainty of zeros that count as known, as a share of the stated uncertainty."""
FOLDS, LEAST_SESSIONS = 4, 2
CAUTION = (1.0, 1.5, 2.2, 3.3, 5.0)
CHOICES = {
    "drifting": (1.0, 2.0, 4.0),
    "learning": CAUTION,
    "stating": CAUTION,
}
"""Candidates for ``OffsetTracker.careful``."""
MARGIN = 0.5
"""Share of a quantity's training span by which it may leave that span before its blocks no longer count."""
RANGED_PLACES = (0, 2, 5, 7)
"""Indices of pressure, speed, load and temperature among ``QUANTITIES``."""


def fit_offset_tracker(
    recordings: Sequence[Recording], cylinder: Cylinder, inputs: Sequence[str], plan: OffsetPlan | None = None
) -> OffsetTracker:
    """Fit the tracker with which a step learns the offset of a session, from labels of ``OffsetModel.corrected``.

    ``inputs`` are the columns of a sample: both pressures, the position, the load if it is measured, and optionally the
    oil's temperature.

    Raises:
        RecordingError: An input that the force balance needs is missing, no zeros were identified, or there is only
            one session.
    """
    plan = plan or OffsetPlan()
    needed = [*PRESSURES, *([LOAD_FORCE] if LOAD_FORCE in recordings[0].columns else [])]
    missing = [column for column in needed if column not in inputs]
    if missing:
        raise RecordingError(f"an offset cannot be learned without {missing[0]} among the inputs; got {tuple(inputs)}")
    bare = [recording.name for recording in recordings if not recording.metadata.identified_zero]
    if bare:
        raise RecordingError(f"recording {bare[0]!r}: no zeros were identified; correct its offset first")
    if len(_sessions(recordings)) < LEAST_SESSIONS:
        raise RecordingError(
            f"how an offset is learned is found by leaving sessions out; expected at least {LEAST_SESSIONS} of them, "
            f"but got {_sessions(recordings)[0]!r} alone; give recordings of another session"
        )
    recordings = [without_line_loss(each, each.metadata.line_loss) for each in recordings]
    prior_n = max(zero_uncertainty_n(recording, cylinder) or 0.0 for recording in recordings)
    # The smallest uncertainty is almost all common: strokes do not show the mean offset of all sessions
    common_n = min(zero_uncertainty_n(recording.zeroed(), cylinder) or 0.0 for recording in recordings)

    def fitted(slowest: float, chosen: Sequence[Recording]) -> OffsetTracker:
        own = replace(plan, slowest_m_s=slowest * plan.slowest_m_s)
        model = fit_offset_model([recording.zeroed() for recording in chosen], cylinder, own, inputs)
        return _tracker(replace(model, common_uncertainty_n=common_n), recordings[0], inputs, prior_n)

    found = {slowest: _chosen(recordings, inputs, partial(fitted, slowest)) for slowest in (1.0, SLOWER)}
    level_n = np.mean([np.abs(recording.column("friction_n")).mean() for recording in recordings])
    slowest = SLOWER if found[1.0][0] - found[SLOWER][0] > WORTHWHILE * level_n else 1.0
    return fitted(slowest, recordings).careful(**found[slowest][1])


def zeros_are_known(recordings: Sequence[Recording]) -> bool:
    """Check whether several sessions have identified zeros, on average clearly less uncertain than stated.

    If friction does not show the zeros of these sessions, it does not show those of the next session either.
    """
    if len(_sessions(recordings)) < LEAST_SESSIONS or not all(
        recording.metadata.identified_zero for recording in recordings
    ):
        return False
    remains = [
        zero.uncertainty / max(recording.metadata.uncertainty[column].zero, 1e-12)
        for recording in recordings
        for column, zero in recording.metadata.identified_zero.items()
        if recording.metadata.uncertainty[column].zero > 0.0
    ]
    return float(np.mean(remains)) <= LEAST_KNOWN


def _sessions(recordings: Sequence[Recording]) -> list[str]:
    return sorted({recording.metadata.session for recording in recordings})


def _chosen(
    recordings: Sequence[Recording], inputs: Sequence[str], fitted: Callable[[Sequence[Recording]], OffsetTracker]
) -> tuple[float, dict[str, float]]:
    """Choose the settings of ``careful`` by leaving sessions out; return them after the offset's mean absolute error.

    Each setting is chosen from ``CHOICES`` in turn: ``stating`` by its likelihood, all others by that error.
    """
    sessions = _sessions(recordings)
    folds = []
    for fold in range(min(FOLDS, len(sessions) - 1)):
        own = sessions[fold::FOLDS]
        others = [each for each in recordings if each.metadata.session not in own]
        folds.append((fitted(others), [each for each in recordings if each.metadata.session in own]))
    chosen: dict[str, float] = {}

    def missed(name: str, value: float) -> float:
        cautious = [(tracker.careful(**{**chosen, name: value}), own) for tracker, own in folds]
        errors = [_errors(tracker, each, inputs) for tracker, own in cautious for each in own]
        if name == "stating":  # Minus the mean log-likelihood of normal errors, up to a constant
            return float(np.mean([np.mean(np.log(variance) + off_n**2 / variance) for off_n, variance in errors]))
        return float(np.mean([np.mean(np.abs(off_n)) for off_n, _ in errors]))

    for name, values in CHOICES.items():
        chosen[name] = min(values, key=partial(missed, name))
    return missed("learning", chosen["learning"]), chosen


def _errors(tracker: OffsetTracker, recording: Recording, inputs: Sequence[str]) -> tuple[Array, Array]:
    """Compute the offset's error and its stated variance at each sample, without the part common to all sessions."""
    samples = recording.samples(inputs)
    place = list(inputs).index("position_m")
    found = tracker.rows(samples, causal_velocity(recording), place, tracker.new_state())
    true_n = (samples - recording.zeroed().samples(inputs)) @ tracker.weights[BALANCE]
    return found[:, 0] - true_n, found[:, 1] ** 2 - tracker.settings.common_n**2


def _tracker(model: OffsetModel, recording: Recording, inputs: Sequence[str], prior_n: float) -> OffsetTracker:
    """Build the tracker from a model; the tracker's friction coefficients are in SI units, not standardised."""
    explain, step_s = model.quantities, recording.sample_time_s
    count, means, deviations = len(explain.means), np.array(explain.means), np.array(explain.deviations)
    standard = np.array(model.coefficients[1 : 1 + count]) / deviations * model.level_n
    friction = np.zeros(QUANTITIES)
    friction[_places(explain)] = standard
    along = np.zeros(POWERS)
    powers = legendre.leg2poly([0.0, *model.coefficients[1 + count : 1 + count + POSITION_ORDER]])
    along[: len(powers)] = model.level_n * powers
    along[0] += model.level_n * model.coefficients[0] - float(standard @ means)
    even = model.level_n * np.array(model.coefficients[-len(explain.even_places) :])
    of = np.array(explain.even_places[1:]) - 1
    even_slopes = even[1:] / deviations[of]
    even_constant = even[0] - float(even_slopes @ means[of])
    plan, block = model.plan, max(1, round(model.plan.block_s / step_s))
    speed, cylinder = explain.speed_place, explain.cylinder
    settings = [
        *(plan.slowest_m_s, round(plan.settling_s / step_s), block, cylinder.moving_mass_kg, block * step_s),
        *(model.noise_n, model.stroke_n, prior_n**2 * step_s / plan.drift_s, model.common_uncertainty_n),
        *(explain.means[speed], explain.deviations[speed], *explain.position_range_m),
        *(even_constant, even_slopes[0], 1.0, prior_n**2),
        *(1.0 / (UNLIKE * deviation**2) if deviation > 0.0 else 0.0 for deviation in (model.scale, model.slope)),
    ]
    weights = _weights(recording, cylinder, inputs, prior_n)
    weights[BALANCE] -= float(sum(even_slopes[1:])) * weights[LOAD]
    return OffsetTracker(
        weights=weights,
        settings=OffsetSettings(*map(float, settings)),
        friction=friction,
        position=along,
        ranges=_ranges(explain),
        prior=np.array([prior_n, 0.5 * plan.asymmetry_sd, model.scale, model.slope, 0.0]),
    )


def _weights(recording: Recording, cylinder: Cylinder, inputs: Sequence[str], prior_n: float) -> Array:
    weights = np.zeros((5, len(inputs)))
    stated, whole = recording.metadata.uncertainty, cylinder.piston_area_m2 + cylinder.annulus_area_m2
    areas = sensor_areas(recording, cylinder)
    for place, column in enumerate(inputs):
        if column in areas:
            weights[BALANCE, place] = areas[column]
            zero = stated[column].zero if column in stated else 0.0  # a load that depends on position has no sensor
            weights[ZERO, place] = areas[column] * zero**2 / max(prior_n, 1e-9) ** 2
        if column in PRESSURES:
            weights[PRESSURE, place] = abs(areas[column]) / whole
        weights[LOAD, place] = float(column == LOAD_FORCE)
        weights[WARM, place] = float(column == OIL_TEMPERATURE)
    return weights


def _ranges(explain: FrictionQuantities) -> Array:
    """Compute the widened range of each ranged quantity; unlimited for a quantity that is not an input."""
    lower, upper, places = np.full(QUANTITIES, -UNLIMITED), np.full(QUANTITIES, UNLIMITED), _places(explain)
    slack = MARGIN * (np.array(explain.highest) - np.array(explain.lowest))
    lower[places], upper[places] = explain.lowest - slack, explain.highest + slack
    return np.stack([lower[list(RANGED_PLACES)], upper[list(RANGED_PLACES)]])


def _places(explain: FrictionQuantities) -> list[int]:
    """List the index among ``QUANTITIES`` of each quantity, if pressures are among them."""
    load = [5, 6] if LOAD_FORCE in explain.inputs else []
    return [*range(5), *load, *(range(7, QUANTITIES) if OIL_TEMPERATURE in explain.inputs else [])]
