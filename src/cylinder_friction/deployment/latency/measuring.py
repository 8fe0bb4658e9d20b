"""All runtimes of all models in one run: in turns, on one core, so that disturbances affect all alike."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.latency.machine import Quiet, QuietWatch, machine, one_core, preemptions
from cylinder_friction.deployment.latency.runtimes import CompiledRuntime, Runtime, runtimes_of, size_of
from cylinder_friction.estimators.base import FrictionEstimator

Times = NDArray[np.int64]

Peers = Callable[[FrictionEstimator], Sequence[Runtime]]

COMPARED_STEPS = 200  # First steps, in which all are checked to estimate the same; they compile and warm up what runs
LEAD_IN_STEPS = 20
"""Steps of each turn that are not timed, after the first: they fetch what the others drove out of the caches."""


@dataclass(frozen=True)
class Effort:
    """How much is measured."""

    steps: int = 100_000  # Timed steps of each runtime, as far as ``seconds`` allow
    rounds: int = 20  # Turns into which they are cut
    seconds: float = 10.0  # For one runtime

    def __post_init__(self) -> None:
        if self.steps < 1 or self.rounds < 1 or not self.seconds > 0.0:
            raise ValueError(f"expected at least one step, one round and some time, but got {self}")

    def steps_per_round(self, step_ns: float) -> int:
        """Return the steps of one turn of a runtime that takes ``step_ns`` for one."""
        affordable = 1e9 * self.seconds / max(step_ns, 1.0)
        return max(1, round(min(float(self.steps), affordable) / self.rounds))


@dataclass(frozen=True)
class Latency:
    """Times of single steps, each figure one that was measured (none is interpolated)."""

    steps: int  # Number of timed steps
    # Quantiles [µs]
    p50_us: float
    p99_us: float
    p999_us: float
    maximum_us: float
    first_us: float  # Median of the first steps after other work, which left the caches to itself [µs]
    preempted: int  # How often the system took the core away meanwhile


def latency_of(steps_ns: Times, first_ns: Times, timer_ns: float, preempted: int = 0) -> Latency:
    """Return the figures of all timed steps and of each block's first steps, less the time of reading the clock."""
    if len(steps_ns) == 0 or len(first_ns) == 0:
        raise ValueError(f"expected at least one timed step, but got {len(steps_ns)} and {len(first_ns)} first ones")
    own = np.maximum(np.asarray(steps_ns, dtype=np.float64) - timer_ns, 0.0)
    p50, p99, p999, maximum = 1e-3 * np.quantile(own, (0.5, 0.99, 0.999, 1.0), method="inverted_cdf")
    first = 1e-3 * max(float(np.median(first_ns)) - timer_ns, 0.0)
    return Latency(len(own), float(p50), float(p99), float(p999), float(maximum), first, preempted)


@dataclass(frozen=True)
class RuntimeFigures(Latency):
    """One runtime: its times, and its largest difference from the expected friction [N]."""

    title: str
    ratio_to_c: float  # Of the medians; 0 where that of C is
    largest_difference_n: float


@dataclass(frozen=True)
class ModelFigures:
    """One model: its size in words, its runtimes, and the size and cost of its C."""

    size: str
    runtimes: dict[str, RuntimeFigures]
    state_bytes: int
    operations: int


@dataclass(frozen=True)
class Measured:
    """A whole run."""

    models: dict[str, ModelFigures]
    effort: Effort
    core: int | None
    quiet: Quiet
    machine: dict[str, Any]


