"""The offset of the sensors' zeros in each session of logger files, and the evidence for it.

The evidence is strokes in both directions (``labelling.offset_identification``), or the stated uncertainty alone, with
the reason for having no more.
"""

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.offset_identification import (
    LEAST_NARROWING,
    OffsetModel,
    SessionOffset,
    offset_model,
)
from cylinder_friction.labelling.sliding_blocks import (
    OffsetPlan,
    SlidingBlocks,
    sliding_blocks,
    unstated_zero,
    zero_uncertainty_n,
)
from cylinder_friction.labelling.uncertainty import sensitivities
from cylinder_friction.recordings.columns import ALL_CONDITIONS, COVERAGE_FACTOR, LOAD_FORCE, PRESSURES
from cylinder_friction.recordings.line_loss import BAR_PA
from cylinder_friction.recordings.mapping.channel_mapping import EACH_SESSION
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.wording import four_digits

STROKES, STATED, NOTHING = "strokes in both directions", "stated uncertainty", "nothing"
"""Sources of an offset or its uncertainty."""

LEAST_SESSIONS, LEAST_NARROWING_OF_FEW = 12, 0.4
"""With fewer sessions than the first number, strokes must leave at most the second number, as a share of the stated
uncertainty, because few sessions hardly show how much friction differs."""
UNEXPECTED = 1.5
"""Multiple of the plan's asymmetry above which each session's friction may have an asymmetry of its own."""
LEAST_IN_CONDITION = 3
"""Least number of sessions of a condition for identifying their deviations from the mean."""
ODD_SHARE = 0.1
"""Largest share of uneven sessions that may be left out; if more are uneven, friction or zeros are the cause."""
VENT = (
    "vent the chambers and state what each sensor reads then (offset and sensor.zero_uncertainty in the mapping), or "
    f"sensor.zeroed: {EACH_SESSION} if they are zeroed"
)
RARE = 0.05
"""Probability of larger deviations between sessions, if zeros are as stated, below which their intervals widen."""
HIGHEST_SPEED = 0.98
"""Quantile of the speed of steady sliding that counts as the highest."""
NINE_OF_TEN = 0.64
"""Share of its expanded uncertainty that an error exceeds in one of ten rows, on the side of a constant error."""


@dataclass(frozen=True)
class OffsetEvidence:
    """Evidence of one recording for its sensors' offset: stated zeros and steady sliding."""

    session: str
    # Standard uncertainty of the zeros behind the driving force, as friction [N]; None if it is not stated
    stated_n: float | None
    sliding: SlidingBlocks
    why_not: str = ""  # Reason why strokes do not count for the offset; empty if they do
    # Reason why the force that does not turn with the direction is too large for the stated zeros; else empty
    uneven: str = ""
    condition: str = ""
    lines_stated: bool = False  # Whether the losses of both lines between sensors and cylinder are stated
    # What the stated losses take off at the highest speed of steady sliding: force [N], and piston side [bar]
    stated_loss_n: float = 0.0
    stated_loss_bar: float = 0.0


