"""How far the real-time bounds and flags can be trusted: coverage and recovery on the test recordings.

Run from the repository's root after `dvc repro`: `python performance/real_time_trust.py [models/hybrid]`.
"""

import sys
from pathlib import Path

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.evaluation.strata import StrataLimits, strata_masks
from cylinder_friction.realtime.bounds import REGIMES, regimes_of
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored

LIMITS = StrataLimits(1e-3, 16e-3, 0.1)
LENGTHS = (1, 20, 200, 1000)
AFTER = 4000


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
    """Print how far estimates are from the undisturbed ones once RECOVERING is over, by how long samples were invalid.

    The tracker of the sensors' offset remembers what it has seen of a session, so that small differences stay.
    """
    generator = np.random.default_rng(0)
    found: dict[tuple[str, int], list[Array]] = {}
    stream = RealTimeStream(model)
    for recording in recordings:
        samples = recording.samples()
        stream.reset()
        undisturbed, _ = stream.run(samples)
        for kind in ("not a number", "frozen"):
            for channels in ([0], [1], [2], [0, 1, 2]):
                for length in LENGTHS:
                    start = int(generator.integers(1000, len(samples) - length - AFTER))
                    end = start + length
                    corrupted = samples[: end + AFTER].copy()
                    corrupted[start:end, channels] = np.nan if kind == "not a number" else samples[start - 1, channels]
                    stream.reset()
                    newtons, _ = stream.run(corrupted)
                    since = slice(end + model.guard.recovery_samples, end + AFTER)
                    own, expected = newtons[since], undisturbed[since, 0]
                    within = (own[:, 1] <= expected) & (expected <= own[:, 2])
                    found.setdefault((kind, length), []).append(np.stack([np.abs(own[:, 0] - expected), within]))
    print(f"\n{'invalid samples':24} {'rows':>8} {'median':>8} {'95 %':>8} {'99 %':>8} {'between bounds':>15}")
    for (kind, length), each in found.items():
        distance_n, within = np.concatenate(each, axis=1)
        quantiles = "".join(f"{np.quantile(distance_n, share):7.2f} N" for share in (0.5, 0.95, 0.99))
        print(f"{kind + ', ' + str(length):24} {len(within):8} {quantiles} {100 * within.mean():13.1f} %")


if __name__ == "__main__":
    main()
