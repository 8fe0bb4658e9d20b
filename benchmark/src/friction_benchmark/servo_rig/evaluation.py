"""The product's estimators on the servo rig, trained there and trained elsewhere, against its true friction.

What is trained elsewhere - on labelled recordings of the default rig, or on the true friction of rigs of its kind drawn
at random - is applied as it is: pressures are converted to those at which that rig's piston is pushed as hard, and the
logger samples at that rig's rate. Sensor offsets are identified before training, as by the pipeline; a hybrid learns
those of each test session from a cold start.
"""

import copy
import warnings
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.evaluation.sessions import half_width_points
from cylinder_friction.execution.progress import progress
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.offset_identification import fit_offset_model
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.columns import LOAD_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.splits import split
from cylinder_friction.rig.campaign_plan import CampaignPlan
from friction_benchmark.campaigns import labelled_campaign, twin_campaign
from friction_benchmark.models.learned_gain import MODELS, LearnedGain
from friction_benchmark.registry import BuildConfiguration, Estimator
from friction_benchmark.servo_rig.parameters import CYLINDER
from friction_benchmark.servo_rig.sessions import CONDITIONS, ServoSession, SessionPlan, as_seen_by, record_sessions

DEFAULT_RIG_CYLINDER = Cylinder(
    name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
SMALL_CAMPAIGN = CampaignPlan(sessions_per_condition=3, recordings_per_session=1, duration_s=40.0)
"""What is simulated where no folder of recordings is given: twelve sessions of the default rig."""
LABEL = "off-line label"
ELSEWHERE = "elsewhere: "  # Before the names of estimators that were trained on the default rig
OFFSET_LEFT = "hybrid, offset left"  # The same hybrid where it learns the sensors' offset, if it did not
TWIN = "twin: hybrid"
TWIN_S = 30.0  # Duration of a recording on a rig of the twin [s]
COLUMN = 23  # Characters of a column of the table


@dataclass(frozen=True)
class EvaluationPlan:
    """What is recorded and how the hybrid is trained."""

    sessions: SessionPlan = field(default_factory=SessionPlan)
    test_sessions: int = 2  # In each condition
    epochs: int = TrainingPlan.epochs  # Of the hybrid; the rest of its training is the product's default
    twin_rigs: int = 16  # Of the default rig's kind, that the twin's hybrid is trained on; none without it
    twin_effort: float = 0.2  # Share of its full training


@dataclass(frozen=True)
class Score:
    """Absolute errors in one test session, sums over its usable rows [N]."""

    estimator: str
    condition: str
    session: str
    friction_n: float  # Absolute true friction
    error_n: float  # Against true friction
    offset_free_n: float  # What is left of it without the mean error, most of which is the sensors' zeros
    label_n: float  # Against the off-line label


def evaluate(plan: EvaluationPlan, elsewhere: Sequence[Recording] | None = None) -> list[Score]:
    """Return every estimator's scores in every test session; equal arguments give equal scores.

    ``elsewhere`` are labelled recordings of the default rig; else ``SMALL_CAMPAIGN`` is simulated at this rig's rate.
    """
    foreign = _of_the_default_rig(elsewhere, plan.sessions.sample_time_s)
    train, test, truth = prepared(plan, plan.sessions)
    inputs = SAMPLE_COLUMNS if plan.sessions.mounting == "horizontal" else (*SAMPLE_COLUMNS, LOAD_FORCE)
    made = _estimators(CYLINDER, inputs, plan.epochs)
    made["pressure-scaled LuGre"] = lambda: AnalyticalEstimator(CYLINDER, LuGre(pressure_scaled=True), inputs)
    scores = [scored(LABEL, each, each.column("friction_n"), truth[each.name]) for each in test]
    for name, estimator in _fitted(made, train, "train on the servo rig").items():
        scores += [scored(name, each, estimator.estimate(each), truth[each.name]) for each in test]
    return scores + _from_elsewhere(plan, foreign)


def prepared(
    plan: EvaluationPlan, recorded: SessionPlan
) -> tuple[list[Recording], list[Recording], dict[str, ServoSession]]:
    """Return labelled recordings for training and test, free of identified offsets, and all sessions by name."""
    sessions = record_sessions(recorded)
    train, test = split(labelled_sessions(sessions, recorded), plan.test_sessions)
    if recorded.mounting == "horizontal":  # a load identified from position has absorbed the offsets
        offsets = fit_offset_model(train, CYLINDER)
        train, test = offsets.corrected(train), offsets.corrected(test)
    return train, test, {each.recording.name: each for each in sessions}


def labelled_sessions(sessions: Sequence[ServoSession], plan: SessionPlan) -> list[Recording]:
    """Return the recordings with the product's default label; a vertical rig's load is identified by position."""
    load: LoadMode = "none" if plan.mounting == "horizontal" else "position"
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "filter windows are in samples")  # this rig is logged at 250 Hz
        return label([each.recording for each in sessions], CYLINDER, load=load)