@dataclass(frozen=True)
class KnownOffset:
    """The offset in one session's friction, its uncertainty and its source."""

    session: str
    source: str  # ``STROKES``, ``STATED`` or ``NOTHING``
    words: str  # Evidence for it, or the reason why there is none
    # Expanded uncertainties (k = 2) of the offset, and of the zeros as stated, as friction [N]; NaN if unknown
    uncertainty_n: float = math.nan
    stated_n: float = math.nan
    offset_n: float = math.nan  # Offset to subtract from friction [N]; NaN if unknown
    doubt: str = ""  # What is not as stated, so that bounds may be too narrow; empty if nothing shows that
    kept: bool = False  # Whether sensors keep their zeros, so that sessions share an error of up to ``stated_n``

    @property
    def value(self) -> str:
        """Offset and uncertainty as text."""
        if math.isfinite(self.offset_n):
            return f"{self.offset_n:z.1f} ± {self.uncertainty_n:.1f} N"
        return f"unknown, ± {self.uncertainty_n:.1f} N" if math.isfinite(self.uncertainty_n) else "unknown"

    @property
    def correction_n(self) -> float:
        """Offset that strokes determine, to subtract from friction [N]; else 0."""
        return self.offset_n if self.source == STROKES else 0.0

    def half_n(self, label_n: Array, load_n: float = 0.0) -> Array:
        """Compute half the width of bounds about friction less ``correction_n`` [N], shape ``(n,)``.

        ``label_n`` is the label's expanded uncertainty with the zeros as stated, and ``load_n`` that of a stated load.
        The zeros count as stated unless strokes determine the offset or show that they are worse. Then the offset's own
        uncertainty counts. Offset and load are the same in all rows, so that the errors of rows come on top.
        """
        if self.source != STROKES and not self.uncertainty_n > self.stated_n:
            return label_n
        variance = np.maximum(label_n**2 - self.stated_n**2, 0.0)
        same_n = math.hypot(self.uncertainty_n, load_n)
        return np.maximum(np.sqrt(variance + same_n**2), same_n + NINE_OF_TEN * np.sqrt(variance))


def offset_evidence(
    labelled: Recording, cylinder: Cylinder, plan: OffsetPlan, uneven_n: float, friction_n: float, why_not: str
) -> OffsetEvidence:
    """Collect the evidence of a labelled recording, which is its own session if it names none.

    ``uneven_n`` and ``friction_n`` are half the sum and half the difference of friction up and down at equal position
    [N]. ``why_not`` states why strokes cannot show an offset; it is empty if they may.
    """
    session = labelled.metadata.session or labelled.name
    identified = () if LOAD_FORCE in labelled.metadata.uncertainty else (LOAD_FORCE,)  # it has no sensor
    stated_n = zero_uncertainty_n(labelled.without_columns(*identified), cylinder)
    sliding = replace(sliding_blocks(labelled, cylinder, plan, stated_n or 0.0), session=session)
    why_not = why_not or unstated_zero(labelled, cylinder)
    uneven = "" if why_not else too_uneven(uneven_n, friction_n, sliding.prior_n, plan)
    lines = labelled.metadata.line_loss
    lines_stated = set(PRESSURES) <= lines.keys()
    evidence = OffsetEvidence(session, stated_n, sliding, why_not, uneven, labelled.metadata.condition, lines_stated)
    if not lines_stated or not len(sliding.direction):
        return evidence
    highest_m_s = highest_speed(np.abs(sliding.columns["velocity_m_s"]))
    lost_pa = {name: float(lines[name].lost_pa(np.array([highest_m_s]))[0]) for name in PRESSURES}
    lost_n = sum(lost_pa[name] * abs(area) for name, area in sensitivities(labelled, cylinder).items())
    return replace(evidence, stated_loss_n=lost_n, stated_loss_bar=lost_pa[PRESSURES[0]] / BAR_PA)


def highest_speed(speed_m_s: Array) -> float:
    """Compute the quantile of the speed of steady sliding that counts as the highest [m/s]."""
    return float(np.quantile(speed_m_s, HIGHEST_SPEED))


def too_uneven(uneven_n: float, friction_n: float, zero_n: float | None, plan: OffsetPlan) -> str:
    """Explain why ``uneven_n`` [N] is too large for zeros with standard uncertainty ``zero_n`` [N]; else empty."""
    largest_n = math.inf if zero_n is None else COVERAGE_FACTOR * math.hypot(zero_n, plan.asymmetry * friction_n)
    if not abs(uneven_n) > largest_n:
        return ""
    return (
        f"{four_digits(uneven_n)} N does not turn with the direction, while the stated zeros and an asymmetry of "
        f"friction explain {four_digits(largest_n)} N; a load acts, a line loses pressure, friction is more "
        "asymmetric, or a zero is worse than stated"
    )


