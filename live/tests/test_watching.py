"""What the page is sent of sessions that ended, and of those that are replayed."""

import json
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from websockets.sync.client import ClientConnection, connect

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.recording import Recording
from cylinder_friction_live.client import Client
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.history import last_rows, move_into_history
from cylinder_friction_live.journal import HISTORY_FOLDER, Journal
from cylinder_friction_live.replay import Replay
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.settings import SessionRules
from live_process import keep

INPUTS = ("pressure_1_pa", "pressure_2_pa", "position_m")


def the_next(page: ClientConnection, key: str) -> dict[str, Any]:
    """The next message that holds a key."""
    while key not in (content := json.loads(page.recv(timeout=60.0))):
        pass
    return dict(content)


def test_after_the_end_a_page_gets_the_last_rows(served: Callable[..., str], samples: Array, tmp_path: Path) -> None:
    address = served()
    with Client(f"ws://{address}/stream", "press", 0.005) as client:
        client.send(samples[:400])
        client.wait_until_kept()
    damaged = tmp_path / HISTORY_FOLDER / "press/2026-01-01/0000000000000000.parquet"
    damaged.parent.mkdir(parents=True)
    damaged.write_bytes(b"nothing that Parquet is")
    with connect(f"ws://{address}/watch") as page:
        flag = json.loads(page.recv(timeout=60.0))["flags"][1]
        assert (flag["name"], flag["meaning"]) == ("WARMING", "The state still remembers the start, for 3 s")
        page.send("press")
        shown = the_next(page, "rows")
        assert shown["begins"]
        assert shown["rows"]["index"] == list(range(400))
        np.testing.assert_array_equal(shown["rows"]["samples"], samples[:400])
        while not (row := the_next(page, "sessions")["sessions"][0])["ended"]:
            pass
        assert row["rest_s"] > 0.0


def test_a_page_that_waits_for_a_session_gets_it_once_it_is_open(served: Callable[..., str], samples: Array) -> None:
    address = served()
    with connect(f"ws://{address}/watch") as page:
        page.send("press")
        the_next(page, "sessions")
        with Client(f"ws://{address}/stream", "press", 0.005) as client:
            client.send(samples[:100])
            shown = the_next(page, "rows")
    assert shown["begins"]
    assert shown["rows"]["index"][0] == 0


def test_a_session_without_an_estimate_has_no_newtons(served: Callable[..., str]) -> None:
    address = served()
    with connect(f"ws://{address}/watch") as page, Client(f"ws://{address}/stream", "press", 0.005):
        while not (rows := the_next(page, "sessions")["sessions"]):
            pass
    assert (rows[0]["newtons"], rows[0]["lag_s"]) == (None, None)


def test_a_replay_is_not_of_the_future(served: Callable[..., str], labelled_recordings: list[Recording]) -> None:
    address = served()
    recordings = [each.rows(slice(0, 300)) for each in labelled_recordings[:2]]
    for speed in (None, 50.0):
        replay = Replay(f"ws://{address}/stream", {f"at {speed}": recordings}, speed)
        assert replay.run(INPUTS, threading.Event()) == 600
    with connect(f"ws://{address}/watch") as page:
        rows = the_next(page, "sessions")["sessions"]
    assert [row["counts"]["resets"] for row in rows] == [1, 1]
    assert all(0.0 <= row["lag_s"] < 60.0 for row in rows)


def test_last_rows_come_from_the_history_without_a_gap(engine: Engine, samples: Array, tmp_path: Path) -> None:
    inputs = engine.inputs
    assert last_rows(tmp_path / HISTORY_FOLDER, "press", inputs, 50) is None
    with closing(Journal(tmp_path / "journal.db")) as journal:
        service = LiveService(engine, journal)
        session = service.open("press", inputs, engine.sample_time_s)
        for first in (0, 100, 400):  # the last begins anew
            block = SampleBlock(session.handle, first, 1e9 + 0.005 * first, samples[first : first + 100])
            service.receive([block])
            service.sessions["press"].order.rules = SessionRules(hold_s=1e-9)
            service.overdue()
            keep(service)
            move_into_history(journal)
    for before, index in ((None, range(450, 500)), (420, range(400, 420)), (150, range(100, 150)), (0, ())):
        found = last_rows(tmp_path / HISTORY_FOLDER, "press", inputs, 50, before)
        if not index:
            assert found is None
            continue
        assert found is not None
        estimates, rows = found
        assert (estimates.index, len(estimates), estimates.model) == (index[0], len(index), engine.model)
        np.testing.assert_array_equal(rows, samples[index[0] : index[-1] + 1])
