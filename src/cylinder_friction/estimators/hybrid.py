"""The hybrid of LSTM and random forest, for any inputs.

``force_balance``, the default: an LSTM corrects a tuned low-pass of the force balance, and a forest
corrects the residual of the LSTM. Without raw pressures, LSTM and forest give all of friction.
``paper``: an LSTM reads both pressures and velocity, filtered as published, and a random forest turns
its last hidden state into the estimate. Without its forest, either design is the LSTM alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.adaptation import (
    ADAPTATION_PLAN,
    adaptation_inputs,
    adapted_in_words,
    feature_places,
    left_out_in_words,
    refuse_few_strokes,
)
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.forest import FOREST_FILE, ForestPlan, fit_forest
from cylinder_friction.estimators.front_end import Design, FrontEnd, fit_front_end
from cylinder_friction.estimators.gain import Gain
from cylinder_friction.estimators.held_out import folds, held_out_for_stopping
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.estimators.onnx_files import read_forest, read_network, write_forest, write_network
from cylinder_friction.estimators.training_plan import (
    Architecture,
    Checkpoint,
    EpochReport,
    SequenceData,
    TrainingCurve,
    TrainingPlan,
)
from cylinder_friction.extras import explained
from cylinder_friction.labelling.offset_tracker import fit_offset_tracker, zeros_are_known
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.sensor_offset import OffsetTracker
from cylinder_friction.realtime.trained_for import TrainedFor
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

NETWORK_FILE = "network.onnx"
DEFAULT_FOREST = ForestPlan()


@dataclass(frozen=True)
class HybridParts:
    """The parts of a trained hybrid: filters, network, forest, and the forces that the network's output stands for [N].

    ``HybridEstimator.parts`` holds them after ``fit``, None before. Pass them as ``start`` to ``fit`` to train on.
    """

    design: Design  # Which parts are combined, and how
    front_end: FrontEnd  # Filters, history and scaling
    network: LstmWeights  # The LSTM
    forest: Forest | None  # The forest; None for the LSTM alone
    target_mean_n: float  # Force that the network's output 0 stands for [N]
    target_scale_n: float  # Force that its output 1 adds to that [N]


class HybridEstimator(FrictionEstimator):
    """LSTM and random forest on causally filtered samples: the most accurate estimator of this package.

    Use it if you have labelled recordings of some ten minutes or more; with a few minutes ``adapt`` a trained one. It
    needs the extra ``train`` to fit, and none to estimate. Training takes minutes on one core, a step microseconds.
    With raw pressures it corrects a tuned low-pass of the force balance. On the sessions that ``fit`` gets beside those
    to train on, it scales the correction by the share that holds there, so a correction that gains nothing is dropped.
    ``gain`` then states both errors; None: there were no such sessions, or nothing to correct.

    Args:
        cylinder: Its areas; needed for ``fit`` alone.
        design: ``force_balance``, ``paper`` or ``full``, see ``fit_front_end``.
        architecture: Layers, nodes, dropout and learning rate of the LSTM; None for the default.
        plan: Epochs and batches of its training; None for the default.
        forest_plan: Size of the forest; None for the LSTM alone.
        seed: Seeds weights, dropout, batch order and bootstrap.
        device: ``cpu`` or ``cuda``, for training.
        inputs: Columns of a sample; ``position_m`` must be among them.
        tracker: How the sensors' offset is learned, if known from elsewhere; None: ``fit`` finds it, if recordings
            state their identified zeros.
        lag_s: Delay after which friction is estimated [s]; see ``FrictionEstimator``.
        position_load: The load that position decides, see ``labelling.load.pooled_load``; None: a load is among the
            inputs, or there is none.

    Raises:
        RecordingError: ``fit`` got no recordings, or recordings of different sample times.
        ValueError: An input is missing, or ``fit`` is called on a loaded estimator without a cylinder.

    Example:
        >>> from dataclasses import replace
        >>> plan = cf.HybridEstimator(cylinder).plan
        >>> small = cf.HybridEstimator(cylinder, plan=replace(plan, epochs=1)).fit(train)
        >>> comparison = cf.compare({"hybrid": small}, test)
    """

    kind: ClassVar[str] = "hybrid"
    shown: ClassVar[tuple[str, ...]] = ("design", "architecture", "forest_plan")

    def __init__(
        self,
        cylinder: Cylinder | None = None,
        design: Design = "force_balance",
        architecture: Architecture | None = None,
        plan: TrainingPlan | None = None,
        forest_plan: ForestPlan | None = DEFAULT_FOREST,
        seed: int = 0,
        device: str = "cpu",
        inputs: Sequence[str] = SAMPLE_COLUMNS,
        tracker: OffsetTracker | None = None,
        lag_s: float = 0.0,
        position_load: PositionLoad | None = None,
    ) -> None:
        super().__init__(inputs, lag_s)
        self.position_load = position_load
        self.offset = self._tracker = tracker
        self.cylinder, self.design, self.forest_plan = cylinder, design, forest_plan
        self.architecture, self.plan = architecture or Architecture(), plan or TrainingPlan()
        self.seed, self.device = seed, device
        self.learning_curve = TrainingCurve()
        self.gain: Gain | None = None
        self.parts: HybridParts | None = None

    def fit(
        self,
        recordings: Sequence[Recording],
        validation: Sequence[Recording] | None = None,
        calibration: Sequence[Recording] = (),
        checkpoint: Checkpoint | None = None,
        report: EpochReport | None = None,
        start: HybridParts | None = None,
    ) -> Self:
        """Fit front end, network and forest; if zeros were identified, fit the tracker of the sensors' offset too.

        Args:
            recordings: Labelled recordings.
            validation: Labelled recordings of other sessions, which stop the network's training, decide the
                share of the correction and calibrate the bounds; None: whole sessions of ``recordings`` are held
                out for that, see ``held_out_for_stopping``, or none if the plan's ``patience`` is None, and then
                there are no bounds.
            calibration: Labelled recordings of further sessions; they count for the share, and calibrate the bounds
                instead of ``validation``.
            checkpoint: State of the network's training, kept after each epoch.
            report: Called after each epoch with its number and both mean absolute errors [N].
            start: A trained hybrid of the same layers; the training continues from its network, see ``adapt``.
        """
        if self.cylinder is None:
            raise ValueError("a hybrid needs a cylinder to be fitted; got a loaded one without")
        train = recordings
        if validation is None:
            stops = self.plan.patience is not None
            train, validation = held_out_for_stopping(recordings) if stops else (recordings, ())
        zeroed = self._begin_fit(train)
        self.offset = self._tracker or _tracker_of(list(map(self._with_load, train)), self.cylinder, self.channels)
        front_end = fit_front_end(self.design, self.cylinder, zeroed, self.channels)
        sequences = [_correction(front_end, each) for each in zeroed]
        stopping = [_correction(front_end, self._training_recording(each)) for each in validation]
        begin = None if start is None else (start.network, feature_places(start.front_end.names, front_end.names))
        network, self.learning_curve, mean_n, scale_n = train_correction(
            self.architecture, self.plan, sequences, stopping, self.seed, self.device, checkpoint, report, begin
        )
        self._set(HybridParts(self.design, front_end, network, None, mean_n, scale_n))
        if self.forest_plan is not None:
            self._set(replace(self._fitted(), forest=self._fit_forest(sequences, self.forest_plan)))
        self.guard = self.bounds = self.trained_for = None
        self._keep_what_holds(self._corrections([*validation, *calibration]))
        self.bounds_by_noise = ()
        if calibration or validation:
            self.calibrate(train, calibration or validation, self.cylinder)
        return self

    def adapt(
        self,
        recordings: Sequence[Recording],
        cylinder: Cylinder,
        position_load: PositionLoad | None = None,
        plan: TrainingPlan | None = None,
        bounds: bool = True,
    ) -> HybridEstimator | LowPassForceBalanceEstimator:
        """Make a model for another cylinder from this hybrid and a few labelled recordings of that cylinder.

        It is a hybrid, or, if the correction gains nothing, the tuned low-pass with the same tracker and bounds.

        - Scaled by areas: only the force balance P1·A1 - P2·A2; velocities and learned weights are not scaled.
        - Fitted anew: low-pass of the force balance, mean and scale of every feature and of the correction, forest,
          bounds, guard, ranges, and, if the recordings state identified zeros, the tracker of the sensors' offset.
        - Trained further: all weights of the network. A new feature, such as a load, begins without influence.
        - Kept: design, layers, nodes, size of the forest, lag. The sample time is that of the recordings.

        For the bounds, the training is repeated without some of the sessions, and that model estimates them, until each
        session was left out once (cross-conformal prediction: Vovk 2015), see ``folds``. The correction is scaled by
        the share that holds on these sessions, see ``gain``. ``trained_for`` states this model's hash and what the
        bounds rest on.

        Args:
            recordings: Labelled recordings of the other cylinder. A load in ``load_force_n`` becomes an input.
            cylinder: The other cylinder.
            position_load: Its load, if position decides it; then ``load_force_n`` is no input.
            plan: Epochs and batches of the training; None: ``ADAPTATION_PLAN``.
            bounds: Whether to calibrate bounds; training then takes about four times as long.

        Raises:
            RecordingError: There are too few recordings, or the piston slides too briefly in one direction.
        """
        source = self._fitted()
        groups, rests_on = folds(recordings) if bounds else ([], "")
        others = [[one for group in groups if group is not own for one in group] for own in groups]
        for some in (recordings, *others):
            refuse_few_strokes(some)
        inputs = adaptation_inputs(self.inputs, recordings, position_load)
        architecture = replace(self.architecture, dropout=0.0, learning_rate=Architecture.learning_rate)
        settings = architecture, plan or ADAPTATION_PLAN, self.forest_plan, self.seed, self.device, inputs
        result, *without = (
            HybridEstimator(cylinder, self.design, *settings, None, self.lag_s, position_load).fit(
                some, (), start=source
            )
            for some in (recordings, *others)
        )
        if groups:
            pairs = [pair for each, own in zip(without, groups, strict=True) for pair in each._corrections(own)]
            for each in (result, *without):
                each._keep_what_holds(pairs)
            left_out = [recording for own in groups for recording in own]
            estimates_n = [each._stepped(one) for each, own in zip(without, groups, strict=True) for one in own]
            result.calibrate(recordings, left_out, cylinder, estimates_n)
            rests_on += left_out_in_words([each.lagged(result.lag_samples) for each in left_out], estimates_n)
        where = result.trained_for or TrainedFor.of(recordings, cylinder)
        result.trained_for = replace(where, adapted=adapted_in_words(self.saved_hash(), recordings, rests_on))
        return result._low_pass(recordings) if result.gain is not None and result.gain.share == 0.0 else result

    def _low_pass(self, recordings: Sequence[Recording]) -> LowPassForceBalanceEstimator:
        """Make the tuned low-pass that this hybrid corrects, with the hybrid's tracker and bounds."""
        assert self.cylinder is not None
        low_pass = LowPassForceBalanceEstimator(self.cylinder, inputs=self.inputs)
        low_pass.position_load, low_pass.lag_s = self.position_load, self.lag_s
        low_pass.fit(recordings)._copy_fitted(self)
        low_pass.bounds, low_pass.bounds_by_noise = self.bounds, self.bounds_by_noise
        low_pass.trained_for = self.trained_for
        return low_pass

    def without_forest(self) -> HybridEstimator:
        """Copy this hybrid without its forest: the LSTM alone."""
        parts = replace(self._fitted(), forest=None)
        settings = (self.design, self.architecture, self.plan, None, self.seed, self.device)
        alone = HybridEstimator(self.cylinder, *settings)
        alone._copy_fitted(self)
        alone._set(parts)
        return alone

    def multiply_adds(self) -> int:
        parts = self._fitted()
        trees = 0 if parts.forest is None else parts.forest.comparisons()
        return parts.front_end.multiply_adds() + parts.network.multiply_adds() + trees

    def step_model(self) -> StepModel:
        """Return what one real-time step needs; see ``FrictionEstimator.step_model``."""
        parts = self._fitted()
        paper = parts.design == "paper"
        return self._step_model(
            **parts.front_end.step_fields(),
            network=parts.network,
            forest=parts.forest,
            forest_sees="nothing" if parts.forest is None else "hidden" if paper else "hidden_head_features",
            head_counts=parts.forest is None or not paper,
            target_mean_n=parts.target_mean_n,
            target_scale_n=parts.target_scale_n,
        )

    def _set(self, parts: HybridParts) -> None:
        self.parts = parts
        self.files = (NETWORK_FILE,) if parts.forest is None else (NETWORK_FILE, FOREST_FILE)
        self.design = parts.design

    def _fitted(self) -> HybridParts:
        self._refuse_unfitted()
        assert self.parts is not None
        return self.parts

    def _corrections(self, recordings: Sequence[Recording]) -> list[Array]:
        """Compute the correction of the base force, and the wanted one, in each recording's usable rows [N].

        Each has shape ``(2, rows)``; a recording without usable rows has none.
        """
        pairs = []
        for each in map(self._training_recording, recordings):
            wanted = _correction(self._fitted().front_end, each)
            off_n = self.advance(self.new_state(), each.samples(self.channels)) - each.column("friction_n")
            if wanted.usable.any():
                pairs.append(np.stack([wanted.target + off_n, wanted.target])[:, wanted.usable])
        return pairs

    def _keep_what_holds(self, pairs: Sequence[Array]) -> None:
        """Scale the correction, both the network's and the forest's, by the share that holds; see ``Gain.of``."""
        parts = self._fitted()
        self.gain = Gain.of(pairs) if pairs and parts.front_end.has_base else None
        if self.gain is not None:
            share = self.gain.share
            mean_n, scale_n = share * parts.target_mean_n, share * parts.target_scale_n
            self._set(replace(parts, target_mean_n=mean_n, target_scale_n=scale_n))

    def _fit_forest(self, train: Sequence[SequenceData], plan: ForestPlan) -> Forest:
        """Fit the forest on the label (paper) or on the residual of the LSTM."""
        parts = self._fitted()
        inputs, targets = list[NDArray[Any]](), list[NDArray[Any]]()
        for each in train:
            hidden, head = parts.network.run(each.features)
            target = (each.target - parts.target_mean_n) / parts.target_scale_n
            inputs.append(forest_input(parts.design, hidden, head, each.features)[each.usable])
            targets.append((target if parts.design == "paper" else target - head)[each.usable])
        return fit_forest(np.concatenate(inputs), np.concatenate(targets), plan, self.seed)

    def _write(self, folder: Path) -> dict[str, Any]:
        parts = self._fitted()
        write_network(parts.network, folder / NETWORK_FILE)
        if parts.forest is not None:
            write_forest(parts.forest, folder / FOREST_FILE)
        return {
            "design": parts.design,
            "front_end": parts.front_end.to_dict(),
            "network": NETWORK_FILE,
            "forest": None if parts.forest is None else FOREST_FILE,
            "target_mean_n": parts.target_mean_n,
            "target_scale_n": parts.target_scale_n,
        }

    @classmethod
    def _read(cls, folder: Path, parameters: dict[str, Any]) -> Self:
        network = read_network(folder / NETWORK_FILE)
        forest = None if parameters["forest"] is None else read_forest(folder / FOREST_FILE)
        architecture = replace(Architecture(), layers=network.layers, nodes=network.nodes)
        plan = None if forest is None else replace(DEFAULT_FOREST, trees=len(forest.roots), depth=forest.depth)
        estimator = cls(None, parameters["design"], architecture, None, plan)
        estimator._set(
            HybridParts(
                parameters["design"],
                FrontEnd.from_dict(parameters["front_end"]),
                network,
                forest,
                parameters["target_mean_n"],
                parameters["target_scale_n"],
            )
        )
        return estimator


