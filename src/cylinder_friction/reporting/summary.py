"""The result in three sentences, written from the numbers alone, and the rule for a clear difference."""

import math
from collections.abc import Iterable, Sequence

from cylinder_friction.evaluation.comparison import LABEL_ITSELF, Comparison, Scores, equal_to_label, points_ahead
from cylinder_friction.reporting.estimator_titles import phrase

CLEAR_POINTS = 0.1
"""Least difference that counts [percentage points]; another seed or a warmer sensor moves an error by more.

The promotion gate has the same tolerance (``register.tolerance_percent``).
"""


def ranked(scores: Scores) -> list[str]:
    """Rank the estimators, without those that equal the label by construction if the label is the reference."""
    return [name for name in scores if name not in (LABEL_ITSELF, *equal_to_label(scores))]


def winner(scores: Scores, condition: str) -> str:
    """Find the estimator with the smallest percentage in a condition; of equals the first by name."""
    names = [name for name in ranked(scores) if condition in scores[name]]
    return min(names, key=lambda name: (scores[name][condition].errors.percent, name))


def verdict(scores: Scores, one: str, other: str, condition: str) -> str:
    """Judge a difference as ``better``, ``worse`` or ``level``: within chance, or below ``CLEAR_POINTS``.

    If no condition has two sessions, chance is not known and all estimators count as level.
    """
    ahead, low, high = points_ahead(scores, one, other, condition)
    if not (low > 0.0 or high < 0.0) or abs(ahead) < CLEAR_POINTS:  # an unknown interval excludes nothing
        return "level"
    return "better" if ahead > 0.0 else "worse"


def leaders(scores: Scores, condition: str) -> list[str]:
    """List the best estimator of a condition and those that it is not clearly better than, if chance is known."""
    best = winner(scores, condition)
    if not math.isfinite(points_ahead(scores, best, best, condition)[2]):  # of one session each
        return [best]
    names = [name for name in ranked(scores) if condition in scores[name]]
    return [name for name in names if name == best or verdict(scores, best, name, condition) != "better"]


def best_reference(comparison: Comparison) -> tuple[Scores, tuple[str, ...]]:
    """Choose the scores against the best reference, with their conditions: the truth, else the label."""
    if comparison.truth:
        return comparison.truth, comparison.truth_conditions
    return comparison.label, comparison.conditions


def summary(comparison: Comparison, main: str) -> list[str]:
    """Write three sentences: the error of ``main``, the estimators that it does not beat, the error of the label."""
    return [_errors(comparison, main), _rivals(comparison, main), _label(comparison, main)]


def _errors(comparison: Comparison, main: str) -> str:
    scores, known = best_reference(comparison)
    found = [scores[main][condition].errors for condition in known]
    percents, newtons = [f"{each.percent:.2f} %" for each in found], [f"{each.mae_n:.1f}" for each in found]
    against = "true friction" if scores is comparison.truth else "the label"
    return (
        f"Against {against}, the mean absolute error of {phrase(main)} is {_listed(percents)} of mean friction in "
        f"{conditions_in_words(known)}: {_span(newtons)} N."
    )


def _rivals(comparison: Comparison, main: str) -> str:
    if comparison.sessions == len(comparison.conditions):
        return (
            "With one held-out session in each condition chance is not known and no difference is clear: hold out two "
            "(split.test_sessions)."
        )
    scores, known = best_reference(comparison)
    verdicts = {
        name: [verdict(scores, main, name, condition) for condition in known] for name in ranked(scores) if name != main
    }
    beaten = sum(set(each) == {"better"} for each in verdicts.values())
    others = (
        "every other estimator"
        if beaten == len(verdicts)
        else f"{beaten or 'none'} of the {len(verdicts)} other estimators"
    )
    words = [f"It is clearly better than {others} in every condition"]
    for outcome, relation in (("worse", "clearly better"), ("level", "level with it")):
        names = [
            name for name, each in verdicts.items() if outcome in each and (outcome == "worse" or "worse" not in each)
        ]
        if names:
            where = "" if all(set(verdicts[name]) == {outcome} for name in names) else " in at least one condition"
            listed = _listed(map(phrase, names))
            words.append(f"{listed} {'is' if len(names) == 1 else 'are'} {relation}{where}")
    left_out = [phrase(name) for name in comparison.equal_to_label if name not in (main, *verdicts)]
    if left_out:
        words.append(f"what equals the label by construction is left out: {_listed(left_out)}")
    return f"{'; '.join(words)}."


def _label(comparison: Comparison, main: str) -> str:
    truth, known = comparison.truth, comparison.truth_conditions
    if not truth:
        return "True friction is not known for these recordings, so nothing is stated about errors against it."
    label = _span([f"{truth[LABEL_ITSELF][condition].errors.percent:.2f}" for condition in known])
    own = _span([f"{comparison.label[main][condition].errors.percent:.2f}" for condition in comparison.conditions])
    best = list(dict.fromkeys(winner(truth, condition) for condition in known))
    nearest = f"Nearest to true friction {'is' if len(best) == 1 else 'are'} {_listed(map(phrase, best))}"
    known_of_it = [comparison.notes[LABEL_ITSELF]] if LABEL_ITSELF in comparison.notes else []
    if comparison.equal_to_label:
        known_of_it.append(f"by construction equal to {_listed(map(phrase, comparison.equal_to_label))}")
    made = f" ({'; '.join(known_of_it)})" if known_of_it else ""
    return (
        f"{'No estimator betters it' if best == [main] else nearest}; the label itself{made} errs by {label} %. "
        f"Against that label, which it was trained on, {phrase(main)} errs by {own} %."
    )


def conditions_in_words(conditions: Sequence[str]) -> str:
    """Write ``condition 1`` or ``conditions 1, 2 and 3``."""
    return f"condition{'s' if len(conditions) > 1 else ''} {_listed(conditions)}"


def _listed(words: Iterable[str]) -> str:
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def _span(numbers: Sequence[str]) -> str:
    low, high = min(numbers, key=float), max(numbers, key=float)
    return low if low == high else f"{low} to {high}"
