"""The offset of the pressure sensors' zeros in each session's friction label, identified without knowing the truth.

Friction changes its sign with the direction of motion, a sensor's zero does not. Over steady sliding, averaged in
short blocks, the label of a session is a linear mixed model (Henderson 1975):

    label = direction·g(speed, pressure, load, temperature, position) + h(pressure, load)
            + offset + asymmetry·mean level + scale·direction·level + stroke + noise

g is friction and h its asymmetry, common to all sessions of a cylinder. Each session has an offset of its own, whose
prior is the stated uncertainty of the sensors' zeros; a scale, as friction differs from day to day; and an asymmetry
of its own. Blocks of a stroke share an error, so that strokes, not rows, count. The standard deviations of scale,
stroke and noise are found by restricted maximum likelihood, all else by generalised least squares
(``labelling.mixed_model``). Without a column of the oil's temperature each session also has a slope of its own over
speed, as cold oil makes fast strokes heavier.

Strokes do not separate an asymmetry of a session's own from its offset, so that its standard deviation is stated and
enters the uncertainty; few sessions do not show how large it is, and if they differ by more than that and the zeros
explain, it is taken to be as large as they show. Nor do strokes separate **the mean offset of all sessions from the
asymmetry common to them**: it stays 0, as uncertain as the sensors' zeros make it, divided by the root of the number
of sessions.

Only the mean of both pressures, weighted by their areas, explains friction: each pressure by itself contains friction,
as their difference is the label. With a measured load it is the load that shows how the mean divides between them. A
gain error of the sensors is not identified; what of it does not change with direction goes into the offset, or where
all sessions share it and it grows with the load, into h.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import minimize

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.mixed_model import Evidence, Posterior, Reduced, solved
from cylinder_friction.labelling.sliding_blocks import (
    EXPLAINING,
    OffsetPlan,
    SlidingBlocks,
    sensor_areas,
    sliding_blocks,
    zero_uncertainty_n,
)
from cylinder_friction.recordings.columns import (
    COVERAGE_FACTOR,
    LOAD_FORCE,
    OIL_TEMPERATURE,
    PRESSURE_1,
    PRESSURE_2,
    REFERENCE_C,
    UNCERTAINTY_COLUMN,
)
from cylinder_friction.recordings.recording import IdentifiedZero, Recording, RecordingError

POSITION_ORDER = 12
"""Order of the polynomial in position: ripple of the bore, where strokes do not average it out."""
LEAST_OWN_SHARE = 0.02
"""If the direction explains all but this share of the mean pressure's variance, as behind a servo valve, pressure does
not explain friction: it would explain the difference between the directions, and with it the zeros."""
_NOTHING = 1e6
PASSES = 2
"""The second pass knows the level of friction of each block, to which scale and asymmetry are relative."""

MOST_SEARCHED = 100
"""Standard deviations of what sessions have of their own are sought with at most so many sessions, evenly spread."""
LEAST_NARROWING = 0.75
"""Strokes that leave a larger share of the stated uncertainty than this have determined nothing."""
_SURE = np.array([1.0, 1.0, 0.8, 1.0, 1.0])
"""By how much logarithms may be off; the third, of the asymmetry, by little: only a large one is taken for that."""
_LEAST_ASYMMETRY = 1e-4
_LEAST_NOISE = 1e-4
"""Over friction's level, for simulated friction without noise: with none, the equations would be singular."""
_STARTS = (0.003, 0.03, 0.15)
"""A second start of the search for a session's own asymmetry: offsets and asymmetry each explain much."""
_FEW = 0.25
"""Share of the common asymmetry by which two sessions may differ; it falls with the number of sessions, which show it.
"""
_QUANTITY, _RIPPLE = 0.3, 0.05
"""Standard deviations of what explains friction, over its level: per standardised quantity, and per order of position.
Where more is allowed, what the directions do not have in common is taken for friction, and leaves the offset."""
_GUESS = np.log([0.01, 0.01, 0.03, 0.03])
"""Logarithms of the standard deviations of noise, stroke (over friction's level), scale and slope; each may be off by
e."""


