"""The offset of the sensors' zeros in each session of logger files, and the evidence for it.

The evidence is a vented interval on which sensors were zeroed, strokes in both directions
(``labelling.offset_identification``), or the stated uncertainty alone, with the reason why nothing better is known.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.offset_identification import LEAST_NARROWING, OffsetModel, SessionOffset, offset_model
from cylinder_friction.labelling.sliding_blocks import (
    OffsetPlan,
    SlidingBlocks,
    sliding_blocks,
    stated_zero_n,
    zero_uncertainty_n,
)
from cylinder_friction.labelling.uncertainty import sensitivities
from cylinder_friction.recordings.columns import ALL_CONDITIONS, COVERAGE_FACTOR, LOAD_FORCE
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.wording import four_digits

VENTED, STROKES, STATED, NOTHING = "vented interval", "strokes in both directions", "stated uncertainty", "nothing"
"""Sources of an offset or its uncertainty."""

LEAST_SESSIONS, LEAST_NARROWING_OF_FEW = 12, 0.4
"""With fewer sessions, which hardly show how much friction differs, strokes must leave at most this share of the stated
uncertainty."""
UNEXPECTED = 1.5
"""Multiple of the plan's asymmetry above which friction may be asymmetric in its own way in each session."""
LEAST_IN_CONDITION = 3
"""Fewest sessions of a condition whose deviations from their mean are identified."""
ODD_SHARE = 0.1
"""Largest share of uneven sessions that are left out; if more are uneven, friction or zeros cause it, not a load."""


@dataclass(frozen=True)
class OffsetEvidence:
    """Evidence of one recording for its sensors' offset: stated zeros and steady sliding."""

    session: str
    # Standard uncertainty of the zeros behind the driving force, as friction [N]; None if it is not stated
    stated_n: float | None
    vented_n: float | None  # Offset read with vented chambers and subtracted, as friction [N]; None if not read
    sliding: SlidingBlocks | None  # None without labels
    why_not: str = ""  # Why strokes do not count for the offset; empty if they do
    uneven: str = ""  # Why the force that does not turn with the direction exceeds the stated zeros; else empty
    condition: str = ""

    @property
    def sliding_key(self) -> float:
        """Key of the session."""
        return 0.0 if self.sliding is None else float(self.sliding.label_n.sum())

    @property
    def strokes(self) -> SlidingBlocks | None:
        """Steady sliding from which the offset is identified; None if strokes do not count."""
        return None if self.why_not or self.vented_n is not None else self.sliding


@dataclass(frozen=True)
class KnownOffset:
    """The offset in one session's friction, its uncertainty and its source."""

    session: str
    source: str  # ``VENTED``, ``STROKES``, ``STATED`` or ``NOTHING``
    words: str  # Evidence for it, or the reason why there is none
    # Expanded uncertainties (k = 2) of the offset and as stated for the zeros, as friction [N]; NaN where not known
    uncertainty_n: float = math.nan
    stated_n: float = math.nan
    offset_n: float = math.nan  # Offset to subtract from friction; if vented, subtracted already [N]; NaN if unknown

    @property
    def value(self) -> str:
        """Offset and uncertainty as text."""
        spread = f"± {self.uncertainty_n:.1f} N"
        if math.isfinite(self.offset_n):
            return f"{self.offset_n:.1f} {spread}" if math.isfinite(self.uncertainty_n) else f"{self.offset_n:.1f} N"
        return f"within {spread}" if math.isfinite(self.uncertainty_n) else "unknown"


