"""All contenders of all models in one run: in turns, on one core, so that whatever the machine does hits all alike."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
import torch

from cylinder_friction.deployment.latency.figures import Latency, latency_of
from cylinder_friction.deployment.latency.floor import Floor, FloorKernels
from cylinder_friction.deployment.latency.instructions import instructions_per_step
from cylinder_friction.deployment.latency.line_up import LineUp, line_up
from cylinder_friction.deployment.latency.machine import Quiet, QuietWatch, machine, one_core, preemptions

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from numpy.typing import NDArray

    from cylinder_friction.deployment.latency.contender import Contender
    from cylinder_friction.estimators.base import FrictionEstimator

    Array = NDArray[np.float64]
    Times = NDArray[np.int64]

COMPARED_STEPS = 200
"""Steps that are taken first: all are checked to estimate the same, compiled and warm."""
LEAD_IN_STEPS = 20
"""Steps of each turn that are not timed, after the first: they fetch what the others drove out of the caches."""


@dataclass(frozen=True)
class Effort:
    """How much is measured.

    Attributes:
        steps: Timed steps of each contender, as far as ``seconds`` allow.
        rounds: Turns into which they are cut.
        seconds: For one contender.
        instructions: Whether instructions are counted too, where Valgrind is there.
    """

    steps: int = 100_000
    rounds: int = 20
    seconds: float = 10.0
    instructions: bool = False

    def __post_init__(self) -> None:
        if self.steps < 1 or self.rounds < 1 or not self.seconds > 0.0:
            raise ValueError(f"expected at least one step, one round and some time, but got {self}")

    def steps_a_round(self, step_ns: float) -> int:
        """Return the steps of one turn of a contender that takes ``step_ns`` for one."""
        affordable = 1e9 * self.seconds / max(step_ns, 1.0)
        return max(1, round(min(float(self.steps), affordable) / self.rounds))


@dataclass(frozen=True)
class ContenderFigures:
    """One contender: its title, its times, and how far it is from what it should estimate [N]."""

    title: str
    latency: Latency
    largest_difference_n: float


@dataclass(frozen=True)
class ModelFigures:
    """One model; ``instructions`` are of one step of its C, None where nobody counted them."""

    size: str
    published: bool
    contenders: dict[str, ContenderFigures]
    floor: Floor | None
    state_bytes: int
    operations: int
    instructions: float | None


@dataclass(frozen=True)
class Measured:
    """A whole run."""

    models: dict[str, ModelFigures]
    effort: Effort
    core: int | None
    quiet: Quiet
    machine: dict[str, Any]


def measure(estimators: Mapping[str, FrictionEstimator], samples: Array, effort: Effort) -> Measured:
    """Measure every runtime of every estimator.

    Args:
        estimators: Hybrids and LuGre by name.
        samples: Raw, shape ``(n, 3)``; taken over and over.
        effort: How much.

    Raises:
        NoCompilerError: There is no C compiler.
        ValueError: An estimator is of another kind, or there are no samples.
    """
    if len(samples) < COMPARED_STEPS:
        raise ValueError(f"expected at least {COMPARED_STEPS} samples, but got {len(samples)}")
    with TemporaryDirectory() as folder, one_core() as core, _one_thread():
        kernels = FloorKernels(Path(folder))
        line_ups = {
            name: line_up(each, samples, Path(folder) / f"model{place}")
            for place, (name, each) in enumerate(estimators.items())
        }
        away = {name: _differences(line, estimators[name], samples) for name, line in line_ups.items()}
        watch = QuietWatch(core)
        everybody = [contender for line in line_ups.values() for contender in line.contenders]
        times = _in_turns(everybody, samples, effort)
        quiet = watch.end()
        floors = {name: None if line.work is None else kernels.floor(line.work) for name, line in line_ups.items()}
        counted = {
            name: instructions_per_step(line.exported, samples) if effort.instructions else None
            for name, line in line_ups.items()
        }
        models = {
            name: _figures(line, times, away[name], floors[name], counted[name]) for name, line in line_ups.items()
        }
    return Measured(models, effort, core, quiet, machine())


@contextmanager
def _one_thread() -> Iterator[None]:
    """PyTorch on one thread, and no collection of garbage between two steps."""
    threads, collects = torch.get_num_threads(), gc.isenabled()
    torch.set_num_threads(1)
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        if collects:
            gc.enable()


def _differences(line: LineUp, estimator: FrictionEstimator, samples: Array) -> dict[str, float]:
    """Take the first steps; returns how far each is from the estimator itself, or from the first of its window."""
    expected = {"step": estimator.advance(estimator.new_state(), samples[:COMPARED_STEPS])}
    result = {}
    for contender in line.contenders:
        friction, _ = contender.run(samples[:COMPARED_STEPS])
        away = np.abs(friction - expected.setdefault(contender.family, friction))
        result[contender.name] = float(away.max())
    return result


@dataclass
class _Turns:
    """What one contender's turns gave."""

    steps: int
    timed: list[Times]
    first: list[int]
    preempted: int = 0


def _in_turns(contenders: list[Contender], samples: Array, effort: Effort) -> dict[int, Latency]:
    """Return each contender's latency by its ``id``.

    In every round another one begins, and all start at one place, the rounds' places spread over the samples.
    """
    endless = np.concatenate([samples, samples])
    turns = []
    for contender in contenders:
        _, trial = contender.run(samples[:LEAD_IN_STEPS])
        turns.append(_Turns(effort.steps_a_round(float(np.median(trial))), [], []))
    for start in range(effort.rounds):
        for place in range(len(contenders)):
            which = (start + place) % len(contenders)
            begin = start * len(samples) // effort.rounds
            _take_turn(contenders[which], turns[which], endless[begin : begin + len(samples)])
    return {
        id(contender): latency_of(np.concatenate(turn.timed), np.array(turn.first), contender.timer_ns, turn.preempted)
        for contender, turn in zip(contenders, turns, strict=True)
    }


def _take_turn(contender: Contender, turn: _Turns, samples: Array) -> None:
    _, lead_in = contender.run(samples[:LEAD_IN_STEPS])
    turn.first.append(int(lead_in[0]))
    left, before = turn.steps, preemptions()
    while left > 0:
        _, times = contender.run(samples[LEAD_IN_STEPS : LEAD_IN_STEPS + left])
        turn.timed.append(times)
        left -= len(times)
    turn.preempted += preemptions() - before


def _figures(
    line: LineUp, times: dict[int, Latency], away: dict[str, float], floor: Floor | None, instructions: float | None
) -> ModelFigures:
    contenders = {
        contender.name: ContenderFigures(contender.title, times[id(contender)], away[contender.name])
        for contender in line.contenders
    }
    exported = line.exported
    return ModelFigures(
        line.size, line.published, contenders, floor, exported.state_bytes, exported.operations, instructions
    )