@dataclass(frozen=True)
class SessionOffset:
    """The offset of one session's friction label, with its uncertainty; subtract it from the label.

    All numbers are forces [N], with standard uncertainties (k = 1). ``common_uncertainty_n`` is the part that more
    strokes of this session cannot reduce, as all sessions share it.
    """

    session: str
    offset_n: float  # Posterior mean; 0 where nothing is known but the prior [N]
    # Standard uncertainty (k = 1): of the strokes, of the session's own asymmetry, and ``common_uncertainty_n`` [N]
    standard_uncertainty_n: float
    common_uncertainty_n: float  # Part of it that is common to all sessions: of their mean offset [N]
    prior_n: float  # Stated standard uncertainty of the sensors' zeros, as friction [N]
    # Number of strokes; with none in one of the directions, offset and friction's level are not separated
    strokes_extend: int
    strokes_retract: int
    sliding_s: float  # Steady sliding that was used [s]
    even_n: float = math.nan  # Half the sum of mean friction extending and retracting: what does not turn [N]

    @property
    def relative_uncertainty_n(self) -> float:
        """Standard uncertainty (k = 1) relative to the mean offset of all sessions [N]."""
        return math.sqrt(max(self.standard_uncertainty_n**2 - self.common_uncertainty_n**2, 0.0))

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return what ``to_dict`` wrote."""
        return cls(**content)


@dataclass(frozen=True)
class OffsetModel:
    """Friction common to all sessions of a cylinder, and the offset of each session of the fit.

    ``fit_offset_model`` makes it. ``identify`` finds the offset of a further session, and ``corrected`` subtracts
    offsets from labels. It is as good as the sessions: at least a dozen, with strokes in both directions.
    """

    plan: OffsetPlan
    cylinder: Cylinder
    inputs: tuple[str, ...]  # Columns beside velocity and position that explain friction
    position_range_m: tuple[float, float]
    # Mean and standard deviation by which each quantity that explains friction is standardised
    means: tuple[float, ...]
    deviations: tuple[float, ...]
    # Smallest and largest value of each
    lowest: tuple[float, ...]
    highest: tuple[float, ...]
    level_n: float  # Mean absolute friction [N]
    noise_n: float  # Standard deviation of a block [N]
    stroke_n: float  # Standard deviation of what the blocks of a stroke share [N]
    scale: float  # Standard deviation of a session's friction over that of all sessions
    slope: float  # The same of its dependence on standardised speed; 0 if the oil's temperature explains it
    coefficients: tuple[float, ...]  # Of friction and its common asymmetry, over ``level_n``
    precision: tuple[tuple[float, ...], ...]  # Inverse of their covariance
    common_uncertainty_n: float  # Standard uncertainty of the mean offset of all sessions [N]
    sessions: Mapping[str, SessionOffset] = field(default_factory=dict)  # Of those it was fitted to

    @property
    def speed_place(self) -> int:
        """Place of the speed among the quantities that explain friction."""
        return 2 if PRESSURE_1 in self.inputs else 0

    @property
    def even_places(self) -> list[int]:
        """Places of what explains the common asymmetry, h, among what explains friction: constant, pressure, load."""
        pressure = [1] if PRESSURE_1 in self.inputs else []
        return [0, *pressure, *([self.speed_place + 4] if LOAD_FORCE in self.inputs else [])]

    def about_mean(self) -> Self:
        """Make the model with each session's deviation from their mean as its offset.

        The mean cannot be told from an asymmetry of friction and stays in friction, as uncertain as the stated zeros of
        these sessions leave it. The deviations are right if asymmetry does not change between sessions.
        """
        mean_n = sum(each.offset_n for each in self.sessions.values()) / len(self.sessions)
        return self._shifted(mean_n, _common_n(self.sessions.values()))

    def _shifted(self, mean_n: float, common_n: float) -> Self:
        """Build the model with the mean offset moved into friction, with the uncertainty ``common_n``."""
        coefficients = list(self.coefficients)
        coefficients[len(coefficients) - len(self.even_places)] += mean_n / self.level_n
        sessions = {
            name: replace(
                each,
                offset_n=each.offset_n - mean_n,
                standard_uncertainty_n=math.hypot(each.relative_uncertainty_n, common_n),
                common_uncertainty_n=common_n,
            )
            for name, each in self.sessions.items()
        }
        return replace(self, coefficients=tuple(coefficients), common_uncertainty_n=common_n, sessions=sessions)

    @property
    def even_spread_n(self) -> float:
        """Spread of sessions in the force that does not turn with the direction [N]; 0 for one session."""
        values = [each.even_n for each in self.sessions.values() if math.isfinite(each.even_n)]
        return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0

    def identify(self, recordings: Iterable[Recording]) -> SessionOffset:
        """Identify the offset of a further session from its own labelled recordings, given the friction of the others.

        The model does not change. ``recordings`` may be truncated, to see what the first seconds determine; without
        steady sliding the offset is 0, as uncertain as stated. For a session of the fit take its offset from
        ``sessions``: here its strokes would count twice.

        Raises:
            RecordingError: The recordings are of several sessions, lack labels or a column of ``inputs``, or do not
                state the uncertainty of their sensors' zeros.
        """
        session = SlidingBlocks.joined([sliding_blocks(each, self.cylinder, self.plan) for each in recordings])
        missing = [column for column in self.inputs if column not in session.columns]
        if missing:
            raise RecordingError(
                f"session {session.session!r}: column {missing[0]!r} is missing; the offset model was fitted to "
                f"recordings with {', '.join(self.inputs)}; fit it without that column"
            )
        seen, precision, asymmetry_sd = self._seen([session]), np.array(self.precision), self.plan.asymmetry_sd
        friction = [self.scale] if self._warm_known else [self.scale, self.slope]
        part = seen.reduced(self.noise_n, self.stroke_n, asymmetry_sd, friction)
        posterior = solved(precision, precision @ np.array(self.coefficients), part)
        found = seen.offsets(posterior, part, asymmetry_sd)
        return _session_offsets(*found, [session], self.common_uncertainty_n)[0]

    def corrected(self, recordings: Sequence[Recording]) -> list[Recording]:
        """Subtract their session's offset from the labels of recordings, and state its uncertainty.

        Pressures stay as measured; the zeros most likely to make up the offset are noted in the metadata, from which
        ``Recording.zeroed`` takes them off. Sessions of the fit have the offset found there, others are identified.

        Raises:
            RecordingError: As ``identify``.
        """
        offsets = self.offsets(recordings)
        return [_without_offset(each, offsets[each.metadata.session], self.cylinder) for each in recordings]

    def offsets(self, recordings: Iterable[Recording]) -> dict[str, SessionOffset]:
        """Collect the offset of each session among labelled recordings, by name; see ``corrected``."""
        by_session: dict[str, list[Recording]] = {}
        for recording in recordings:
            by_session.setdefault(recording.metadata.session, []).append(recording)
        return {name: self.sessions.get(name) or self.identify(own) for name, own in by_session.items()}

    def to_dict(self) -> dict[str, Any]:
        """Collect the content as JSON-compatible values."""
        content = asdict(self) | {"sessions": {name: each.to_dict() for name, each in self.sessions.items()}}
        content |= {name: list(value) for name, value in content.items() if isinstance(value, tuple)}
        return content | {"cylinder": self.cylinder.to_dict(), "precision": [list(row) for row in self.precision]}

    @classmethod
    def from_dict(cls, content: Mapping[str, Any]) -> Self:
        """Return what ``to_dict`` wrote."""
        lists = {name: tuple(value) for name, value in content.items() if isinstance(value, list)}
        return cls(
            **{
                **content,
                **lists,
                "plan": OffsetPlan(**content["plan"]),
                "cylinder": Cylinder(**content["cylinder"]),
                "precision": tuple(tuple(row) for row in content["precision"]),
                "sessions": {name: SessionOffset.from_dict(each) for name, each in content["sessions"].items()},
            }
        )

    def _explaining(self, session: SlidingBlocks) -> Array:
        """Compute the standardised quantities that explain friction, the constant first, ``(blocks, quantities)``."""
        standard = (_quantities(session, self.inputs, self.cylinder) - np.array(self.means)) / np.array(self.deviations)
        first, last = self.position_range_m
        along = np.clip((2.0 * session.columns["position_m"] - first - last) / max(last - first, 1e-12), -1.0, 1.0)
        return np.hstack([np.ones((len(standard), 1)), standard, legendre.legvander(along, POSITION_ORDER)[:, 1:]])

    @property
    def _warm_known(self) -> bool:
        return OIL_TEMPERATURE in self.inputs

    def _seen(self, sessions: Sequence[SlidingBlocks]) -> _Seen:
        """Build the columns of own effects and of common friction, and the label [N], of the sessions' blocks."""
        blocks, counts = SlidingBlocks.together(sessions), np.array([len(session.stroke) for session in sessions])
        explaining, session = self._explaining(blocks), np.repeat(np.arange(len(counts)), counts)
        known = np.array(self.coefficients[: explaining.shape[1]] or (1.0,))  # Before the first pass, friction's mean
        level_n = np.abs(explaining[:, : len(known)] @ known) * self.level_n
        # A varying level would seem to separate asymmetry from offset, and with strokes in one direction scale from
        # offset, but that relies on friction's model being exact.
        mean_level_n = np.bincount(session, level_n, len(counts)) / np.maximum(counts, 1)
        both = np.abs(np.bincount(session, blocks.direction, len(counts))) < counts
        scaled_n = np.where(both[session], level_n, mean_level_n[session]) * blocks.direction
        own = [scaled_n, np.ones_like(level_n)]
        if not self._warm_known:
            own.insert(1, scaled_n * explaining[:, 1 + self.speed_place])
        design = (self.level_n * blocks.direction)[:, None] * explaining, self.level_n * explaining[:, self.even_places]
        columns = np.column_stack([*own, *design, blocks.label_n])
        prior_n = np.array([session.prior_n for session in sessions])
        return _Seen(Evidence.of(columns, len(own), counts, blocks.stroke), prior_n, mean_level_n)


