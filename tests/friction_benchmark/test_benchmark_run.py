"""The whole benchmark on made campaigns: complete, resumable, the same whoever does the work, honest about failures."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from cylinder_friction.evaluation.strata import StrataLimits
from friction_benchmark import running
from friction_benchmark.conclusions import findings_of
from friction_benchmark.conducting import run_benchmark
from friction_benchmark.data import Sources
from friction_benchmark.programme import Programme
from friction_benchmark.running import Bench
from friction_benchmark.scoring import ScoreSettings
from friction_benchmark_models import CYLINDER, MODULES, SIZES, write_campaign, write_own

if TYPE_CHECKING:
    from pathlib import Path

    from friction_benchmark.results import BenchmarkResults

HOW = ScoreSettings(StrataLimits(1e-3, 8e-3, 0.1), maximum_lag_s=0.05, bootstrap_repeats=50, bootstrap_block_s=1.0)
PROGRAMME = Programme(
    tasks=("identity", "pressure_free", "external_load"),
    splits={
        "leave_one_load_out": ("identity",),
        "leave_one_temperature_out": ("identity",),
        "unseen_rig": ("identity",),
    },
)
TIMES = ("step_us", "training_s")


def made_bench(folder: Path) -> Bench:
    sources = Sources(folder / "data", SIZES)
    for seed in (0, 1):
        write_campaign(sources, "campaign", seed)
        write_campaign(sources, "loaded", seed)
        write_campaign(sources, "unseen", seed, sessions=1)
    return Bench(CYLINDER, sources, folder / "work", (0, 1), 0.5, 2, MODULES)


def without_times(results: BenchmarkResults) -> dict[str, Any]:
    content = asdict(results)
    for task in content["tasks"]:
        for entry in task["entries"]:
            for name in TIMES:
                del entry[name]
    return content


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    return made_bench(tmp_path_factory.mktemp("bench"))


@pytest.fixture(scope="module")
def results(bench: Bench) -> BenchmarkResults:
    return run_benchmark(bench, PROGRAMME, HOW, workers=1, progress=False)


def found(results: BenchmarkResults, task: str, split: str = "held_out_sessions") -> Any:
    return next(one for one in results.tasks if (one.task, one.split) == (task, split))


def test_every_task_and_split_that_was_asked_is_answered(results: BenchmarkResults) -> None:
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


def test_leaderboards_hold_everyone_who_can_best_first(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    assert [entry.model for entry in identity.entries[:1]] != ["hold"]
    assert {entry.model for entry in identity.entries} == {"low_pass", "hold", "constant_by_direction", "ridge"}
    percents = [entry.score.percent.value for entry in identity.entries]
    assert percents == sorted(percents)
    for entry in identity.entries:
        assert entry.score.percent.low <= entry.score.percent.value <= entry.score.percent.high
        assert set(entry.seeds) == {"0", "1"}
        assert set(entry.by_condition) == {"1", "2", "3", "4"}


def test_who_cannot_and_who_failed_is_named_with_the_reason(results: BenchmarkResults) -> None:
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


def test_the_floor_is_level_with_itself_and_others_are_measured_against_it(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    floor = next(entry for entry in identity.entries if entry.model == identity.baseline)
    assert floor.below_baseline is not None
    assert (floor.below_baseline.low, floor.below_baseline.high) == (0.0, 0.0)
    hold = next(entry for entry in identity.entries if entry.model == "hold")
    assert hold.below_baseline is not None
    assert hold.below_baseline.value == pytest.approx(floor.score.percent.value - hold.score.percent.value)
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
        assert entry.trust is not None
        assert set(entry.trust.coverage) == {"", "1", "2", "3", "4"}
        assert 0.0 <= entry.trust.coverage_after_reversal <= 1.0
        assert entry.trust.width_n > 0.0


def test_a_load_that_nobody_taught_is_flagged(results: BenchmarkResults) -> None:
    left_out = found(results, "identity", "leave_one_load_out").entries[0].trust
    held_out = found(results, "identity").entries[0].trust
    assert left_out.outside > 0.4
    assert left_out.caught > 0.8
    assert held_out.outside < 0.2


def test_every_split_is_asked_on_every_seed(results: BenchmarkResults) -> None:
    assert results.tasks
    for one in results.tasks:
        assert all(set(entry.seeds) == {"0", "1"} for entry in one.entries), (one.task, one.split)


def test_what_is_finished_is_not_done_again(
    bench: Bench, results: BenchmarkResults, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("answered again")

    known = {"models": ("low_pass", "hold", "constant_by_direction", "ridge")}
    monkeypatch.setattr(running, "_answer", refuse)
    monkeypatch.setattr(running, "_tune", refuse)
    again = run_benchmark(bench, replace(PROGRAMME, **known), HOW, workers=1, progress=False)
    for one, before in zip(again.tasks, results.tasks, strict=True):
        assert one.entries == before.entries


def test_nothing_sees_a_test_recording_while_tuning(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    from friction_benchmark.data import folds_of
    from friction_benchmark.tasks import task_named

    fold = folds_of(bench.sources, task_named("identity"), "held_out_sessions", 0)[0]
    seen: set[str] = set()
    fit, percent = running.fitted, running._percent

    def watched_fit(entry, making, recordings, store):  # type: ignore[no-untyped-def]
        seen.update(recording.name for recording in recordings)
        return fit(entry, making, recordings, store)

    def watched_percent(estimator, exams):  # type: ignore[no-untyped-def]
        seen.update(exam.recording.name for exam in exams)
        return percent(estimator, exams)

    monkeypatch.setattr(running, "fitted", watched_fit)
    monkeypatch.setattr(running, "_percent", watched_percent)
    running.tune_model(replace(bench, store=tmp_path), "ridge", ("identity",))
    assert seen == set(fold.train) | set(fold.validation)
    assert not seen & set(fold.test)


@pytest.mark.slow
def test_two_processes_find_the_same_as_one(results: BenchmarkResults, tmp_path: Path) -> None:
    again = run_benchmark(made_bench(tmp_path), PROGRAMME, HOW, workers=2, progress=False)
    assert without_times(again) == without_times(results)


def test_own_recordings_are_asked_what_needs_no_truth(tmp_path: Path) -> None:
    sources = Sources(tmp_path / "none", SIZES, write_own(tmp_path / "own"))
    own = Bench(CYLINDER, sources, tmp_path / "work", (0, 1), 0.5, 2, MODULES)
    known = replace(PROGRAMME, models=("low_pass", "hold", "constant_by_direction"))
    results = run_benchmark(own, known, HOW, workers=1, progress=False)
    assert [(one.task, one.split) for one in results.tasks] == [
        ("identity", "held_out_sessions"),
        ("pressure_free", "held_out_sessions"),
        ("identity", "leave_one_load_out"),
    ]
    assert results.missing.pop("identity, leave_one_temperature_out").startswith(  # one session of each test teaches
        "split leave_one_temperature_out 'cold': no recording has the role train"
    )
    assert results.missing == {
        "external_load": "it is judged against true friction, which nobody knows of one's own recordings",
        "identity, unseen_rig": "there are no recordings of another rig",
    }
    assert all("truth_percent" not in entry.extras for one in results.tasks for entry in one.entries)
    assert results.tasks[0].label_truth_percent is None


def test_an_unknown_model_is_refused_by_name(bench: Bench) -> None:
    with pytest.raises(
        ValueError, match="no participant 'rigde'; expected some of low_pass, hold, constant_by_direction, ridge"
    ):
        run_benchmark(bench, replace(PROGRAMME, models=("rigde",)), HOW, workers=1, progress=False)


def test_the_paragraph_of_a_task_follows_from_its_numbers(results: BenchmarkResults) -> None:
    findings = findings_of(results)
    assert set(findings) == {"identity", "pressure_free", "external_load"}
    identity = found(results, "identity")
    best = identity.entries[0]
    title = results.models[best.model].title
    assert findings["identity"].startswith(
        f"On other sessions of the rig that taught, {title} is nearest to the label: {best.score.percent.value:.2f} %"
    )
    assert "do not beat the baseline" in findings["identity"] or "does not beat the baseline" in findings["identity"]
    assert "Without a figure, because they failed: Raises; and Nan." in findings["identity"]
    assert "As a virtual load cell" in findings["external_load"]
    assert "The baseline, Constant, has" in findings["pressure_free"]


def test_where_nothing_beats_the_floor_the_paragraph_says_so(results: BenchmarkResults) -> None:
    identity = found(results, "identity")
    only_floor = [entry for entry in identity.entries if entry.model == identity.baseline]
    worse = [entry for entry in identity.entries if entry.below_baseline.high < 0.0]
    poor = replace(results, tasks=(replace(identity, entries=(*only_floor, *worse)),))
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
