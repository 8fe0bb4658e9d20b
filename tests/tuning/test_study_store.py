"""Trials are the same bit for bit wherever they are kept, and however many processes search the same thing."""

import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import team_servers as servers
from cylinder_friction.tuning.search import Objective, Report, SearchPlan, Trial, Values, run_search
from cylinder_friction.tuning.space import SearchSpace
from cylinder_friction.tuning.study_store import STUDY_STORE, StudyStoreError, study_storage
from process_work import cost
from search_work import KilledError, bowl, killed_at

SPACE = SearchSpace((1, 2, 3), (16, 32, 64), (0.1,), (1e-5, 1e-3), (32, 100), (10, 50))
PLAN = SearchPlan(trials=14, startup_trials=4, seed=3, maximum_multiply_adds=192)


@pytest.fixture(scope="module")
def database() -> Iterator[str]:
    if servers.postgresql_programs() is None:
        pytest.skip("PostgreSQL is not installed")
    pytest.importorskip("psycopg2")
    with servers.postgresql("studies") as urls:
        yield urls["studies"]


def searched(journal: Path, objective: Objective = bowl) -> list[Trial]:
    return run_search(SPACE, PLAN, cost, objective, journal)


def test_a_search_killed_and_resumed_in_a_database_equals_one_in_the_journal(
    database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_the_journal = searched(tmp_path / "search-1/trials.log")
    monkeypatch.setenv(STUDY_STORE, database)
    tried, killed_once = killed_at(5)
    elsewhere = tmp_path / "other/search-2/trials.log"
    with pytest.raises(KilledError):
        searched(elsewhere, killed_once)
    assert searched(elsewhere, killed_once) == in_the_journal
    assert "pruned" in [trial.state for trial in in_the_journal]
    assert len(tried) == PLAN.trials + 1, "what was finished is not repeated"
    assert not elsewhere.parent.exists()


def test_two_processes_that_search_the_same_at_the_same_time_find_the_same(
    database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STUDY_STORE, database)
    started, finished, (tried, counted) = threading.Event(), threading.Event(), killed_at()

    def slow(values: Values, report: Report) -> float:
        started.set()
        assert finished.wait(60.0)
        return bowl(values, report)

    results: list[list[Trial]] = []
    journal = tmp_path / "search-3/trials.log"
    first = threading.Thread(target=lambda: results.append(searched(journal, slow)))
    first.start()
    assert started.wait(60.0)
    second = searched(journal)
    finished.set()
    first.join()
    assert [second] == results
    assert searched(journal, counted) == second, "each trial counts once, although both processes stored it"
    assert tried == []


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("sqlite:///studies.db", "names a database of sqlite; expected postgresql"),
        (
            "postgresql+psycopg2://me:hidden@127.0.0.1:1/studies",
            r"names postgresql\+psycopg2://me:\*\*\*@127.0.0.1:1/studies, which cannot be reached .*refused.*; correct "
            "it, or unset it to keep trials in the repository",
        ),
        (
            "postgresql+pg8000://me@127.0.0.1/studies",
            r'needs pg8000, which is not installed; pip install "cylinder-friction\[postgres\]", and write post',
        ),
    ],
)
def test_what_is_no_such_database_is_refused(
    url: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("psycopg2")
    monkeypatch.setenv(STUDY_STORE, url)
    with pytest.raises(StudyStoreError, match=message):
        study_storage(tmp_path / "search-4/trials.log")
