"""The benchmark's page: nothing from outside, nothing left out, no word that breaks it, and a browser that sorts it."""

from __future__ import annotations

import html
import math
import re
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.evaluation.strata import STRATA
from cylinder_friction.reporting.page import static
from friction_benchmark.report.words import of_size
from friction_benchmark.report.write import report_html, write_report
from friction_benchmark.results import (
    BenchmarkResults,
    Entry,
    Interval,
    ModelInfo,
    Score,
    TaskResult,
    Trust,
)

CHROMIUM = Path("/usr/bin/chromium")

MODELS = {
    "low_pass": ("Tuned low-pass of the force balance", "baseline", 2),
    "hold": ("Hold the last value", "baseline", 0),
    "stribeck": ("Coulomb–viscous–Stribeck", "analytical", 9),
    "dahl": ("Dahl", "analytical", 8),
    "lugre": ("LuGre", "analytical", 24),
    "pressure_lugre": ("LuGre, pressure-scaled", "analytical", 28),
    "film_lugre": ("LuGre with film dynamics (Tran, Hafizah and Yanada)", "analytical", 41),
    "gms": ("Generalised Maxwell-slip, 6 elements", "analytical", 60),
    "machado": ("Machado 2006: friction compensator network", "related work", 74),
    "pan_swarm": ("Pan 2017: Elman network, swarm then simplex", "related work", 160),
    "pan_adam": ("Pan 2017: Elman network, Adam", "related work", 160),
    "han_zero": ("Han 2023: synthetic LuGre, zero-shot", "related work", 17_408),
    "han_tuned": ("Han 2023: fine-tuned", "related work", 17_408),
    "ridge": ("Ridge on lagged samples", "modern", 80),
    "narx": ("NARX", "modern", 96),
    "boosting": ("Histogram gradient boosting", "modern", 900),
    "gru": ("GRU", "modern", 9_800),
    "tcn": ("Causal TCN", "modern", 14_200),
    "lugre_residual": ("LuGre plus learned residual", "modern", 3_100),
    "observer": ("Kalman disturbance observer", "modern", 66),
    "twin": ("Hybrid trained by the twin", "modern", 9_900),
}
TASKS = {
    "identity": ("friction from pressures and position", "low_pass"),
    "pressure_free": ("friction without pressures", "stribeck"),
    "pressure_level": ("friction from the pressure level", "stribeck"),
    "forecast_25ms": ("forecast 25 ms ahead", "hold"),
    "forecast_100ms": ("forecast 100 ms ahead", "hold"),
    "sensor_drift": ("drifting pressure sensors", "low_pass"),
    "external_load": ("unknown external load", "low_pass"),
}
SPLITS = ("held_out_sessions", "leave_one_load_out", "leave_one_temperature_out", "unseen_rig")


def random_results(seed: int, splits: tuple[str, ...] = SPLITS, tasks: int = len(TASKS)) -> BenchmarkResults:
    """Return results as plausible as numbers drawn at random can be; every task on the first split."""
    draw = np.random.default_rng(seed)
    found = []
    for task in list(TASKS)[:tasks]:
        found += [
            _result(draw, task, split) for split in (splits if task in ("identity", "pressure_free") else splits[:1])
        ]
    participants = {
        name: ModelInfo(title, family, "Author, A. and Other, B. 2017, Mechatronics 22", "Window of 64 samples. " * 3)
        for name, (title, family, _) in MODELS.items()
    }
    budget: dict[str, float | int | str] = {
        "trials": 8,
        "effort": 0.25,
        "seeds": 3,
        "training recordings": 32,
        "machine": "two cores",
    }
    return BenchmarkResults(tuple(found), participants, budget, {"alarms": "no recording has an alarm"})


def _result(draw: np.random.Generator, task: str, split: str) -> TaskResult:
    title, baseline = TASKS[task]
    missing = {"hold": "forecasts alone hold a value"} if "forecast" not in task else {"observer": "it looks at now"}
    scale = 4.0 * draw.uniform(1.0, 4.0) * (1.0 + SPLITS.index(split))
    entries = [_entry(draw, name, scale, baseline) for name in MODELS if name not in missing]
    return TaskResult(
        task=task,
        split=split,
        title=title,
        inputs=("pressure_1_pa", "pressure_2_pa", "position_m"),
        reference="truth" if task == "sensor_drift" else "label",
        baseline=baseline,
        mean_friction_n=float(draw.uniform(300.0, 900.0)),
        entries=tuple(sorted(entries, key=lambda entry: entry.score.percent.value)),
        missing=missing,
        explanation=f"Why {task} is asked.",
        label_truth_percent=Interval(0.8 * scale, 0.7 * scale, 0.9 * scale),
    )