def known_offsets(evidence: Sequence[OffsetEvidence], cylinder: Cylinder, plan: OffsetPlan) -> list[KnownOffset]:
    """Find the offset of each session, in order of appearance; all sessions together determine the common friction.

    The order of the evidence changes no digit of the results.
    """
    order = list(dict.fromkeys(each.session for each in evidence))
    evidence = sorted(evidence, key=lambda each: (each.session, float(each.sliding.label_n.sum())))
    counted = [each for each in evidence if not each.why_not]
    odd = {each.session for each in evidence if each.uneven}
    if len(odd) <= ODD_SHARE * len({each.session for each in counted}):
        counted = [each for each in counted if each.session not in odd]
    sliding = [each.sliding for each in counted if len(each.sliding.direction)]
    names = {each.session for each in sliding}
    share = LEAST_NARROWING_OF_FEW if len(names) < LEAST_IN_CONDITION else math.inf
    model = offset_model(sliding, cylinder, cautious(plan, names), greatest_share=share) if sliding else None
    sessions: dict[str, list[OffsetEvidence]] = {}
    for each in evidence:
        sessions.setdefault(each.session, []).append(each)
    conditions = {each.session: each.condition for each in counted}
    known = [_known(name, sessions[name], model, plan) for name in order]
    if model is None:
        return known
    left = {each.session for each in known if each.source == STATED}
    of_them = [each for each in counted if each.condition in {conditions[name] for name in left & conditions.keys()}]
    both_ways = [(each.condition, each.sliding) for each in of_them if not math.isnan(each.sliding.halves_n()[0])]
    own_models = _deviation_models(both_ways, plan, model).values()
    deviations = {name: _deviation(each, own) for own in own_models for name, each in own.sessions.items()}
    known = [
        replace(deviations[each.session], doubt=each.doubt, kept=each.kept)
        if each.session in left & deviations.keys()
        else each
        for each in known
    ]
    factor = _spread_factor(model, conditions, plan)
    return known if factor == 1.0 else [_widened(each, factor) for each in known]


def _spread_factor(model: OffsetModel, conditions: Mapping[str, str], plan: OffsetPlan) -> float:
    """Compute how many times as much sessions of a condition differ as stated zeros and the plan's asymmetry explain.

    It is 1 if that happens by chance more often than ``RARE``.
    """
    from scipy.special import chdtrc  # slow to import

    found = [each for each in model.sessions.values() if each.strokes_extend and each.strokes_retract]
    _, place, counts = np.unique([conditions[each.session] for each in found], False, True, True)
    free, own_n = len(found) - len(counts), 0.5 * cautious(plan, model.sessions).asymmetry_sd * model.level_n
    stated_n, changing_n = (np.maximum([getattr(each, name) for each in found], 1e-9) for name in ("prior_n", "own_n"))
    # An offset and a session's own asymmetry are not told apart: the model takes a share of both for the offset
    offsets_n = np.array([each.offset_n - model.kept.offset_n for each in found])
    both_n = offsets_n * (1.0 + (model.own_asymmetry_n / changing_n) ** 2)
    off_n = both_n - (np.bincount(place, both_n) / counts)[place]
    square = float(np.sum(off_n**2 / (stated_n**2 + own_n**2)))
    return math.sqrt(square / free) if free and chdtrc(free, square) < RARE else 1.0


def _widened(known: KnownOffset, factor: float) -> KnownOffset:
    """Widen the interval of an offset by a factor, and state why."""
    doubt = (
        f"what does not turn with the direction differs from session to session by ± {factor * known.stated_n:.0f} N, "
        f"while the stated zeros explain ± {known.stated_n:.0f} N: zeros are worse than stated, a load differs, a line "
        f"loses pressure, or friction of each is asymmetric in its own way; bounds allow for {factor:.1f} times the "
        "stated zeros"
    )
    return replace(known, uncertainty_n=factor * known.uncertainty_n, doubt=known.doubt or doubt)


