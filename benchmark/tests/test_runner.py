"""The whole benchmark on made campaigns: complete, cached, the same whoever does the work, honest about failures."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.params.file import ParamsError
from cylinder_friction.recordings.storage import read_stored, write_recording
from friction_benchmark.conclusions import findings_of
from friction_benchmark.datasets import Sources, _read, cases_of, folds_of
from friction_benchmark.plan import Plan
from friction_benchmark.runner import Runner
from friction_benchmark.scoring import ScoreSettings
from friction_benchmark.tasks import task_named
from friction_benchmark_models import CYLINDER, MODULES, SIZES, without_times, write_campaign, write_own

if TYPE_CHECKING:
    from pathlib import Path

    from friction_benchmark.results import BenchmarkResults

SETTINGS = ScoreSettings(
    maximum_lag_s=0.05,
    standstill_velocity_m_s=1e-3,
    stribeck_velocity_m_s=8e-3,
    reversal_window_s=0.1,
    bootstrap_repeats=50,
    bootstrap_block_s=1.0,
)
PLAN = Plan(
    tasks=("identity", "pressure_free", "external_load"),
    splits={
        "leave_one_load_out": ("identity",),
        "leave_one_temperature_out": ("identity",),
        "unseen_rig": ("identity",),
    },
    seeds=(0, 1),
    effort=0.5,
    trials=2,
    modules=MODULES,
)
KNOWN = ("low_pass", "hold", "constant_by_direction", "ridge")
ADDED = """
from cylinder_friction.estimators.linear import RidgeEstimator
from friction_benchmark.registry import RegisteredModel

def build(configuration):
    return RidgeEstimator(3, 1.0)