@dataclass(frozen=True)
class _Seen:
    """The evidence of sessions, whose own effects are a scale, a slope if the model has one, and an offset.

    A session's own asymmetry is part of that offset until ``offsets`` leaves it out, as the two do not separate.
    """

    evidence: Evidence
    prior_n: Array  # Stated standard uncertainty of each session's zeros
    level_n: Array  # Mean friction of each session

    def reduced(self, noise_n: float, stroke_n: float, asymmetry_sd: float, friction: Sequence[float]) -> Reduced:
        """Reduce the evidence, given standard deviations; ``friction`` has those of scale and slope."""
        offset_n = np.hypot(self.prior_n, 0.5 * asymmetry_sd * self.level_n)
        deviations = np.empty((len(offset_n), 1 + len(friction)))
        deviations[:, :-1], deviations[:, -1] = friction, offset_n
        return self.evidence.reduced(noise_n, stroke_n, deviations)

    def offsets(self, posterior: Posterior, parts: Reduced, asymmetry_sd: float) -> tuple[Array, Array]:
        """Compute posterior means and standard deviations of the sessions' offsets [N]."""
        both_n, uncertainty_n = posterior.last_effect(parts)
        asymmetry_n = 0.5 * asymmetry_sd * self.level_n
        share = self.prior_n**2 / np.maximum(self.prior_n**2 + asymmetry_n**2, 1e-300)
        return share * both_n, np.hypot(share * uncertainty_n, np.sqrt(share) * asymmetry_n)


