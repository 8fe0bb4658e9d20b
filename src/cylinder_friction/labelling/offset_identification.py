"""The offset of the pressure sensors' zeros in each session's friction label, identified without knowing the truth.

Friction changes its sign with the direction of motion; a sensor's zero does not. Over steady sliding, averaged in
short blocks, the label of a session is a linear mixed model (Henderson 1975):

    label = direction·g(speed, pressure, load, temperature, position) + h(pressure, load)
            + offset + asymmetry·mean level + condition + scale·direction·level + stroke + noise

All sessions of a cylinder share friction g and its asymmetry h. Each session has its own offset, whose prior is the
stated uncertainty of the sensors' zeros; its own scale, as friction differs from day to day; and its own asymmetry.
Blocks of a stroke share an error, so the number of strokes counts, not the number of rows. Restricted maximum
likelihood finds the standard deviations of scale, stroke and noise; generalised least squares finds all else
(``labelling.mixed_model``). Without a column of the oil's temperature, each session also has its own slope over speed,
as cold oil makes fast strokes heavier.

Strokes do not separate a session's own asymmetry from its offset. The standard deviation of that asymmetry is therefore
stated and adds to the uncertainty. If sessions differ by more than the stated asymmetry and zeros explain, the fit uses
the larger value that they show. Nor do strokes separate **the mean offset of all sessions from their common
asymmetry**: the mean offset stays 0, and its uncertainty is that of the sensors' zeros.

Conditions may differ in asymmetry: each has its own deviation from the common one. How much they differ is itself
uncertain; the mean offsets of their sessions show it. What sensors keep from session to session is in
``labelling.kept_zero``.

The fit does not identify a gain error of the sensors. Its part that does not change with direction goes into the offset
or, if all sessions share it and it grows with the load, into h.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.friction_quantities import POSITION_ORDER, FrictionQuantities
from cylinder_friction.labelling.kept_zero import KeptZero, of_mean_n, one_draw_n, together_n
from cylinder_friction.labelling.label import by_session
from cylinder_friction.labelling.mixed_model import Evidence, Posterior, Reduced, solved
from cylinder_friction.labelling.sliding_blocks import (
    EXPLAINING,
    OffsetPlan,
    SlidingBlocks,
    sensor_areas,
    sliding_blocks,
    zero_uncertainty_n,
)
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, OIL_TEMPERATURE, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import IdentifiedZero, Recording, RecordingError

PASSES = 2
"""Number of passes; from the second on, the friction level of each block is known, to which scale and asymmetry are
relative."""
MOST_SEARCHED = 100
"""Greatest number of sessions, evenly spread, in the search for standard deviations between sessions."""
LEAST_NARROWING = 0.75
"""Largest share of the stated uncertainty that strokes may leave; if they leave more, they determine nothing."""
_SURE = np.array([1.0, 1.0, 0.8, 1.0, 1.0])
"""Prior standard deviations of the logarithms; small for the third, so that only a large asymmetry is found."""
_LEAST_ASYMMETRY = 1e-4
_LEAST_NOISE = 1e-4
"""Least noise over friction's level; simulated friction without noise would make the equations singular."""
_LEAST_FRICTION = 0.1
"""Least friction of a session, over the level of all, that tells how asymmetric friction is."""
_STARTS = (0.003, 0.03, 0.15)
"""Starts of the search for a session's own asymmetry, since offset and asymmetry explain much the same."""
MAY_DIFFER = 0.25
"""Share of the common asymmetry by which conditions may differ, or two sessions; sessions less if there are more."""
_QUANTITY, _RIPPLE = 0.3, 0.05
"""Prior standard deviations of friction's coefficients over its level: per standardised quantity, and per order of
position. Greater values would let friction absorb differences between the directions that belong to the offset.
Asymmetry is a share of friction: pressure and load change it as they change friction, and ``MAY_DIFFER`` of that."""
_DIFFERENCES = np.linspace(0.0025, 3.0, 150)
"""Standard deviations of asymmetry between conditions that are considered, over that of the common asymmetry."""
_GUESS = np.log([0.01, 0.01, 0.03, 0.03])
"""Logarithms of the expected standard deviations of noise and stroke (over friction's level), scale and slope."""