def train_correction(
    architecture: Architecture,
    plan: TrainingPlan,
    train: Sequence[SequenceData],
    validation: Sequence[SequenceData],
    seed: int,
    device: str = "cpu",
    checkpoint: Checkpoint | None = None,
    report: EpochReport | None = None,
    begin: tuple[LstmWeights, Sequence[int | None]] | None = None,
) -> tuple[LstmWeights, TrainingCurve, float, float]:
    """Train an LSTM on targets in newtons; return it, its learning curve, and mean and scale of the targets [N].

    Output 0 stands for the mean, and 1 adds the scale. Arguments are those of ``train_network``, and all errors are in
    newtons. With ``begin`` the training continues from those weights, see ``network_from``.
    """
    with explained():  # PyTorch: an extra that only training needs
        from cylinder_friction.estimators.training import FrictionNetwork, network_from, train_network, weights_of

    usable_n = np.concatenate([each.target[each.usable] for each in train])
    mean_n, scale_n = float(usable_n.mean()), float(usable_n.std()) or 1.0

    def scaled(sequences: Sequence[SequenceData]) -> list[SequenceData]:
        return [replace(each, target=((each.target - mean_n) / scale_n).astype(np.float32)) for each in sequences]

    network, curve = train_network(
        lambda inputs: FrictionNetwork(architecture, inputs) if begin is None else network_from(architecture, *begin),
        architecture.learning_rate,
        plan,
        scaled(train),
        scaled(validation),
        seed,
        device,
        checkpoint,
        None if report is None else lambda epoch, *maes: report(epoch, *(scale_n * mae for mae in maes)),
    )
    in_newtons = TrainingCurve(
        [scale_n * mae for mae in curve.train_mae], [scale_n * mae for mae in curve.validation_mae], curve.best_epoch
    )
    return weights_of(network), in_newtons, mean_n, scale_n


