"""Every session's newtons are those of a stream of its own, also over a restart, and all of them reach the history."""

import re
import sqlite3
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.engine_building import build_engine
from cylinder_friction_live.frames import EstimateBlock, SampleBlock
from cylinder_friction_live.history import join_past_days, move_into_history
from cylinder_friction_live.journal import Journal, JournalError
from cylinder_friction_live.service import BusyError, LiveError, LiveService, LiveSession
from cylinder_friction_live.settings import LiveLimits, SessionRules
from live_process import keep

DAY_S = 86400.0


class Kept:
    """What a service gave, by session."""

    def __init__(self) -> None:
        self.newtons: dict[str, dict[int, tuple[float, ...]]] = {}

    def __call__(self, session: LiveSession, block: EstimateBlock) -> None:
        rows = self.newtons.setdefault(session.name, {})
        for row, (newtons, flags) in enumerate(zip(block.newtons.tolist(), block.flags.tolist(), strict=True)):
            rows[block.index + row] = (*newtons, flags)

    def array(self, name: str) -> Array:
        rows = self.newtons[name]
        return np.array([rows[index] for index in sorted(rows)])


def service_of(engine: Engine, folder: Path, kept: Kept | None = None, **settings: Any) -> LiveService:
    return LiveService(engine, Journal(folder / "journal.db"), takers=[kept] if kept else [], **settings)


def opened(service: LiveService, name: str) -> LiveSession:
    return service.open(name, service.engine.inputs, service.engine.sample_time_s)


def blocks(session: LiveSession, samples: Array, begin: int, end: int, size: int = 7) -> list[SampleBlock]:
    parts = [(at, samples[at : min(at + size, end)]) for at in range(begin, end, size)]
    return [SampleBlock(session.handle, at, 10.0 + 0.005 * at, part) for at, part in parts]


@pytest.fixture(scope="module")
def expected(newtons: Array, flags: Array) -> Array:
    return np.column_stack([newtons, flags])


def test_a_session_that_the_model_does_not_know_is_named(service: LiveService, samples: Array) -> None:
    known, foreign, silent = opened(service, "known"), opened(service, "foreign"), opened(service, "silent")
    loaded, unread = samples + np.array([20e5, 0.0, 0.0]), samples * np.array([1.0, 1.0, np.nan])
    pairs = ((known, samples), (foreign, loaded), (silent, unread))
    for each in zip(*(blocks(session, rows, 0, 1500) for session, rows in pairs), strict=True):
        service.receive(list(each))
    keep(service)
    assert known.not_known == ""
    assert re.fullmatch(r"\d+ % of the rows (hold a force that|lie outside the range) .*", foreign.not_known)
    assert silent.not_known.startswith("100 % of the rows have no estimate: no sample with a valid reading of every")


def test_a_session_too_noisy_for_the_bounds_is_named(service: LiveService, engine: Engine, samples: Array) -> None:
    known, noisy = opened(service, "known"), opened(service, "noisy")
    rows = np.tile(samples, (4, 1))
    added_pa = np.random.default_rng(0).normal(0.0, 4.0 * engine.pressure_noise_pa, rows.shape) * [1.0, 1.0, 0.0]
    added_pa[500:600] = np.nan  # which does not count
    both = (blocks(session, each, 0, 14_500, 500) for session, each in ((known, rows), (noisy, rows + added_pa)))
    for pair in zip(*both, strict=True):
        service.receive(list(pair))
        keep(service)
    assert known.noise.noise_pa == pytest.approx(engine.pressure_noise_pa, rel=0.5)
    assert (known.too_narrow, service.load()["noisy_sessions"]) == ("", 1)
    assert re.fullmatch(r"pressures are (3|4)\.\d times as noisy as .*, and bounds are too narrow", noisy.too_narrow)


def test_it_goes_on_after_a_kill(engine: Engine, expected: Array, samples: Array, tmp_path: Path) -> None:
    """What was not kept is sent again; nothing else is, and the history has each sample once."""
    kept = Kept()
    before = service_of(engine, tmp_path, kept)
    session = opened(before, "press 1")
    before.receive(blocks(session, samples, 0, 300))
    keep(before)
    assert session.kept_index == 300
    before.receive(blocks(session, samples, 300, 450))  # lost with the process
    before.journal.close()

    after = service_of(engine, tmp_path, kept)
    again = opened(after, "press 1")
    assert again.next_index == again.kept_index == 300
    assert again.order.counts.stepped == 300
    after.receive(blocks(again, samples, 280, 600))
    assert again.order.counts.duplicate == 20
    keep(after)
    np.testing.assert_array_equal(kept.array("press 1"), expected[:600])

    files = move_into_history(after.journal)
    table = pd.read_parquet(files[0])
    assert files == [tmp_path / "history/press%201/1970-01-01/0000000000000000.parquet"]
    assert table["index"].tolist() == list(range(600))
    np.testing.assert_allclose(table["time_s"], 10.0 + 0.005 * np.arange(600))
    np.testing.assert_array_equal(table[list(engine.inputs)], samples[:600])
    np.testing.assert_array_equal(table[["friction_n", "lower_n", "upper_n", "flags"]], expected[:600])
    assert move_into_history(after.journal) == []


