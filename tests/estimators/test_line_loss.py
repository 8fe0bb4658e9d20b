"""A stated loss of lines is subtracted from the pressures that an estimator learns from, and again at run time."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.line_loss import FLOW_SIGNS, LineLoss
from cylinder_friction.recordings.recording import Recording, RecordingError

LINES = {name: LineLoss(bar=1.5, speed_m_s=0.1) for name in FLOW_SIGNS}


@pytest.fixture(scope="module")
def behind_lines(labelled_recordings: list[Recording]) -> list[Recording]:
    """Recordings whose pressures are those at sensors behind lines, as their metadata state."""
    made = []
    for each in labelled_recordings[:3]:
        velocity_m_s = each.column("velocity_m_s")
        lost = {name: line.lost_pa(FLOW_SIGNS[name] * velocity_m_s) for name, line in LINES.items()}
        raised = each.with_columns(**{name: each.column(name) + lost[name] for name in lost})
        made.append(replace(raised, metadata=replace(raised.metadata, line_loss=LINES)))
    return made


def error_n(estimator: FrictionEstimator, recording: Recording) -> float:
    missed_n = np.abs(estimator.estimate(recording) - recording.column("friction_n"))
    return float(missed_n[recording.usable()].mean())


@pytest.mark.parametrize("kind", ["low_pass", "ridge"])
def test_what_is_stated_is_not_taken_for_friction(
    kind: str, cylinder: Cylinder, labelled_recordings: list[Recording], behind_lines: list[Recording]
) -> None:
    make = {
        "low_pass": lambda: LowPassForceBalanceEstimator(cylinder),
        "ridge": lambda: RidgeEstimator(lags=6),
    }[kind]
    at_chambers, behind = labelled_recordings[2], behind_lines[2]
    best_n = error_n(make().fit(labelled_recordings[:2]), at_chambers)
    stated = make().fit(behind_lines[:2])
    assert stated.line_loss == LINES
    assert error_n(stated, behind) < 1.25 * best_n
    silent = [each.described(line_loss={}) for each in behind_lines]
    assert error_n(make().fit(silent[:2]), silent[2]) > 5.0 * best_n


def test_all_its_steps_are_one_and_a_saved_model_keeps_it(
    cylinder: Cylinder, behind_lines: list[Recording], tmp_path: Path
) -> None:
    estimator = LowPassForceBalanceEstimator(cylinder).fit(behind_lines)
    recording = behind_lines[2]
    estimate_n, stream = estimator.estimate(recording), estimator.stream()
    assert [stream.step(*sample) for sample in recording.samples()[:300].tolist()] == estimate_n[:300].tolist()
    newtons, _ = RealTimeStream(estimator.step_model()).run(recording.readings())
    np.testing.assert_array_equal(newtons[:, 0], estimate_n)
    estimator.save(tmp_path)
    again = load_estimator(tmp_path)
    assert again.line_loss == LINES
    np.testing.assert_array_equal(again.estimate(recording), estimate_n)
    lost = "pressure_1_pa = reading - loss of its line (1.5 bar at 0.1 m/s ± 75 %)"
    assert again.step_model().applied().startswith(lost)


def test_a_kind_without_a_step_leaves_it_in(cylinder: Cylinder, behind_lines: list[Recording]) -> None:
    lugre = LugreEstimator(cylinder, population=4, generations=1, simulated_recordings=1)
    assert lugre.fit(behind_lines[:1]).line_loss == {}


def test_lines_that_lose_nothing_are_not_kept_and_different_ones_refused(behind_lines: list[Recording]) -> None:
    ported = behind_lines[0].described(line_loss={name: LineLoss(bar=0.0) for name in FLOW_SIGNS})
    assert RidgeEstimator(lags=6).fit([ported]).line_loss == {}
    with pytest.raises(RecordingError, match=r"mappings disagree: .*loss of its line.*; neither sign nor offset"):
        RidgeEstimator(lags=6).fit([behind_lines[0], ported])
