"""A smaller network that is taught by a larger estimator: distillation (Hinton, Vinyals and Dean 2015).

The pupil is one LSTM layer on the teacher's own front end, trained on the teacher's estimates in place of labels: they
carry what the teacher knows without the labels' noise. What it costs is measured on recordings of other sessions.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.estimators.front_end import FrontEndBlock
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, LearningCurve, SequenceData, TrainingPlan
from cylinder_friction.realtime.guard import largest_friction_n
from cylinder_friction.recordings.storage import read_recordings

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.hybrid import HybridParts
    from cylinder_friction.recordings.recording import Recording

    Array = NDArray[np.float64]

PLAN = TrainingPlan(epochs=40, patience=12, sequence_length=200, burn_in=100, batch_size=16, schedule="cosine")
LEARNING_RATE = 5e-3


@dataclass(frozen=True)
class DistilReport:
    """What a smaller network costs, on recordings that neither learnt from; errors are means over usable rows.

    Attributes:
        teacher_mae_n, pupil_mae_n: Mean absolute error against the labels [N].
        apart_n: Mean absolute difference between the two [N].
        teacher_multiply_adds, pupil_multiply_adds: Of one step.
    """

    teacher_mae_n: float
    pupil_mae_n: float
    apart_n: float
    teacher_multiply_adds: int
    pupil_multiply_adds: int

    def text(self) -> str:
        """Return the report as a few lines."""
        cost = self.pupil_mae_n / self.teacher_mae_n - 1.0
        teacher, pupil = f"{self.teacher_multiply_adds} operations", f"{self.pupil_multiply_adds} operations"
        return (
            f"teacher  {self.teacher_mae_n:.2f} N mean absolute error, {teacher} a step\n"
            f"pupil    {self.pupil_mae_n:.2f} N ({cost:+.1%}), {pupil} a step\n"
            f"apart    {self.apart_n:.2f} N on average"
        )


def distil(
    teacher: HybridEstimator,
    nodes: int,
    train: Sequence[Recording],
    validation: Sequence[Recording],
    held_out: Sequence[Recording],
    plan: TrainingPlan = PLAN,
    seed: int = 0,
) -> tuple[HybridEstimator, DistilReport]:
    """Return an LSTM of one layer that imitates ``teacher``, without a forest, and what it costs.

    Args:
        teacher: A fitted hybrid, with or without a forest.
        nodes: Of the pupil's layer.
        train: Labelled recordings; the teacher's estimates on their usable rows are learnt.
        validation: Stops the training, and calibrates the pupil's bounds.
        held_out: Labelled recordings for the report.
        plan: Of the training.
        seed: Of weights, dropout and order.

    Raises:
        ValueError: ``nodes`` is not positive, or the teacher is not fitted.
    """
    if nodes < 1:
        raise ValueError(f"nodes must be at least 1, but got {nodes!r}")
    if teacher.parts is None:
        raise ValueError("the teacher is not fitted yet; call fit or load first")
    from cylinder_friction.estimators.training import FrictionNetwork, train_network, weights_of

    parts = teacher.parts
    lessons = [_Lesson.of(teacher, parts, recording) for recording in train]
    exams = [_Lesson.of(teacher, parts, recording) for recording in validation]
    taught = np.concatenate([lesson.left_n[lesson.usable] for lesson in lessons])
    mean_n, scale_n = float(taught.mean()), float(taught.std()) or 1.0
    architecture = Architecture(1, nodes, 0.0, LEARNING_RATE)
    network, curve = train_network(
        lambda inputs: FrictionNetwork(architecture, inputs),
        architecture.learning_rate,
        plan,
        [lesson.sequence(mean_n, scale_n) for lesson in lessons],
        [exam.sequence(mean_n, scale_n) for exam in exams],
        seed,
    )
    pupil = HybridEstimator(teacher.cylinder, parts.design, architecture, plan, None, seed, inputs=teacher.inputs)
    pupil.sample_time_s, pupil.training_range = teacher.sample_time_s, teacher.training_range
    pupil._set(replace(parts, network=weights_of(network), forest=None, target_mean_n=mean_n, target_scale_n=scale_n))
    pupil.learning_curve = LearningCurve(
        [scale_n * mae for mae in curve.train_mae], [scale_n * mae for mae in curve.validation_mae], curve.best_epoch
    )
    pupil.calibrate(largest_friction_n(train), validation)
    return pupil, compare(teacher, pupil, held_out)


def distil_from_folder(teacher: HybridEstimator, nodes: int, folder: Path) -> tuple[HybridEstimator, DistilReport]:
    """Distils with the recordings in ``train``, ``validation`` and ``test`` of a folder; the last are held out."""
    train, validation, test = (read_recordings(folder / role) for role in ("train", "validation", "test"))
    return distil(teacher, nodes, train, validation, test)


def compare(teacher: FrictionEstimator, pupil: FrictionEstimator, recordings: Sequence[Recording]) -> DistilReport:
    """Return what the pupil costs on labelled recordings."""
    rows = []
    for recording in recordings:
        columns = (recording.column("friction_n"), teacher.estimate(recording), pupil.estimate(recording))
        rows.append(np.stack(columns)[:, recording.usable()])
    label, taught, learnt = np.concatenate(rows, axis=1)
    return DistilReport(
        teacher_mae_n=float(np.abs(taught - label).mean()),
        pupil_mae_n=float(np.abs(learnt - label).mean()),
        apart_n=float(np.abs(learnt - taught).mean()),
        teacher_multiply_adds=teacher.multiply_adds(),
        pupil_multiply_adds=pupil.multiply_adds(),
    )


@dataclass(frozen=True)
class _Lesson:
    """One recording as the pupil sees it: features, what the teacher adds to the base force [N], usable rows."""

    features: NDArray[np.float32]
    left_n: Array
    usable: NDArray[np.bool_]

    @classmethod
    def of(cls, teacher: HybridEstimator, parts: HybridParts, recording: Recording) -> _Lesson:
        block = FrontEndBlock(parts.front_end)
        features, base_n = block.advance(block.new_state(), recording.samples(teacher.inputs))
        return cls(features, teacher.estimate(recording) - base_n, recording.usable())

    def sequence(self, mean_n: float, scale_n: float) -> SequenceData:
        """Return the lesson in the units of the network."""
        return SequenceData(self.features, ((self.left_n - mean_n) / scale_n).astype(np.float32), self.usable)