def _entry(draw: np.random.Generator, model: str, scale: float, baseline: str) -> Entry:
    percent = scale if model == baseline else scale * float(np.exp(draw.normal(0.1, 0.5)))
    spread = percent * float(draw.uniform(0.02, 0.1))
    mae_n = 5.0 * percent
    tests = [str(test + 1) for test in range(4)]
    trust = Trust(
        {**{test: float(min(1.0, draw.normal(0.9, 0.03))) for test in tests}, "": 0.9 + float(draw.normal(0.0, 0.01))},
        float(draw.uniform(0.6, 0.93)),
        4.0 * mae_n,
        float(draw.uniform(0.0, 0.1)),
        float(draw.uniform(0.5, 1.0)),
    )
    below = Interval(scale - percent, scale - percent - 1.5 * spread, scale - percent + 1.5 * spread)
    return Entry(
        model=model,
        score=Score(
            Interval(percent, percent - spread, percent + spread),
            mae_n,
            1.4 * mae_n,
            3.0 * mae_n,
            float(draw.normal(0.0, 3.0)),
            float(draw.choice([0.0, 0.005, 0.02, math.nan])),
        ),
        seeds={str(seed): percent * float(draw.normal(1.0, 0.02)) for seed in range(3)},
        by_condition={test: percent * float(np.exp(draw.normal(0.0, 0.2))) for test in tests},
        strata={name: (percent * float(np.exp(draw.normal(0.0, 0.4))), mae_n) for name in STRATA},
        below_baseline=None if model == baseline else below,
        trust=trust,
        multiply_adds=MODELS[model][2],
        step_us=0.4 + 1e-3 * MODELS[model][2],
        training_s=float(draw.exponential(10.0)),
        tuning={"size": 48, "rate": 0.0123456, "validation_percent": 4.5},
    )


CONCLUSIONS = {task: f"In {task} the conclusion states who wins." for task in TASKS}


def page_of(results: BenchmarkResults) -> str:
    return report_html(results, CONCLUSIONS)


@pytest.fixture(scope="module")
def results() -> BenchmarkResults:
    return random_results(3)


@pytest.fixture(scope="module")
def page(results: BenchmarkResults) -> str:
    return page_of(results)


def test_results_read_back_from_json_are_written_whole_and_as_the_same_bytes(page: str, tmp_path: Path) -> None:
    def reordered(content: object) -> object:
        """Return what JSON with sorted keys makes of it."""
        if is_dataclass(content) and not isinstance(content, type):
            return replace(content, **{each.name: reordered(getattr(content, each.name)) for each in fields(content)})
        if isinstance(content, dict):
            return {key: reordered(content[key]) for key in sorted(content)}
        return tuple(map(reordered, content)) if isinstance(content, tuple) else content

    results = random_results(3)
    again = reordered(results)
    assert isinstance(again, BenchmarkResults)
    assert list(again.tasks[0].entries[0].tuning) != list(results.tasks[0].entries[0].tuning)
    path = tmp_path / "reports/benchmark.html"
    write_report(again, CONCLUSIONS, path)
    written = path.read_bytes()
    assert written == page.encode()
    assert written.startswith(b"<!DOCTYPE html>")
    assert len(written) < 3e6


def test_the_page_loads_nothing_from_outside(page: str) -> None:
    own = page.replace(static("plotly-basic.min.js"), "")
    assert len(own) < len(page)
    assert "http" not in own
    assert not re.search(r"\ssrc=|@import|url\s*\(|<link|<iframe|<img", own)


def test_every_model_finding_reason_source_and_figure_of_the_budget_is_there(
    page: str, results: BenchmarkResults
) -> None:
    for task in TASKS:
        assert f"In {task} the conclusion states who wins." in page
        assert f"Why {task} is asked. Models see pressure_1_pa" in page
    for result in results.tasks:
        words = f"of mean |{'true friction' if result.reference == 'truth' else 'label'}| = "
        assert f"{words}{of_size(result.mean_friction_n)} N" in page
        for reason in result.missing.values():
            assert reason in page
        for entry in result.entries:
            assert of_size(entry.score.rmse_n) in page
    for participant in results.models.values():
        assert html.escape(participant.title) in page
        assert participant.source in page
    assert "Alarms: no recording has an alarm" in page
    assert "<dt>Training recordings</dt><dd>32</dd>" in page
    for name in STRATA.values():
        assert f">{name}</th>" in page


def test_every_link_leads_to_a_part_of_the_page(page: str) -> None:
    links = set(re.findall(r'href="#([^"]+)"', page))
    assert {f"task-{task.replace('_', '-')}" for task in TASKS} < links
    assert all(page.count(f'id="{link}"') == 1 for link in links)


def test_words_from_results_cannot_break_the_page(results: BenchmarkResults) -> None:
    evil = '</script><b onclick="x">&'
    first = results.tasks[0]
    entries = (replace(first.entries[0], model=evil, tuning={evil: evil}), *first.entries[1:])
    task = replace(first, task=evil, title=evil, baseline=evil, entries=entries, missing={"hold": evil})
    models = {**results.models, evil: ModelInfo(evil, "modern", evil, evil)}
    text = report_html(replace(results, tasks=(task,), models=models, budget={evil: evil}), {evil: evil})
    assert evil not in text
    assert 'onclick="x"' not in text


