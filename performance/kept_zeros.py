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
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import pandas as pd
from scipy.stats.qmc import LatinHypercube
from zero_sweep import BAR, Kind, identified, recordings

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import PRESSURES, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.rig.campaign import KEPT_SHARES, ZERO_DRIFT_SD, ZERO_DRIFT_SESSIONS
from cylinder_friction.rig.lever import ornstein_uhlenbeck

SESSIONS = {"default": 6, "wide": 6, "servo": 8}
"""Sessions of each condition, by bench: 24 in all."""
LIMITS_BAR = {"±0.5 % of 250 bar": 1.25, "±0.25 %": 0.625}
COUNTS = (1, 3, 12, 24)


@dataclass(frozen=True)
class Bench:
    """Labelled sessions without zero errors, and the true friction of each."""

    cylinder: Cylinder
    labelled: list[Recording]
    truths_n: list[Array]

    @classmethod
    def made(cls, name: str, limit_bar: float) -> "Bench":
        return cls(*recordings(Kind(0.0, limit_bar, name, zeroed=False), 0, SESSIONS[name], 30.0))


def zeros_pa(generator: np.random.Generator, limit_bar: float, zeros: str, kept_shares: Array, count: int) -> Array:
    """Draw the zeros of both transmitters in each session, ``(count, 2)``; ``kept_shares`` of the limit are kept."""
    walk = partial(ornstein_uhlenbeck, generator, count, 1.0, ZERO_DRIFT_SESSIONS, ZERO_DRIFT_SD)
    drifted = np.clip(np.stack([walk() for _ in PRESSURES], axis=1), -1.0, 1.0)
    kept = KEPT_SHARES[zeros]
    shares = kept * kept_shares + (1.0 - kept) * drifted
    return np.asarray(BAR * limit_bar * shares)


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
    parser.add_argument(
        "benches", metavar="BENCH", nargs="*", default=list(SESSIONS), help=f"of: {', '.join(SESSIONS)}"
    )
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
