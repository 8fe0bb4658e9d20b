"""The product's estimators on the servo rig: scores, table, and the command."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.friction_models.identification.procedure import SearchEffort
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.rig.campaign_plan import CampaignPlan
from friction_benchmark.campaigns import labelled_campaign
from friction_benchmark.cli import main
from friction_benchmark.servo_rig import evaluation
from friction_benchmark.servo_rig.evaluation import (
    DEFAULT_RIG_CYLINDER,
    EvaluationPlan,
    Score,
    evaluate,
    half_interval_points,
    percent,
    table,
)
from friction_benchmark.servo_rig.sessions import CONDITIONS, SessionPlan, record_sessions

if TYPE_CHECKING:
    from pathlib import Path

TINY = SessionPlan(sessions=3, duration_s=8.0)


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    quick_search = partial(AnalyticalEstimator, effort=SearchEffort(0, 4, 2, 1))
    monkeypatch.setattr(evaluation, "AnalyticalEstimator", quick_search)


@pytest.fixture(scope="module")
def elsewhere() -> list[Recording]:
    plan = CampaignPlan(sessions_per_condition=1, recordings_per_session=1, duration_s=8.0)
    return [each.recording for each in labelled_campaign(plan, DEFAULT_RIG_CYLINDER)]


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize("mounting", ["horizontal", "vertical"])
def test_every_estimator_is_scored_in_every_test_session(elsewhere: list[Recording], mounting: str) -> None:
    duration_s = 8.0 if mounting == "horizontal" else 20.0
    plan = EvaluationPlan(SessionPlan(0, 3, duration_s, mounting), epochs=1, twin_rigs=1, twin_effort=0.005)  # type: ignore[arg-type]
    scores = evaluate(plan, elsewhere)
    names = list(dict.fromkeys(score.estimator for score in scores))
    assert names == [
        "off-line label",
        "hybrid",
        "ridge",
        "force balance, low-pass",
        "force balance, unfiltered",
        "pressure-scaled LuGre",
        "elsewhere: hybrid",
        "elsewhere: ridge",
        "elsewhere: force balance, low-pass",
        "twin: hybrid",
    ]
    sessions = {score.session for score in scores}
    assert len(sessions) == 6
    assert len(scores) == len(names) * len(sessions)
    assert all(np.isfinite(score.error_n) and score.offset_free_n > 0.0 for score in scores)
    label = [score for score in scores if score.estimator == "off-line label"]
    assert {score.label_n for score in label} == {0.0}
    if mounting == "horizontal":
        assert percent(label) < 12.0
    printed = table(scores)
    assert all(name in printed for name in names)
    assert "Nearest to true friction: " in printed


def test_sessions_are_scored_against_their_own_truth() -> None:
    session = record_sessions(TINY)[0]
    labelled = evaluation.labelled_sessions([session], TINY)[0]
    score = evaluation.scored("off by 7 N", labelled, session.true_friction_n + 7.0, session)
    rows = int(labelled.usable().sum())
    assert score.error_n == pytest.approx(7.0 * rows)
    assert score.offset_free_n == pytest.approx(0.0, abs=1e-6)
    assert score.friction_n == pytest.approx(np.abs(session.true_friction_n[labelled.usable()]).sum())
    assert percent([score, score]) == pytest.approx(700.0 * rows / score.friction_n)


def test_the_table_states_who_is_nearest_and_how_often() -> None:
    scores = [made("off-line label", condition, 1.0) for condition in CONDITIONS]
    scores += [made("ridge", condition, error) for condition, error in zip(CONDITIONS, (4.0, 4.0, 4.0), strict=True)]
    scores += [made("hybrid", condition, error) for condition, error in zip(CONDITIONS, (3.0, 5.0, 2.5), strict=True)]
    printed = table(scores)
    assert "Nearest to true friction: hybrid, 3.50 %; then ridge, 4.00 %; the first is ahead in 2 of 3 test" in printed
    assert "hybrid          3.00 (3.00)" in printed


def test_the_interval_goes_by_how_much_sessions_of_a_condition_differ() -> None:
    """Errors of 2 and 4 %, twice: a deviation of 1 point, and Student's t of two degrees of freedom."""
    scores = [made("ridge", condition, error) for condition in "12" for error in (2.0, 4.0)]
    assert half_interval_points(scores) == pytest.approx(4.303 * 2.0**0.5 / 2.0, rel=1e-3)


def made(name: str, condition: str, error_n: float) -> Score:
    return Score(name, condition, f"session {condition}", 100.0, error_n, error_n, error_n)


def test_recordings_of_another_cylinder_are_refused() -> None:
    foreign = [each.recording for each in record_sessions(SessionPlan(sessions=1, duration_s=4.0))]
    with pytest.raises(RecordingError, match=r"recording 'servo1_session01': cylinder is 'servo 40/25 x 300', but exp"):
        evaluate(EvaluationPlan(TINY, epochs=1), foreign)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_the_command_prints_the_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], elsewhere: list[Recording]
) -> None:
    monkeypatch.chdir(tmp_path)
    for recording in elsewhere:
        write_recording(tmp_path / "labelled", recording)
    small = ["--sessions", "3", "--duration-s", "8", "--epochs", "1", "--twin-rigs", "0"]
    assert main(["servo-rig", *small, "--elsewhere", "labelled"]) == 0
    assert capsys.readouterr().out.startswith("Error against true friction")


def test_a_folder_that_is_not_there_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    assert main(["servo-rig", "--elsewhere", str(tmp_path / "nothing")]) == 1
    assert "nothing: no such folder of recordings" in capsys.readouterr().err
