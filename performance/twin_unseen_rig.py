"""Is the hybrid trained on the twin closer to true friction than the off-line label is, on rigs it has never seen?

    python performance/twin_unseen_rig.py 6 64

Six unseen rigs, after training on 64 others; a third number, in (0, 1], is the effort of training. Every unseen rig is
drawn from the whole range of rigs of this size, with four sessions in each of the four conditions. The hybrid trained
on the twin has seen none of it. The tuned low-pass and the default hybrid are trained on the labels of its first two
sessions. All are scored on the other two, against true friction: MAE in percent of mean |friction|, block-bootstrap
intervals of 95 %. The off-line label looks ahead (zero-phase Savitzky-Golay); the others do not.
"""

from __future__ import annotations

import sys
from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.forest import ForestPlan
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.rig.campaign import CampaignPlan
from friction_benchmark.bootstrap import block_sums, bootstrap_percent, interval
from friction_benchmark.campaigns import labelled_campaign, twin_campaign
from friction_benchmark.registry.learned_gain import MODELS
from friction_benchmark.registry.model import BuildConfiguration

if TYPE_CHECKING:
    from cylinder_friction.arrays import Array, Mask
    from cylinder_friction.estimators.base import FrictionEstimator
    from friction_benchmark.cases import LabelledRecording

FIRST_SEED = 2_000
TRAINING_SESSIONS, SESSIONS = 2, 4
BLOCK_SAMPLES, REPEATS = 400, 2_000
LABEL, TWIN = "off-line label", "trained on the twin"

Piece = tuple["Array", "Array", "Mask"]
"""True friction, estimate and mask of one recording."""


def twin_trained(cylinder: Cylinder, rigs: int, effort: float) -> FrictionEstimator:
    """Return the hybrid trained on so many simulated rigs, as the benchmark builds it before any tuning."""
    model = next(one for one in MODELS if one.trained_on == "twin")
    estimator = model.build(BuildConfiguration(cylinder, SAMPLE_COLUMNS, 0, effort, model.defaults))
    estimator.fit([labelled.recording for labelled in twin_campaign(0, rigs, 30.0, cylinder)])
    return estimator


def rivals(cylinder: Cylinder, effort: float) -> dict[str, FrictionEstimator]:
    """Return those trained on the unseen rig's own labels; the hybrid with the settings of ``params.yaml``."""
    return {
        "tuned low-pass": LowPassForceBalanceEstimator(cylinder),
        "default hybrid": HybridEstimator(
            cylinder,
            "force_balance",
            Architecture(1, 48, 0.0, 5e-3),
            TrainingPlan(max(2, round(40 * effort)), 12, 200, 100, 16),
            ForestPlan(64, 10, 15_000, 10),
            seed=1,
        ),
    }


def scored(cylinder: Cylinder, twin: FrictionEstimator, seed: int, effort: float) -> dict[tuple[str, str], list[Piece]]:
    """Return an unseen rig's pieces by condition and estimator."""
    plan = CampaignPlan(
        seed=seed, sessions_per_condition=SESSIONS, recordings_per_session=2, duration_s=30.0, specimen="wide"
    )
    everything = labelled_campaign(plan, cylinder)
    training = [one.recording for one in everything if _session(one) <= TRAINING_SESSIONS]
    estimators = rivals(cylinder, effort)
    for estimator in estimators.values():
        estimator.fit(training)
    pieces: defaultdict[tuple[str, str], list[Piece]] = defaultdict(list)
    for one in everything:
        if _session(one) > TRAINING_SESSIONS:
            recording, condition = one.recording, one.recording.metadata.condition
            assert one.true_friction_n is not None
            found = {name: each.estimate(recording) for name, each in {TWIN: twin, **estimators}.items()}
            for name, estimate in {LABEL: recording.column("friction_n"), **found}.items():
                pieces[condition, name].append((one.true_friction_n, estimate, recording.usable()))
    return dict(pieces)


def _session(one: LabelledRecording) -> int:
    return int(one.recording.metadata.session[-2:])


def draws_of(pieces: list[Piece]) -> tuple[float, Array]:
    """Return the percentage and its bootstrap draws; equal recordings give equal blocks, so that draws pair."""
    truths, estimates = [truth for truth, _, _ in pieces], [estimate for _, estimate, _ in pieces]
    sums = block_sums(truths, estimates, [usable for _, _, usable in pieces], BLOCK_SAMPLES)
    percent = 100.0 * sums.abs_error_n.sum() / sums.abs_friction_n.sum()
    return float(percent), bootstrap_percent(sums, REPEATS, seed=0)


def line(title: str, by_name: dict[str, list[Piece]]) -> tuple[str, float]:
    """Return one line of the table, and the lower end of how far the twin's hybrid is below the label [%]."""
    found = {name: draws_of(pieces) for name, pieces in by_name.items()}
    words = []
    for name, (percent, draws) in found.items():
        low, high = interval(draws)
        words.append(f"{name} {percent:5.2f} [{low:.2f}, {high:.2f}]")
    low, high = interval(found[LABEL][1] - found[TWIN][1])
    gain = found[LABEL][0] - found[TWIN][0]
    return f"{title:22s}{'   '.join(words)}   below the label by {gain:.2f} [{low:.2f}, {high:.2f}]", low


def main(arguments: list[str]) -> int:
    """Print the table; returns 1 where the hybrid is not below the label outside the interval, over all rigs."""
    given = [*arguments, *("6", "64", "1.0")[len(arguments) :]]
    rigs, training_rigs, effort = int(given[0]), int(given[1]), float(given[2])
    cylinder = Cylinder(**yaml.safe_load(Path("params.yaml").read_text(encoding="utf-8"))["cylinder"])
    twin = twin_trained(cylinder, training_rigs, effort)
    pooled: defaultdict[str, defaultdict[str, list[Piece]]] = defaultdict(lambda: defaultdict(list))
    for number in range(rigs):
        for (condition, name), pieces in scored(cylinder, twin, FIRST_SEED + number, effort).items():
            for title in (f"rig {number + 1}", f"condition {condition}, all rigs", "all"):
                pooled[title][name] += pieces
        sys.stdout.write(line(f"rig {number + 1}", pooled[f"rig {number + 1}"])[0] + "\n")
        sys.stdout.flush()
    for title in sorted(pooled):
        if title.startswith("condition"):
            sys.stdout.write(line(title, pooled[title])[0] + "\n")
    words, low = line("all", pooled["all"])
    sys.stdout.write(words + "\n")
    return 0 if low > 0.0 else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
