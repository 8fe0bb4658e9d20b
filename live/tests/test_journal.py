"""What is kept, when it could not be, and by which version."""

import sqlite3
from pathlib import Path

import pandas as pd
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.history import move_into_history
from cylinder_friction_live.journal import Journal, JournalError
from cylinder_friction_live.service import LiveService, LiveSession


def send(service: LiveService, name: str, samples: Array, begin: int, end: int) -> LiveSession:
    session = service.open(name, service.engine.inputs, service.engine.sample_time_s)
    for at in range(begin, end, 33):
        service.receive([SampleBlock(session.handle, at, 0.005 * at, samples[at : min(at + 33, end)])])
    return session


def test_what_could_not_be_kept_is_kept_later(service: LiveService, samples: Array, tmp_path: Path) -> None:
    session = send(service, "press", samples, 0, 66)
    saved, _ = service.take_pending([session])
    send(service, "press", samples, 66, 99)
    service.requeue(saved, "database or disk is full")
    assert (service.keeps_not_because, service.unkept_rows) == ("database or disk is full", 99)
    service.keep()
    assert (service.keeps_not_because, service.unkept_rows, session.kept_index) == ("", 0, 99)
    (path,) = move_into_history(service.journal, tmp_path / "history")
    assert pd.read_parquet(path)["index"].tolist() == list(range(99))


def test_a_journal_of_another_version_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "journal.db"
    with sqlite3.connect(path) as database:
        database.execute("CREATE TABLE session (name TEXT)")
    with pytest.raises(JournalError, match="a journal of version 0, expected 3; let the program that wrote it"):
        Journal(path)
