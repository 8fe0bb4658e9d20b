"""The MLflow UI in a real browser on a finished pipeline: what a user opens is there to be seen."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from mlflow import MlflowClient
from playwright.sync_api import Page

from cylinder_friction.deployment.mlflow_ui import runs_page, served_ui
from cylinder_friction.tracking.store import EXPERIMENT, tracking_uri

MODEL = "friction-estimator-smoke"

pytestmark = pytest.mark.extended


@pytest.fixture(scope="module")
def ui(finished_pipeline: Path) -> Iterator[str]:
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("MLFLOW_TRACKING_URI", raising=False)
        with served_ui(finished_pipeline) as url:
            yield url


@pytest.fixture
def page(new_page: Callable[..., Page], tmp_path: Path) -> Iterator[Page]:
    """A fresh page; what it showed last is kept as a picture beside the test's other files."""
    opened = new_page(1500, 1100)
    yield opened
    opened.screenshot(path=str(tmp_path / "last_seen.png"))


def sees(page: Page, *texts: str) -> None:
    """Wait until every text is on the page; the test fails where one does not come."""
    for text in texts:
        page.get_by_text(text).first.wait_for()


def expand(page: Page, name: str) -> None:
    page.get_by_role("row").filter(has_text=name).first.get_by_role("button").first.click()


def test_executions_are_compared_by_condition_and_hold_every_stage_and_trial(
    page: Page, ui: str, finished_pipeline: Path
) -> None:
    page.goto(runs_page(ui, finished_pipeline))
    page.get_by_role("link", name="pipeline 1", exact=True).first.wait_for()
    sees(page, "Which is better, and in which condition?", *(f"error_percent/condition_{name}" for name in "1234"))
    page.goto(runs_page(ui, finished_pipeline).replace("CHART", "TABLE"))
    page.get_by_role("link", name="pipeline 1", exact=True).first.wait_for()
    expand(page, "pipeline 1")
    for stage in ("compare", "search", "train"):
        page.get_by_role("link", name=stage, exact=True).first.wait_for()
    expand(page, "search")
    trials = page.get_by_role("link", name=re.compile(r"^trial \d+$"))
    trials.first.wait_for()
    assert trials.count() >= 2


def test_the_comparison_shows_metrics_tables_figures_and_report(page: Page, ui: str, finished_pipeline: Path) -> None:
    client = MlflowClient(tracking_uri(finished_pipeline))
    experiment = client.get_experiment_by_name(EXPERIMENT)
    assert experiment is not None
    run = client.search_runs([experiment.experiment_id], "attributes.run_name = 'compare'")[0]
    address = f"{ui}/#/experiments/{experiment.experiment_id}/runs/{run.info.run_id}"
    page.goto(address)
    page.get_by_role("heading", name="compare").first.wait_for()
    page.get_by_placeholder("Search metrics").first.fill("error_percent/condition_1")
    sees(page, "error_percent/condition_1")
    page.goto(f"{address}/artifacts")
    page.get_by_text("errors_by_condition.json").first.click()
    sees(page, "truth_percent", "force_balance_unfiltered")
    page.get_by_text("reports", exact=True).first.click()
    page.get_by_text("report.html").first.click()
    page.frame_locator("iframe").locator("h1, h2").first.wait_for()
    page.get_by_text("figures", exact=True).first.click()
    page.get_by_text(".png").first.click()
    page.locator("img[src^='blob:'], img[src*='get-artifact']").first.wait_for()


def test_the_registered_version_shows_its_alias_and_the_way_back(page: Page, ui: str, finished_pipeline: Path) -> None:
    client = MlflowClient(tracking_uri(finished_pipeline))
    version = client.get_model_version_by_alias(MODEL, "champion")
    page.goto(f"{ui}/#/models/{MODEL}")
    sees(page, "Version 1", "champion")
    page.goto(f"{ui}/#/models/{MODEL}/versions/{version.version}")
    sees(page, "champion", "Promoted: there is no incumbent", "Errors on held-out recordings, against true friction")
    sees(page, "Valid range; what lies beyond is flagged", "checks every link", "data/raw/rig")
