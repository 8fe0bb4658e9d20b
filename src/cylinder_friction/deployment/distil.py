"""A smaller network trained to imitate a larger estimator: distillation (Hinton, Vinyals and Dean 2015).

The student is one LSTM layer on the original's own front end. It is trained on the original's estimates instead of
labels, because they have no noise of the labels. The loss in accuracy is measured on recordings of other sessions.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator, train_correction
from cylinder_friction.estimators.training_plan import Architecture, SequenceData, TrainingPlan
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_stored

PLAN = TrainingPlan(epochs=40, patience=12, sequence_length=200, burn_in=100, batch_size=16, schedule="cosine")
LEARNING_RATE = 5e-3


@dataclass(frozen=True)
class DistilReport:
    """Accuracy and cost of original and student on held-out recordings; errors are means over usable rows."""

    # Mean absolute error against the labels [N]
    original_mae_n: float
    student_mae_n: float
    difference_n: float  # Mean absolute difference between the two [N]
    # Operations of one step
    original_multiply_adds: int
    student_multiply_adds: int

    def text(self) -> str:
        """Write the report in a few lines."""
        cost = self.student_mae_n / self.original_mae_n - 1.0
        return (
            f"original    {self.original_mae_n:.2f} N mean absolute error, "
            f"{self.original_multiply_adds} operations per step\n"
            f"student     {self.student_mae_n:.2f} N ({cost:+.1%}), {self.student_multiply_adds} operations per step\n"
            f"difference  {self.difference_n:.2f} N on average"
        )


def distil(
    original: HybridEstimator,
    nodes: int,
    train: Sequence[Recording],
    validation: Sequence[Recording],
    held_out: Sequence[Recording],
    plan: TrainingPlan = PLAN,
    seed: int = 0,
) -> tuple[HybridEstimator, DistilReport]:
    """Train an LSTM of one layer with ``nodes`` nodes, without a forest, that imitates ``original``; report its cost.

    The targets are the estimates of ``original`` on the usable rows of ``train``. ``validation`` stops the training and
    calibrates the bounds; the report is about ``held_out``. All recordings are labelled.

    Raises:
        ValueError: ``nodes`` is not positive, or the original is not fitted.
    """
    if nodes < 1:
        raise ValueError(f"nodes must be at least 1, but got {nodes!r}")
    if original.parts is None:
        raise ValueError("the hybrid to distil is not fitted yet; call fit or load first")
    parts = original.parts
    architecture = Architecture(1, nodes, 0.0, LEARNING_RATE)

    def imitation_data(recording: Recording) -> SequenceData:
        """Compute features, and as the target the original's correction of the base force [N]."""
        samples = original._training_recording(recording).samples(original.channels)
        features, base_n = parts.front_end.run(samples)
        return SequenceData(features, original.advance(original.new_state(), samples) - base_n, recording.usable())

    sequences, stopping = ([imitation_data(recording) for recording in part] for part in (train, validation))
    network, curve, mean_n, scale_n = train_correction(architecture, plan, sequences, stopping, seed)
    student = HybridEstimator(original.cylinder, parts.design, architecture, plan, None, seed)
    student._copy_fitted(original)
    student._set(replace(parts, network=network, forest=None, target_mean_n=mean_n, target_scale_n=scale_n))
    student.learning_curve = curve
    student.calibrate(train, validation)
    student.guard, student.trained_for = original.guard or student.guard, original.trained_for
    return student, compare(original, student, held_out)


def distil_from_folder(original: HybridEstimator, nodes: int, folder: Path) -> tuple[HybridEstimator, DistilReport]:
    """Distil with the recordings in ``train``, ``validation`` and ``test`` of a folder; the last are held out."""
    train, validation, test = (read_stored(folder / role) for role in ("train", "validation", "test"))
    return distil(original, nodes, train, validation, test)


def compare(original: FrictionEstimator, student: FrictionEstimator, recordings: Sequence[Recording]) -> DistilReport:
    """Compare student and original on labelled recordings."""
    rows = []
    for recording in recordings:
        columns = (recording.column("friction_n"), original.estimate(recording), student.estimate(recording))
        rows.append(np.stack(columns)[:, recording.usable()])
    label, imitated, imitation = np.concatenate(rows, axis=1)
    return DistilReport(
        original_mae_n=float(np.abs(imitated - label).mean()),
        student_mae_n=float(np.abs(imitation - label).mean()),
        difference_n=float(np.abs(imitation - imitated).mean()),
        original_multiply_adds=original.multiply_adds(),
        student_multiply_adds=student.multiply_adds(),
    )