@dataclass(frozen=True)
class SessionOffset:
    """The offset of one session's friction label, with its uncertainty; subtract it from the label.

    All numbers are forces [N], with standard uncertainties (k = 1). All sessions share ``common_uncertainty_n``, so
    more strokes of one session cannot reduce it.
    """

    session: str
    offset_n: float  # Posterior mean of the offset; 0 if only the prior is known [N]
    # Standard uncertainty from strokes, the session's own asymmetry and ``common_uncertainty_n`` together [N]
    standard_uncertainty_n: float
    common_uncertainty_n: float  # Part common to all sessions: the uncertainty of their mean offset [N]
    prior_n: float  # Stated standard uncertainty of the sensors' zeros, as friction [N]
    own_n: float  # Standard deviation of the part of the zeros that changes from session to session [N]
    # Number of strokes; offset and level of friction are separated only if both numbers are positive
    strokes_extend: int
    strokes_retract: int
    sliding_s: float  # Duration of the steady sliding that was used [s]
    # Standard uncertainty that comes on top if friction of the condition is more asymmetric than is likely [N]
    condition_n: float = 0.0

    @property
    def whole_uncertainty_n(self) -> float:
        """Standard uncertainty (k = 1) with ``condition_n`` [N]."""
        return math.hypot(self.standard_uncertainty_n, self.condition_n)

    @property
    def relative_uncertainty_n(self) -> float:
        """Standard uncertainty (k = 1) relative to the mean offset of all sessions [N]."""
        return math.sqrt(max(self.standard_uncertainty_n**2 - self.common_uncertainty_n**2, 0.0))


