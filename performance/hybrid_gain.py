"""What the hybrid, or the model that `adapt` writes instead, gains over a tuned low-pass in new sessions.

    python performance/hybrid_gain.py [--model models/hybrid] [--seed N] [--worlds NAME ...]

The model is adapted to machines that `sentences.py` simulates, each with another option of the bench, and tested on
sessions that it did not see. A row per machine: mean absolute error against true friction, each recording's mean error
taken off, in percent of mean friction, of the low-pass and of the model that was written, and the ratio of both.
"""

import argparse
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from sentences import ONLY_INTERVALS, WORLDS, World, simulated, write_logs

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import Recording

SESSIONS = 6
"""Sessions of each condition, of which every third is held out."""
MACHINES = {
    **WORLDS,
    **ONLY_INTERVALS,
    "line stated": World(options={"line_loss_bar": 3.0}, line_stated=1.0),
}
CHOSEN = (
    "default rig",
    "friction free of pressure",
    "zeros as stated",
    "zeros kept",
    "asymmetry by condition",
    "line stated",
    "noisy position",
    "100 Hz",
)


def main() -> None:
    """Print a row per machine."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"), help="to adapt")
    parser.add_argument("--seed", type=int, default=141)
    parser.add_argument("--worlds", nargs="*", default=CHOSEN, choices=MACHINES, metavar="NAME")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    source = load_estimator(arguments.model)
    assert isinstance(source, HybridEstimator)
    print(f"{'machine':28}{'low-pass %':>12}{'written %':>12}{'ratio':>8}  written")
    for name in arguments.worlds:
        print(row(name, source, MACHINES[name], arguments.seed), flush=True)


def row(name: str, source: HybridEstimator, world: World, seed: int) -> str:
    """Adapt the model to one machine, and compare it with the low-pass on other sessions."""
    made = simulated(world, seed, quick=False, sessions=SESSIONS)
    with tempfile.TemporaryDirectory() as scratch:
        mapping = write_logs(made, Path(scratch))
        read = read_recordings(Path(scratch) / "logs", mapping, made.cylinder)
    true_n = {each.metadata.name: each.truth["friction_n"].to_numpy() for each in made.recorded}
    labelled = label(read, made.cylinder)
    sessions = sorted({each.metadata.session for each in labelled})
    new = set(sessions[2::3])
    train = [each for each in labelled if each.metadata.session not in new]
    test = [each for each in labelled if each.metadata.session in new]
    inputs = (*SAMPLE_COLUMNS, *({LOAD_FORCE} & {*train[0].columns}))
    low_pass = LowPassForceBalanceEstimator(made.cylinder, inputs=inputs).fit(train)
    written = source.adapt(train, made.cylinder)
    errors = [error_percent(model, test, true_n) for model in (low_pass, written)]
    cells = "".join(f"{each:12.2f}" for each in errors)
    return f"{name:28}{cells}{errors[1] / errors[0]:8.2f}  {written.kind}"


def error_percent(model: FrictionEstimator, test: Sequence[Recording], true_n: dict[str, Array]) -> float:
    """Measure the error against true friction, less each recording's mean error [% of mean friction]."""
    errors, levels = [], []
    for each in test:
        usable, truth_n = each.usable(), true_n[each.name]
        error_n = (model.estimate(each) - truth_n)[usable]
        errors.append(np.abs(error_n - error_n.mean()))
        levels.append(np.abs(truth_n[usable]))
    return 100.0 * float(np.concatenate(errors).mean() / np.concatenate(levels).mean())


if __name__ == "__main__":
    main()
