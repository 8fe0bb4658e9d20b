"""What the project makes of four public measurements that nobody here controls.

    python public_data/public_recordings.py --data FOLDER [emps|crane|seals|tribometer ...]

FOLDER holds ``emps``, ``crane``, ``pneumatic-seals`` and ``tribometer``. Each file comes in through the project's own
readers, mapping and resampling, each label through its filter and force balance:

- emps: a positioning stage driven by a motor (Janot, Gautier and Brunot 2019); mass and friction are published.
- crane: the jib cylinder of a loader crane, which carries its boom; the load is not measured.
- seals: a pneumatic piston with two kinds of seal at 1 to 7 bar; the stamps are uneven.
- tribometer: a reciprocating test, mostly presliding.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from public_data import CYLINDERS
from public_figures import PUBLISHED_EMPS, CraneFigures, crane, emps, seals, tribometer


def print_emps(data: Path) -> None:
    figures = emps(data)
    print("EMPS, identified on DATA_EMPS")
    low, high = figures.motion.mass_interval_kg
    print(f"  95 % interval of the mass {low:.2f} to {high:.2f} kg")
    for name, value in figures.parameters.items():
        published = PUBLISHED_EMPS.get(name)
        beside = "" if published is None else f"   published {published}, {100.0 * (value / published - 1.0):+.2f} %"
        print(f"  {name:14s} {value:8.2f}{beside}")
    for name, percent in figures.force_error_percent.items():
        blocks = figures.block_error_percent[name]
        print(
            f"  predicted force, RMS error over RMS force: {name} {percent:.2f} %, of means over 0.05 s {blocks:.2f} %"
        )


def print_crane(data: Path) -> None:
    print("Crane, jib cylinder; load identified from each run, LuGre identified on the other run")
    for name, figures in crane(data).items():
        load = figures.found.load
        assert load is not None
        low, high = load.coulomb_interval_n
        print(
            f"  {name}: Coulomb {load.coulomb_n:.0f} N ({low:.0f} to {high:.0f}), "
            f"greatest local difference {figures.greatest_asymmetry_percent:.1f} %"
        )
        print(
            f"    load {load.load_range_n[0]:.0f} to {load.load_range_n[1]:.0f} N, order {load.order}, "
            f"scatter up to {max(load.scatter_n):.0f} N, asymmetry {load.asymmetry_n:.0f} N (k = 1)"
        )
        print(f"    {crane_offset(figures)}")
        print(
            f"    LuGre of the other run: MAE {figures.lugre_mae_n:.0f} N, {figures.lugre_percent:.1f} % of mean "
            f"|friction|; of this run itself {figures.own_percent:.1f} %"
        )
        for whose, errors in (("the other's", figures.others_load_percent), ("its own", figures.own_load_percent)):
            each = ", ".join(f"{name} {percent:.1f} %" for name, percent in errors.items())
            print(f"    real-time estimates, friction of the other run, load {whose}: {each}")


def crane_offset(figures: CraneFigures) -> str:
    """Return what is known of the pressure sensors' offset in a run, and what could be."""
    load, cylinder = figures.found.load, CYLINDERS["crane"]
    assert load is not None
    both_n = 2.0 * float(np.hypot(load.asymmetry_n, max(load.scatter_n)))
    words = (
        f"sensor offset: inseparable from the load, both together known to ± {both_n:.0f} N (k = 2), not in friction; "
    )
    if figures.stated_zero_n is not None:
        return f"{words}± {2.0 * figures.stated_zero_n:.0f} N as the zeros are stated (k = 2)"
    piston_n, rod_n = (1e5 * area for area in (cylinder.piston_area_m2, cylinder.annulus_area_m2))
    return (
        f"{words}the file states no accuracy: {piston_n:.0f} N for each bar that the zero of the piston side may be "
        f"off, {rod_n:.0f} N of the rod side"
    )


def print_seals(data: Path) -> None:
    print("Pneumatic seals: Coulomb friction [N] with its 95 % interval, and the load [N]")
    for seal, pressures in seals(data).items():
        for bar, found in pressures.items():
            load = found.load
            assert load is not None
            low, high = load.coulomb_interval_n
            print(
                f"  {seal:6s} {bar} bar  {load.coulomb_n:6.2f}  {low:6.2f} to {high:6.2f}   load "
                f"{load.load_range_n[0]:.1f} to {load.load_range_n[1]:.1f}, {load.strokes_extend} strokes up, "
                f"{load.strokes_retract} down"
            )


def print_tribometer(data: Path) -> None:
    figures = tribometer(data)
    found = figures.reversals
    print("Tribometer: presliding stiffness, rig compliance in series with the contact, so a lower bound")
    print(
        f"  reversals: {found.stiffness_n_m:.0f} N/m, 95 % interval {found.interval_n_m[0]:.0f} to "
        f"{found.interval_n_m[1]:.0f}; {found.reversals_extend} and {found.reversals_retract} reversals, "
        f"{found.extend_n_m:.0f} and {found.retract_n_m:.0f} N/m, {found.left_out} left out"
    )
    levels = ", ".join(f"{level:.1f}: {value:.0f}" for level, value in figures.by_level.items())
    print(f"  by the share of Coulomb friction that rows lie within: {levels} N/m")
    low, high = figures.lugre_interval_n_m
    print(
        f"  LuGre over the whole test: {figures.lugre.bristle_stiffness_n_m:.0f} N/m ({low:.0f} to {high:.0f}), "
        f"Coulomb {figures.lugre.coulomb_n:.3f} N, MAE {figures.lugre_percent:.1f} % of mean |friction|"
    )


PRINTED = {"emps": print_emps, "crane": print_crane, "seals": print_seals, "tribometer": print_tribometer}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("which", nargs="*", choices=[*PRINTED, []], default=[])
    arguments = parser.parse_args()
    for name in arguments.which or PRINTED:
        PRINTED[name](arguments.data)


if __name__ == "__main__":
    main()
