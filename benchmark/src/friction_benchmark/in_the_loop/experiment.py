"""Tune each way to compensate friction alike, run it in every session and condition, and gather what it is worth."""

import ctypes
import math
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.lugre import LuGre
from friction_benchmark.in_the_loop import closed_loop
from friction_benchmark.in_the_loop.closed_loop import POSITION, REFERENCE, START_2_PA, Controller
from friction_benchmark.in_the_loop.compensators import BY_TITLE, Compensator, Trained, controller_library, train
from friction_benchmark.in_the_loop.courses import COURSES, MIDDLE_M, course
from friction_benchmark.in_the_loop.measures import Measures, limit_cycle, measure
from friction_benchmark.servo_rig.dynamics import P1, TICK_S, at_rest
from friction_benchmark.servo_rig.evaluation import EvaluationPlan
from friction_benchmark.servo_rig.parameters import Drive, Seals, Sensors
from friction_benchmark.servo_rig.sessions import SEED_WORD, SessionPlan, draw

CONDITIONS = {  # Oil [°C], factor on dry friction
    "warm oil, new seals": (45.0, 1.0),
    "warm oil, worn seals": (45.0, 0.7),
    "cold oil, new seals": (12.0, 1.0),
    "cold oil, worn seals": (12.0, 0.7),
}
NOMINAL = "warm oil, new seals"
POSITION_GAIN_1_S = 15.0  # The rig's own
LAGS_MS = (0, 5, 10, 20)
STABILITY_SHARES = (0.5, 0.8, 1.0, 1.2, 1.5, 2.0, 3.0)
LAGGED = ("low-pass", "hybrid", "true friction")
REPEATS = 2000

Rig = tuple[Seals, Drive, Sensors]
Way = tuple[Compensator, Controller]
Settings = dict[str, dict[str, Any]]  # By compensator


@dataclass(frozen=True)
class Plan:
    """How much is run."""

    trainings: tuple[EvaluationPlan, ...] = tuple(EvaluationPlan(SessionPlan(seed)) for seed in (0, 1))
    effort: float = 0.1  # Share of the full searches of observer and LuGre
    sessions: int = 3  # Of each training and condition
    courses: tuple[str, ...] = tuple(COURSES)
    conditions: tuple[str, ...] = tuple(CONDITIONS)
    trials: int = 12  # Of each tuning


QUICK = Plan((EvaluationPlan(SessionPlan(0, 3, 10.0), epochs=2),), 0.02, 1, ("slow sine", "micro-steps"), (NOMINAL,), 2)
"""What the tests run; its figures mean nothing."""


class Bench(NamedTuple):
    """The loop's fixed parts."""

    library: ctypes.CDLL  # ``controller.c``
    trained: Sequence[Trained]
    gains: Controller = Controller()


def session(condition: str, *words: int) -> Rig:
    """Return a session's rig: zeros, seals, supply and air drawn as for recordings, oil and wear of the condition."""
    oil_c, wear = CONDITIONS[condition]
    seals, drive, sensors = draw(np.random.default_rng([SEED_WORD, *words]), "2", "horizontal")
    drive = drive._replace(oil_c=oil_c, warming_c_s=0.0)
    return seals._replace(wear=wear * seals.wear), drive, sensors