def scored(name: str, recording: Recording, estimate_n: Array, session: ServoSession) -> Score:
    """Return an estimate's errors on the usable rows of a labelled recording."""
    usable = recording.usable()
    truth_n = session.true_friction_n[usable]
    error_n = estimate_n[usable] - truth_n
    off_label_n = estimate_n[usable] - recording.column("friction_n")[usable]
    sums = (float(np.abs(each).sum()) for each in (truth_n, error_n, error_n - error_n.mean(), off_label_n))
    return Score(name, recording.metadata.condition, recording.metadata.session, *sums)


def percent(scores: Sequence[Score], error: str = "error_n") -> float:
    """Return an error of sessions together, in percent of their absolute true friction."""
    return 100.0 * sum(getattr(each, error) for each in scores) / sum(each.friction_n for each in scores)


def half_interval_points(scores: Sequence[Score]) -> float:
    """Return half the 95 % interval [points] of one estimator's percentage, by how much its sessions differ."""
    deviations = {}
    for condition in dict.fromkeys(each.condition for each in scores):
        here = [each for each in scores if each.condition == condition]
        friction_n, error_n = np.array([(each.friction_n, each.error_n) for each in here]).T
        deviations[condition] = (100.0 * error_n - percent(here) * friction_n) / friction_n.mean()
    return half_width_points(deviations, list(deviations))


def table(scores: Sequence[Score]) -> str:
    """Return the table: percent of mean |true friction|, by condition with each test session's value, and who wins."""
    grouped: defaultdict[str, list[Score]] = defaultdict(list)
    for each in scores:
        grouped[each.estimator].append(each)
    wide = max(map(len, grouped)) + 2
    titles = [*(condition.title for condition in CONDITIONS.values()), "all", "offset-free", "against label"]
    brackets = "(in brackets: each test session; ±: 95 % interval by sessions)"
    lines = [f"Error against true friction, % of its mean {brackets}", _line(wide, "", titles)]
    for name, own in grouped.items():
        cells = []
        for condition in CONDITIONS:
            here = [each for each in own if each.condition == condition]
            cells.append(f"{percent(here):.2f} ({' '.join(f'{percent([each]):.2f}' for each in here)})")
        cells.append(f"{percent(own):.2f} ± {half_interval_points(own):.2f}")
        cells += [f"{percent(own, error):.2f}" for error in ("offset_free_n", "label_n")]
        lines.append(_line(wide, name, cells))
    return "\n".join([*lines, "", *_sentences(grouped)])


def _line(wide: int, name: str, cells: Sequence[str]) -> str:
    """Return a line of the table; the last three columns are narrow, one number each."""
    *conditions, every, offset_free, label_alone = cells
    columns = "".join(cell.ljust(COLUMN) for cell in conditions)
    return f"{name:<{wide}}{columns}{every:>13}{offset_free:>15}{label_alone:>15}"


def _sentences(grouped: dict[str, list[Score]]) -> list[str]:
    """Return who is nearest to true friction, and in how many test sessions; with and without the sessions' offsets."""
    named = {name: own for name, own in grouped.items() if name != LABEL}
    sentences = []
    asked = {"error_n": "Nearest to true friction", "offset_free_n": "Nearest without each session's offset"}
    for error, words in asked.items():
        first, second = sorted(named, key=lambda name: percent(named[name], error))[:2]
        pairs = list(zip(named[first], named[second], strict=True))
        ahead = sum(getattr(one, error) < getattr(other, error) for one, other in pairs)
        sentences.append(
            f"{words}: {first}, {percent(named[first], error):.2f} %; then {second}, "
            f"{percent(named[second], error):.2f} %; the first is ahead in {ahead} of {len(pairs)} test sessions."
        )
    return sentences