def measure(
    estimators: Mapping[str, FrictionEstimator],
    samples: Mapping[str, Array],
    effort: Effort,
    peers: Peers | None = None,
) -> Measured:
    """Measure every runtime of every estimator.

    ``samples`` are raw, of each estimator, shape ``(n, inputs)``, and taken over and over. ``peers`` gives further
    runtimes to measure beside an estimator's own.

    Raises:
        NoCompilerError: There is no C compiler.
        ValueError: An estimator cannot be exported, or there are too few samples.
    """
    fewest = min(map(len, samples.values()), default=0)
    if fewest < COMPARED_STEPS:
        raise ValueError(f"expected at least {COMPARED_STEPS} samples, but got {fewest}")
    with TemporaryDirectory() as folder, one_core() as core, _no_garbage_collection():
        turns: dict[str, list[_Turns]] = {}
        for place, (name, estimator) in enumerate(estimators.items()):
            own = runtimes_of(estimator, Path(folder) / f"model{place}")
            turns[name] = _compared([*(peers(estimator) if peers else ()), *own], estimator, samples[name])
        watch = QuietWatch(core)
        _take_turns([turn for each in turns.values() for turn in each], effort)
        quiet = watch.end()
    models = {name: _figures(estimators[name], each) for name, each in turns.items()}
    return Measured(models, effort, core, quiet, machine())


@contextmanager
def _no_garbage_collection() -> Iterator[None]:
    collects = gc.isenabled()
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@dataclass
class _Turns:
    """One runtime, its samples, its largest difference from the expected friction [N], and its times so far."""

    runtime: Runtime
    samples: Array
    largest_difference_n: float
    steps: int = 0
    timed: list[Times] = field(default_factory=list)
    first: list[int] = field(default_factory=list)
    preempted: int = 0

    def take(self, share: float) -> None:
        """Take a turn that begins after this share of the samples."""
        samples = np.roll(self.samples, -int(share * len(self.samples)), axis=0)
        _, lead_in = self.runtime.run(samples[:LEAD_IN_STEPS])
        self.first.append(int(lead_in[0]))
        left, before = self.steps, preemptions()
        while left > 0:
            _, times = self.runtime.run(samples[LEAD_IN_STEPS : LEAD_IN_STEPS + left])
            self.timed.append(times)
            left -= len(times)
        self.preempted += preemptions() - before


def _compared(runtimes: Sequence[Runtime], estimator: FrictionEstimator, samples: Array) -> list[_Turns]:
    """Take the first steps, and compare with the estimator itself, or with the first runtime of another group."""
    stream = estimator.stream()
    expected = {"estimator": np.array([stream.step(*sample) for sample in samples[:COMPARED_STEPS]])}
    result = []
    for runtime in runtimes:
        friction, _ = runtime.run(samples[:COMPARED_STEPS])
        difference = np.abs(friction - expected.setdefault(runtime.group, friction))
        result.append(_Turns(runtime, samples, float(difference.max())))
    return result


def _take_turns(turns: list[_Turns], effort: Effort) -> None:
    """Begin each round with another runtime, all at one place, the rounds' places spread over the samples."""
    for turn in turns:
        _, trial = turn.runtime.run(turn.samples[:LEAD_IN_STEPS])
        turn.steps = effort.steps_per_round(float(np.median(trial)))
    for start in range(effort.rounds):
        for place in range(len(turns)):
            turns[(start + place) % len(turns)].take(start / effort.rounds)


def _figures(estimator: FrictionEstimator, turns: list[_Turns]) -> ModelFigures:
    exported = next(each.runtime.exported for each in turns if isinstance(each.runtime, CompiledRuntime))
    latencies = {
        turn.runtime.name: latency_of(
            np.concatenate(turn.timed), np.array(turn.first), turn.runtime.timer_ns, turn.preempted
        )
        for turn in turns
    }
    own_us = latencies["c"].p50_us
    runtimes = {
        turn.runtime.name: RuntimeFigures(
            **vars(found),
            title=turn.runtime.title,
            ratio_to_c=found.p50_us / own_us if own_us > 0.0 else 0.0,
            largest_difference_n=turn.largest_difference_n,
        )
        for turn, found in zip(turns, latencies.values(), strict=True)
    }
    return ModelFigures(size_of(estimator), runtimes, exported.state_bytes, exported.operations)