def _deviation_models(
    sliding: Iterable[tuple[str, SlidingBlocks]], plan: OffsetPlan, of_all: OffsetModel
) -> dict[str, OffsetModel]:
    """Fit, by condition, the models whose offsets are deviations from the condition's mean, if strokes show them.

    The sessions of a condition share friction's asymmetry but not their zeros. ``of_all`` is the model of all
    conditions; if there is only one condition, it is used.
    """
    conditions: dict[str, list[SlidingBlocks]] = {}
    for condition, each in sliding:
        conditions.setdefault(condition, []).append(each)
    models = {}
    for condition, own in conditions.items():
        names = {each.session for each in own}
        if len(names) < LEAST_IN_CONDITION:
            continue
        alone = names == set(of_all.sessions)
        model = of_all if alone else offset_model(own, of_all.quantities.cylinder, cautious(plan, names))
        model = model.about_mean()
        changing_n = max(each.own_n for each in model.sessions.values())
        if model.own_asymmetry_n <= changing_n and model.changing_uncertainty_n < LEAST_NARROWING * changing_n:
            models[condition] = model
    return models


def training_models(
    train: Sequence[Recording], cylinder: Cylinder, plan: OffsetPlan, *, always: bool = False
) -> tuple[dict[str, OffsetModel], str]:
    """Fit the offset models of a pipeline's sessions, by condition; without a model, return the reason.

    There is one model of ``ALL_CONDITIONS`` if strokes show the training sessions' offsets, or if ``always`` is set.
    Otherwise there is a model for each condition whose sessions show their deviations from the mean.
    """
    sliding = [sliding_blocks(each, cylinder, plan) for each in train]
    model = offset_model(sliding, cylinder, cautious(plan, {each.session for each in sliding}))
    reasons = [why for found in model.sessions.values() if (why := undetermined(found, model, plan))]
    if always or len(reasons) <= ODD_SHARE * len(model.sessions):
        return {ALL_CONDITIONS: model}, ""
    models = _deviation_models(zip([each.metadata.condition for each in train], sliding, strict=True), plan, model)
    return models, "" if models else f"offsets are not identified: {reasons[0]}"


def of_condition(recordings: Sequence[Recording], condition: str) -> list[Recording]:
    """Select the recordings of a condition, in their order; ``ALL_CONDITIONS`` selects all."""
    return [each for each in recordings if condition in (ALL_CONDITIONS, each.metadata.condition)]


def without_offsets(recordings: Sequence[Recording], models: Mapping[str, OffsetModel]) -> list[Recording]:
    """Subtract from labelled recordings the offsets that their condition's model finds; keep the order."""
    for condition, model in models.items():
        found = {each.name: each for each in model.corrected(of_condition(recordings, condition))}
        recordings = [found.get(each.name, each) for each in recordings]
    return list(recordings)


def _deviation(found: SessionOffset, model: OffsetModel) -> KnownOffset:
    return _from_strokes(
        found,
        f"deviation from the mean of {len(model.sessions)} sessions of its condition ({_counted(found, model.plan)}), "
        "if friction is as asymmetric in each: another ratio of both directions, by "
        f"{200.0 * abs(found.offset_n) / model.level_n:.1f} %, would look the same",
    )


def _counted(found: SessionOffset, plan: OffsetPlan) -> str:
    """Count the strokes with a block of sliding; other commands' counts have other limits of speed and position."""
    faster = f"faster than {1e3 * plan.slowest_m_s:g} mm/s"
    return f"{found.strokes_extend} extending and {found.strokes_retract} retracting {faster}"


def _from_strokes(found: SessionOffset, words: str) -> KnownOffset:
    common_n = COVERAGE_FACTOR * found.common_uncertainty_n
    words += f"; ± {common_n:.1f} N of this are common to all sessions, as a mean offset looks like asymmetric friction"
    uncertainty_n = COVERAGE_FACTOR * found.whole_uncertainty_n
    return KnownOffset(found.session, STROKES, words, uncertainty_n, COVERAGE_FACTOR * found.prior_n, found.offset_n)


