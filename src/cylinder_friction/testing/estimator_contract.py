"""The promises that every estimator keeps, as checks to run on an estimator of your own.

All at once, with labelled recordings:

    check_estimator(lambda: MyEstimator(cylinder), recordings)

or as one test per promise, with pytest:

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
    def test_my_estimator_keeps(check): check(case)  # with one case = Case(lambda: MyEstimator(cylinder), recordings)
"""

import itertools
import math
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator, NotFittedError
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.recording import Recording, RecordingError

ROWS = 600
"""Number of samples, from the start of the first recording, that most checks use."""
SEED = 0


class ContractError(AssertionError):
    """An estimator or friction model breaks a promise of its contract.

    The message names the estimator or model, the broken promise, what was given and what was expected. It is an
    ``AssertionError``, so pytest shows it as a failure, not as an error.
    """


@dataclass(frozen=True)
class Case:
    """An estimator under test, fitted once for all checks.

    Args:
        make: Makes the estimator, not yet fitted; equal at each call.
        recordings: Labelled recordings of one sample time, with the estimator's inputs, to fit on and to estimate.
    """

    make: Callable[[], FrictionEstimator]
    recordings: Sequence[Recording]

    @cached_property
    def fitted(self) -> tuple[FrictionEstimator, Any]:
        """The estimator after ``fit``, and what ``fit`` returned."""
        made = self.make()
        return made, made.fit(self.recordings)

    @property
    def estimator(self) -> FrictionEstimator:
        return self.fitted[0]

    @cached_property
    def recording(self) -> Recording:
        first = self.recordings[0]
        return first.rows(slice(ROWS))

    @cached_property
    def samples(self) -> Array:
        return self.recording.samples(self.estimator.inputs)

    @cached_property
    def estimate(self) -> Array:
        found: Any = self.estimator.estimate(self.recording)
        got = f"a {type(found).__name__}"
        self.require(
            isinstance(found, np.ndarray), f"estimate is {got}, but expected a NumPy array; let advance return one"
        )
        return np.asarray(found)

    def streamed(self, count: int) -> list[float]:
        """Compute the first outputs of a fresh stream [N]."""
        stream = self.estimator.stream()
        return [stream.step(*sample) for sample in self.samples[:count]]

    def require(self, holds: bool, message: str) -> None:
        if not holds:
            raise ContractError(f"{self.estimator.kind}: {message}")

    def require_equal(self, got: Any, expected: Any, what: str) -> None:
        """Refuse arrays that differ in any bit."""
        got, expected = np.asarray(got), np.asarray(expected)
        self.require(got.shape == expected.shape, f"{what}: shape is {got.shape}, but expected {expected.shape}")
        rows = np.flatnonzero(got != expected)
        if len(rows):
            row = rows[0]
            one, other = got[row].tolist(), expected[row].tolist()  # plain numbers, to the last digit
            self.require(False, f"{what}: row {row} is {one} N, but expected {other} N")

    def require_error(self, call: Callable[[], object], error: type[Exception], words: str, what: str) -> None:
        """Refuse a call that does not raise this error with these words."""
        try:
            call()
        except error as raised:
            self.require(words in str(raised), f"{what}: message is {str(raised)!r}, but expected {words!r} in it")
        else:
            self.require(False, f"{what} is accepted, but expected {error.__name__} with {words!r}")


def fit_returns_the_estimator(case: Case) -> None:
    made, returned = case.fitted
    case.require(returned is made, f"fit returned {returned!r}, but expected the estimator itself")


def repr_is_readable(case: Case) -> None:
    text = repr(case.estimator)
    readable = type(case.estimator).__name__ in text and " at 0x" not in text and len(text) < 1000
    case.require(readable, f"repr is {text[:200]!r}, but expected the class and its settings in brief")


def one_finite_value_per_sample(case: Case) -> None:
    case.require_equal(case.estimate.shape, (len(case.recording),), "shape of the estimate")
    bad = np.flatnonzero(~np.isfinite(case.estimate))
    case.require(len(bad) == 0, f"estimate is not finite at rows {bad[:5].tolist()} of {case.recording.name}")


def the_future_never_changes_the_past(case: Case) -> None:
    generator = np.random.default_rng(SEED)
    inputs = case.estimator.inputs
    scale = 3.0 * case.samples.std(axis=0) + 1e-3 * np.abs(case.samples).max(axis=0)
    for cut in [1, len(case.samples) - 1, *generator.integers(1, len(case.samples), 8).tolist()]:
        samples = case.samples.copy()
        samples[cut:] += scale * generator.normal(size=samples[cut:].shape)
        changed = case.recording.with_columns(**dict(zip(inputs, samples.T, strict=True)))
        known = max(cut - case.estimator.lag_samples, 0)
        past = case.estimator.estimate(changed)[:known]
        case.require_equal(past, case.estimate[:known], f"estimate before samples changed from row {cut}")


def a_stream_equals_the_estimate(case: Case) -> None:
    lag = case.estimator.lag_samples
    case.require_equal(case.streamed(ROWS)[lag:], case.estimate[: ROWS - lag], "stream against estimate")


