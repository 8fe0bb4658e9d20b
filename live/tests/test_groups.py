"""Messages that are stepped as a whole give what their blocks give one at a time, whatever comes between them."""

import json
import sqlite3
import tempfile
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest

from cylinder_friction.arrays import Array
from cylinder_friction_live.connection import Connection, Peers
from cylinder_friction_live.engine import Engine
from cylinder_friction_live.frames import EstimateBlock, SampleBlock, pack_samples, unpack
from cylinder_friction_live.journal import Journal
from cylinder_friction_live.service import LiveService, LiveSession
from live_process import PATIENT
from test_connection import Wire, opening

NAMES = [f"press {number}" for number in range(5)]
OF_CLIENTS = NAMES[:3], NAMES[3:]


class Side:
    """A service with two clients that steps whole messages, or each block by itself, and all that it gave."""

    def __init__(self, engine: Engine, path: Path, whole: bool, watched: bool) -> None:
        self.engine, self.path, self.whole, self.watched, self.now_s = engine, path, whole, watched, 0.0
        self.given: list[Any] = []
        self.start()

    def start(self) -> None:
        takers, journal = [self.take] if self.watched else [], Journal(self.path)
        self.service = LiveService(self.engine, journal, None, PATIENT, takers, lambda: self.now_s)
        self.clients = [Connection(Wire(), self.service, Peers()) for _ in OF_CLIENTS]
        self.open()

    def open(self) -> None:
        for client, names in zip(self.clients, OF_CLIENTS, strict=True):
            for name in names:
                if name not in self.service.sessions:
                    client._take(opening(name))

    def take(self, session: LiveSession, block: EstimateBlock) -> None:
        samples = session.pending[-1].newest_samples(len(block)).tobytes() if block.index % 3 else b""
        self.given.append((session.name, "taken", block, samples))

    def send(self, number: int, blocks: list[SampleBlock], refused: bool) -> bool:
        """Send blocks, as one message if that is refused as a whole; return whether it was."""
        client = self.clients[number]
        before = client._peers.refused.total()
        for part in [blocks] if self.whole or refused else [[block] for block in blocks]:
            if not self.whole:
                client._groups._groups.clear()
            client._take(b"".join(map(pack_samples, part)))
        return client._peers.refused.total() > before

    def keep(self, names: list[str], fails: bool) -> None:
        saved, chunks = self.service.take_pending([self.service.sessions[name] for name in names])
        if fails:
            self.service.requeue(saved, "database or disk is full")
        else:
            self.service.journal.keep(saved, chunks)
            self.service.kept(saved)

    def collect(self) -> list[Any]:
        """All that was given so far, by session, and all that is known of the sessions."""
        names = {each.handle: name for name, each in self.service.sessions.items()}
        for number, client in enumerate(self.clients):
            for block in [block for frame in client._frames for block in unpack(frame)]:
                self.given.append((names[block.handle], type(block).__name__, block, number))
            self.given += [("", "text", text, number) for text in sorted(client._texts)]
            client._frames, client._texts = [], []
        with closing(sqlite3.connect(self.path)) as database:
            columns = "name, first_index, rows, content, samples, estimates"
            kept = database.execute(f"SELECT {columns} FROM chunk ORDER BY name, id").fetchall()
            kept += database.execute("SELECT * FROM session ORDER BY name").fetchall()
        about = self.service.outcomes(), self.service.load(), self.service.flags.totals(), self.service.kept_age_s
        known = [
            (s.name, s.next_index, s.kept_index, s.order.last_seen_s, s.latest) for s in self.service.sessions.values()
        ]
        return [sorted(self.given, key=lambda each: each[:2]), kept, about, known]


def blocks_of(side: Side, draw: Random, sent: dict[str, int], client: int, samples: Array) -> list[SampleBlock]:
    """Draw a message, mostly of the next samples of all sessions of a client."""
    names = OF_CLIENTS[client] if draw.random() < 0.97 else draw.sample(NAMES, 2)
    wrong, rows, blocks = draw.random() < 0.06, 3 if sent[names[0]] % 400 > 300 else 4, []
    for name in names:
        index, time_s, count = sent[name], 0.005 * (sent[name] % 100_000) + 9.0 + draw.uniform(-0.002, 0.002), rows
        if wrong and draw.random() < 0.5:
            index = max(0, index + draw.choice((0, 0, 0, 0, 3, 300, -2, -300)))
            count = draw.choice((rows, rows, 1))
            time_s = draw.choice((time_s, time_s + 0.004, 0.0, -1.0, 1e300, float("nan")))
        sent[name] = max(sent[name], index + count)
        part = samples[np.arange(index, index + count) % len(samples)]
        blocks.append(SampleBlock(side.service.sessions[name].handle, index, time_s, part))
    return blocks


@pytest.mark.parametrize("seed", range(20))
def test_whole_messages_give_what_single_blocks_give(
    engine: Engine, samples: Array, seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw, sent, runs = Random(seed), dict.fromkeys(NAMES, 0), list[int]()
    run_frames = Engine.run_frames
    monkeypatch.setattr(Engine, "run_frames", lambda *given: runs.append(given[2]) or run_frames(*given))
    with tempfile.TemporaryDirectory() as folder:
        sides = [Side(engine, Path(folder) / f"{whole}.db", whole, watched=seed % 3 == 0) for whole in (True, False)]
        for _ in range(300):
            what, client, name, names = draw.random(), draw.randrange(2), draw.choice(NAMES), draw.sample(NAMES, 3)
            blocks, fails = blocks_of(sides[0], draw, sent, client, samples) if what < 0.85 else [], draw.random() < 0.2
            if fails and draw.random() < 0.1:
                blocks.append(SampleBlock(999, 0, 1e9, samples[:4]))
            text = {"session": name, "index": sent[name], "time_s": 1e9, "rows": samples[:2].tolist()}
            asked = json.loads(opening(name))["open"] | {"estimates_from": draw.choice((None, 0, 20))}
            refused = False
            for side in sides:
                side.now_s += 0.1 if what < 0.98 else 601.0
                if blocks:
                    refused = side.send(client, blocks, refused)
                elif what < 0.92:
                    side.keep(names, fails)
                elif what < 0.922:
                    side.clients[client]._take(json.dumps({"samples": text}))
                elif what < 0.95:
                    side.clients[client]._take(json.dumps({"open": asked}))
                    if what > 0.935:
                        side.clients[name in OF_CLIENTS[1]]._take(json.dumps({"open": asked}))
                elif what < 0.97:
                    side.service.overdue()
                else:
                    side.keep(NAMES, False)
                    side.collect()
                    side.service.close_idle()
                    if what > 0.99:
                        side.service.journal.close()
                        side.start()
                    side.open()
                    sent |= {each: session.next_index for each, session in side.service.sessions.items()}
        one, other = (side.collect() for side in sides)
        for side in sides:
            side.service.journal.close()
    for mine, others in zip(one, other, strict=True):
        assert mine == others
    assert len(runs) > 30, len(runs)