def test_a_restart_with_another_model_lets_sessions_begin_anew_and_states_so(
    engine: Engine, other_estimator: HybridEstimator, newtons: Array, samples: Array, tmp_path: Path
) -> None:
    kept = Kept()
    before = service_of(engine, tmp_path, kept)
    before.receive(blocks(opened(before, "press"), samples, 0, 300))
    keep(before)
    before.journal.close()
    other = Engine(build_engine(other_estimator, tmp_path / "engines"))
    after = service_of(other, tmp_path, kept)
    session = opened(after, "press")
    words = f"the session was kept by model {engine.model[:12]}, and the service runs {other.model[:12]}"
    assert session.begins_anew == words
    assert (session.next_index, session.order.counts.resets) == (300, 1)
    after.receive(blocks(session, samples, 300, 600))
    keep(after)
    assert session.begins_anew == ""
    np.testing.assert_array_equal(kept.array("press")[:300, :3], newtons[:300])
    np.testing.assert_array_equal(kept.array("press")[300:, :3], other_estimator.real_time().run(samples[300:600])[0])
    files = move_into_history(after.journal)
    models = {pq.read_schema(path).metadata[b"model"].decode(): len(pd.read_parquet(path)) for path in files}
    assert models == {engine.model: 300, other.model: 300}


def test_what_is_not_written_in_time_stays_in_the_journal(service: LiveService, samples: Array, tmp_path: Path) -> None:
    for name in ("press 1", "press 2"):
        service.receive(blocks(opened(service, name), samples, 0, 100))
    keep(service)
    assert move_into_history(service.journal, within_s=0.0) == []
    service.journal.forget(service.journal.last_chunk(), but=["press 2"])
    assert service.journal.with_chunks(service.journal.last_chunk()) == ["press 2"]
    (path,) = move_into_history(service.journal)
    assert pd.read_parquet(path)["index"].tolist() == list(range(100))
    assert path.parts[-3] == "press%202"


def test_a_past_day_becomes_one_file_also_over_a_kill(service: LiveService, samples: Array, tmp_path: Path) -> None:
    session = opened(service, "press")
    for at in range(0, 40, 10):
        service.receive([SampleBlock(session.handle, at, 60.0 + 0.005 * at, samples[at : at + 10])])
        keep(service)
        paths = move_into_history(service.journal)
    left_by_a_kill = paths[0].read_bytes()
    assert join_past_days(tmp_path / "history") == []  # today may grow
    service.receive([SampleBlock(session.handle, 40, DAY_S, samples[40:50])])
    keep(service)
    move_into_history(service.journal)
    (joined,) = join_past_days(tmp_path / "history")
    paths[0].write_bytes(left_by_a_kill)
    for _ in range(2):
        assert join_past_days(tmp_path / "history") == []
        assert list(joined.parent.iterdir()) == [joined]
        assert pd.read_parquet(joined)["index"].tolist() == list(range(40))


def test_estimates_are_given_again_once(service: LiveService, newtons: Array, samples: Array) -> None:
    session = opened(service, "press")

    def given() -> Array:
        return np.vstack([block.newtons for block in service.given_from(session, 30)])

    service.receive(blocks(session, samples, 0, 200))
    saved, chunks = service.take_pending([session])
    service.receive(blocks(session, samples, 200, 300))
    for step in (
        lambda: None,
        lambda: service.journal.keep(saved, chunks),
        lambda: service.kept(saved),
        lambda: keep(service),
    ):
        step()
        np.testing.assert_array_equal(given(), newtons[30:300])


def test_an_idle_session_comes_back_as_it_was_and_outcomes_count_since_the_start(
    engine: Engine, expected: Array, samples: Array, tmp_path: Path
) -> None:
    kept, now_s = Kept(), [0.0]
    before = service_of(engine, tmp_path, kept, clock=lambda: now_s[0])
    before.receive(blocks(opened(before, "press"), samples, 0, 100))
    now_s[0] = 601.0
    assert before.close_idle() == []  # its samples are not kept yet
    keep(before)
    assert before.close_idle() == ["press"]
    assert before.sessions == {}
    assert before.outcomes()["stepped"] == 100
    before.receive(blocks(opened(before, "press"), samples, 90, 130))
    assert (before.outcomes()["stepped"], before.outcomes()["duplicate"]) == (130, 10)
    np.testing.assert_array_equal(kept.array("press"), expected[:130])
    keep(before)
    before.journal.close()
    after = service_of(engine, tmp_path)
    opened(after, "press")
    assert set(after.outcomes().values()) == {0}
    assert "late" in after.outcomes()  # also of a service that nothing has come to: a rate begins at a count of 0


def test_what_could_not_be_kept_is_kept_later(service: LiveService, samples: Array, tmp_path: Path) -> None:
    session = opened(service, "press")
    service.receive(blocks(session, samples, 0, 66))
    saved, _ = service.take_pending([session])
    service.receive(blocks(session, samples, 66, 99))
    service.requeue(saved, "database or disk is full")
    assert (service.keeps_not_because, service.unkept_rows) == ("database or disk is full", 99)
    keep(service)
    assert (service.keeps_not_because, service.unkept_rows, session.kept_index) == ("", 0, 99)
    (path,) = move_into_history(service.journal)
    assert pd.read_parquet(path)["index"].tolist() == list(range(99))