def fit_offset_model(
    recordings: Iterable[Recording],
    cylinder: Cylinder,
    plan: OffsetPlan | None = None,
    columns: Collection[str] = EXPLAINING,
) -> OffsetModel:
    """Identify the friction common to the sessions of a cylinder, and the offset of each session, together.

    The recordings are labelled. Sliding is explained by speed and position, and by pressures, oil temperature and a
    measured load if they are among ``columns`` and every recording has them. A session alone, or strokes in one
    direction alone, do not separate offset from asymmetry or from friction's level: the offset then stays as uncertain
    as the plan's asymmetry or the stated zeros make it. A session has one zero: recordings zeroed each for itself share
    what is left on average.

    Raises:
        RecordingError: There is no recording, nothing slides steadily, there are no labels, or the uncertainty of a
            sensor's zero is not stated. That of a load identified from position never is: such a load has absorbed
            the offset already.

    Example:
        >>> from dataclasses import replace
        >>> offsets = cf.fit_offset_model(train, cylinder)
        >>> corrected = offsets.corrected(train)  # labels without the offset of each session's zeros
        >>> with_tracker = cf.HybridEstimator(cylinder, plan=replace(hybrid.plan, epochs=1)).fit(corrected)
    """
    return offset_model([sliding_blocks(each, cylinder, plan) for each in recordings], cylinder, plan, columns)


