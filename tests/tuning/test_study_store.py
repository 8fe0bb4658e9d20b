"""Trials are the same bit for bit wherever they are kept, and one process at a time searches one thing."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import pytest
from optuna.distributions import CategoricalDistribution, FloatDistribution
from optuna.trial import TrialState

import team_servers as servers
from cylinder_friction.tuning.study_store import STUDY_STORE, StudyStoreError, study_storage
from cylinder_friction.tuning.trials import TuningPlan, reason_of, run_trials

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from optuna.trial import FrozenTrial

    from cylinder_friction.tuning.trials import Objective, Report, Values

SPACE = {"nodes": CategoricalDistribution((16, 32, 64)), "learning_rate": FloatDistribution(1e-5, 1e-3, log=True)}
PLAN = TuningPlan(trials=10, startup_trials=3, seed=3)


class KilledError(Exception):
    """Stands for the kill signal."""


def bowl(values: Values, report: Report) -> float:
    """Reports an error that falls over three epochs."""
    error = abs(values["nodes"] - 48) / 7 + 1e3 * values["learning_rate"]
    for epoch in range(3):
        report(error * (2.0 - 0.3 * epoch))
    return float(error)


@pytest.fixture(scope="module")
def database() -> Iterator[str]:
    if servers.postgresql_programs() is None:
        pytest.skip("PostgreSQL is not installed")
    pytest.importorskip("psycopg2")
    with servers.postgresql("studies") as urls:
        yield urls["studies"]


def searched(journal: Path, objective: Objective = bowl) -> list[tuple[object, ...]]:
    """Return all of each trial that does not depend on when it ran."""
    return [_without_time(trial) for trial in run_trials(SPACE, PLAN, objective, journal)]


def _without_time(trial: FrozenTrial) -> tuple[object, ...]:
    return trial.params, trial.state, trial.value, sorted(trial.intermediate_values.items()), reason_of(trial)


def test_a_search_killed_and_resumed_in_a_database_equals_one_in_the_journal(
    database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    in_the_journal = searched(tmp_path / "search-1/trials.log")
    monkeypatch.setenv(STUDY_STORE, database)
    calls = 0

    def killed_once(values: Values, report: Report) -> float:
        nonlocal calls
        calls += 1
        if calls == 5:
            raise KilledError
        return bowl(values, report)

    elsewhere = tmp_path / "other/search-2/trials.log"
    with pytest.raises(KilledError):
        searched(elsewhere, killed_once)
    assert searched(elsewhere, killed_once) == in_the_journal
    assert TrialState.PRUNED in [state for _, state, *_ in in_the_journal]
    assert calls == PLAN.trials + 1, "what was finished is not repeated"
    assert not elsewhere.parent.exists()


def test_a_second_process_waits_and_finds_the_trials_of_the_first(
    database: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STUDY_STORE, database)
    started, waits, calls = threading.Event(), threading.Event(), 0
    monkeypatch.setattr("cylinder_friction.tuning.study_store._log.warning", lambda *_: waits.set())

    def slow(values: Values, report: Report) -> float:
        nonlocal calls
        calls += 1
        started.set()
        assert waits.wait(30.0), "the other one did not wait"
        return bowl(values, report)

    results: list[list[tuple[object, ...]]] = []
    journal = tmp_path / "search-3/trials.log"
    first = threading.Thread(target=lambda: results.append(searched(journal, slow)))
    first.start()
    assert started.wait(30.0)
    second = searched(journal, slow)
    first.join()
    assert [second] == results
    assert calls == PLAN.trials


@pytest.mark.parametrize(
    ("url", "message"),
    [
        ("studies", f"{STUDY_STORE} is no URL of a database; expected postgresql.psycopg2://USER@HOST/DATABASE"),
        ("sqlite:///studies.db", "names a database of sqlite; expected postgresql"),
        (
            "postgresql+psycopg2://me:hidden@127.0.0.1:1/studies",
            r"names postgresql\+psycopg2://me:\*\*\*@127.0.0.1:1/studies, which cannot be reached .*refused.*; correct "
            "it, or unset it to keep trials in the repository",
        ),
    ],
)
def test_what_is_no_such_database_is_refused(
    url: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("psycopg2")
    monkeypatch.setenv(STUDY_STORE, url)
    with pytest.raises(StudyStoreError, match=message), study_storage(tmp_path / "search-4/trials.log"):
        pass


def test_a_driver_that_is_not_installed_is_named_with_what_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(STUDY_STORE, "postgresql+pg8000://me@127.0.0.1/studies")
    with (
        pytest.raises(
            StudyStoreError,
            match=r'needs pg8000, which is not installed; pip install "cylinder-friction\[postgres\]", and write post',
        ),
        study_storage(tmp_path / "search-5/trials.log"),
    ):
        pass
