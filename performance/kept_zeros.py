"""Do bounds hold friction if pressure sensors keep their zeros, whatever the number of logs?

    python performance/kept_zeros.py [--zeros kept drifting ...] [--draws N] [--seed N] [BENCH ...]

A bench records sessions without any zero error, and each is labelled once. A draw then gives both transmitters a zero
error within the stated limit, the same in all sessions, or one that drifts from session to session, or half of each.
The draws of kept zeros are spread evenly over the limits. From 1, 3, 12 and 24 sessions at a time, offsets are
identified as the commands on logs do. Prints, per bench, limit and number of sessions: the share of all rows, pooled
over the draws, in which bounds hold true friction, their mean half width, and its ratio to that of an oracle. The
oracle takes each session's true deviation from the mean zero off the label and knows the constant half width that then
holds 95 % of the pooled rows.

The servo rig needs the package in ``benchmark``.
"""

import argparse
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from scipy.stats.qmc import LatinHypercube
from zero_sweep import Kind, identified, recordings

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.columns import PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import Recording, SensorUncertainty

BENCHES = {"default": Kind(0.0, 0.0, "default"), "wide": Kind(0.0, 0.0), "servo": Kind(0.0, 0.0, "servo")}
LIMITS_BAR = {"±0.5 % of 250 bar": 1.25, "±0.25 %": 0.625}
COUNTS = (1, 3, 12, 24)
KEPT_SHARES = {"kept": 1.0, "drifting": 0.0, "kept and drifting": 0.5}
DRIFT_SD = 0.5
"""Standard deviation of drifting zeros, over the limit."""
FORGET = 0.8
"""Share of a drifting zero's deviation that the next session still has."""


@dataclass(frozen=True)
class Bench:
    """Labelled sessions without zero errors, and the true friction of each."""

    cylinder: Cylinder
    labelled: list[Recording]
    truths_n: list[Array]

    @classmethod
    def made(cls, name: str, limit_bar: float) -> "Bench":
        cylinder, labelled, truths_n = recordings(BENCHES[name], 0, 6 if name != "servo" else 8, 30.0)
        sensor = SensorUncertainty(1e5 * limit_bar / math.sqrt(3.0), 0.0005, 6.1e3)
        stated = [
            replace(each, metadata=replace(each.metadata, uncertainty=dict.fromkeys(PRESSURES, sensor)))
            for each in labelled
        ]
        bare = [each.without_columns("friction_n", UNCERTAINTY_COLUMN) for each in stated]
        return cls(cylinder, label(bare, cylinder), truths_n)


def zeros_pa(generator: np.random.Generator, limit_bar: float, zeros: str, kept_shares: Array, count: int) -> Array:
    """Draw the zeros of both transmitters in each session, ``(count, 2)``; ``kept_shares`` of the limit are kept."""
    walk = np.empty((count, 2))
    walk[0] = generator.normal(0.0, DRIFT_SD, 2)
    for session in range(1, count):
        shock = generator.normal(0.0, DRIFT_SD * math.sqrt(1.0 - FORGET**2), 2)
        walk[session] = FORGET * walk[session - 1] + shock
    kept = KEPT_SHARES[zeros]
    shares = kept * kept_shares + (1.0 - kept) * np.clip(walk, -1.0, 1.0)
    return np.asarray(1e5 * limit_bar * shares)


def draws(bench: Bench, limit_bar: float, zeros: str, count: int, number: int, seed: int) -> Iterator[dict[str, Array]]:
    """Yield error, half width and the oracle's error of the usable rows of each draw [N]."""
    areas = np.array([bench.cylinder.piston_area_m2, -bench.cylinder.annulus_area_m2])
    for draw, kept_shares in enumerate(2.0 * LatinHypercube(2, rng=seed).random(number) - 1.0):
        generator = np.random.default_rng([seed, draw])
        places = generator.permutation(len(bench.labelled))[:count]
        shifts_pa = zeros_pa(generator, limit_bar, zeros, kept_shares, count)
        offsets_n = shifts_pa @ areas
        drawn = zip(places, shifts_pa, offsets_n, strict=True)
        shifted = [_shifted(bench.labelled[place], *zeros_of) for place, *zeros_of in drawn]
        known = identified(shifted, bench.cylinder)
        errors, halves, oracle = [], [], []
        for each, place, offset_n in zip(shifted, places, offsets_n, strict=True):
            found, rows = known[each.metadata.session], each.usable()
            error_n = (each.column("friction_n") - bench.truths_n[place])[rows]
            errors.append(error_n - found.correction_n)
            halves.append(found.half_n(each.column(UNCERTAINTY_COLUMN)[rows]))
            oracle.append(error_n - (offset_n - offsets_n.mean()))
        yield dict(zip(("error", "half", "oracle"), map(np.concatenate, (errors, halves, oracle)), strict=True))


def _shifted(recording: Recording, zero_pa: Array, offset_n: float) -> Recording:
    pressures = {name: recording.column(name) + own for name, own in zip(PRESSURES, zero_pa, strict=True)}
    return recording.with_columns(friction_n=recording.column("friction_n") + offset_n, **pressures)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("benches", metavar="BENCH", nargs="*", default=list(BENCHES), help=f"of: {', '.join(BENCHES)}")
    parser.add_argument("--zeros", nargs="*", choices=list(KEPT_SHARES), default=list(KEPT_SHARES))
    parser.add_argument("--draws", type=int, default=40, help="draws of zeros")
    parser.add_argument("--seed", type=int, default=0, help="of the draws")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    rows = []
    for name in arguments.benches:
        for stated, limit_bar in LIMITS_BAR.items():
            bench = Bench.made(name, limit_bar)
            for zeros in arguments.zeros:
                for count in COUNTS:
                    found = list(draws(bench, limit_bar, zeros, count, arguments.draws, arguments.seed))
                    whole = {key: np.concatenate([each[key] for each in found]) for key in found[0]}
                    held = [float(np.mean(np.abs(each["error"]) <= each["half"])) for each in found]
                    needs_n = float(np.quantile(np.abs(whole["oracle"]), 0.95))
                    rows.append(
                        {
                            "bench": name,
                            "stated": stated,
                            "zeros": zeros,
                            "sessions": count,
                            "held %": 100.0 * float(np.mean(held)),
                            "draws below 90 %": sum(each < 0.9 for each in held),
                            "half width N": float(whole["half"].mean()),
                            "over oracle's": float(whole["half"].mean()) / needs_n,
                            "mean error N": float(np.abs(whole["error"]).mean()),
                            "oracle's error N": float(np.abs(whole["oracle"]).mean()),
                        }
                    )
                    print(pd.DataFrame(rows[-1:]).round(2).to_string(index=False, header=len(rows) == 1), flush=True)


if __name__ == "__main__":
    main()