def offset_model(
    sliding: Iterable[SlidingBlocks],
    cylinder: Cylinder,
    plan: OffsetPlan | None = None,
    columns: Collection[str] = EXPLAINING,
) -> OffsetModel:
    """Fit the model of ``fit_offset_model`` from the steady sliding of each recording, without its signals.

    Use it if recordings do not fit into memory together: keep the ``sliding_blocks`` of each, which are small. The
    result is the same bit for bit.

    Raises:
        RecordingError: As ``fit_offset_model``.
    """
    plan, by_session = plan or OffsetPlan(), dict[str, list[SlidingBlocks]]()
    for part in sliding:
        by_session.setdefault(part.session, []).append(part)
    sessions = [SlidingBlocks.joined(parts) for parts in by_session.values()]
    if not sessions:
        raise RecordingError("sensor offsets cannot be identified: expected at least one recording, but got none")
    if not sum(len(session.direction) for session in sessions):
        raise RecordingError(
            f"sensor offsets cannot be identified: got no steady sliding in sessions "
            f"{', '.join(by_session)}; expected strokes faster than "
            f"{1e3 * plan.slowest_m_s:g} mm/s for more than {plan.settling_s:g} s"
        )
    model = _empty_model(SlidingBlocks.together(sessions), cylinder, plan, columns)
    asymmetry = max(plan.asymmetry, _asymmetry_seen(sessions))
    few = _FEW * asymmetry / max(len(sessions) - 1, 1)
    varies = plan.asymmetry_sd * (asymmetry / plan.asymmetry if plan.asymmetry > 0.0 else 1.0)
    plan = replace(plan, asymmetry=asymmetry, asymmetry_sd=math.hypot(varies, 2.0 * few))
    model = replace(model, plan=plan)
    least = math.log(max(0.5 * plan.asymmetry_sd, _LEAST_ASYMMETRY))
    guess = expected = np.insert(_GUESS[:3] if model._warm_known else _GUESS, 2, least)
    for _ in range(PASSES):
        model, guess, offsets = _fitted(model, plan, sessions, guess, expected)
    return _with_sessions(model, sessions, *offsets)


def _asymmetry_seen(sessions: Sequence[SlidingBlocks]) -> float:
    """Compute the asymmetry of friction: root mean square over sessions, less the part that zeros explain."""
    squares = []
    for session in sessions:
        ways = [session.label_n[session.direction == sign] for sign in (1.0, -1.0)]
        if min(map(len, ways)):
            extend_n, retract_n = (float(way.mean()) for way in ways)
            friction_n = max(0.5 * (extend_n - retract_n), 1e-9)
            squares.append(((0.5 * (extend_n + retract_n)) ** 2 - session.prior_n**2) / friction_n**2)
    return math.sqrt(max(float(np.mean(squares)), 0.0)) if squares else 0.0


def _without_offset(recording: Recording, found: SessionOffset, cylinder: Cylinder) -> Recording:
    """Subtract the offset from a recording; each sensor gets the share that its stated zero makes likely."""
    stated, areas = recording.metadata.uncertainty, sensor_areas(recording, cylinder)
    own_n = zero_uncertainty_n(recording, cylinder)
    assert own_n is not None
    remaining = found.standard_uncertainty_n / own_n if own_n > 0.0 else 1.0
    zeros = {
        column: IdentifiedZero(
            found.offset_n * area * stated[column].zero ** 2 / own_n**2 if own_n > 0.0 else 0.0,
            stated[column].zero * remaining,
        )
        for column, area in areas.items()
    }
    columns = {"friction_n": recording.column("friction_n") - (found.offset_n if own_n > 0.0 else 0.0)}
    if UNCERTAINTY_COLUMN in recording.columns:
        less = COVERAGE_FACTOR**2 * own_n**2 * (1.0 - remaining**2)
        columns[UNCERTAINTY_COLUMN] = np.sqrt(np.maximum(recording.column(UNCERTAINTY_COLUMN) ** 2 - less, 0.0))
    return replace(recording.with_columns(**columns), metadata=replace(recording.metadata, identified_zero=zeros))


