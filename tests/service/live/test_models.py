"""Another model beside the first: it changes no bit until it takes over, and a restart repeats the change by index."""

import sqlite3
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.engine_building import built_engine
from cylinder_friction.service.live.frames import EstimateBlock, SampleBlock
from cylinder_friction.service.live.history import move_into_history
from cylinder_friction.service.live.journal import Journal, JournalError
from cylinder_friction.service.live.service import LiveService, LiveSession
from cylinder_friction.service.live.settings import SessionRules


class Given:
    """The newtons that a service gave, by index."""

    def __init__(self) -> None:
        self.newtons: dict[int, list[float]] = {}

    def __call__(self, session: LiveSession, block: EstimateBlock) -> None:
        self.newtons |= dict(enumerate(block.newtons.tolist(), block.index))

    def array(self, begin: int, end: int) -> Array:
        return np.array([self.newtons[index] for index in range(begin, end)])


@pytest.fixture(scope="module")
def other_engine(other_estimator: FrictionEstimator, tmp_path_factory: pytest.TempPathFactory) -> Engine:
    return Engine(built_engine(other_estimator, tmp_path_factory.mktemp("engines")))


def service_of(engine: Engine, other: Engine, folder: Path, given: Given, warm_s: float = 10.0) -> LiveService:
    rules = replace(SessionRules(), warm_s=warm_s)
    return LiveService(engine, Journal(folder / "journal.db"), rules, takers=[given], others=[other])


def send(service: LiveService, name: str, samples: Array, begin: int, end: int, size: int = 33) -> LiveSession:
    session = service.open(name, service.engine.inputs, service.engine.sample_time_s)
    for at in range(begin, end, size):
        service.receive([SampleBlock(session.handle, at, 0.005 * at, samples[at : min(at + size, end)])])
    return session


@pytest.fixture(scope="module")
def others(other_estimator: FrictionEstimator, samples: Array) -> Array:
    """Newtons of the other model, which begins at sample 300."""
    return other_estimator.real_time().run(samples[300:])[0]


def test_a_second_model_changes_nothing_until_it_takes_over_and_can_be_taken_back(
    engine: Engine, other_engine: Engine, newtons: Array, others: Array, samples: Array, tmp_path: Path
) -> None:
    given = Given()
    service = service_of(engine, other_engine, tmp_path, given)
    session = send(service, "press", samples, 0, 100)
    session.models.run_beside(other_engine.model, session.next_index, recorded=True)
    service.keep()
    send(service, "press", samples, 100, 400)
    session.models.take_over(700)
    service.keep()
    send(service, "press", samples, 400, 900)
    assert session.model == other_engine.model
    session.models.take_over(1000)
    service.keep()
    send(service, "press", samples, 900, 1200)
    assert session.model == engine.model
    np.testing.assert_array_equal(given.array(0, 700), newtons[:700])
    np.testing.assert_array_equal(given.array(700, 1000), others[400:700])
    np.testing.assert_array_equal(given.array(1000, 1200), newtons[1000:1200])
    service.keep()
    files = [pd.read_parquet(path) for path in move_into_history(service.journal, tmp_path / "history")]
    history = pd.concat(files).sort_values("index").set_index("index")
    assert history.index.tolist() == list(range(1200))
    beside = history["shadow_friction_n"]
    assert beside[:299].isna().all()
    np.testing.assert_array_equal(beside.loc[300:699], others[:400, 0])
    np.testing.assert_array_equal(beside.loc[700:999], newtons[700:1000, 0])


@pytest.mark.parametrize("killed_at", [350, 650, 760])
def test_a_kill_changes_no_bit_of_a_change(
    killed_at: int, engine: Engine, other_engine: Engine, newtons: Array, others: Array, samples: Array, tmp_path: Path
) -> None:
    """Killed before the second model takes over, between its last keeping and the change, and after it."""
    given = Given()
    service = service_of(engine, other_engine, tmp_path, given)
    session = send(service, "press", samples, 0, 100)
    session.models.run_beside(other_engine.model, session.next_index, recorded=False)
    session.models.take_over(700)
    service.keep()
    send(service, "press", samples, 100, killed_at - 30)
    service.keep()
    send(service, "press", samples, killed_at - 30, killed_at)  # lost with the process
    service.journal.close()
    again = service_of(engine, other_engine, tmp_path, given)
    send(again, "press", samples, killed_at - 30, 900)
    np.testing.assert_array_equal(given.array(0, 700), newtons[:700])
    np.testing.assert_array_equal(given.array(700, 900), others[400:600])


def test_a_change_that_is_not_kept_waits(
    engine: Engine, other_engine: Engine, newtons: Array, samples: Array, tmp_path: Path
) -> None:
    """Were it not, a kill would undo what clients have been given already."""
    given = Given()
    service = service_of(engine, other_engine, tmp_path, given)
    session = send(service, "press", samples, 0, 100)
    session.models.run_beside(other_engine.model, session.next_index, recorded=False)
    session.models.take_over(0)
    send(service, "press", samples, 100, 600)
    assert session.models.shadow is None
    np.testing.assert_array_equal(given.array(0, 600), newtons[:600])
    service.keep()
    send(service, "press", samples, 600, 1400)
    assert session.model == other_engine.model


def test_a_start_with_another_model_goes_on_with_the_old_one_until_the_new_one_is_warm(
    engine: Engine, other_engine: Engine, newtons: Array, others: Array, samples: Array, tmp_path: Path
) -> None:
    given = Given()
    before = service_of(engine, other_engine, tmp_path, given)
    send(before, "press", samples, 0, 300)
    before.keep()
    before.journal.close()
    after = service_of(other_engine, engine, tmp_path, given, warm_s=1.0)
    session = send(after, "press", samples, 300, 900)
    assert session.order.counts.resets == 0
    np.testing.assert_array_equal(given.array(0, 500), newtons[:500])
    np.testing.assert_array_equal(given.array(500, 900), others[200:600])


def test_what_could_not_be_kept_is_kept_later(service: LiveService, samples: Array, tmp_path: Path) -> None:
    session = send(service, "press", samples, 0, 66)
    saved, _ = service.unkept([session])
    send(service, "press", samples, 66, 99)
    service.not_kept(saved, "database or disk is full")
    assert (service.keeps_not_because, service.unkept_rows) == ("database or disk is full", 99)
    service.keep()
    assert (service.keeps_not_because, service.unkept_rows, session.kept_index) == ("", 0, 99)
    (path,) = move_into_history(service.journal, tmp_path / "history")
    assert pd.read_parquet(path)["index"].tolist() == list(range(99))


def test_a_journal_of_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.db"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE session (name TEXT)")
    with pytest.raises(JournalError, match="a journal of version 0, expected 2; let the program that wrote it"):
        Journal(path)
