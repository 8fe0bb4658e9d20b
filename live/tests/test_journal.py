"""What is damaged in the journal costs one session its state, and no other session anything."""

import asyncio
import json
import re
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction_live.connection import Connection, Peers
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.frames import EstimateBlock, SampleBlock, pack_samples, unpack
from cylinder_friction_live.history import move_into_history, write_session
from cylinder_friction_live.journal import PAGE_BYTES, Journal
from cylinder_friction_live.service import LiveService
from live_process import PATIENT, keep
from test_connection import Wire, opening

ROWS = 100
DAMAGES = {
    "UPDATE session SET content = '{' WHERE name = ?": "damaged (Expecting property name",
    "UPDATE session SET content = '7' WHERE name = ?": "damaged ('int' object",
    "UPDATE session SET content = replace(content, '100', '102') WHERE name = ?": "its checksum differs",
    "UPDATE session SET state = substr(state, 2) WHERE name = ?": "its checksum differs",
    "UPDATE session SET state = zeroblob(length(state)) WHERE name = ?": "its checksum differs",
    "DELETE FROM session WHERE name = ?": "the journal no longer holds its state",
}


def kept(engine: Engine, folder: Path, names: list[str], samples: Array) -> None:
    """Step the first rows of sessions, and end with all of them in the journal."""
    with closing(Journal(folder / "journal.db")) as journal:
        service = LiveService(engine, journal, limits=PATIENT)
        for name in names:
            session = service.open(name, engine.inputs, engine.sample_time_s)
            service.receive([SampleBlock(session.handle, 0, 10.0, samples[:ROWS])])
        keep(service)


def resumed(engine: Engine, folder: Path, names: list[str], samples: Array) -> dict[str, tuple[str, Array]]:
    """Open sessions over one connection and send the next rows; return why each began anew, and its newtons."""
    with closing(Journal(folder / "journal.db")) as journal:
        service = LiveService(engine, journal, limits=PATIENT)
        message = b"".join(
            pack_samples(SampleBlock(handle, ROWS, 10.5, samples[ROWS : 2 * ROWS]))
            for handle in range(1, len(names) + 1)
        )
        wire = Wire(*map(opening, names), message)
        asyncio.run(Connection(wire, service, Peers()).run())
        keep(service)
        move_into_history(journal)
    replies = [json.loads(each)["opened"] for each in wire.got if isinstance(each, str)]
    frames = b"".join(each for each in wire.got if isinstance(each, bytes))
    newtons = {each.handle: each.newtons for each in unpack(frames) if isinstance(each, EstimateBlock)}
    assert [each["next_index"] for each in replies] == [ROWS] * len(names)
    return {each["session"]: (each["begins_anew"], newtons[each["handle"]]) for each in replies}


@pytest.mark.parametrize("in_history", [False, True])
@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_row_costs_its_session_alone(
    engine: Engine, newtons: Array, samples: Array, tmp_path: Path, damage: str, in_history: bool,
    small_hybrid: HybridEstimator,
) -> None:  # fmt: skip
    names = ["press 1", "press 2", "press 3"]
    kept(engine, tmp_path, names, samples)
    if in_history:
        with closing(Journal(tmp_path / "journal.db")) as journal:
            move_into_history(journal)
    with closing(sqlite3.connect(tmp_path / "journal.db")) as database, database:
        assert database.execute(damage, ("press 2",)).rowcount == 1
    after = resumed(engine, tmp_path, names, samples)
    assert DAMAGES[damage] in after["press 2"][0]
    np.testing.assert_array_equal(after["press 2"][1], small_hybrid.real_time().run(samples[ROWS : 2 * ROWS])[0])
    for name in ("press 1", "press 3"):
        assert after[name][0] == ""
        np.testing.assert_array_equal(after[name][1], newtons[ROWS : 2 * ROWS])


def test_a_session_that_begins_anew_replaces_no_file_of_the_history(
    engine: Engine, samples: Array, tmp_path: Path
) -> None:
    kept(engine, tmp_path, ["press"], samples)
    with closing(Journal(tmp_path / "journal.db")) as journal:
        (first,) = move_into_history(journal)
    for path in tmp_path.glob("journal.db*"):
        path.unlink()
    before = first.read_bytes()
    ((why, _),) = resumed(engine, tmp_path, ["press"], samples).values()
    assert why == "the journal no longer holds its state"
    assert first.read_bytes() == before
    rows = pd.concat([pd.read_parquet(path) for path in sorted(first.parent.iterdir())])
    assert rows["index"].tolist() == list(range(2 * ROWS))


@pytest.mark.parametrize("lost", ["sessions", "chunks", "one page"])
def test_a_journal_that_was_cut_costs_the_sessions_of_the_lost_part(
    engine: Engine, newtons: Array, samples: Array, tmp_path: Path, lost: str, caplog: pytest.LogCaptureFixture
) -> None:
    names, path = [f"press {place:03d}" for place in range(200)], tmp_path / "journal.db"
    kept(engine, tmp_path, names, samples)
    with closing(Journal(path)) as journal:
        for name in names:
            write_session(journal, name, journal.last_chunk())
    content = path.read_bytes()
    of_sessions = [each.start() for each in re.finditer(b'"next_index"', content)]
    page = of_sessions[len(of_sessions) // 2] // PAGE_BYTES * PAGE_BYTES
    path.write_bytes({
        "sessions": content[:page],
        "chunks": content[: len(content) // 2],
        "one page": content[:page] + bytes(PAGE_BYTES) + content[page + PAGE_BYTES :],
    }[lost])  # fmt: skip
    after = resumed(engine, tmp_path, names, samples)
    (aside,) = tmp_path.glob("journal-damaged-*.db")
    assert f"{path} is damaged (" in caplog.text
    assert str(aside) in caplog.text
    whole = [name for name in names if not after[name][0]]
    assert len(whole) > 0
    assert (len(whole) < len(names)) == (lost != "chunks")
    for name in whole:
        np.testing.assert_array_equal(after[name][1], newtons[ROWS : 2 * ROWS])
    assert {after[name][0] for name in names if name not in whole} <= {"the journal no longer holds its state"}


def test_a_file_that_is_no_journal_is_set_aside(engine: Engine, samples: Array, tmp_path: Path) -> None:
    (tmp_path / "journal.db").write_bytes(b"nothing that SQLite is" * 1000)
    kept(engine, tmp_path, ["press"], samples)
    (aside,) = tmp_path.glob("journal-damaged-*.db")
    assert aside.read_bytes() == b"nothing that SQLite is" * 1000


def test_damaged_estimates_are_left_out_and_named(
    engine: Engine, samples: Array, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kept(engine, tmp_path, ["press 1", "press 2"], samples)
    with closing(sqlite3.connect(tmp_path / "journal.db")) as database, database:
        database.execute("UPDATE chunk SET estimates = zeroblob(length(estimates)) WHERE name = 'press 1'")
    with closing(Journal(tmp_path / "journal.db")) as journal:
        (path,) = move_into_history(journal)
        assert journal.with_chunks(journal.last_chunk()) == []
    assert path.parts[-3] == "press%202"
    assert "session 'press 1': samples 0 to 99 are damaged (its checksum differs)" in caplog.text