def _quantities(session: SlidingBlocks, inputs: Sequence[str], cylinder: Cylinder) -> Array:
    """Compute the quantities that explain friction, except position, ``(blocks, quantities)``; mean pressure first."""
    of = session.columns
    speed = np.abs(of["velocity_m_s"])
    fast = np.log(np.maximum(speed, 1e-12))
    pressure: list[Array] = []
    if PRESSURE_1 in inputs:
        areas = np.array([cylinder.piston_area_m2, cylinder.annulus_area_m2])
        mean = areas @ np.stack([of[PRESSURE_1], of[PRESSURE_2]]) / areas.sum()
        pressure = [mean, np.sqrt(np.maximum(mean, 0.0))]
    load = [of[LOAD_FORCE], np.abs(of[LOAD_FORCE])] if LOAD_FORCE in inputs else []
    quantities = [*pressure, speed, fast, fast**2, *load]
    if OIL_TEMPERATURE in inputs:
        warm = of[OIL_TEMPERATURE] - REFERENCE_C
        quantities += [warm, warm**2, *(warm * each for each in (*pressure, speed, fast, fast**2))]
    return np.column_stack(quantities)


def _own_share(values: Array, direction: Array) -> float:
    """Compute the share of a quantity's variance that the direction does not explain."""
    ways = [values[direction == sign] for sign in (1.0, -1.0)]
    return sum(float(way.var()) * len(way) for way in ways if len(way)) / max(float(values.var()) * len(values), 1e-300)