def cutting_the_samples_changes_nothing(case: Case) -> None:
    generator = np.random.default_rng(SEED)
    count, lag = len(case.samples), case.estimator.lag_samples
    for cuts in ([1, 2, 3, count // 2, count // 2], *generator.integers(0, count, (5, 4)).tolist()):
        state = case.estimator.new_state()
        edges = [0, *sorted(cuts), count]
        channels = case.estimator.channels_of(case.samples)
        pieces = [case.estimator.advance(state, channels[a:b]) for a, b in itertools.pairwise(edges)]
        stepped = np.concatenate(pieces)[lag:]
        case.require_equal(stepped, case.estimate[: count - lag], f"pieces cut at {sorted(cuts)}")


def reset_is_exact(case: Case) -> None:
    stream = case.estimator.stream()
    first = [stream.step(*sample) for sample in case.samples[:300]]
    stream.reset()
    case.require_equal([stream.step(*sample) for sample in case.samples[:300]], first, "stream after reset")


def two_streams_do_not_touch_each_other(case: Case) -> None:
    one, other = case.estimator.stream(), case.estimator.stream()
    beside = []
    for sample in case.samples[:200]:
        beside.append(one.step(*sample))
        other.step(*(0.5 * sample))
    case.require_equal(beside, case.streamed(200), "stream beside another one")


def save_and_load_round_trip(case: Case) -> None:
    estimator = case.estimator
    with tempfile.TemporaryDirectory() as folder:
        files = _saved(estimator, Path(folder))
        loaded = load_estimator(Path(folder))
    suffixes = {Path(name).suffix for name in files}
    case.require(suffixes <= {".json", ".onnx"}, f"saved files end in {sorted(suffixes)}, but expected .json and .onnx")
    case.require(type(loaded) is type(estimator), f"loaded a {type(loaded).__name__}")
    case.require_equal(loaded.estimate(case.recording), case.estimate, "estimate after save and load")
    case.require(estimator.multiply_adds() > 0, f"multiply_adds is {estimator.multiply_adds()}, but expected over 0")
    for name in ("inputs", "sample_time_s", "training_range", "guard", "bounds"):
        before, after = getattr(estimator, name), getattr(loaded, name)
        case.require(before == after, f"{name} is {after!r} after save and load, but expected {before!r}")
    case.require(loaded.multiply_adds() == estimator.multiply_adds(), "multiply_adds differs after save and load")


def fitting_and_saving_again_gives_the_same_bytes(case: Case) -> None:
    again = case.make()
    again.fit(case.recordings)
    saved = []
    for estimator in (case.estimator, case.estimator, again):
        with tempfile.TemporaryDirectory() as folder:
            saved.append(_saved(estimator, Path(folder)))
    case.require(saved[0] == saved[1], "saving twice writes different bytes")
    differing = sorted(name for name in saved[0] if saved[0][name] != saved[2].get(name))
    case.require(not differing, f"fitted again on the same recordings, {differing} differ; seed whatever is random")


def not_a_number_is_refused_by_name(case: Case) -> None:
    for value in (math.nan, math.inf):
        stream, untouched = case.estimator.stream(), case.estimator.stream()
        sample = case.samples[0]
        case.require(stream.step(*sample) == untouched.step(*sample), "two streams differ at their first sample")
        for column, name in enumerate(case.estimator.inputs):
            bad = sample.copy()
            bad[column] = value
            words = f"stream: {name} is {value} at row 0"
            case.require_error(partial(stream.step, *bad), RecordingError, words, f"{value} in {name}")
            case.require_equal([stream.step(*sample)], [untouched.step(*sample)], f"stream after a refused {value}")


def another_sample_time_is_refused(case: Case) -> None:
    trained_s = case.recording.sample_time_s
    faster = replace(case.recording, metadata=replace(case.recording.metadata, sample_time_s=trained_s / 5))
    words = f"sample time is {trained_s / 5} s, but this estimator was trained at {trained_s} s"
    case.require_error(lambda: case.estimator.estimate(faster), RecordingError, words, "another sample time")


def an_unfitted_estimator_is_refused(case: Case) -> None:
    words = "not fitted yet; call fit or load first"
    case.require_error(lambda: case.make().estimate(case.recording), NotFittedError, words, "estimate before fit")


def fitting_on_nothing_is_refused(case: Case) -> None:
    words = "nothing to fit on, got no recording"
    case.require_error(lambda: case.make().fit([]), RecordingError, words, "an empty list of recordings")


CHECKS: tuple[Callable[[Case], None], ...] = (
    fit_returns_the_estimator,
    repr_is_readable,
    one_finite_value_per_sample,
    the_future_never_changes_the_past,
    a_stream_equals_the_estimate,
    cutting_the_samples_changes_nothing,
    reset_is_exact,
    two_streams_do_not_touch_each_other,
    save_and_load_round_trip,
    fitting_and_saving_again_gives_the_same_bytes,
    not_a_number_is_refused_by_name,
    another_sample_time_is_refused,
    an_unfitted_estimator_is_refused,
    fitting_on_nothing_is_refused,
)
"""All promises; each check takes a ``Case`` and raises ``ContractError`` if one is broken."""


def check_estimator(make: Callable[[], FrictionEstimator], recordings: Sequence[Recording]) -> None:
    """Check all promises of an estimator.

    Args:
        make: Makes the estimator, not yet fitted; equal at each call.
        recordings: At least one labelled recording, all of one sample time, with the estimator's inputs.

    Raises:
        ContractError: A promise is broken.

    Example:
        >>> from cylinder_friction.estimators.linear import ForceBalanceEstimator
        >>> from cylinder_friction.testing.estimator_contract import check_estimator
        >>> check_estimator(lambda: ForceBalanceEstimator(cylinder), labelled[:1])
    """
    case = Case(make, recordings)
    for check in CHECKS:
        check(case)


def _saved(estimator: FrictionEstimator, folder: Path) -> dict[str, bytes]:
    """Read each file that the estimator writes."""
    estimator.save(folder)
    return {path.name: path.read_bytes() for path in folder.iterdir()}
