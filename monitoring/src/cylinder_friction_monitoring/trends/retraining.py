"""Test a model's bounds against later labels, and propose retraining if neither a sensor nor wear explains a loss.

A CUSUM compares each session's share of label rows within the bounds with the first sessions that the model estimated.
A share is lower only if it is below both those sessions and the probability of the bounds. A service begins no new
baseline here, because the model stays the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from cylinder_friction_monitoring.arrays import Array
from cylinder_friction_monitoring.trends.assessment import ModelBounds
from cylinder_friction_monitoring.trends.dating import Z95
from cylinder_friction_monitoring.trends.plan import MonitorPlan
from cylinder_friction_monitoring.trends.sentences import VENTED
from cylinder_friction_monitoring.trends.session_row import SessionRow
from cylinder_friction_monitoring.trends.trend import BEYOND, Tested, against_baseline

ROWS = 100.0  # Number of independent rows in the label of a session
LEAST_SCATTER = 0.2  # Least scatter of sessions, in the logit of their share: 2 percentage points at 90 %
PRIOR_LEVEL = 4.5
"""Level for the priors of the covariates, in logits: 10 K of oil may change a share of 90 % by 2 points."""
LATEST = 60  # Most of the latest sessions that give the present share
FEW = 2  # Largest number of sessions that does not show how much shares scatter
ADAPT = "the model was not made for this cylinder: `cylinder-friction adapt` makes one that is"
TRAIN = (
    "Train on the logs since then: `cylinder-friction params experiment=own ingest.source=LOGS`, then `dvc repro`; the "
    "candidate has to pass the gate"
)
ZERO_FIRST = f"The sensors first: {VENTED} decides whether a zero or the load changed; retraining is not proposed"
WEAR_FIRST = (
    "Wear changes friction: act on the alarm first; if the bounds hold too little after the service too, retraining is "
    "proposed"
)


def model_bounds(
    rows: Sequence[SessionRow], tests: Mapping[str, Tested], worn: Callable[[], bool], plan: MonitorPlan
) -> ModelBounds | None:
    """Test the model's bounds; None without a model.

    ``rows`` are all sessions of the cylinder in their order, also those before a service. ``tests`` are the indicators'
    tests since then. ``worn`` returns whether an alarm, acknowledged or not, shows wear or a leak.
    """
    newest = rows[-1].held if rows else None
    if newest is None:
        return None
    own = tuple(row for row in rows if row.held and row.held.model == newest.model and row.held.share is not None)
    stated, count = 100.0 * newest.stated, plan.baseline_sessions
    if len(own) < count:
        words = f"The model has estimated {len(own)} of the {count} sessions after which its bounds are tested."
        return ModelBounds(stated, len(own), words)
    less_zero, as_it_is = (_seen(own, name, newest.stated, plan) for name in ("share_less_zero", "share"))
    known = less_zero if less_zero.lost or not as_it_is.lost else as_it_is
    if not known.lost:
        return known
    reason = _sensors(tests) or (WEAR_FIRST if worn() else "")
    if known is as_it_is:  # a constant force in each session explains the loss
        reason = ZERO_FIRST
    if reason:
        return replace(known, words=f"{known.words}. {reason}.")
    words = f"Retraining is proposed. {known.words}; the sensors' zeros have not moved. {TRAIN}."
    return replace(known, words=words, proposed=True)


def _seen(rows: tuple[SessionRow, ...], name: str, share: float, plan: MonitorPlan) -> ModelBounds:
    """Compare the share ``name`` of ``HeldLabel`` since the baseline with the baseline and with the stated share."""
    shares, count, stated = np.array([getattr(row.held, name) for row in rows]), plan.baseline_sessions, 100.0 * share
    values, nothing, most = _logit(shares), np.zeros(len(rows)), float(_logit(share))
    test = against_baseline("held", rows, values, nothing, PRIOR_LEVEL, plan, most=most, least_scatter=LEAST_SCATTER)
    assert isinstance(test, Tested)
    before, before_interval = _mean(shares[:count], test)
    known = ModelBounds(stated, len(rows), "", False, before, before_interval)
    of = "of the label" if name == "share" else "of the label, a constant force of each session aside,"
    over = np.flatnonzero(test.test.downward > test.baseline.threshold)
    if not len(over):
        words = f"The model's bounds state {stated:g} % and hold {_percent(before, before_interval)} {of} in the "
        words += f"first {count} sessions, no less in the {len(rows) - count} since"
        return replace(known, words=f"{words}; {ADAPT}." if before_interval[1] < stated else f"{words}.")
    alarm = int(over[0])
    dated = test.dated(alarm)
    since = len(rows) - dated.begins
    now, now_interval = _mean(shares[-min(since, LATEST) :], test)
    counted = since if since <= LATEST else f"latest {LATEST} of the {since}"
    first, last = (rows[each].session for each in dated.interval)
    found = replace(
        known,
        words=f"The model's bounds state {stated:g} % and held {_percent(before, before_interval)} {of} in the "
        f"first {count} sessions; they hold {_percent(now, now_interval)} in the {counted} since "
        f"session {rows[dated.begins].session} (between {first} and {last})",
        now_percent=now,
        now_interval=now_interval,
        since=rows[dated.begins].session,
        since_interval=(first, last),
        alarm_session=rows[alarm].session,
    )
    return found if found.lost else replace(found, words=f"{found.words}, not surely less than stated.")


def _sensors(tests: Mapping[str, Tested]) -> str:
    """State why a sensor may be the cause; empty if no sensor may be."""
    half_sum = tests.get("half_sum_n")
    if half_sum is None:
        return (
            "The half sum of strokes shows a sensor's zero: no retraining is proposed before its baseline is complete"
        )
    if half_sum.alarm is not None or half_sum.watched:
        return ZERO_FIRST
    if half_sum.beyond >= BEYOND:
        return (
            f"The half sum of strokes cannot be tested in the latest {half_sum.beyond} sessions, so that the sensors' "
            "zeros are not known; retraining is not proposed"
        )
    return ""


def _logit(share: Array | float) -> Array:
    held = np.asarray(share, dtype=np.float64) * ROWS
    return np.asarray(np.log((held + 0.5) / (ROWS - held + 0.5)))


def _mean(shares: Array, test: Tested) -> tuple[float, tuple[float, float]]:
    """Average shares [%]; the 95 % interval includes the scatter and the autocorrelation of sessions."""
    phi = test.reference.autocorrelation
    spread = float(shares.std(ddof=1)) if len(shares) > FEW else 1.0
    half = Z95 * spread * float(np.sqrt((1.0 + phi) / (1.0 - phi) / len(shares)))
    mean = float(shares.mean())
    return 100.0 * mean, (100.0 * max(mean - half, 0.0), 100.0 * min(mean + half, 1.0))


def _percent(value: float, interval: tuple[float, float]) -> str:
    return f"{value:.0f} % ({interval[0]:.0f} to {interval[1]:.0f} %)"