def _of_the_default_rig(given: Sequence[Recording] | None, sample_time_s: float) -> Sequence[Recording]:
    """Return the labelled recordings given, or a small campaign; refuse those of another cylinder."""
    if given is None:
        small = replace(SMALL_CAMPAIGN, sample_time_s=sample_time_s)
        return [each.recording for each in labelled_campaign(small, DEFAULT_RIG_CYLINDER)]
    for each in given:
        if each.metadata.cylinder != DEFAULT_RIG_CYLINDER.name:
            raise RecordingError(
                f"recording {each.name!r}: cylinder is {each.metadata.cylinder!r}, but expected the default rig's, "
                f"{DEFAULT_RIG_CYLINDER.name!r}, by whose areas pressures are converted; give recordings of that rig"
            )
    return given


def _from_elsewhere(plan: EvaluationPlan, elsewhere: Sequence[Recording]) -> list[Score]:
    """Return the scores of estimators that were trained on the default rig and are applied here as they are."""
    made = _estimators(DEFAULT_RIG_CYLINDER, SAMPLE_COLUMNS, plan.epochs)
    del made["force balance, unfiltered"]  # it learns nothing, there as here
    if not any(each.metadata.identified_zero for each in elsewhere):
        elsewhere = fit_offset_model(elsewhere, DEFAULT_RIG_CYLINDER).corrected(elsewhere)
    as_logged = replace(plan.sessions, sample_time_s=elsewhere[0].sample_time_s)
    fitted: dict[str, Estimator] = {
        ELSEWHERE + name: each for name, each in _fitted(made, elsewhere, "train on the default rig").items()
    }
    if plan.twin_rigs:
        fitted[TWIN] = _twin_trained(plan, as_logged.sample_time_s)
    _, test, truth = prepared(plan, as_logged)
    areas = (DEFAULT_RIG_CYLINDER.piston_area_m2, DEFAULT_RIG_CYLINDER.annulus_area_m2)
    scores = []
    for name, estimator in fitted.items():
        for recording in test:
            load_n = recording.column(LOAD_FORCE) if LOAD_FORCE in recording.columns else 0.0
            estimate_n = estimator.estimate(as_seen_by(recording, areas, load_n))
            scores.append(scored(name, recording, estimate_n, truth[recording.name]))
    return scores


def _twin_trained(plan: EvaluationPlan, sample_time_s: float) -> LearnedGain:
    """Return the hybrid trained on the true friction of rigs of the default rig's kind, each drawn at random."""
    model = next(one for one in MODELS if one.trained_on == "twin")
    rigs = twin_campaign(0, plan.twin_rigs, TWIN_S, DEFAULT_RIG_CYLINDER, sample_time_s=sample_time_s)
    build = BuildConfiguration(DEFAULT_RIG_CYLINDER, SAMPLE_COLUMNS, 0, plan.twin_effort, model.defaults)
    return LearnedGain(build).fit([each.recording for each in rigs])


def _fitted(
    made: Mapping[str, Callable[[], FrictionEstimator]], recordings: Sequence[Recording], what: str
) -> dict[str, FrictionEstimator]:
    """Return the estimators, fitted, with a progress bar."""
    bar = progress(made.items(), what, unit="estimator")
    fitted = {name: make().fit(recordings) for name, make in bar}
    if fitted["hybrid"].offset is not None:
        fitted[OFFSET_LEFT] = copy.copy(fitted["hybrid"])
        fitted[OFFSET_LEFT].offset = None
    return fitted


def _estimators(cylinder: Cylinder, inputs: Sequence[str], epochs: int) -> dict[str, Callable[[], FrictionEstimator]]:
    """Return how each of the product's estimators is made, by name."""
    plan = TrainingPlan(epochs=epochs)
    return {
        "hybrid": lambda: HybridEstimator(cylinder, plan=plan, inputs=inputs),
        "ridge": lambda: RidgeEstimator(inputs=inputs),
        "force balance, low-pass": lambda: LowPassForceBalanceEstimator(cylinder, inputs=inputs),
        "force balance, unfiltered": lambda: ForceBalanceEstimator(cylinder, inputs=inputs),
    }