def test_a_journal_of_another_version_is_refused(tmp_path: Path) -> None:
    with sqlite3.connect(tmp_path / "journal.db") as database:
        database.execute("CREATE TABLE session (name TEXT)")
    with pytest.raises(JournalError, match="a journal of version 0, expected 4; let the program that wrote it"):
        Journal(tmp_path / "journal.db")


@pytest.mark.parametrize(
    ("name", "inputs", "sample_time_s", "words"),
    [
        ("../etc\n", None, None, "expected 1 to 80 letters"),
        (".", None, None, "a letter or digit among them"),
        ("..", None, None, "a letter or digit among them"),
        ("\u6cb9" * 60, None, None, "at most 200 bytes as the name of a folder"),
        ("press", ("position_m",), None, r"got columns \['position_m'\]; the model takes"),
        ("press", None, 0.001, "got a sample time of 0.001 s; the model was trained at 0.005 s"),
        ("press", None, float("nan"), "got a sample time of nan s"),
    ],
)
def test_what_the_model_is_not_made_for_is_refused(
    service: LiveService, name: str, inputs: tuple[str, ...] | None, sample_time_s: float | None, words: str
) -> None:
    with pytest.raises(LiveError, match=words):
        service.open(name, inputs or service.engine.inputs, sample_time_s or service.engine.sample_time_s)


def test_sessions_that_no_client_has_give_way_once_they_are_kept(
    service: LiveService, newtons: Array, samples: Array
) -> None:
    service.limits, kept = LiveLimits(sessions=2), Kept()
    service.takers.append(kept)
    for name in ("first", "second"):
        service.receive(blocks(opened(service, name), samples, 0, 100))
    with pytest.raises(BusyError, match="'third': 2 sessions are open, all that are taken; try later"):
        opened(service, "third")  # the journal does not hold the others yet
    assert service.full != ""
    keep(service)
    assert service.full == ""
    opened(service, "third")
    assert set(service.sessions) == {"second", "third"}
    service.receive(blocks(opened(service, "first"), samples, 100, 200))
    assert set(service.sessions) == {"third", "first"}
    np.testing.assert_array_equal(kept.array("first")[:, :3], newtons[:200])


def test_a_wrong_block_is_refused(service: LiveService, samples: Array) -> None:
    session = opened(service, "one")
    good = blocks(session, samples, 0, 7)
    for wrong, words in (
        (SampleBlock(99, 0, 0.0, samples[:2]), "handle 99: no open session has it"),
        (SampleBlock(session.handle, 7, 0.0, samples[:2, :1]), "got 1 columns"),
        (SampleBlock(session.handle, 7, 1e300, samples[:2]), "expected seconds since 1970, before the year 2242"),
        (SampleBlock(session.handle, 7, -1.0, samples[:2]), "got time -1.0"),
        (
            SampleBlock(session.handle, 2**53 - 1, 0.0, samples[:1]),
            "leaves no room for later samples; expected at most",
        ),
    ):
        with pytest.raises(LiveError, match=words):
            service.receive([*good, wrong])
    assert session.next_index == 0


def test_whatever_index_is_taken_leaves_room_for_later_samples(service: LiveService, samples: Array) -> None:
    session = opened(service, "press")
    service.receive([SampleBlock(session.handle, 2**52, 0.0, samples[:1])])
    for index in (2**52 + 2, 2**53 - 1):
        with suppress(LiveError):
            service.receive([SampleBlock(session.handle, index, 0.0, samples[:1])])
    session.order.rules = SessionRules(hold_s=1e-9)
    service.overdue()
    assert session.next_index == 2**52 + 3
    service.receive([SampleBlock(session.handle, 2**52 + 3, 0.0, samples[:10])])
    assert session.next_index == 2**52 + 13


def test_a_session_that_cannot_be_written_stops_no_other(service: LiveService, samples: Array, tmp_path: Path) -> None:
    for name in ("bad", "good"):
        service.receive(blocks(opened(service, name), samples, 0, 7))
    keep(service)
    history = tmp_path / "history"
    history.mkdir()
    (history / "bad").write_text("a file where its folder would be")
    files = move_into_history(service.journal)
    days = {path.parent.relative_to(history).as_posix() for path in files}
    assert days == {"good/1970-01-01"}
    assert service.journal.with_chunks(service.journal.last_chunk()) == ["bad"]


@pytest.mark.parametrize("name", ["journal.db", "journal.db-wal"])
def test_a_journal_that_is_removed_is_noticed(service: LiveService, samples: Array, tmp_path: Path, name: str) -> None:
    session = opened(service, "press")
    service.receive(blocks(session, samples, 0, 7))
    (tmp_path / name).unlink()
    with pytest.raises(OSError, match=f"{name} was removed or replaced while the service ran; start it again"):
        keep(service)
    assert session.kept_index == 0