@dataclass(frozen=True)
class OffsetModel:
    """Friction common to all sessions of a cylinder, and the offset of each session of the fit.

    ``fit_offset_model`` makes it. ``identify`` finds the offset of a further session, and ``corrected`` subtracts
    offsets from labels. Give the fit at least a dozen sessions with strokes in both directions.
    """

    plan: OffsetPlan
    quantities: FrictionQuantities
    level_n: float  # Mean absolute friction [N]
    # All numbers that follow are NaN or empty before the fit
    noise_n: float = math.nan  # Standard deviation of a block [N]
    stroke_n: float = math.nan  # Standard deviation of the error that the blocks of a stroke share [N]
    scale: float = math.nan  # Standard deviation between sessions of friction relative to the common friction
    slope: float = math.nan  # The same of its slope over standardised speed; 0 if the oil's temperature explains it
    coefficients: tuple[float, ...] = ()  # Coefficients of friction and its common asymmetry, over ``level_n``
    precision: tuple[tuple[float, ...], ...] = ()  # Inverse of the coefficients' covariance
    common_uncertainty_n: float = math.nan  # Standard uncertainty of the mean offset of all sessions [N]
    kept: KeptZero = field(default_factory=KeptZero)
    conditions: tuple[str, ...] = ()  # Conditions with an asymmetry of their own; empty if there is one condition
    condition_sd: float = 0.0  # Standard deviation of a condition's own asymmetry, as a share of friction
    # Standard uncertainty of the offsets in each condition, beside theirs, if conditions differ more than is likely [N]
    conditions_n: Mapping[str, float] = field(default_factory=dict)
    sessions: Mapping[str, SessionOffset] = field(default_factory=dict)  # Offsets of the sessions of the fit

    def about_mean(self) -> Self:
        """Make the model with each session's deviation from their mean as its offset.

        The mean cannot be told from an asymmetry of friction. It stays in friction, with the uncertainty of the stated
        zeros of these sessions. The deviations are right if asymmetry does not change between sessions.
        """
        found = self.sessions.values()
        mean_n = sum(each.offset_n for each in found) / len(self.sessions)
        model = replace(self, kept=replace(self.kept, offset_n=0.0, uncertainty_n=self.kept.stated_n))
        return model._shifted(mean_n, math.hypot(of_mean_n(each.own_n for each in found), self.kept.stated_n))

    def _shifted(self, mean_n: float, common_n: float) -> Self:
        """Build the model with the mean offset moved into friction, with the uncertainty ``common_n``."""
        coefficients = list(self.coefficients)
        coefficients[len(coefficients) - len(self.quantities.even_places)] += mean_n / self.level_n
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

    def identify(self, recordings: Iterable[Recording]) -> SessionOffset:
        """Identify the offset of a further session from its own labelled recordings, given the friction of the others.

        The model does not change. Truncate ``recordings`` to see what the first seconds determine; without steady
        sliding, the offset is 0 with the stated uncertainty. For a session of the fit, take the offset from
        ``sessions``, because ``identify`` would count its strokes twice.

        Raises:
            RecordingError: The recordings are of several sessions, lack labels or a column of ``inputs``, or do not
                state the uncertainty of their sensors' zeros.
        """
        cylinder, inputs = self.quantities.cylinder, self.quantities.inputs
        parts = [sliding_blocks(each, cylinder, self.plan) for each in recordings]
        if len(names := sorted({each.session for each in parts})) != 1:
            raise RecordingError(
                f"expected recordings of one session, but got {len(names)} sessions ({', '.join(names) or 'none'}); "
                "identify each session's offset by itself"
            )
        session = SlidingBlocks.together(parts)
        session = replace(session, label_n=session.label_n - self.kept.offset_n)
        missing = [column for column in inputs if column not in session.columns]
        if missing:
            raise RecordingError(
                f"session {session.session!r}: column {missing[0]!r} is missing; the offset model was fitted to "
                f"recordings with {', '.join(inputs)}; fit it without that column"
            )
        seen, precision, asymmetry_sd = self._seen([session]), np.array(self.precision), self.plan.asymmetry_sd
        friction = [self.scale] if self._warm_known else [self.scale, self.slope]
        part = seen.reduced(self.noise_n, self.stroke_n, asymmetry_sd, friction)
        posterior = solved(precision, precision @ np.array(self.coefficients), part)
        offset_n, own_n = seen.offsets(posterior, part, asymmetry_sd)
        offset_n, own_n = offset_n + self.kept.offset_n, np.hypot(own_n, self.kept.uncertainty_n)
        if self.conditions and session.condition not in self.conditions:
            own_n = np.hypot(own_n, self.condition_sd * self.level_n)
        return _session_offsets(offset_n, own_n, [session], self, self.common_uncertainty_n)[0]

    def corrected(self, recordings: Sequence[Recording]) -> list[Recording]:
        """Subtract their session's offset from the labels of recordings, and state its uncertainty.

        Pressures stay as measured. The metadata notes the zeros that most likely make up the offset;
        ``Recording.zeroed`` subtracts them. Sessions of the fit keep their offset; other sessions are identified.

        Raises:
            RecordingError: As ``identify``.
        """
        offsets = self.offsets(recordings)
        return [_without_offset(each, offsets[each.metadata.session], self.quantities.cylinder) for each in recordings]

    def offsets(self, recordings: Iterable[Recording]) -> dict[str, SessionOffset]:
        """Collect the offset of each session among labelled recordings, by name; see ``corrected``."""
        sessions = by_session(recordings)
        return {name: self.sessions.get(name) or self.identify(own) for name, own in sessions.items()}

    def _common_seen_n(self, sessions: Sequence[SlidingBlocks]) -> float:
        """Compute the uncertainty of the sessions' mean offset from the stated zeros and the asymmetry [N]."""
        stated_n, asymmetry_n = self._stated_mean_n(sessions), self.plan.asymmetry * self.level_n
        if not self.kept.stated_n:
            return together_n(stated_n, asymmetry_n)
        # The mean of the sessions' own asymmetries looks like the zero that they share
        return one_draw_n(stated_n, math.hypot(asymmetry_n, self.own_asymmetry_n / math.sqrt(len(sessions))))

    def _stated_mean_n(self, sessions: Sequence[SlidingBlocks]) -> float:
        """Compute the uncertainty of the sessions' mean offset from the stated zeros alone [N]."""
        return math.hypot(of_mean_n(map(self.kept.own_part_n, sessions)), self.kept.stated_n)

    @property
    def own_asymmetry_n(self) -> float:
        """How far a session's own asymmetry shifts its friction [N] (k = 1)."""
        return 0.5 * self.plan.asymmetry_sd * self.level_n

    @property
    def changing_uncertainty_n(self) -> float:
        """Greatest standard uncertainty of an offset without the part that sensors keep [N]."""
        kept_n = self.kept.uncertainty_n
        return max(math.sqrt(max(each.standard_uncertainty_n**2 - kept_n**2, 0.0)) for each in self.sessions.values())

    @property
    def _warm_known(self) -> bool:
        return OIL_TEMPERATURE in self.quantities.inputs

    def _seen(self, sessions: Sequence[SlidingBlocks]) -> _Seen:
        """Build the columns of own effects and of common friction, and the label [N], of the sessions' blocks."""
        blocks, counts = SlidingBlocks.together(sessions), np.array([len(session.stroke) for session in sessions])
        explaining, session = self.quantities.explaining(blocks), np.repeat(np.arange(len(counts)), counts)
        known = np.array(self.coefficients[: explaining.shape[1]] or (1.0,))  # Before the first pass, friction's mean
        level_n = np.abs(explaining[:, : len(known)] @ known) * self.level_n
        # A varying level would seem to separate asymmetry from offset, and with strokes in one direction scale from
        # offset, but that relies on friction's model being exact.
        mean_level_n = np.bincount(session, level_n, len(counts)) / np.maximum(counts, 1)
        both = np.abs(np.bincount(session, blocks.direction, len(counts))) < counts
        scaled_n = np.where(both[session], level_n, mean_level_n[session]) * blocks.direction
        own = [scaled_n, np.ones_like(level_n)]
        if not self._warm_known:
            own.insert(1, scaled_n * explaining[:, 1 + self.quantities.speed_place])
        even = self.level_n * explaining[:, self.quantities.even_places]
        odd = (self.level_n * blocks.direction)[:, None] * explaining
        place = [[each.condition == name for name in self.conditions] for each in sessions]
        conditions = self.level_n * np.array(place, dtype=np.float64)[session]
        columns = np.column_stack([*own, odd, conditions, even, blocks.label_n])
        own_n = np.array([self.kept.own_part_n(session) for session in sessions])
        return _Seen(Evidence.of(columns, len(own), counts, blocks.stroke), own_n, mean_level_n)


