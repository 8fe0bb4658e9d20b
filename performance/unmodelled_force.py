"""How much of what an estimator takes for friction, and is not, the flag UNMODELLED_FORCE finds, and what it costs.

    python performance/unmodelled_force.py [LOADED] [--run FOLDER] [--model FOLDER]

Reads a finished run, the present folder by default, and ``LOADED``, if given: a run up to stage `offset` with a load
that its hybrid does not know, as after `make params ARGS="record=loaded ingest=rig_loaded"` in another clone. Without
the flag, each figure is that of the same estimator whose range of the force balance is not known. A row counts as
flagged where a flag but WARMING and OFFSET_UNKNOWN is set. Errors are against the true friction of the simulated rig.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.recordings.columns import POSITION, PRESSURES
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.recordings.truth import known_truth

if TYPE_CHECKING:
    from collections.abc import Callable

    from cylinder_friction.arrays import Array, Mask
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.recordings.recording import Recording

HELD_OUT = ("validation", "calibration", "test")
STOPPED_N = 2000.0  # Further from true friction, a row is at an end stop
ROUNDS = 40
OTHER_UNITS = (
    ("bar in place of pascal", PRESSURES, 1e-5),
    ("kPa in place of pascal", PRESSURES, 1e-3),
    ("MPa in place of pascal", PRESSURES, 1e-6),
    ("psi in place of pascal", PRESSURES, 1.0 / 6894.757),
    ("both pressures zero", PRESSURES, 0.0),
    ("all zero", (*PRESSURES, POSITION), 0.0),
    ("millimetres in place of metres", (POSITION,), 1e3),
    ("both pressures at half their gain", PRESSURES, 0.5),
    ("position at half its gain", (POSITION,), 0.5),
)
"""What a column is multiplied by."""
EXPECTED = Flag.WARMING | Flag.OFFSET_UNKNOWN
FAR_N = 100.0  # An error that matters
HEAD = (
    f"{'rows':46} {'number':>8} {'flagged, without':>17} {'with':>8} {'error, all':>11} {'not flagged':>12} "
    f"{'off by over 100 N unflagged':>28}"
)


def main() -> None:
    """Print the figures of one estimator."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("loaded", type=Path, nargs="?", help="root of a run with an external load")
    parser.add_argument("--run", type=Path, default=Path(), help="root of a finished run without")
    parser.add_argument("--model", type=Path, help="folder of an estimator; that run's hybrid by default")
    options = parser.parse_args()
    run, loaded = options.run, options.loaded
    folder = options.model or run / "models/hybrid"
    with_flag, without = load_estimator(folder), load_estimator(folder)
    if with_flag.guard is None or not with_flag.guard.force_weights:
        parser.error(f"{folder}: does not know the range of the force balance; train it again")
    without.guard = replace(with_flag.guard, force_weights=())
    held_out = [each for role in HELD_OUT for each in read_stored(run / "data/processed" / role)]
    known, pair = run / "data/raw/rig_truth", (without, with_flag)
    print(HEAD)
    print(line("held out, unloaded, usable", pair, held_out, known, usable))
    print(line(f"held out, unloaded, off by over {STOPPED_N:g} N (end stop)", pair, held_out, known, stopped))
    if loaded is not None:
        loads = read_stored(loaded / "data/processed/test")
        words = "held out, with a load that it does not know"
        print(line(words, pair, loads, loaded / "data/raw/rig_truth", usable))
    for words, columns, unit in OTHER_UNITS:
        scaled = [each.with_columns(**{name: unit * each.column(name) for name in columns}) for each in held_out]
        print(line(f"held out, {words}", pair, scaled, known, usable))
    one, other = PRESSURES
    swapped = [each.with_columns(**{one: each.column(other), other: each.column(one)}) for each in held_out]
    print(line("held out, pressures swapped", pair, swapped, known, usable))
    late = [each.with_columns(**{name: np.roll(each.column(name), 40) for name in PRESSURES}) for each in held_out]
    print(line("held out, pressures 200 ms late", pair, late, known, usable))
    for times, hertz in ((2, 400), (5, 1000)):
        print(line(f"held out, rows of {hertz} Hz taken for 200 Hz", pair, held_out, known, usable, times))
    print(f"a step of the C takes {cost(pair, held_out[0].samples(with_flag.inputs)):.3f} times as long as without")


def usable(recording: Recording, error_n: Array) -> Mask:  # noqa: ARG001
    """Return the rows that are neither near an end stop nor near an edge."""
    return recording.usable()


def stopped(recording: Recording, error_n: Array) -> Mask:  # noqa: ARG001
    """Return the rows at an end stop."""
    return error_n > STOPPED_N


def line(
    words: str,
    pair: tuple[FrictionEstimator, FrictionEstimator],
    recordings: list[Recording],
    truth: Path,
    chosen: Callable[[Recording, Array], Mask],
    times: int = 1,
) -> str:
    """Return the share of chosen rows that are flagged without and with the flag, and errors with it, as text.

    The estimators are given ``times`` as many rows as were recorded, in straight lines between them.
    """
    truth_n, errors = known_truth(str(truth), recordings), []
    flagged: tuple[list[Mask], list[Mask]] = ([], [])
    for recording in recordings:
        for estimator, into in zip(pair, flagged, strict=True):
            newtons, flags = estimator.real_time().run(between(recording.samples(estimator.inputs), times))
            newtons, flags = newtons[::times], flags[::times]
            error_n = np.abs(newtons[:, 0] - truth_n[recording.name])
            rows = chosen(recording, error_n)
            into.append((flags & ~EXPECTED != 0)[rows])
        errors.append(error_n[rows])
    error_n, before, after = (np.concatenate(each) for each in (errors, *flagged))
    left = f"{error_n[~after].mean():10.1f} N" if not after.all() else f"{'none':>12}"
    shares = f"{100.0 * before.mean():15.2f} % {100.0 * after.mean():6.2f} %"
    far = 100.0 * (~after & (error_n > FAR_N)).mean()
    return f"{words:46} {len(error_n):8d} {shares} {error_n.mean():9.1f} N {left} {far:26.1f} %"


def between(samples: Array, times: int) -> Array:
    """Return samples with more of them in straight lines between each two."""
    places = np.arange((len(samples) - 1) * times + 1) / times
    return np.column_stack([np.interp(places, np.arange(len(samples)), column) for column in samples.T])


def cost(pair: tuple[FrictionEstimator, FrictionEstimator], samples: Array) -> float:
    """Return how many times as long a step of the C takes with the flag: fastest of alternating rounds."""
    with tempfile.TemporaryDirectory() as folder:
        streams = [
            CompiledEstimator(export_c(each, Path(folder) / str(place))).stream() for place, each in enumerate(pair)
        ]
        fastest = [np.inf, np.inf]
        for _ in range(ROUNDS):
            for place, stream in enumerate(streams):
                began = perf_counter()
                stream.run(samples)
                fastest[place] = min(fastest[place], perf_counter() - began)
    return fastest[1] / fastest[0]


if __name__ == "__main__":
    main()