def forest_input(design: Design, hidden: Any, head: Any, features: Any) -> Any:
    """Assemble the forest's input, float32: the last hidden state alone in ``paper``, else also head and features.

    Shapes: ``hidden`` ``(rows, nodes)``, ``head`` ``(rows,)``, ``features`` ``(rows, features)``; the result has one
    row per sample and its columns in this order. Training, the step, C and FMU all assemble it in this way.
    """
    if design == "paper":
        return hidden
    return np.concatenate([hidden, head[:, None], features], axis=1)


def _tracker_of(recordings: Sequence[Recording], cylinder: Cylinder, inputs: tuple[str, ...]) -> OffsetTracker | None:
    """Fit the tracker of the sensors' offset; None if no offset was identified with enough certainty."""
    if not (all(each.metadata.identified_zero for each in recordings) and set(SAMPLE_COLUMNS) <= set(inputs)):
        return None
    return fit_offset_tracker(recordings, cylinder, inputs) if zeros_are_known(recordings) else None


def _correction(front_end: FrontEnd, recording: Recording) -> SequenceData:
    """Compute a recording's features and its target: the label less the force that is corrected [N]."""
    features, base_n = front_end.run(recording.samples(front_end.inputs))
    return SequenceData(features, recording.column("friction_n") - base_n, recording.usable())