@dataclass(frozen=True)
class _Seen:
    """The evidence of sessions, whose own effects are a scale, a slope if the model has one, and an offset.

    The offset includes a session's own asymmetry, as strokes do not separate the two; ``offsets`` takes it out.
    """

    evidence: Evidence
    own_n: Array  # Standard deviation of each session's own part of the zeros
    level_n: Array  # Mean friction of each session

    def reduced(self, noise_n: float, stroke_n: float, asymmetry_sd: float, friction: Sequence[float]) -> Reduced:
        """Reduce the evidence, given standard deviations; ``friction`` has the ones of scale and, if any, slope."""
        offset_n = np.hypot(self.own_n, 0.5 * asymmetry_sd * self.level_n)
        deviations = np.empty((len(offset_n), 1 + len(friction)))
        deviations[:, :-1], deviations[:, -1] = friction, offset_n
        return self.evidence.reduced(noise_n, stroke_n, deviations)

    def offsets(self, posterior: Posterior, parts: Reduced, asymmetry_sd: float) -> tuple[Array, Array]:
        """Compute posterior means and standard deviations of the sessions' offsets [N]."""
        both_n, uncertainty_n = posterior.last_effect(parts)
        asymmetry_n = 0.5 * asymmetry_sd * self.level_n
        share = self.own_n**2 / np.maximum(self.own_n**2 + asymmetry_n**2, 1e-300)
        return share * both_n, np.hypot(share * uncertainty_n, np.sqrt(share) * asymmetry_n)