@pytest.mark.parametrize(
    ("tasks", "message"),
    [
        ((), "expected leaderboards with entries, but got none in: the results"),
        (
            (replace(random_results(0, SPLITS[:1], 1).tasks[0], entries=()),),
            "expected leaderboards with entries, but got none in: identity, held-out sessions",
        ),
    ],
)
def test_results_without_entries_are_refused(tasks: tuple[TaskResult, ...], message: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
        report_html(BenchmarkResults(tasks, {}, {}), {})


def test_a_model_that_its_task_leaves_out_says_why_in_the_heat_map(page: str) -> None:
    assert 'class="none" title="it looks at now"' in page


def test_the_label_stands_among_the_models_only_where_errors_are_against_truth(
    page: str, results: BenchmarkResults
) -> None:
    assert page.count('"text":"label"') == sum(task == "sensor_drift" for task in TASKS)
    assert page.count("The off-line label, which looks ahead, is itself") == len(results.tasks)


def test_what_nobody_asked_for_is_left_out(results: BenchmarkResults) -> None:
    bare = [replace(entry, by_condition={}, strata={}, seeds={}, tuning={}) for entry in results.tasks[0].entries]
    text = report_html(replace(results, tasks=(replace(results.tasks[0], entries=tuple(bare)),)), {})
    assert "<summary>Residuals" not in text
    assert "Tuned choices" not in text
    assert text.count('class="plot"') == 2
    assert text.count("The cost of an estimate") == 1


def test_further_figures_of_a_task_are_columns_of_their_own(results: BenchmarkResults) -> None:
    entries = tuple(replace(entry, extras={"load_mae_n": 41.5}) for entry in results.tasks[0].entries)
    text = report_html(replace(results, tasks=(replace(results.tasks[0], entries=entries),)), {})
    assert ">load MAE [N]</th>" in text
    assert text.count(">41.5</td>") == len(entries)


@settings(max_examples=15, deadline=None)
@given(
    seed=st.integers(0, 1000),
    percent=st.sampled_from([0.0, 1e-9, 3.0, 1e5, math.nan, math.inf]),
    lag_s=st.sampled_from([0.0, -0.01, math.nan]),
)
def test_no_number_however_odd_spoils_a_drawing(seed: int, percent: float, lag_s: float) -> None:
    results = random_results(seed, SPLITS[:1], 1)
    (result,) = results.tasks
    odd = replace(
        result.entries[-1],
        score=Score(Interval(percent, percent, percent), percent, percent, percent, percent, lag_s),
        by_condition={"1": percent},
        strata={"sliding": (percent, percent)},
        below_baseline=Interval(percent, percent, percent),
        trust=Trust({"": percent, "1": percent}, percent, percent, percent, percent),
        multiply_adds=0,
    )
    few = [entry for entry in result.entries[:-1] if entry.model in (result.baseline, "lugre", "ridge")]
    text = page_of(replace(results, tasks=(replace(result, entries=(*few, odd)),)))
    assert not re.search(r"\b(nan|inf)\b", re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL))


@pytest.mark.slow
@pytest.mark.skipif(not CHROMIUM.is_file(), reason=f"no Chromium at {CHROMIUM}; install the system's package")
def test_a_browser_shows_it_wide_and_narrow_and_sorts_its_tables(tmp_path: Path, page: str) -> None:
    from playwright.sync_api import sync_playwright

    path = tmp_path / "benchmark.html"
    path.write_text(page, encoding="utf-8")
    arguments = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=str(CHROMIUM), args=arguments)
        shown = browser.new_page(viewport={"width": 1400, "height": 1000})
        errors: list[str] = []
        shown.on("pageerror", lambda error: errors.append(str(error)))
        shown.goto(path.as_uri())
        drawn = shown.locator("#task-identity ~ .many .plot").nth(1)
        drawn.scroll_into_view_if_needed()
        drawn.locator(".main-svg").first.wait_for()
        lags = shown.locator("#task-identity ~ .scroll table").first
        lags.locator("th", has_text="lag [ms]").click()
        cells = lags.locator("tbody tr td:nth-child(7)").all_inner_texts()
        numbers = [float(cell) for cell in cells if cell != "–"]
        assert numbers == sorted(numbers)
        assert cells == sorted(cells, key=lambda cell: cell == "–")
        lags.locator("th", has_text="lag [ms]").click()
        again = [float(cell) for cell in lags.locator("tbody tr td:nth-child(7)").all_inner_texts() if cell != "–"]
        assert again == sorted(numbers, reverse=True)
        lags.locator("th", has_text="Model").click()
        names = lags.locator("tbody tr td:first-child").all_inner_texts()
        assert names[0].startswith("Causal TCN")
        for width in (1400, 400):
            shown.set_viewport_size({"width": width, "height": 1000})
            assert shown.evaluate("document.documentElement.scrollWidth") == width
        browser.close()
    assert errors == []