def mean_uncertainty_n(known: Sequence[KnownOffset]) -> float:
    """Compute how far the sensors' zeros may shift the sessions' mean friction [N] (k = 2); 0 if unknown.

    Zeros of sensors that are zeroed before each session are independent between sessions. Zeros that sensors keep, and
    the error left in identified zeros, are common to all.
    """
    own = [each.uncertainty_n for each in known if math.isfinite(each.uncertainty_n)]
    alike = any(each.source == STROKES or each.kept for each in known)
    return math.sqrt(sum(each**2 for each in own) / len(own) / (1 if alike else len(own))) if own else 0.0


def cautious(plan: OffsetPlan, sessions: Collection[str]) -> OffsetPlan:
    """Raise the plan's spread of asymmetry between sessions; the fewer sessions there are, the more it rises."""
    return replace(plan, asymmetry_sd=max(plan.asymmetry_sd, plan.asymmetry / max(len(sessions), 1)))


def _known(session: str, own: Sequence[OffsetEvidence], model: OffsetModel | None, plan: OffsetPlan) -> KnownOffset:
    found = None if model is None else model.sessions.get(session)
    doubt = next((each.uneven for each in own if each.uneven), "")
    kept = any(each.sliding.kept_n > 0.0 for each in own)
    if found is None or model is None:
        reasons = dict.fromkeys(each.why_not or each.uneven for each in own if each.why_not or each.uneven)
        why_not = "; ".join(reasons) or f"no steady sliding faster than {1e3 * plan.slowest_m_s:g} mm/s"
    elif why_not := undetermined(found, model, plan):
        why_not, doubt = doubt or why_not, doubt or _doubt(model, plan)
    else:
        count = len(model.sessions)
        alike = "each of a condition" if model.conditions else "each"
        together = "1 session" if count == 1 else f"{count} sessions together, if friction is as asymmetric in {alike}"
        words = f"{_counted(found, plan)}, {found.sliding_s:.0f} s, {together}"
        return replace(_from_strokes(found, words), kept=kept)
    stated_n = float(np.max([math.nan if each.stated_n is None else COVERAGE_FACTOR * each.stated_n for each in own]))
    source = NOTHING if math.isnan(stated_n) else STATED
    return KnownOffset(session, source, f"not identified: {why_not}", stated_n, stated_n, doubt=doubt, kept=kept)


def undetermined(found: SessionOffset, model: OffsetModel, plan: OffsetPlan) -> str:
    """Explain why strokes do not determine an offset under the plan's assumptions on friction; empty if they do."""
    if not (found.strokes_extend and found.strokes_retract):
        way, missing = ("retracting", "extending") if found.strokes_retract else ("extending", "retracting")
        return f"strokes {way} alone do not separate it from friction; record strokes {missing} too"
    few = len(model.sessions) < LEAST_SESSIONS
    narrow = found.standard_uncertainty_n < (LEAST_NARROWING_OF_FEW if few else LEAST_NARROWING) * found.prior_n
    if narrow and model.plan.asymmetry <= UNEXPECTED * plan.asymmetry:
        return ""
    more = f"; give at least {LEAST_SESSIONS} sessions of the cylinder together" if few else ""
    if found.own_n < found.prior_n and not found.common_uncertainty_n < LEAST_NARROWING * found.prior_n:
        more = f"; {VENT}"
    return _doubt(model, plan) or (
        "strokes in both directions narrow it no further, as friction of each session may be asymmetric in its own "
        f"way{more}"
    )


def _doubt(model: OffsetModel, plan: OffsetPlan) -> str:
    """Explain that friction is less symmetric than planned; empty if it is as planned."""
    if model.plan.asymmetry <= UNEXPECTED * plan.asymmetry:
        return ""
    return (
        f"friction extending and retracting differs from its mean by {100.0 * model.plan.asymmetry:.0f} %, where "
        f"{100.0 * plan.asymmetry:.0f} % is expected; bounds hold friction that is so asymmetric, but do not allow for "
        "a load that is not as stated, a line that loses pressure, or zeros worse than stated"
    )