def fit_offset_model(
    recordings: Iterable[Recording],
    cylinder: Cylinder,
    plan: OffsetPlan | None = None,
    columns: Collection[str] = EXPLAINING,
) -> OffsetModel:
    """Identify the friction common to the sessions of a cylinder, and the offset of each session, together.

    Give labelled recordings. Speed and position explain friction, and so do pressures, oil temperature and a measured
    load if they are among ``columns`` and every recording has them. A single session does not separate offset from
    asymmetry, and strokes in one direction do not separate offset from the level of friction. The offset then keeps the
    uncertainty of the plan's asymmetry or of the stated zeros. A session has one offset: if its recordings were zeroed
    one by one, it is their mean.

    Raises:
        RecordingError: There is no recording, nothing slides steadily, there are no labels, or the uncertainty of a
            sensor's zero is not stated. A load identified from position never states it, because such a load has
            already absorbed the offset.

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
    greatest_share: float = math.inf,
) -> OffsetModel:
    """Fit the model of ``fit_offset_model`` from the steady sliding of each recording, without the signals.

    Use it if the recordings do not fit into memory together: keep only the small ``sliding_blocks`` of each. The result
    is the same bit for bit. If the uncertainty common to all sessions alone is more than ``greatest_share`` of each
    stated one, nothing is fitted, and each session keeps its stated uncertainty.

    Raises:
        RecordingError: As ``fit_offset_model``.
    """
    plan, by_name = plan or OffsetPlan(), dict[str, list[SlidingBlocks]]()
    for part in sliding:
        by_name.setdefault(part.session, []).append(part)
    sessions = [SlidingBlocks.together(parts) for parts in by_name.values()]
    if not sessions:
        raise RecordingError("sensor offsets cannot be identified: expected at least one recording, but got none")
    if not sum(len(session.direction) for session in sessions):
        raise RecordingError(
            f"sensor offsets cannot be identified: got no steady sliding in sessions "
            f"{', '.join(by_name)}; expected strokes faster than "
            f"{1e3 * plan.slowest_m_s:g} mm/s for more than {plan.settling_s:g} s"
        )
    blocks = SlidingBlocks.together(sessions)
    asymmetry = max(plan.asymmetry, _asymmetry_seen(sessions, blocks.level_n))
    few = MAY_DIFFER * asymmetry / max(len(sessions) - 1, 1)
    varies = plan.asymmetry_sd * (asymmetry / plan.asymmetry if plan.asymmetry > 0.0 else 1.0)
    plan = replace(plan, asymmetry=asymmetry, asymmetry_sd=math.hypot(varies, 2.0 * few))
    quantities = FrictionQuantities.of(blocks, cylinder, columns)
    conditions = tuple(sorted({each.condition for each in sessions}))
    conditions = conditions if 1 < len(conditions) <= len(sessions) / 2 else ()  # else sessions differ
    model = OffsetModel(plan, quantities, blocks.level_n, kept=KeptZero.of(sessions), conditions=conditions)
    seen_n, priors_n = model._common_seen_n(sessions), np.array([each.prior_n for each in sessions])
    if seen_n > greatest_share * priors_n.max():
        stated = _session_offsets(np.zeros(len(sessions)), priors_n, sessions, model, seen_n)
        return replace(model, sessions={each.session: each for each in stated})
    least = math.log(max(0.5 * plan.asymmetry_sd, _LEAST_ASYMMETRY))
    expected = np.insert(_GUESS[:3] if model._warm_known else _GUESS, 2, least)
    starts = [np.concatenate([expected[:2], [math.log(own)], expected[3:]]) for own in _STARTS]
    for _ in range(PASSES):
        model, found, offsets = _fitted(model, plan, sessions, starts, expected)
        starts = [found]
    return _with_sessions(model, sessions, *offsets)


def _asymmetry_seen(sessions: Sequence[SlidingBlocks], level_n: float) -> float:
    """Compute the asymmetry of friction: root mean square over sessions, minus the part that zeros explain.

    A session whose friction hardly opposes its motion says nothing about it. A zero that sensors keep is one draw: it
    may be as large as its expanded uncertainty in all sessions.
    """
    more = COVERAGE_FACTOR**2 - 1.0
    halves = [(*each.halves_n(), math.sqrt(each.prior_n**2 + more * each.kept_n**2)) for each in sessions]
    least_n = _LEAST_FRICTION * level_n
    squares = [(even_n**2 - prior_n**2) / odd_n**2 for even_n, odd_n, prior_n in halves if odd_n > least_n]
    return math.sqrt(max(float(np.mean(squares)), 0.0)) if squares else 0.0


def _without_offset(recording: Recording, found: SessionOffset, cylinder: Cylinder) -> Recording:
    """Subtract the offset from a recording; each sensor gets the share that its stated zero makes likely."""
    stated, areas = recording.metadata.uncertainty, sensor_areas(recording, cylinder)
    own_n = zero_uncertainty_n(recording, cylinder)
    assert own_n is not None
    remaining = found.whole_uncertainty_n / own_n if own_n > 0.0 else 1.0
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


def _fitted(
    model: OffsetModel, plan: OffsetPlan, sessions: Sequence[SlidingBlocks], starts: Sequence[Array], expected: Array
) -> tuple[OffsetModel, Array, tuple[Array, Array]]:
    """Fit a model, without its sessions, given the friction levels of ``model``.

    Return the model, the logarithms of its standard deviations, and the posterior means and standard deviations of the
    sessions' offsets. The search for the logarithms begins at each of ``starts`` and expects values near ``expected``.
    """
    from scipy.optimize import minimize  # a third of a second, which a run with nothing new need not wait for

    seen, every = model._seen(sessions), -(-len(sessions) // MOST_SEARCHED)
    searched = seen if every == 1 else model._seen(sessions[::every])
    size, even = len(seen.evidence.common) - 1, len(model.quantities.even_places)
    conditions = len(model.conditions)
    counts = 1, size - conditions - even - 1 - POSITION_ORDER, POSITION_ORDER, conditions, 1, even - 1
    asymmetry = max(model.plan.asymmetry, 1e-6)
    alike = math.hypot(asymmetry, model.kept.stated_n / model.level_n)  # a zero that sensors keep looks the same
    nothing = np.zeros(size)

    def prior(condition_sd: float) -> Array:
        own = [1.0, _QUANTITY, _RIPPLE, condition_sd, alike, MAY_DIFFER * _QUANTITY * asymmetry]
        return np.diag(1.0 / np.repeat(own, counts) ** 2)

    precision = prior(asymmetry)  # Wide, so that conditions that differ do not look like sessions that differ

    def variances(logarithms: Array) -> tuple[float, float, float, list[float]]:
        noise, stroke, asymmetry, *friction = np.exp(logarithms).tolist()
        noise_n, asymmetry_sd = max(noise, _LEAST_NOISE) * model.level_n, max(plan.asymmetry_sd, 2.0 * asymmetry)
        return noise_n, stroke * model.level_n, asymmetry_sd, friction

    def objective(logarithms: Array) -> float:
        surprise = np.sum(((logarithms - expected) / _SURE[: len(logarithms)]) ** 2)
        parts = searched.reduced(*variances(logarithms))
        return solved(precision, nothing, parts).minus_twice_likelihood + float(surprise)

    options = {"xatol": 0.02, "fatol": 0.02, "maxiter": 500}
    searches = [minimize(objective, start, method="Nelder-Mead", options=options) for start in starts]
    found = min(searches, key=lambda search: float(search.fun)).x
    noise_n, stroke_n, asymmetry_sd, friction = variances(found)
    parts = seen.reduced(noise_n, stroke_n, asymmetry_sd, friction)
    posterior = solved(precision, nothing, parts)
    condition_sd, conditions_n = 0.0, dict[str, float]()
    if conditions:
        possible = asymmetry * _DIFFERENCES
        ways = [solved(prior(each), nothing, parts) for each in possible.tolist()]
        surprise = np.array([each.minus_twice_likelihood for each in ways]) + 2.0 * conditions * np.log(possible)
        likely = np.exp(0.5 * (surprise.min() - surprise))
        weights = np.exp(-0.5 * (_DIFFERENCES / MAY_DIFFER) ** 2)
        weights[0] = weights[1:].sum()  # As likely as not, conditions are alike
        posterior = Posterior.mixed(ways, likely * weights)
        cautious = Posterior.mixed(ways, likely * np.exp(-0.5 * (2.0 * _DIFFERENCES) ** 2))
        condition_sd = math.sqrt(np.average(possible**2, weights=likely * weights))
        own = slice(size - even - conditions, size - even)
        moved, wider = (cautious.coefficients - posterior.coefficients)[own], cautious.variances - posterior.variances
        more_n = model.level_n * np.sqrt(np.maximum(moved**2 + wider[own], 0.0))
        conditions_n = dict(zip(model.conditions, more_n.tolist(), strict=True))
    fitted = replace(
        model,
        condition_sd=condition_sd,
        conditions_n=conditions_n,
        plan=replace(plan, asymmetry_sd=asymmetry_sd),
        noise_n=noise_n,
        stroke_n=stroke_n,
        scale=friction[0],
        slope=0.0 if model._warm_known else friction[1],
        coefficients=tuple(posterior.coefficients.tolist()),
        precision=tuple(map(tuple, posterior.precision.tolist())),
    )
    return fitted, found, seen.offsets(posterior, parts, asymmetry_sd)


def _with_sessions(
    model: OffsetModel, sessions: Sequence[SlidingBlocks], offsets_n: Array, uncertainties_n: Array
) -> OffsetModel:
    """Add the offset of each session of the fit to the model.

    The mean offset cannot be told from an asymmetry. It therefore stays 0, with the uncertainty of the zeros, unless
    the zeros may be much larger than an asymmetry.
    """
    stated_n, kept_n = model._stated_mean_n(sessions), model.kept.stated_n
    asymmetry_n, common_n = model.plan.asymmetry * model.level_n, model._common_seen_n(sessions)
    own_mean_n = together_n(of_mean_n(map(model.kept.own_part_n, sessions)), math.hypot(asymmetry_n, kept_n))
    if common_n > LEAST_NARROWING * stated_n:
        weights = np.array([1.0 / max(model.kept.own_part_n(each), 1e-9) ** 2 for each in sessions])
        common_n, mean_n = stated_n, float(weights @ offsets_n) / float(weights.sum())
        kept = replace(model.kept, uncertainty_n=kept_n)
    else:
        alike_n = model.level_n * model.coefficients[len(model.coefficients) - len(model.quantities.even_places)]
        kept_offset_n = kept_n**2 / max(kept_n**2 + asymmetry_n**2, 1e-300) * alike_n
        mean_n = -kept_offset_n
        uncertainty_n = one_draw_n(kept_n, asymmetry_n) if kept_n else 0.0
        kept = replace(model.kept, offset_n=kept_offset_n, uncertainty_n=uncertainty_n)
    found = _session_offsets(offsets_n, uncertainties_n, sessions, model, own_mean_n)
    model = replace(model, kept=kept, sessions={each.session: each for each in found})
    return model._shifted(mean_n, common_n)


def _session_offsets(
    offsets_n: Array, uncertainties_n: Array, sessions: Sequence[SlidingBlocks], model: OffsetModel, common_n: float
) -> list[SessionOffset]:
    found = []
    for session, offset_n, uncertainty_n in zip(sessions, offsets_n.tolist(), uncertainties_n.tolist(), strict=True):
        extend, retract = (len(np.unique(session.stroke[session.direction == sign])) for sign in (1.0, -1.0))
        prior = (session.prior_n, model.kept.own_part_n(session), extend, retract, session.sliding_s)
        common = min(common_n, uncertainty_n)
        condition_n = model.conditions_n.get(session.condition, 0.0)
        found.append(SessionOffset(session.session, offset_n, uncertainty_n, common, *prior, condition_n))
    return found
