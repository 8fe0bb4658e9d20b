"""Comparison of estimators on held-out recordings: errors against the label and, separately, against the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.evaluation.metrics import Errors, errors, lag_s
from cylinder_friction.evaluation.sessions import SessionErrors, half_width_points, session_errors
from cylinder_friction.evaluation.strata import STRATA, StrataLimits, strata_masks
from cylinder_friction.execution.progress import Progress, progress
from cylinder_friction.realtime.bounds import creep_below_m_s
from cylinder_friction.recordings.recording import Recording, RecordingError

LABEL_ITSELF = "label"
"""In the scores against truth: the off-line label, scored like an estimate."""

EQUAL_PERCENT = 1e-3
"""Greatest error from rounding to single precision [% of the mean absolute label]; what is learned is further off."""


@dataclass(frozen=True)
class ComparisonSettings:
    """Settings of a comparison: which rows are at rest or near a reversal, and how large a lag may be.

    They decide the strata and the lag, not the errors in all rows. The defaults suit a bench at 200 Hz with speeds of a
    few centimetres per second; widen ``maximum_lag_s`` for filters that are slower.
    """

    standstill_velocity_m_s: float = 0.001  # Greatest speed that counts as rest [m/s]
    reversal_window_s: float = 0.1  # Time after a change of direction that counts as just after it [s]
    maximum_lag_s: float = 0.2  # Greatest shift in the search for an estimate's lag [s]


@dataclass(frozen=True, eq=False)
class Trace:
    """One held-out recording and every estimate of it, for figures of your own; all arrays have shape ``(n,)``.

    Signals are raw, in SI units, extension positive; friction is positive when it opposes extension. Rows outside
    ``usable``, near end stops and edges, count in no error.
    """

    # Metadata of the recording
    name: str
    condition: str
    session: str
    sample_time_s: float
    # Signals of the recording; velocity is from the off-line filter
    time_s: Array
    velocity_m_s: Array
    pressure_1_pa: Array
    pressure_2_pa: Array
    label_n: Array  # Friction from the equation of motion [N]; may be NaN in unusable rows
    usable: Mask  # Rows that count
    truth_n: Array | None  # True friction [N], or None if it is not known
    estimates_n: Mapping[str, Array]  # Estimated friction [N] by estimator


@dataclass(frozen=True, eq=False)
class Score:
    """Errors of one estimator in one condition, against the label or against true friction.

    ``Comparison.label["hybrid"]["1"].errors.percent`` is the mean absolute error in percent of the mean absolute
    reference. ``sessions`` shows how much errors differ between sessions: that is the chance in a comparison.
    """

    errors: Errors  # Over all usable rows of the condition
    sessions: SessionErrors  # Errors within each session
    lag_s: float  # Delay of the estimate [s]
    strata: Mapping[str, Errors]  # Errors within each stratum that has a usable row


Scores = dict[str, dict[str, Score]]
"""Scores by estimator, then by condition."""


@dataclass(frozen=True, eq=False)
class Comparison:
    """Errors of every estimator on the same held-out recordings; ``print`` it, or show it in a notebook, as a table.

    ``compare`` makes it. It holds every estimate of every sample, so a comparison of many hours takes memory:
    8 bytes per sample and estimator. Sums run over the usable rows of a condition.
    """

    estimators: tuple[str, ...]  # Names in the order given
    conditions: tuple[str, ...]  # Names of the operating conditions, sorted
    label: Scores  # Scores against the label
    # Scores against true friction, with ``LABEL_ITSELF`` as one more name; conditions without a known truth are missing
    truth: Scores
    # Limits of the strata; near zero velocity is the slowest ``realtime.bounds.CREEP_SHARE`` of the recordings' motion
    limits: StrataLimits
    multiply_adds: dict[str, int]  # Operations of one step by estimator
    traces: tuple[Trace, ...]  # Every recording with every estimate; 8 bytes per sample and estimator
    # Short notes on an estimator, or on ``LABEL_ITSELF``, beside its errors
    notes: Mapping[str, str] = field(default_factory=dict)

    def __repr__(self) -> str:
        return "\n\n".join(f"{words}:\n{table.to_string()}" for words, table in self._tables())

    def _repr_html_(self) -> str:
        return "".join(f"<p>{words}</p>{table.to_html(border=0)}" for words, table in self._tables())

    def _tables(self) -> list[tuple[str, pd.DataFrame]]:
        tables = [("Mean absolute error against the label", error_frame(self.label, self.conditions, "label"))]
        if self.truth:
            frame = error_frame(self.truth, self.truth_conditions, "truth")
            tables.append(("Mean absolute error against true friction", frame))
        return tables

    @property
    def truth_conditions(self) -> tuple[str, ...]:
        """The conditions in which true friction is known, sorted."""
        return tuple(condition for condition in self.conditions if condition in self.truth.get(LABEL_ITSELF, {}))

    @property
    def sessions(self) -> int:
        """The number of held-out sessions with a usable row."""
        return sum(len(score.sessions.percent) for score in self.label[self.estimators[0]].values())

    @property
    def equal_to_label(self) -> list[str]:
        """The estimators whose output is the label by construction, so that an error against it means nothing."""
        return equal_to_label(self.label)

    def of_condition(self, condition: str) -> list[Trace]:
        return [trace for trace in self.traces if trace.condition == condition]

    def percent(self, estimator: str, condition: str) -> float:
        """Compute the mean absolute error over the mean absolute label [%]."""
        return self.label[estimator][condition].errors.percent

    def residuals(self, estimator: str) -> tuple[Array, Mask]:
        """Compute label minus estimate [N] over all recordings in turn, with an uncounted row between two."""
        return with_gaps(
            [trace.label_n - trace.estimates_n[estimator] for trace in self.traces],
            [trace.usable for trace in self.traces],
            1,
        )


def equal_to_label(scores: Scores) -> list[str]:
    """List the estimators whose output equals the label up to rounding, in every condition.

    Tables mark them, as their error of zero says nothing: an estimator with the label's own inputs and filters can
    reproduce it. Against true friction, if that is known, the list is empty.
    """
    if LABEL_ITSELF in scores:
        return []
    return [
        name for name, each in scores.items() if all(score.errors.percent < EQUAL_PERCENT for score in each.values())
    ]


def mean_percent(by_condition: Mapping[str, Score], conditions: Sequence[str]) -> tuple[float, float, float]:
    """Compute the mean over some conditions of MAE / mean absolute friction [%] and its 95 % interval, by sessions.

    Example:
        >>> from cylinder_friction.evaluation.comparison import mean_percent
        >>> percent, lower, upper = mean_percent(comparison.label["hybrid"], comparison.conditions)
        >>> round(percent, 6) == round(sum(comparison.percent("hybrid", each) for each in comparison.conditions) / 4, 6)
        True
    """
    percent = float(np.mean([by_condition[condition].errors.percent for condition in conditions]))
    deviations = {condition: score.sessions.deviation for condition, score in by_condition.items()}
    half = half_width_points(deviations, conditions)
    return percent, percent - half, percent + half


def points_ahead(scores: Scores, one: str, other: str, condition: str) -> tuple[float, float, float]:
    """Compute by how many percentage points ``one`` is better than ``other``, with the 95 % interval.

    Use it to decide whether a difference is more than chance: it is if the interval excludes 0. Sessions are compared
    in pairs, so a session that is hard for both does not widen the interval.
    """
    mine, theirs = scores[one], scores[other]
    ahead = theirs[condition].errors.percent - mine[condition].errors.percent
    deviations = {name: theirs[name].sessions.deviation - mine[name].sessions.deviation for name in mine}
    half = half_width_points(deviations, [condition])
    return ahead, ahead - half, ahead + half


def error_frame(scores: Scores, conditions: Sequence[str], reference: str) -> pd.DataFrame:
    """Tabulate errors: one row per estimator, one column per condition, in percent and newtons.

    Show it in a notebook. The cells are text, such as ``4.10 % (13.2 N)``; for numbers read ``Score.errors``. The head
    of a column states the mean absolute friction [N] that its percentages refer to.

    Example:
        >>> from cylinder_friction.evaluation.comparison import error_frame
        >>> error_frame(comparison.label, comparison.conditions, "label").index.tolist()
        ['hybrid', 'LuGre']
    """
    columns = {}
    for condition in conditions:
        found = {name: by_condition[condition].errors for name, by_condition in scores.items()}
        denominator_n = next(iter(found.values())).mean_abs_friction_n
        columns[f"condition {condition} [% of mean |{reference}| = {denominator_n:.0f} N]"] = {
            name: f"{each.percent:.2f} % ({each.mae_n:.1f} N)" for name, each in found.items()
        }
    return pd.DataFrame(columns)


def compare(
    estimators: Mapping[str, FrictionEstimator],
    recordings: Sequence[Recording],
    settings: ComparisonSettings | None = None,
    truth_n: Mapping[str, Array] | None = None,
) -> Comparison:
    """Run every estimator over every recording and score it, one operating condition at a time.

    Args:
        estimators: Fitted estimators by name.
        recordings: Held-out recordings with ``velocity_m_s``, ``friction_n`` and ``usable``.
        settings: How they are compared; None for the defaults.
        truth_n: True friction [N] by recording name, shape ``(n,)``, as far as it is known.

    Raises:
        RecordingError: Nothing to compare on; a condition without usable rows or without friction; an estimate or
            label that is not finite; truth of another length than its recording.

    Example:
        >>> ridge = cf.RidgeEstimator().fit(train)
        >>> print(cf.compare({"hybrid": hybrid, "ridge": ridge}, test))  # doctest: +ELLIPSIS
        Mean absolute error against the label...
    """
    settings = settings or ComparisonSettings()
    given_n = {name: np.asarray(values, dtype=np.float64) for name, values in (truth_n or {}).items()}
    if not recordings or not estimators:
        raise RecordingError(
            f"nothing to compare: got {len(estimators)} estimators and {len(recordings)} held-out recordings; "
            "expected at least one of each; hold at least one session out of training"
        )
    with progress(words="compare", total=len(recordings) * len(estimators), unit="estimate") as bar:
        traces = tuple(_trace(estimators, recording, given_n.get(recording.name), bar) for recording in recordings)
    conditions = tuple(sorted({trace.condition for trace in traces}))
    near_zero_m_s = creep_below_m_s(
        [each.velocity_m_s[each.usable] for each in traces], settings.standstill_velocity_m_s
    )
    limits = StrataLimits(settings.standstill_velocity_m_s, near_zero_m_s, settings.reversal_window_s)
    label: Scores = {name: {} for name in estimators}
    truth: Scores = {}
    for condition in conditions:
        labelled = [trace for trace in traces if trace.condition == condition]
        labels = [trace.label_n for trace in labelled]
        for name in estimators:
            estimates = [trace.estimates_n[name] for trace in labelled]
            label[name][condition] = _score(
                f"condition {condition}, {name} against the label", labelled, labels, estimates, settings, limits
            )
        known = [trace for trace in labelled if trace.truth_n is not None and trace.usable.any()]
        truths = [trace.truth_n for trace in known if trace.truth_n is not None]
        for name in (*estimators, LABEL_ITSELF) if known else ():
            estimates = [trace.label_n if name == LABEL_ITSELF else trace.estimates_n[name] for trace in known]
            where = f"condition {condition}, {name} against the truth"
            truth.setdefault(name, {})[condition] = _score(where, known, truths, estimates, settings, limits)
    costs = {name: estimator.multiply_adds() for name, estimator in estimators.items()}
    return Comparison(tuple(estimators), conditions, label, truth, limits, costs, traces)


def with_gaps(parts: Sequence[Array], masks: Sequence[Mask], gap: int) -> tuple[Array, Mask]:
    """Join arrays end to end with ``gap`` unusable zeros after each; return the mask of usable places too.

    Use it to correlate the residuals of several recordings without mixing one recording's end with the next one's
    beginning. Arrays and masks have shape ``(n,)``, one of each per recording; so have the results, laid end to end.
    """
    filler = np.zeros(gap)
    values = [np.concatenate([np.where(mask, part, 0.0), filler]) for part, mask in zip(parts, masks, strict=True)]
    usable = [np.concatenate([mask, filler.astype(np.bool_)]) for mask in masks]
    return np.concatenate(values), np.concatenate(usable)


def _trace(
    estimators: Mapping[str, FrictionEstimator], recording: Recording, truth_n: Array | None, bar: Progress
) -> Trace:
    if truth_n is not None and truth_n.shape != (len(recording),):
        raise RecordingError(
            f"recording {recording.name!r}: true friction has shape {truth_n.shape}, expected ({len(recording)},), "
            "one value per row; make both again with the record and ingest stages"
        )
    estimates: dict[str, Array] = {}
    for name, estimator in estimators.items():
        bar.set_postfix_str(f"{recording.name} {name}", refresh=False)
        estimates[name] = estimator.estimate(recording)
        bar.update()
    return Trace(
        name=recording.name,
        condition=recording.metadata.condition,
        session=recording.metadata.session,
        sample_time_s=recording.sample_time_s,
        time_s=recording.column("time_s"),
        velocity_m_s=recording.column("velocity_m_s"),
        pressure_1_pa=recording.column("pressure_1_pa"),
        pressure_2_pa=recording.column("pressure_2_pa"),
        label_n=recording.column("friction_n"),
        usable=recording.usable(),
        truth_n=truth_n,
        estimates_n=estimates,
    )


def _score(
    where: str,
    traces: list[Trace],
    references: list[Array],
    estimates: list[Array],
    settings: ComparisonSettings,
    limits: StrataLimits,
) -> Score:
    masks = [trace.usable for trace in traces]
    sample_time_s = traces[0].sample_time_s
    gap = round(settings.maximum_lag_s / sample_time_s) + 1
    reference, usable = with_gaps(references, masks, gap)
    estimate, _ = with_gaps(estimates, masks, gap)
    try:
        total = errors(reference, estimate, usable)
        lag = lag_s(reference, estimate, usable, sample_time_s, settings.maximum_lag_s)
    except ValueError as error:
        raise RecordingError(f"{where}: {error}; recordings {[trace.name for trace in traces]}") from None
    if total.mean_abs_friction_n <= 0.0:
        raise RecordingError(f"{where}: friction is zero in every usable row, so a percentage has no denominator")
    strata = {
        stratum: errors(reference, estimate, rows)
        for stratum, rows in _strata_rows(traces, gap, limits).items()
        if rows.any()
    }
    sessions = session_errors([trace.session for trace in traces], references, estimates, masks)
    return Score(total, sessions, lag, strata)


def _strata_rows(traces: list[Trace], gap: int, limits: StrataLimits) -> dict[str, Mask]:
    """Compute the usable rows of each stratum, laid out as ``with_gaps`` lays out its values."""
    each = [strata_masks(trace.velocity_m_s, trace.sample_time_s, limits) for trace in traces]
    usable = [trace.usable for trace in traces]
    rows: dict[str, Mask] = {}
    for stratum in STRATA:
        parts = [masks[stratum] & mask for masks, mask in zip(each, usable, strict=True)]
        rows[stratum] = with_gaps([trace.velocity_m_s for trace in traces], parts, gap)[1]
    return rows
