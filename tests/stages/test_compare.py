"""The compare stage: what it reads, what it leaves behind, and what it refuses."""

import json
import re
import shutil
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.analytical import AnalyticalEstimator
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import ForceBalanceEstimator, LowPassForceBalanceEstimator, RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.evaluation.known_notes import notes_of
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.params.checking import Params
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages import compare
from cylinder_friction.stages._stage import (
    BEST_FILE,
    CHOSEN_FILE,
    FILTERS_FILE,
    FINALS_FILE,
    INGESTED_FILE,
    OFFSET_FILE,
    SPACE_FILE,
)
from shipped_params import shipped

TRUTH_FOLDER = Path("data/raw/rig_truth")


def tiny_params(truth: str = TRUTH_FOLDER.as_posix(), main: str = "hybrid") -> Params:
    """Only what the stage reads; what earlier stages decided lies in their files."""
    write_json(INGESTED_FILE, {"source": "data/raw/rig", "truth": truth, "load": "none"})
    write_json(OFFSET_FILE, {"left_alone_because": "offset.identify is never", "sessions": []})
    quick = {"figure_duration_s": 2.0, "autocorrelation_lags": 40, "timing_repeats": 5, "maximum_lag_s": 0.1}
    return shipped(compare={"main": main, **quick})


