"""The result in plain words, written from the numbers alone: who wins, where, and by how much."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.evaluation.bootstrap import interval
from cylinder_friction.evaluation.comparison import LABEL_ITSELF
from cylinder_friction.evaluation.names import phrase, sentence_start
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


def winner(scores: Scores, test: str) -> str:
    """Returns the estimator with the smallest percentage in a test; the first by name among equals."""
    names = [name for name in scores if name != LABEL_ITSELF and test in scores[name]]
    return min(names, key=lambda name: (scores[name][test].errors.percent, name))


def summary(comparison: Comparison, main: str) -> list[str]:
    """Returns sentences: how ``main`` stands, who wins each test, against what it loses, what the truth says.

    A difference counts as clear when its paired 95 % block-bootstrap interval leaves out zero.
    """
    sentences = [_standing(comparison.label, comparison.tests, main, "the label")]
    sentences += [_winner_sentence(comparison.label, test) for test in comparison.tests]
    sentences += [
        _against(comparison, main, name) for name in TO_BEAT if name in comparison.estimators and name != main
    ]
    if set(comparison.tests) <= set(PERCENT_BY_TEST):
        sentences.append(_against_published(comparison, main))
    return sentences + _truth_sentences(comparison, main)


def _standing(scores: Scores, tests: Sequence[str], main: str, reference: str) -> str:
    best = {test: winner(scores, test) for test in tests}
    lost = [test for test in tests if best[test] != main]
    numbers = ", ".join(f"{scores[main][test].errors.percent:.2f} %" for test in tests)
    start = f"Against {reference}, {phrase(main)} errs by {numbers} in {listed(tests)}"
    if not lost:
        return f"{start}: the smallest error of all estimators in every test."
    rivals = list(dict.fromkeys(best[test] for test in lost))
    behind = "; ".join(
        f"{phrase(rival)} is better in {listed([test for test in lost if best[test] == rival])}" for rival in rivals
    )
    return f"{start}. It has the smallest error in {len(tests) - len(lost)} of {len(tests)} tests: {behind}."


def _winner_sentence(scores: Scores, test: str) -> str:
    best = winner(scores, test)
    error = scores[best][test].errors
    words = f"Test {test}: {phrase(best)} has the smallest error, {error.percent:.2f} % ({error.mae_n:.1f} N)"
    others = {name: found for name, found in scores.items() if name != best}
    if not others:
        return words + "."
    second = winner(others, test)
    behind = scores[second][test].errors.percent - error.percent
    if not _clear(scores, best, second, test):
        return f"{words}; {phrase(second)} is {behind:.2f} percentage points behind, which is within chance."
    return f"{words}, clearly ahead of the next, {phrase(second)}, by {behind:.2f} percentage points."


def _against(comparison: Comparison, main: str, other: str) -> str:
    ahead = {test: comparison.percent(other, test) - comparison.percent(main, test) for test in comparison.tests}
    better = [test for test in comparison.tests if ahead[test] > 0.0]
    worse = [test for test in comparison.tests if ahead[test] <= 0.0]
    unsure = [test for test in comparison.tests if not _clear(comparison.label, main, other, test)]
    if not worse:
        words = f"{sentence_start(phrase(main))} beats {phrase(other)} in every test, {_span(ahead, better)}"
    elif not better:
        words = f"{sentence_start(phrase(main))} does not beat {phrase(other)} in any test: it is behind "
        words += _span(ahead, worse)
    else:
        words = f"{sentence_start(phrase(main))} beats {phrase(other)} in {listed(better)} ({_span(ahead, better)}) "
        words += f"and not in {listed(worse)} (behind {_span(ahead, worse)})"
    return words + (f"; in {listed(unsure)} the difference is within chance." if unsure else ".")


def _span(ahead: dict[str, float], tests: list[str]) -> str:
    sizes = sorted(abs(ahead[test]) for test in tests)
    low, high = f"{sizes[0]:.2f}", f"{sizes[-1]:.2f}"
    return f"by {low} percentage points" if low == high else f"by {low} to {high} percentage points"


def _against_published(comparison: Comparison, main: str) -> str:
    below = [test for test in comparison.tests if comparison.percent(main, test) < best_percent()]
    worst = max(comparison.percent(main, test) for test in comparison.tests)
    where = "every test" if len(below) == len(comparison.tests) else listed(below) if below else "no test"
    return (
        f"The smallest published error of the paper is {best_percent():.2f} %, on other data and of a denominator it "
        f"does not state; {phrase(main)} is below it in {where} (its largest error is {worst:.2f} %)."
    )


def _truth_sentences(comparison: Comparison, main: str) -> list[str]:
    truth = comparison.truth
    if not truth:
        return ["True friction is not known for these recordings, so nothing is said about errors against it."]
    tests = [test for test in comparison.tests if test in truth[main]]
    floor = ", ".join(f"{truth[LABEL_ITSELF][test].errors.percent:.2f} %" for test in tests)
    return [
        _standing(truth, tests, main, "true friction"),
        f"The label itself, which is made off line and looks ahead, is {floor} from true friction in {listed(tests)}.",
    ]


def _clear(scores: Scores, one: str, other: str, test: str) -> bool:
    low, high = interval(scores[other][test].draws_percent - scores[one][test].draws_percent)
    return low > 0.0 or high < 0.0


def listed(tests: Sequence[str]) -> str:
    """Returns ``test 1`` or ``tests 1, 2 and 3``."""
    if len(tests) == 1:
        return f"test {tests[0]}"
    return "tests " + ", ".join(tests[:-1]) + f" and {tests[-1]}"