MODELS = (RegisteredModel("added", "Added", "modern", "own", build),)
"""


def made_runner(folder: Path, plan: Plan = PLAN, workers: int = 1) -> Runner:
    sources = Sources(folder / "campaigns", SIZES, CYLINDER)
    for seed in (0, 1):
        for kind in ("campaign", "loaded", "unseen"):
            if not sources.campaign_folder(kind, seed).is_dir():
                write_campaign(sources, kind, seed, sessions=1 if kind == "unseen" else 3)
    return Runner(plan, sources, folder, SETTINGS, workers)


@pytest.fixture(scope="module")
def runner(tmp_path_factory: pytest.TempPathFactory) -> Runner:
    return made_runner(tmp_path_factory.mktemp("benchmark"))


@pytest.fixture(scope="module")
def results(runner: Runner) -> BenchmarkResults:
    return runner.run()


def found(results: BenchmarkResults, task: str, split: str = "held_out_sessions") -> Any:
    return next(one for one in results.tasks if (one.task, one.split) == (task, split))


def test_every_task_and_split_of_the_plan_has_its_leaderboard(results: BenchmarkResults) -> None:
    assert [(one.task, one.split) for one in results.tasks] == [
        ("identity", "held_out_sessions"),
        ("pressure_free", "held_out_sessions"),
        ("external_load", "held_out_sessions"),
        ("identity", "leave_one_load_out"),
        ("identity", "leave_one_temperature_out"),
        ("identity", "unseen_rig"),
    ]
    assert results.missing == {}
    assert results.budget["seeds"] == 2


def test_leaderboards_hold_every_model_that_supports_the_inputs_best_first(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    assert [entry.model for entry in identity.entries[:1]] != ["hold"]
    assert {entry.model for entry in identity.entries} == {"low_pass", "hold", "constant_by_direction", "ridge"}
    percents = [entry.score.percent.value for entry in identity.entries]
    assert percents == sorted(percents)
    for entry in identity.entries:
        assert entry.score.percent.low <= entry.score.percent.value <= entry.score.percent.high
        assert set(entry.seeds) == {"0", "1"}
        assert set(entry.by_condition) == {"1", "2", "3", "4"}


def test_models_that_cannot_or_that_failed_are_named_with_the_reason(results: BenchmarkResults) -> None:
    assert found(results, "identity").missing == {
        "raises": "seed 0: ValueError: cannot learn this",
        "nan": "seed 0: ValueError: estimate is nan in row 1 of recording 'condition1_session03_recording01'",
    } or found(results, "identity").missing["nan"].startswith("seed 0: ValueError: estimate is nan in row 1")
    missing = found(results, "pressure_free").missing
    assert missing["ridge"] == "it needs more than position_m, oil_temperature_c"
    assert missing["raises"] == "seed 0: ValueError: cannot learn this"


def test_only_what_has_a_space_is_tuned_and_says_what_was_chosen(results: BenchmarkResults) -> None:
    tuned = {entry.model: set(entry.tuning) for entry in found(results, "identity").entries}
    assert tuned == {
        "ridge": {"lags", "penalty", "validation_percent"},
        "low_pass": set(),
        "hold": set(),
        "constant_by_direction": set(),
    }


def test_the_baseline_is_level_with_itself_and_others_are_measured_against_it(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    baseline = next(entry for entry in identity.entries if entry.model == identity.baseline)
    assert baseline.below_baseline is not None
    assert (baseline.below_baseline.low, baseline.below_baseline.high) == (0.0, 0.0)
    hold = next(entry for entry in identity.entries if entry.model == "hold")
    assert hold.below_baseline is not None
    assert hold.below_baseline.value == pytest.approx(baseline.score.percent.value - hold.score.percent.value)
    assert hold.below_baseline.high < 0.0


def test_truth_and_label_are_never_mixed(results: BenchmarkResults) -> None:
    identity, load = found(results, "identity"), found(results, "external_load")
    assert (identity.reference, load.reference) == ("label", "truth")
    assert identity.label_truth_percent is not None
    assert identity.label_truth_percent.value == pytest.approx(100.0 * 5.0 / load.mean_friction_n, rel=0.05)
    for entry in load.entries:
        assert entry.extras["truth_percent"] == pytest.approx(entry.score.percent.value)


def test_friction_and_load_make_up_the_force(results: BenchmarkResults) -> None:
    """An estimate wrong by so much leaves the load wrong by as much, but for noise and the low-pass."""
    for entry in found(results, "external_load").entries:
        assert entry.extras["load_mae_n"] == pytest.approx(entry.score.mae_n, abs=40.0)
        assert entry.extras["load_percent"] == pytest.approx(100.0 * entry.extras["load_mae_n"] / 500.0)


def test_every_estimate_has_bounds_and_a_flag(results: BenchmarkResults) -> None:
    for entry in found(results, "identity").entries:
        assert set(entry.trust.coverage) == {"", "1", "2", "3", "4"}
        assert 0.0 <= entry.trust.coverage_after_reversal <= 1.0
        assert entry.trust.width_n > 0.0


def test_a_load_that_training_never_had_is_flagged(results: BenchmarkResults) -> None:
    left_out = found(results, "identity", "leave_one_load_out").entries[0].trust
    held_out = found(results, "identity").entries[0].trust
    assert left_out.flagged > 0.3
    assert held_out.flagged < 0.2


def test_every_split_is_evaluated_on_every_seed(results: BenchmarkResults) -> None:
    assert results.tasks
    for one in results.tasks:
        assert all(set(entry.seeds) == {"0", "1"} for entry in one.entries), (one.task, one.split)


def test_what_is_in_the_cache_is_not_computed_again(runner: Runner, results: BenchmarkResults) -> None:
    again = made_runner(runner.cache, replace(PLAN, models=KNOWN))
    for one, before in zip(again.run().tasks, results.tasks, strict=True):
        assert one.entries == before.entries
    assert not +again.computed


def test_each_part_of_the_plan_recomputes_what_depends_on_it(runner: Runner, results: BenchmarkResults) -> None:
    small = replace(PLAN, tasks=("identity",), splits={}, models=KNOWN)
    for change, computed in (
        ({"effort": 0.25}, {"trials": 2, "predictions": 7, "scores": 4}),  # the best trial is a prediction
        ({"trials": 3}, {"trials": 1}),  # a third trial that is not the best changes nothing else
        ({"seeds": (1,)}, {"trials": 1, "scores": 4}),  # tuned on another first seed; one trial is a prediction already
    ):
        changed = made_runner(runner.cache, replace(small, **change))
        changed.run()
        assert dict(+changed.computed) == computed, change


def test_adding_a_model_computes_it_alone_and_touching_its_module_computes_it_again(
    runner: Runner, results: BenchmarkResults, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = tmp_path / "added_model.py"
    module.write_text(ADDED, encoding="utf-8")
    monkeypatch.syspath_prepend(str(tmp_path))
    plan = replace(PLAN, tasks=("identity",), splits={}, models=(*KNOWN, "added"), modules=(*MODULES, "added_model"))
    computed = {"predictions": 2, "scores": 1}  # one per seed, and their line
    for text, expected in ((ADDED, computed), (ADDED, {}), (f"{ADDED}# touched\n", computed)):
        module.write_text(text, encoding="utf-8")
        with_added = made_runner(runner.cache, plan)
        assert "added" in {entry.model for entry in with_added.run().tasks[0].entries}
        assert dict(+with_added.computed) == expected


def test_the_choice_does_not_depend_on_test_recordings(
    runner: Runner, results: BenchmarkResults, tmp_path: Path
) -> None:
    plan = replace(PLAN, tasks=("identity",), splits={}, seeds=(0,), models=("ridge",))
    other = made_runner(tmp_path, plan)
    tested = folds_of(other.sources, task_named("identity"), "held_out_sessions", 0)[0].test
    folder = other.sources.campaign_folder("campaign", 0)
    for recording in read_stored(folder):
        if recording.name in tested:
            write_recording(folder, recording.with_columns(friction_n=-recording.column("friction_n")))
    cases_of.cache_clear()
    _read.cache_clear()
    tuning = found(other.run(), "identity").entries[0].tuning
    assert tuning == next(entry.tuning for entry in found(results, "identity").entries if entry.model == "ridge")


def test_a_tuning_that_was_killed_goes_on_after_its_last_finished_trial(
    runner: Runner, results: BenchmarkResults, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan = replace(PLAN, tasks=("identity",), splits={}, models=KNOWN, trials=5)
    fitted = 0

    def killed_in_the_fourth(model: RidgeEstimator, recordings: Any) -> Any:
        nonlocal fitted
        fitted += 1
        if fitted == 4:
            raise KeyboardInterrupt
        return fit(model, recordings)

    fit = RidgeEstimator.fit
    monkeypatch.setattr(RidgeEstimator, "fit", killed_in_the_fourth)
    with pytest.raises(KeyboardInterrupt):
        made_runner(tmp_path, plan).run()
    resumed = made_runner(tmp_path, plan)
    assert without_times(resumed.run()) == without_times(made_runner(runner.cache, plan).run())
    assert resumed.computed["trials"] == 2


@pytest.mark.slow
def test_two_processes_find_the_same_as_one(runner: Runner, results: BenchmarkResults, tmp_path: Path) -> None:
    plan = replace(PLAN, tasks=("identity",), splits={"leave_one_load_out": ("identity",)}, seeds=(0,))
    two = made_runner(tmp_path, plan, workers=2).run()
    assert without_times(two) == without_times(made_runner(runner.cache, plan).run())


def test_own_recordings_are_evaluated_where_no_truth_is_needed(tmp_path: Path) -> None:
    sources = Sources(tmp_path / "none", SIZES, CYLINDER, "", write_own(tmp_path / "own"), (("train", "hash"),))
    results = Runner(replace(PLAN, models=KNOWN[:3]), sources, tmp_path / "cache", SETTINGS).run()
    assert [(one.task, one.split) for one in results.tasks] == [
        ("identity", "held_out_sessions"),
        ("pressure_free", "held_out_sessions"),
        ("identity", "leave_one_load_out"),
    ]
    assert results.missing.pop(
        "identity, leave_one_temperature_out"
    ).startswith(  # one session of each condition trains
        "split leave_one_temperature_out 'cold': no recording has the role train"
    )
    assert results.missing == {
        "external_load": "it is scored against true friction, which is not known of one's own recordings",
        "identity, unseen_rig": "there are no recordings of another rig",
    }
    assert all("truth_percent" not in entry.extras for one in results.tasks for entry in one.entries)
    assert results.tasks[0].label_truth_percent is None


def test_a_plan_of_loaded_recordings_alone_needs_no_others(tmp_path: Path) -> None:
    sources = Sources(tmp_path / "campaigns", SIZES, CYLINDER)
    write_campaign(sources, "loaded", 0)
    plan = replace(PLAN, tasks=("external_load",), splits={}, seeds=(0,), models=KNOWN[:2])
    results = Runner(plan, sources, tmp_path, SETTINGS).run()
    assert [one.task for one in results.tasks] == ["external_load"]
    assert results.budget["recordings"] == 12


def test_an_unknown_model_is_refused_by_name(runner: Runner) -> None:
    with pytest.raises(
        ParamsError,
        match=r"plan\.models: no model 'rigde' in the registry; expected some of low_pass, hold, constant_by_",
    ):
        replace(runner, plan=replace(PLAN, models=("rigde",))).run()


def test_the_paragraph_of_a_task_follows_from_its_numbers(results: BenchmarkResults) -> None:
    findings = findings_of(results)
    assert set(findings) == {"identity", "pressure_free", "external_load"}
    identity = found(results, "identity")
    best = identity.entries[0]
    title = results.models[best.model].title
    assert findings["identity"].startswith(
        f"On held-out sessions, {title} is nearest to the label: {best.score.percent.value:.2f} %"
    )
    assert "It is not beaten by" in findings["identity"]
    assert "Without a figure, because they failed: Raises; Nan." in findings["identity"]
    assert "is nearest to true friction" in findings["external_load"]
    assert "The baseline, Constant, has" in findings["pressure_free"]


def test_a_failure_is_named_whatever_its_message(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    failed = replace(identity, missing={"raises": "seed 0: ValueError: the filter needs more samples"})
    paragraph = findings_of(replace(results, tasks=(failed,)))["identity"]
    assert "Without a figure, because they failed: Raises." in paragraph


def test_where_nothing_beats_the_baseline_the_paragraph_states_it(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    only_baseline = [entry for entry in identity.entries if entry.model == identity.baseline]
    worse = [entry for entry in identity.entries if entry.below_baseline.high < 0.0]
    poor = replace(results, tasks=(replace(identity, entries=(*only_baseline, *worse)),))
    assert "no model beats it outside the bootstrap interval" in findings_of(poor)["identity"]


def test_results_hold_finite_numbers_only(results: BenchmarkResults) -> None:
    def check(value: Any) -> None:
        if isinstance(value, dict):
            for inner in value.values():
                check(inner)
        elif isinstance(value, list | tuple):
            for inner in value:
                check(inner)
        elif isinstance(value, float):
            assert np.isfinite(value)

    check(asdict(results))