@pytest.fixture(scope="module")
def finished(
    tmp_path_factory: pytest.TempPathFactory, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> tuple[Path, RunRecord]:
    """A folder in which the stage has run once, and its record; read only."""
    folder = tmp_path_factory.mktemp("compare")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        write_what_it_reads(cylinder, labelled_recordings)
        return folder, compare.run(tiny_params())


def write_what_it_reads(cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    train, condition = labelled_recordings[::2], labelled_recordings[1::2]
    for recording in condition:
        write_recording(Path("data/processed/test"), recording)
        TRUTH_FOLDER.mkdir(parents=True, exist_ok=True)
        truth = recording.table[["time_s", "friction_n", "velocity_m_s"]]
        truth = truth.assign(friction_n=truth["friction_n"] + 1.0)
        truth.to_parquet(TRUTH_FOLDER / f"{recording.name}.parquet")
    models: dict[str, FrictionEstimator] = {
        "hybrid": RidgeEstimator(12),
        "lstm": RidgeEstimator(2),
        "paper_hybrid": ForceBalanceEstimator(cylinder, "paper"),
        "lugre/lugre": ForceBalanceEstimator(cylinder, "paper"),
        "lugre/pressure_lugre": RidgeEstimator(1),
        "lugre/pressure_lugre_all": RidgeEstimator(1),
        "baselines/force_balance_low_pass": LowPassForceBalanceEstimator(cylinder),
        "baselines/force_balance_unfiltered": ForceBalanceEstimator(cylinder, "none"),
        "baselines/a_users_own": RidgeEstimator(3),
    }
    for name, estimator in models.items():
        estimator.fit(train)
        estimator.save(Path("models") / name)
    for name in ("hybrid", "paper_hybrid"):
        curve = {"epoch": [1, 2], "train_mae_n": [9.0, 5.0], "validation_mae_n": [9.5, 6.0], "best_epoch": 2}
        write_json(Path("models") / name / "learning_curve.json", curve)
    chosen = {"layers": 1, "nodes": 8, "dropout": 0.0, "learning_rate": 1e-3, "forest_trees": 4, "forest_depth": 3}
    write_json(Path("models/hybrid") / CHOSEN_FILE, chosen)
    write_json(Path("models/paper_hybrid") / CHOSEN_FILE, chosen | {"nodes": 77})
    write_json(BEST_FILE, chosen | {"nodes": 99, "design": "paper"})
    write_json(FILTERS_FILE, {"method": "moving_average"})
    ranges = {"learning_rate": [1e-3, 1e-2], "forest_trees": [4, 8], "forest_depth": [3, 5]}
    write_json(FINALS_FILE, [{"params": {"layers": 1, "nodes": 8}, "errors_n": [5.0, 6.0], "multiply_adds": 99}])
    write_json(SPACE_FILE, {"layers": [1], "nodes": [8], "dropout": [0.0], **ranges})
    write_json(Path("reports/runs/train.json"), {"kept": True})
    write_json(Path("data/processed/audit/audit.json"), {"savitzky_golay": {"all": {"steady": {"mae_n": 12.25}}}})


def test_the_stage_leaves_everything_whole_and_others_files_alone(finished, labelled_recordings, monkeypatch):
    folder, record = finished
    monkeypatch.chdir(folder)
    metrics = json.loads(compare.METRICS_FILE.read_text())
    headline = json.loads(compare.HEADLINE_FILE.read_text())
    assert sorted(headline) == ["against", "hybrid", "hybrid_label", "hybrid_worst", "low_pass", "lugre", "paper"]
    assert headline["against"] == "truth"
    errors = [each["truth_percent"] for each in metrics["hybrid"].values()]
    assert headline["hybrid"] == pytest.approx(np.mean(errors), abs=1e-3)
    assert headline["hybrid_worst"] == pytest.approx(max(errors), abs=1e-3)
    assert ", ".join(compare.load_estimators()) == (
        "lugre, pressure_lugre, pressure_lugre_all, force_balance_unfiltered, force_balance_low_pass, a_users_own, "
        "lstm, paper_hybrid, hybrid"
    )
    assert set(metrics) == set(compare.load_estimators())
    held_out = labelled_recordings[1]
    estimate = load_estimator(Path("models/hybrid")).estimate(held_out)
    error = np.abs(estimate - held_out.column("friction_n"))
    expected = 100 * error.mean() / np.abs(held_out.column("friction_n")).mean()
    assert metrics["hybrid"]["1"]["label_percent"] == pytest.approx(expected)
    assert record.params["reference"] == "truth"
    assert record.metrics["truth_error_percent/condition_1"] == metrics["hybrid"]["1"]["truth_percent"]
    table = pd.DataFrame(record.tables["errors_by_condition"]).set_index(["estimator", "condition"])
    assert sorted(table.index) == [(name, condition) for name in sorted(metrics) for condition in metrics[name]]
    assert table.loc[("hybrid", "1"), "label_percent"] == round(metrics["hybrid"]["1"]["label_percent"], 2)
    assert metrics["hybrid"]["1"]["truth_mae_n"] != metrics["hybrid"]["1"]["label_mae_n"]
    session = f"label_percent_of_{held_out.metadata.session}"
    assert metrics["hybrid"]["1"][session] == pytest.approx(expected)
    assert metrics["hybrid"]["1"]["multiply_adds"] == 36
    assert all(Path(path).exists() for path in record.artifacts)
    assert len(list(compare.FIGURES_FOLDER.glob("*.png"))) == 11
    assert {path.suffix for path in compare.PLOTS_FOLDER.iterdir()} == {".csv"}
    assert set(json.loads(compare.TIMINGS_FILE.read_text())) == set(metrics)
    assert "a users own" in compare.TABLE_FILE.read_text()
    assert "12.25" in compare.REPORT_FILE.read_text()
    assert json.loads(Path("reports/runs/train.json").read_text()) == {"kept": True}
    assert not list(Path("reports").glob(".*"))


@pytest.mark.extended
def test_without_truth_there_is_none_anywhere_and_figures_are_of_the_estimator_that_compare_main_names(
    finished, tmp_path, monkeypatch
):
    for part in ("data", "models"):
        shutil.copytree(finished[0] / part, tmp_path / part)
    monkeypatch.chdir(tmp_path)
    write_json(Path("data/processed/audit/audit.json"), {"note": "true friction is unknown here"})
    for path in [*Path("data/processed/test").glob("condition[34]*")]:  # two are enough to compare on
        path.unlink()
    record = compare.run(tiny_params(main="paper_hybrid", truth="data/raw/nothing_known"))
    report = compare.REPORT_FILE.read_text()
    assert "true friction is unknown here" in report
    assert "truth" not in compare.METRICS_FILE.read_text() + compare.HEADLINE_FILE.read_text()
    assert "True friction is not known" in compare.TABLE_FILE.read_text()
    assert "the mean absolute error of the hybrid as published is" in record.note
    # the paper's own, so that no title adds a hybrid
    assert "Figure 8: estimated against calculated friction" in report
    assert "The hybrid as published against the label." in report
    assert [path.name for path in compare.FIGURES_FOLDER.glob("figure7*")] == ["figure7_residuals_paper_hybrid.png"]
    assert "search, which was over the published design. Used: what the hybrid as published of this report" in report
    nodes = re.search(r"<td>LSTM nodes per layer</td>(.*?)</tr>", report)
    assert nodes is not None
    assert re.findall(r"<td>(.*?)</td>", nodes[1]) == ["8", "99", "77", "16, 32, 64", "64, 64, 64"]


def test_notes_state_what_is_known_of_label_design_and_load(cylinder, labelled_recordings):
    lugre, everywhere, hybrid = LugreEstimator(cylinder, "1"), AnalyticalEstimator(cylinder, LuGre()), HybridEstimator()
    estimators: dict[str, FrictionEstimator] = {"lugre": lugre, "pressure_lugre_all": everywhere, "hybrid": hybrid}
    notes = partial(notes_of, estimators)
    assert notes(labelled_recordings, "rts") == {
        "label": "off line, looks ahead",
        "lugre": "identified in condition 1",
        "hybrid": "corrects the force balance",
    }
    hybrid.design = "paper"
    assert notes(labelled_recordings, "moving_average") == {
        "label": "off line, late: causal moving averages",
        "lugre": "identified in condition 1",
        "hybrid": "of the published design",
    }
    lifting = [each.with_columns(load_force_n=np.linspace(-20.0, 2500.0, len(each))) for each in labelled_recordings]
    assert notes(lifting, "rts")["lugre"] == "identified in condition 1, under a load of -20 to 2500 N"


def test_a_model_that_is_missing_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FileNotFoundError, match="models/baselines: no such folder of baselines; run `dvc repro`"):
        compare.load_estimators()
    Path("models/baselines").mkdir(parents=True)
    with pytest.raises(FileNotFoundError, match="models/lugre/lugre"):
        compare.load_estimators()