def _empty_model(blocks: SlidingBlocks, cylinder: Cylinder, plan: OffsetPlan, columns: Collection[str]) -> OffsetModel:
    """Make a model of scales alone."""
    common = set(columns).intersection(blocks.columns)
    inputs = tuple(sorted(common - ({PRESSURE_1, PRESSURE_2} if not {PRESSURE_1, PRESSURE_2} <= common else set())))
    quantities = _quantities(blocks, inputs, cylinder)
    deviations, rounding = quantities.std(axis=0), 1e-9 * np.abs(quantities).max(axis=0)
    level_n = float(np.mean(np.abs(blocks.label_n)))
    deviations = np.where(deviations > rounding, deviations, 1.0)
    if LOAD_FORCE in inputs:  # A load that hardly varies explains nothing: were it to, zeros would be taken for it
        place = 3 + 2 * (PRESSURE_1 in inputs)
        deviations[place : place + 2] = np.maximum(deviations[place : place + 2], level_n)
    if PRESSURE_1 in inputs and _own_share(quantities[:, 0], blocks.direction) < LEAST_OWN_SHARE:
        deviations[[0, 1, *([-5, -4] if OIL_TEMPERATURE in inputs else [])]] *= _NOTHING
    position_m = blocks.columns["position_m"]
    return OffsetModel(
        plan=plan,
        cylinder=cylinder,
        inputs=inputs,
        position_range_m=(float(position_m.min()), float(position_m.max())),
        means=_floats(quantities.mean(axis=0)),
        deviations=_floats(deviations),
        lowest=_floats(quantities.min(axis=0)),
        highest=_floats(quantities.max(axis=0)),
        level_n=level_n,
        noise_n=math.nan,
        stroke_n=math.nan,
        scale=math.nan,
        slope=math.nan,
        coefficients=(),
        precision=(),
        common_uncertainty_n=math.nan,
    )


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _fitted(
    model: OffsetModel, plan: OffsetPlan, sessions: Sequence[SlidingBlocks], guess: Array, expected: Array
) -> tuple[OffsetModel, Array, tuple[Array, Array]]:
    """Fit a model, without sessions, with the levels of friction of ``model``.

    Return it with its logarithmic standard deviations, whose search begins at ``guess`` and expects values near
    ``expected``, and with the posterior means and standard deviations of the sessions' offsets.
    """
    seen, every = model._seen(sessions), -(-len(sessions) // MOST_SEARCHED)
    searched = seen if every == 1 else model._seen(sessions[::every])
    size, even = len(seen.evidence.common) - 1, len(model.even_places)
    counts = 1, size - even - 1 - POSITION_ORDER, POSITION_ORDER, even
    deviations = np.repeat([1.0, _QUANTITY, _RIPPLE, max(model.plan.asymmetry, 1e-6)], counts)
    precision, nothing = np.diag(1.0 / deviations**2), np.zeros(size)

    def variances(logarithms: Array) -> tuple[float, float, float, list[float]]:
        noise, stroke, asymmetry, *friction = np.exp(logarithms).tolist()
        noise_n, asymmetry_sd = max(noise, _LEAST_NOISE) * model.level_n, max(plan.asymmetry_sd, 2.0 * asymmetry)
        return noise_n, stroke * model.level_n, asymmetry_sd, friction

    def objective(logarithms: Array) -> float:
        surprise = np.sum(((logarithms - expected) / _SURE[: len(logarithms)]) ** 2)
        parts = searched.reduced(*variances(logarithms))
        return solved(precision, nothing, parts).minus_twice_likelihood + float(surprise)

    starts = [guess, *(np.concatenate([guess[:2], [math.log(own)], guess[3:]]) for own in _STARTS)]
    options = {"xatol": 0.02, "fatol": 0.02, "maxiter": 500}
    searches = [minimize(objective, start, method="Nelder-Mead", options=options) for start in starts]
    found = min(searches, key=lambda search: float(search.fun)).x
    noise_n, stroke_n, asymmetry_sd, friction = variances(found)
    parts = seen.reduced(noise_n, stroke_n, asymmetry_sd, friction)
    posterior = solved(precision, nothing, parts)
    fitted = replace(
        model,
        plan=replace(plan, asymmetry_sd=asymmetry_sd),
        noise_n=noise_n,
        stroke_n=stroke_n,
        scale=friction[0],
        slope=0.0 if model._warm_known else friction[1],
        coefficients=_floats(posterior.coefficients),
        precision=tuple(_floats(row) for row in posterior.precision),
    )
    return fitted, found, seen.offsets(posterior, parts, asymmetry_sd)


def _with_sessions(
    model: OffsetModel, sessions: Sequence[SlidingBlocks], offsets_n: Array, uncertainties_n: Array
) -> OffsetModel:
    """Add the offset of each session of the fit to the model.

    The mean offset cannot be told from an asymmetry: it stays 0, as uncertain as the zeros leave it, unless the zeros
    may be much larger than an asymmetry.
    """
    stated_n = _common_n(sessions)
    common_n = seen_n = 1.0 / math.hypot(1.0 / stated_n, 1.0 / max(model.plan.asymmetry * model.level_n, 1e-9))
    mean_n = 0.0
    if seen_n > LEAST_NARROWING * stated_n:
        weights = np.array([1.0 / max(session.prior_n, 1e-9) ** 2 for session in sessions])
        common_n, mean_n = stated_n, float(weights @ offsets_n) / float(weights.sum())
    found = {each.session: each for each in _session_offsets(offsets_n, uncertainties_n, sessions, seen_n)}
    return replace(model, sessions=found)._shifted(mean_n, common_n)


def _common_n(sessions: Iterable[SlidingBlocks | SessionOffset]) -> float:
    """Compute the uncertainty of the sessions' mean offset from the stated zeros [N]."""
    return 1.0 / math.sqrt(np.array([1.0 / max(each.prior_n, 1e-9) ** 2 for each in sessions]).sum())


def _session_offsets(
    offsets_n: Array, uncertainties_n: Array, sessions: Sequence[SlidingBlocks], common_n: float
) -> list[SessionOffset]:
    found = []
    for session, offset_n, uncertainty_n in zip(sessions, offsets_n.tolist(), uncertainties_n.tolist(), strict=True):
        extend, retract = (len(np.unique(session.stroke[session.direction == sign])) for sign in (1.0, -1.0))
        common, prior = min(common_n, uncertainty_n), (session.prior_n, extend, retract, session.sliding_s)
        ways = [session.label_n[session.direction == sign] for sign in (1.0, -1.0)]
        even_n = 0.5 * sum(float(way.mean()) for way in ways) if min(map(len, ways)) else math.nan
        found.append(SessionOffset(session.session, offset_n, uncertainty_n, common, *prior, even_n))
    return found
