"""Confidence intervals of errors, from the spread between sessions, which is larger than chance within a session."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from cylinder_friction.arrays import Array, Mask

CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class SessionErrors:
    """One estimator's error in each session of one condition."""

    percent: Mapping[str, float]  # MAE / mean |friction| [%] by session, sorted
    deviation: Array  # Contribution of each session to the condition's percentage [points], shape ``(sessions,)``


def session_errors(
    sessions: Sequence[str], references_n: Sequence[Array], estimates_n: Sequence[Array], usable: Sequence[Mask]
) -> SessionErrors:
    """Compute the error in each session that has a usable row; ``sessions`` names each recording's session.

    A percentage is a ratio of sums, so a session deviates by 100 (e - R f) / mean(f), with its sums of absolute error
    e and absolute friction f and the ratio R of all; deviations sum to zero.

    Source: Cochran 1977, Sampling Techniques, chapter 6 (ratio estimators).
    """
    sums: dict[str, list[float]] = {}
    for session, reference, estimate, mask in zip(sessions, references_n, estimates_n, usable, strict=True):
        if mask.any():
            both = sums.setdefault(session, [0.0, 0.0])
            both[0] += float(np.abs(estimate[mask] - reference[mask]).sum())
            both[1] += float(np.abs(reference[mask]).sum())
    ordered = dict(sorted(sums.items()))
    error, friction = np.array(list(ordered.values())).T
    ratio = error.sum() / friction.sum()
    return SessionErrors(
        {session: 100.0 * of[0] / of[1] if of[1] > 0.0 else math.nan for session, of in ordered.items()},
        100.0 * (error - ratio * friction) / friction.mean(),
    )


def half_width_points(deviations: Mapping[str, Array], of: Collection[str]) -> float:
    """Compute half the 95 % interval [points] of the mean percentage of the conditions ``of``.

    It is Student's t with the variance between sessions pooled over all conditions (one-way analysis of variance;
    Montgomery, Design and Analysis of Experiments, chapter 3). With two or three sessions per condition a bootstrap
    would understate the interval: two sessions have only three different draws.

    It assumes that sessions scatter alike and about normally in every condition, and that the held-out sessions
    represent future ones: the same cylinder, sensors and kind of work. It states nothing about another cylinder.

    Args:
        deviations: Deviation of each session, by condition, from ``SessionErrors``; for a difference, their difference.
        of: Conditions, whose percentages have equal weight.

    Returns:
        NaN if no condition has two sessions, as nothing then shows how much sessions differ.
    """
    freedom = sum(len(each) - 1 for each in deviations.values())
    if freedom < 1:
        return math.nan
    pooled = math.sqrt(sum(float(each @ each) for each in deviations.values()) / freedom)
    spread = pooled * math.sqrt(sum(1.0 / len(deviations[condition]) for condition in of)) / len(of)
    return float(stdtrit(freedom, 0.5 + 0.5 * CONFIDENCE)) * spread
