"""The result in plain words, written from the numbers alone: who wins, where, and by how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.evaluation.bootstrap import interval
from cylinder_friction.evaluation.comparison import LABEL_ITSELF
from cylinder_friction.reporting.estimator_titles import phrase, sentence_start
from cylinder_friction.reporting.published import PERCENT_BY_TEST, best_percent

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.evaluation.comparison import Comparison, Scores

TO_BEAT = (
    "force_balance_unfiltered",
    "force_balance_paper",
    "force_balance_low_pass",
    "ridge",
    "lugre",
    "pressure_lugre",
)
"""What a learned estimator must beat to have a reason to exist."""


def winner(scores: Scores, condition: str) -> str:
    """Return the estimator with the smallest percentage in a test; the first by name among equals."""
    names = [name for name in scores if name != LABEL_ITSELF and condition in scores[name]]
    return min(names, key=lambda name: (scores[name][condition].errors.percent, name))


def summary(comparison: Comparison, main: str) -> list[str]:
    """Return sentences: how ``main`` stands, who wins each test, against what it loses, what the truth says.

    A difference counts as clear when its paired 95 % block-bootstrap interval leaves out zero.
    """
    sentences = [_standing(comparison.label, comparison.conditions, main, "the label")]
    sentences += [_winner_sentence(comparison.label, condition) for condition in comparison.conditions]
    sentences += [
        _against(comparison, main, name) for name in TO_BEAT if name in comparison.estimators and name != main
    ]
    if set(comparison.conditions) <= set(PERCENT_BY_TEST):
        sentences.append(_against_published(comparison, main))
    return sentences + _truth_sentences(comparison, main)


def _standing(scores: Scores, conditions: Sequence[str], main: str, reference: str) -> str:
    best = {condition: winner(scores, condition) for condition in conditions}
    lost = [condition for condition in conditions if best[condition] != main]
    numbers = ", ".join(f"{scores[main][condition].errors.percent:.2f} %" for condition in conditions)
    start = f"Against {reference}, {phrase(main)} errs by {numbers} in {listed(conditions)}"
    if not lost:
        return f"{start}: the smallest error of all estimators in every test."
    rivals = list(dict.fromkeys(best[condition] for condition in lost))
    behind = "; ".join(
        f"{phrase(rival)} is better in {listed([condition for condition in lost if best[condition] == rival])}"
        for rival in rivals
    )
    return f"{start}. It has the smallest error in {len(conditions) - len(lost)} of {len(conditions)} tests: {behind}."


def _winner_sentence(scores: Scores, condition: str) -> str:
    best = winner(scores, condition)
    error = scores[best][condition].errors
    words = f"condition {condition}: {phrase(best)} has the smallest error, {error.percent:.2f} % ({error.mae_n:.1f} N)"
    others = {name: found for name, found in scores.items() if name != best}
    if not others:
        return words + "."
    second = winner(others, condition)
    behind = scores[second][condition].errors.percent - error.percent
    if not _clear(scores, best, second, condition):
        return f"{words}; {phrase(second)} is {behind:.2f} percentage points behind, which is within chance."
    return f"{words}, clearly ahead of the next, {phrase(second)}, by {behind:.2f} percentage points."


def _against(comparison: Comparison, main: str, other: str) -> str:
    ahead = {
        condition: comparison.percent(other, condition) - comparison.percent(main, condition)
        for condition in comparison.conditions
    }
    better = [condition for condition in comparison.conditions if ahead[condition] > 0.0]
    worse = [condition for condition in comparison.conditions if ahead[condition] <= 0.0]
    unsure = [condition for condition in comparison.conditions if not _clear(comparison.label, main, other, condition)]
    if not worse:
        words = f"{sentence_start(phrase(main))} beats {phrase(other)} in every test, {_span(ahead, better)}"
    elif not better:
        words = f"{sentence_start(phrase(main))} does not beat {phrase(other)} in any test: it is behind "
        words += _span(ahead, worse)
    else:
        words = f"{sentence_start(phrase(main))} beats {phrase(other)} in {listed(better)} ({_span(ahead, better)}) "
        words += f"and not in {listed(worse)} (behind {_span(ahead, worse)})"
    return words + (f"; in {listed(unsure)} the difference is within chance." if unsure else ".")


def _span(ahead: dict[str, float], conditions: list[str]) -> str:
    sizes = sorted(abs(ahead[condition]) for condition in conditions)
    low, high = f"{sizes[0]:.2f}", f"{sizes[-1]:.2f}"
    return f"by {low} percentage points" if low == high else f"by {low} to {high} percentage points"


def _against_published(comparison: Comparison, main: str) -> str:
    below = [condition for condition in comparison.conditions if comparison.percent(main, condition) < best_percent()]
    worst = max(comparison.percent(main, condition) for condition in comparison.conditions)
    where = "every test" if len(below) == len(comparison.conditions) else listed(below) if below else "no test"
    return (
        f"The smallest published error of the paper is {best_percent():.2f} %, on other data and of a denominator it "
        f"does not state; {phrase(main)} is below it in {where} (its largest error is {worst:.2f} %)."
    )


def _truth_sentences(comparison: Comparison, main: str) -> list[str]:
    truth = comparison.truth
    if not truth:
        return ["True friction is not known for these recordings, so nothing is said about errors against it."]
    conditions = [condition for condition in comparison.conditions if condition in truth[main]]
    floor = ", ".join(f"{truth[LABEL_ITSELF][condition].errors.percent:.2f} %" for condition in conditions)
    return [
        _standing(truth, conditions, main, "true friction"),
        f"The label itself, which is made off line and looks ahead, is {floor} from true friction in "
        f"{listed(conditions)}.",
    ]


def _clear(scores: Scores, one: str, other: str, condition: str) -> bool:
    low, high = interval(scores[other][condition].draws_percent - scores[one][condition].draws_percent)
    return low > 0.0 or high < 0.0


def listed(conditions: Sequence[str]) -> str:
    """Return ``test 1`` or ``tests 1, 2 and 3``."""
    if len(conditions) == 1:
        return f"condition {conditions[0]}"
    return "tests " + ", ".join(conditions[:-1]) + f" and {conditions[-1]}"