def offset_evidence(
    labelled: Recording, cylinder: Cylinder, plan: OffsetPlan, uneven_n: float, friction_n: float, why_not: str
) -> OffsetEvidence:
    """Collect the evidence of a labelled recording.

    Args:
        labelled: Recording with friction, velocity and usable rows; without a known session it is a session of its own.
        cylinder: Its areas.
        plan: How offsets are identified.
        uneven_n, friction_n: Half the sum and half the difference of friction up and down at equal position [N].
        why_not: Why strokes cannot show an offset; empty if they may.
    """
    session, zeros = labelled.metadata.session or labelled.name, labelled.metadata.zero_offset
    identified = () if LOAD_FORCE in labelled.metadata.uncertainty else (LOAD_FORCE,)  # it has no sensor
    stated_n = zero_uncertainty_n(labelled.without_columns(*identified), cylinder)
    condition, sliding = (
        labelled.metadata.condition,
        replace(sliding_blocks(labelled, cylinder, plan, stated_n or 0.0), session=session),
    )
    if zeros:
        areas = sensitivities(labelled, cylinder)
        vented_n = sum(areas[name] * zero for name, zero in zeros.items())
        return OffsetEvidence(session, stated_n, vented_n, sliding, condition=condition)
    if not why_not:
        try:
            sliding = replace(sliding, prior_n=stated_zero_n(labelled, cylinder))
        except RecordingError as error:
            why_not = str(error)
    uneven = "" if why_not else too_uneven(uneven_n, friction_n, sliding.prior_n, plan)
    return OffsetEvidence(session, stated_n, None, sliding, why_not, uneven, condition)


def too_uneven(uneven_n: float, friction_n: float, zero_n: float | None, plan: OffsetPlan) -> str:
    """State why ``uneven_n`` [N] is too large for zeros of standard uncertainty ``zero_n`` [N]; empty if it is not."""
    largest_n = math.inf if zero_n is None else COVERAGE_FACTOR * math.hypot(zero_n, plan.asymmetry * friction_n)
    if not abs(uneven_n) > largest_n:
        return ""
    return (
        f"{four_digits(uneven_n)} N does not turn with the direction, while the stated zeros and an asymmetry of "
        f"friction explain {four_digits(largest_n)} N; a load acts, a line loses pressure, friction is more "
        "asymmetric, or a zero is worse than stated"
    )


def known_offsets(evidence: Sequence[OffsetEvidence], cylinder: Cylinder, plan: OffsetPlan) -> list[KnownOffset]:
    """Find the offset of each session, in their order; common friction is found from all sessions together.

    The order of the evidence changes no digit.
    """
    order = list(dict.fromkeys(each.session for each in evidence))
    evidence = sorted(evidence, key=lambda each: (each.session, each.sliding_key))
    odd = {each.session for each in evidence if each.uneven}
    if len(odd) <= ODD_SHARE * len({each.session for each in evidence if each.strokes is not None}):
        evidence = [replace(each, sliding=None) if each.session in odd else each for each in evidence]
    sliding = [each.strokes for each in evidence if each.strokes is not None and len(each.strokes.direction)]
    model = offset_model(sliding, cylinder, cautious(plan, {each.session for each in sliding})) if sliding else None
    sessions: dict[str, list[OffsetEvidence]] = {}
    for each in evidence:
        sessions.setdefault(each.session, []).append(each)
    known = [_known(name, sessions[name], model, plan) for name in order]
    deviations = _deviations({each.session for each in known if each.source == STATED}, evidence, model, plan)
    return [deviations.get(each.session, each) for each in known]


def _deviations(
    left: set[str], evidence: Sequence[OffsetEvidence], model: OffsetModel | None, plan: OffsetPlan
) -> dict[str, KnownOffset]:
    """Collect the deviation of each session that is ``left`` from the mean of its condition, if strokes show it."""
    conditions: dict[str, list[SlidingBlocks]] = {}
    for each in evidence:
        if each.strokes is not None and len(set(each.strokes.direction.tolist())) == 2:
            conditions.setdefault(each.condition, []).append(each.strokes)
    found: dict[str, KnownOffset] = {}
    for sliding in conditions.values():
        if model is None or not left & {each.session for each in sliding}:
            continue
        own = deviation_model(sliding, model.cylinder, plan, model)
        found |= {} if own is None else {name: _deviation(each, own) for name, each in own.sessions.items()}
    return {name: each for name, each in found.items() if name in left}