def follow(bench: Bench, rig: Rig, way: Way, path: tuple[Array, Array], training: int, number: int, lag: int) -> Array:
    """Return the trace of one run. ``number`` seeds noise; the fed-forward friction is ``lag`` milliseconds late."""
    compensator, gains = way
    trained, (reference_m, load_n) = bench.trained[training], path
    noise = np.random.default_rng([SEED_WORD, 77, training, number]).normal(size=(len(load_n), 4))
    p1 = at_rest(rig[1], reference_m[0], START_2_PA)[P1]
    compiled, model, series = trained.exported[compensator.exported], LuGre(), np.zeros(len(load_n))
    if compensator.title.startswith("LuGre"):
        series = model.simulate(trained.lugre, np.diff(reference_m) / TICK_S, TICK_S, model.new_state())
    memory, address = np.zeros(compiled.exported.state_bytes // 8 + 1), ctypes.cast(compiled.step, ctypes.c_void_p)
    compiled.init(memory.ctypes.data)
    exported = bench.library.loop_estimate, address.value, memory.ctypes.data, np.zeros(4)
    kept = closed_loop.new_observer(trained.observer, p1, START_2_PA, reference_m[0], rig[2].sample_time_s)
    filtering, trace = closed_loop.sensor_filter(rig[2], p1, START_2_PA), np.empty((len(load_n), 5))
    closed_loop.run(rig, gains, path, noise, filtering, compensator.source, series, exported, kept, lag, trace)
    return trace


def tuned_cascade(bench: Bench) -> Controller:
    """Tune the cascade without friction: first the valve, then half the force gain at which the loop cycles sliding.

    Strokes of 5 and 20 mm/s without the force loop show the valve's null and its speed in either direction.
    """
    rig = Seals(), Drive(oil_c=CONDITIONS[NOMINAL][0]), Sensors()

    def error_m(gains: Controller, speeds_m_s: Array) -> Array:
        reference_m = MIDDLE_M + np.cumsum(np.concatenate([[0.0], speeds_m_s])) * TICK_S
        trace = follow(bench, rig, (BY_TITLE["none"], gains), (reference_m, np.zeros(len(speeds_m_s))), 0, 0, 0)
        return np.asarray(trace[:, REFERENCE] - trace[:, POSITION])

    gains, speeds = Controller(POSITION_GAIN_1_S / 1e-12, force_m_s_n=1e-12), np.tile([5e-3, -5e-3, 2e-2, -2e-2], 2)
    steady_m = error_m(gains, speeds.repeat(1500)).reshape(8, 1500)[1:, 1000:].mean(axis=1)
    each_way = np.stack([speeds.clip(min=0.0), speeds.clip(max=0.0), np.ones(8)], axis=1)[1:]
    extend, retract, null_m_s = np.linalg.lstsq(each_way, speeds[1:] + POSITION_GAIN_1_S * steady_m)[0].tolist()
    valve = {"extend_m_s": gains.extend_m_s / extend, "retract_m_s": gains.retract_m_s / retract, "null_m_s": null_m_s}
    force, cycles = 1e-6, False
    while not cycles:
        force *= 1.1
        gains = Controller(POSITION_GAIN_1_S / force, force_m_s_n=force, **valve)
        cycles = limit_cycle(error_m(gains, np.full(11000, 0.01))[2000:]) is not None
    return gains._replace(position_n_m=2.0 * gains.position_n_m, force_m_s_n=0.5 * force)


def tuned(bench: Bench, plan: Plan) -> Settings:
    """Choose each compensator's settings: least mean of error over that of none, no limit cycle, nominal condition."""
    rig, paths = session(NOMINAL, 9), [course(name) for name in plan.courses]

    def costs(trial: tuple[str, dict[str, Any]]) -> Array:
        way = BY_TITLE[trial[0]].tuned(bench.gains, trial[1])
        found = [measure(follow(bench, rig, way, path, 0, 9, 0)) for path in paths]
        return np.array([math.inf if each.cycles else each.rms_um for each in found])

    tried = [(title, settings) for title, each in BY_TITLE.items() for settings in each.tried[-plan.trials :]]
    found = parallel(costs, tried)
    ranked = sorted(zip([float(np.mean(each / found[0])) for each in found], range(len(tried)), strict=True))
    best = {tried[place][0]: tried[place][1] for _, place in reversed(ranked)}
    return {title: best[title] for title in BY_TITLE}


class Case(NamedTuple):
    """One run."""

    condition: str
    training: int
    session: int
    course: str
    compensator: str
    share: float | None = None  # Fed forward in place of the tuned share
    lag_ms: int = 0  # By which the fed-forward friction is late


def runs(bench: Bench, settings: Settings, cases: Iterable[Iterable[Any]]) -> pd.DataFrame:
    """Return each case's measures, one row per run."""
    keys = [Case(*each) for each in cases]

    def one(case: Case) -> Measures:
        others = {} if case.share is None else {"share": case.share}
        way = BY_TITLE[case.compensator].tuned(bench.gains, {**settings[case.compensator], **others})
        rig, which = session(case.condition, 1, case.training, case.session), (case.training, case.session)
        return measure(follow(bench, rig, way, course(case.course), *which, case.lag_ms))

    return pd.DataFrame(keys).join(pd.DataFrame(parallel(one, keys)))


def parallel(function: Callable[[Any], Any], arguments: Iterable[Any]) -> list[Any]:
    """Call a function in two threads; compiled code of one runs beside that of the other."""
    with ThreadPoolExecutor(2) as pool:
        return list(pool.map(function, arguments))


def ratio(table: pd.DataFrame, title: str, over: str, measured: str = "rms_um") -> tuple[float, float, float]:
    """Return the mean of a measure over that of another compensator, and its 95 % interval over trainings and sessions.

    The bootstrap draws trainings, then sessions of each; both compensators get the same draws.
    """
    means = table.groupby(["compensator", "training", "session"])[measured].mean()
    first, second = (means[each].unstack().to_numpy() for each in (title, over))
    generator = np.random.default_rng(0)
    trainings = generator.integers(0, len(first), (REPEATS, len(first), 1))
    sessions = generator.integers(0, first.shape[1], (REPEATS, *first.shape))
    drawn = first[trainings, sessions].mean(axis=(1, 2)) / second[trainings, sessions].mean(axis=(1, 2))
    low, high = np.quantile(drawn, (0.025, 0.975))
    return float(first.mean() / second.mean()), float(low), float(high)


def experiment(plan: Plan) -> tuple[Bench, Settings, dict[str, pd.DataFrame]]:
    """Train, tune and run everything; equal plans give equal numbers."""
    bench = Bench(controller_library(), [train(each, plan.effort) for each in plan.trainings])
    bench = bench._replace(gains=tuned_cascade(bench))
    settings = tuned(bench, plan)
    trainings, sessions = range(len(plan.trainings)), range(plan.sessions)
    sharing = [title for title, each in settings.items() if "share" in each]
    cases = {
        "runs": product(plan.conditions, trainings, sessions, plan.courses, settings),
        "shares": product(plan.conditions, [0], [0], ["triangle with dwell"], sharing, STABILITY_SHARES),
        "lags": product([NOMINAL], trainings, [0], plan.courses, LAGGED, [None], LAGS_MS),
    }
    return bench, settings, {name: runs(bench, settings, each) for name, each in cases.items()}
