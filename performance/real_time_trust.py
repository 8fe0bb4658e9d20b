"""How far the real-time bounds and flags can be trusted: coverage and recovery on the test recordings.

Run from the repository's root after `dvc repro`: `python performance/real_time_trust.py [models/hybrid]`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.strata import StrataLimits, strata_masks
from cylinder_friction.realtime.bounds import REGIMES, regimes_of
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.storage import read_stored

if TYPE_CHECKING:
    from cylinder_friction.realtime.model import StepModel
    from cylinder_friction.recordings.recording import Recording

LIMITS = StrataLimits(1e-3, 16e-3, 0.1)
BACK_N = 0.5
LENGTHS = (1, 20, 200, 1000)
AFTER = 4000
REPEATS = 4


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "models/hybrid")
    model = load_estimator(folder).step_model()
    recordings = read_stored(Path("data/processed/test"))
    coverage(model, recordings)
    recovery(model, recordings)


def coverage(model: StepModel, recordings: list[Recording]) -> None:
    """Print the share of usable rows whose label lies between the bounds, and the bounds' mean width."""
    counts: dict[str, np.ndarray] = {}
    for recording in recordings:
        newtons, _ = RealTimeStream(model).run(recording.samples())
        label = recording.column("friction_n")
        usable = recording.usable().copy()
        usable[: model.guard.warm_up_samples] = False
        within = (newtons[:, 1] <= label) & (label <= newtons[:, 2])
        regime = regimes_of(recording, model.bounds.standstill_m_s, model.bounds.creep_m_s)
        masks = {f"condition {recording.metadata.condition}": np.ones(len(label), dtype=bool)}
        masks |= strata_masks(recording.column("velocity_m_s"), recording.sample_time_s, LIMITS)
        masks |= {f"regime {name}": regime == number for number, name in enumerate(REGIMES)}
        for name, mask in masks.items():
            rows = mask & usable
            width = (newtons[:, 2] - newtons[:, 1])[rows].sum()
            counts.setdefault(name, np.zeros(3))[:] += (within[rows].sum(), rows.sum(), width)
    print(f"{'where':20} {'rows':>8} {'covered':>8} {'width':>9}")
    for name in sorted(counts):
        covered, rows, width = counts[name]
        print(f"{name:20} {rows:8.0f} {100 * covered / rows:6.1f} % {width / rows:7.1f} N")


def recovery(model: StepModel, recordings: list[Recording]) -> None:
    """Print after how many samples the estimate is back, for good, within half a newton of the undisturbed one."""
    generator = np.random.default_rng(0)
    lasting: dict[str, list[int]] = {}
    stream = RealTimeStream(model)
    for recording in recordings:
        samples = recording.samples()
        stream.reset()
        undisturbed, _ = stream.run(samples)
        for kind in ("not a number", "frozen"):
            for channels in ([0], [1], [2], [0, 1, 2]):
                for length in LENGTHS * REPEATS:
                    start = int(generator.integers(1000, len(samples) - length - AFTER))
                    end = start + length
                    corrupted = samples[: end + AFTER].copy()
                    corrupted[start:end, channels] = np.nan if kind == "not a number" else samples[start - 1, channels]
                    stream.reset()
                    newtons, _ = stream.run(corrupted)
                    beyond = np.flatnonzero(np.abs(newtons[end:, 0] - undisturbed[end : end + AFTER, 0]) >= BACK_N)
                    lasting.setdefault(kind, []).append(int(beyond[-1]) + 1 if len(beyond) else 0)
    promised = model.guard.recovery_samples
    print(f"\n{'after':20} {'cases':>8} {'median':>8} {'99 %':>8} {'within ' + str(promised):>12}")
    for kind, each in lasting.items():
        share = 100 * np.mean(np.array(each) <= promised)
        print(f"{kind:20} {len(each):8} {np.median(each):8.0f} {np.percentile(each, 99):8.0f} {share:10.1f} %")


if __name__ == "__main__":
    main()