def deviation_model(
    sliding: Sequence[SlidingBlocks], cylinder: Cylinder, plan: OffsetPlan, of_all: OffsetModel
) -> OffsetModel | None:
    """Fit the model whose offsets are deviations from the mean of one condition; None if strokes do not show them.

    Friction's asymmetry is common to the sessions of a condition, zeros are not. ``of_all`` is the model of all
    conditions, which is used if there is only one.
    """
    names = {each.session for each in sliding}
    if len(names) < LEAST_IN_CONDITION:
        return None
    alone = names == set(of_all.sessions)
    model = (of_all if alone else offset_model(sliding, cylinder, cautious(plan, names))).about_mean()
    prior_n = max(each.prior_n for each in model.sessions.values())
    worst_n = max(each.standard_uncertainty_n for each in model.sessions.values())
    return model if _own_asymmetry_n(model) <= prior_n and worst_n < LEAST_NARROWING * prior_n else None


def training_models(
    train: Sequence[Recording], cylinder: Cylinder, plan: OffsetPlan, *, always: bool = False
) -> tuple[dict[str, OffsetModel], str]:
    """Fit the models of the offsets of a pipeline's sessions, by condition; or state why there are none.

    There is one model of ``ALL_CONDITIONS`` if strokes show the training sessions' offsets, or if ``always`` is set.
    Otherwise there is a model for each condition whose sessions show their deviations from the mean.
    """
    sliding = [sliding_blocks(each, cylinder, plan) for each in train]
    model = offset_model(sliding, cylinder, cautious(plan, {each.session for each in sliding}))
    reasons = [why for found in model.sessions.values() if (why := undetermined(found, model, plan))]
    if always or len(reasons) <= ODD_SHARE * len(model.sessions):
        return {ALL_CONDITIONS: model}, ""
    conditions: dict[str, list[SlidingBlocks]] = {}
    for each, own in zip(train, sliding, strict=True):
        conditions.setdefault(each.metadata.condition, []).append(own)
    found = {name: deviation_model(own, cylinder, plan, model) for name, own in conditions.items()}
    models = {name: each for name, each in found.items() if each is not None}
    return models, "" if models else f"offsets are not identified: {reasons[0]}"


def of_condition(recordings: Sequence[Recording], condition: str) -> list[Recording]:
    """Select the recordings of a condition, in their order; all for ``ALL_CONDITIONS``."""
    return [each for each in recordings if condition in (ALL_CONDITIONS, each.metadata.condition)]


def without_offsets(recordings: Sequence[Recording], models: Mapping[str, OffsetModel]) -> list[Recording]:
    """Subtract from labelled recordings, in their order, the offsets that the model of their condition finds."""
    for condition, model in models.items():
        found = {each.name: each for each in model.corrected(of_condition(recordings, condition))}
        recordings = [found.get(each.name, each) for each in recordings]
    return list(recordings)


def _own_asymmetry_n(model: OffsetModel) -> float:
    """Compute the shift of a session's friction by its own asymmetry, as fitted [N] (k = 1)."""
    return 0.5 * model.plan.asymmetry_sd * model.level_n


def _deviation(found: SessionOffset, model: OffsetModel) -> KnownOffset:
    words = (
        f"deviation from the mean of {len(model.sessions)} sessions of its condition ({found.strokes_extend} strokes "
        f"extending and {found.strokes_retract} retracting), if friction is as asymmetric in each: another ratio of "
        f"both directions, by {200.0 * abs(found.offset_n) / model.level_n:.1f} %, would look the same; ± "
        f"{COVERAGE_FACTOR * found.common_uncertainty_n:.1f} N of it common to all, whose mean looks like an asymmetry "
        "of friction"
    )
    uncertainty_n = COVERAGE_FACTOR * found.standard_uncertainty_n
    return KnownOffset(found.session, STROKES, words, uncertainty_n, COVERAGE_FACTOR * found.prior_n, found.offset_n)


def mean_uncertainty_n(known: Sequence[KnownOffset]) -> float:
    """Compute the possible shift of sessions' mean friction by the sensors' zeros [N] (k = 2); 0 if unknown.

    Stated zeros differ between sessions; the rest of identified zeros is partly common to all.
    """
    own = [each.uncertainty_n for each in known if math.isfinite(each.uncertainty_n)]
    alike = any(each.source == STROKES for each in known)
    return math.sqrt(sum(each**2 for each in own) / len(own) / (1 if alike else len(own))) if own else 0.0


def cautious(plan: OffsetPlan, sessions: Collection[str]) -> OffsetPlan:
    """Widen the plan's difference of asymmetry between sessions, the more the fewer sessions there are."""
    return replace(plan, asymmetry_sd=max(plan.asymmetry_sd, plan.asymmetry / max(len(sessions), 1)))


def _known(session: str, own: Sequence[OffsetEvidence], model: OffsetModel | None, plan: OffsetPlan) -> KnownOffset:
    taken_n = [each.vented_n for each in own if each.vented_n is not None]
    stated = [each.stated_n for each in own]
    stated_n = math.nan if None in stated else COVERAGE_FACTOR * max(each for each in stated if each is not None)
    if taken_n:
        words = "taken off as read with vented chambers"
        return KnownOffset(session, VENTED, words, stated_n, stated_n, sum(taken_n) / len(taken_n))
    found = None if model is None else model.sessions.get(session)
    if found is None or model is None:
        reasons = dict.fromkeys(each.why_not or each.uneven for each in own if each.why_not or each.uneven)
        why_not = "; ".join(reasons) or f"no steady sliding faster than {1e3 * plan.slowest_m_s:g} mm/s"
        source = NOTHING if math.isnan(stated_n) else STATED
        return KnownOffset(session, source, f"not identified: {why_not}", stated_n, stated_n)
    why_not = undetermined(found, model, plan)
    if why_not:
        why_not = next((each.uneven for each in own if each.uneven), why_not)
        return KnownOffset(session, STATED, f"not identified: {why_not}", stated_n, stated_n)
    words = (
        f"{found.strokes_extend} strokes extending and {found.strokes_retract} retracting, {found.sliding_s:.0f} s, "
        f"{len(model.sessions)} {'session' if len(model.sessions) == 1 else 'sessions'} together; "
        f"± {COVERAGE_FACTOR * found.common_uncertainty_n:.1f} N of it common to all, whose mean looks like an "
        "asymmetry of friction"
    )
    uncertainty_n = COVERAGE_FACTOR * found.standard_uncertainty_n
    return KnownOffset(session, STROKES, words, uncertainty_n, COVERAGE_FACTOR * found.prior_n, found.offset_n)


def undetermined(found: SessionOffset, model: OffsetModel, plan: OffsetPlan) -> str:
    """State why strokes have not determined an offset as the plan expects friction to be, empty if they have."""
    for missing, way, count in (
        ("retracting", "extending", found.strokes_retract),
        ("extending", "retracting", found.strokes_extend),
    ):
        if not count:
            return f"strokes {way} alone do not separate it from friction; record strokes {missing} too"
    if model.plan.asymmetry > UNEXPECTED * plan.asymmetry:
        return (
            f"friction extending and retracting differs from its mean by {100.0 * model.plan.asymmetry:.0f} %, where "
            f"{100.0 * plan.asymmetry:.0f} % is expected: it may differ in another way in each session; or a line "
            "loses pressure or zeros are worse than stated, and then bounds are too narrow"
        )
    few = len(model.sessions) < LEAST_SESSIONS
    if found.standard_uncertainty_n < (LEAST_NARROWING_OF_FEW if few else LEAST_NARROWING) * found.prior_n:
        return ""
    if len(model.sessions) > 2 and _own_asymmetry_n(model) > found.prior_n:
        return (
            "what does not turn with the direction differs from session to session by ± "
            f"{COVERAGE_FACTOR * model.even_spread_n:.0f} N, while the stated zeros explain ± "
            f"{COVERAGE_FACTOR * found.prior_n:.0f} N: friction of each is asymmetric in its own way, a load differs, "
            "a line loses pressure, or zeros are worse than stated; unless it is friction, bounds are too narrow"
        )
    return (
        "strokes in both directions narrow it no further, as friction of each session may be asymmetric in its own "
        f"way; give at least {LEAST_SESSIONS} sessions of the cylinder together"
    )
