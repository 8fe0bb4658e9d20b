"""Messages that are stepped as a whole give what their blocks give one at a time, whatever comes between them."""

import json
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

CLIENTS = ("press 0", "press 1", "press 2"), ("press 3", "press 4")
NAMES = [*CLIENTS[0], *CLIENTS[1]]


class Side:
    """A service with two clients that steps whole messages, or each block by itself, and all that it gave."""

    def __init__(self, engine: Engine, path: Path, whole: bool, watched: bool) -> None:
        self.engine, self.path, self.whole, self.now_s = engine, path, whole, 0.0
        self.takers, self.given = [self.take] if watched else [], list[Any]()
        self.start()

    def start(self) -> None:
        self.service = LiveService(self.engine, Journal(self.path), None, PATIENT, self.takers, lambda: self.now_s)
        self.clients = [Connection(Wire(), self.service, Peers()) for _ in CLIENTS]
        self.open(NAMES)

    def open(self, names: list[str]) -> None:
        for name in names:
            self.clients[name in CLIENTS[1]]._take(opening(name))

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
            return
        self.service.journal.keep(saved, chunks)
        self.service.kept(saved)

    def everything(self) -> list[Any]:
        """All that was given so far, by session, and all that is known of the sessions."""
        for number, client in enumerate(self.clients):
            blocks = [block for frame in client._frames for block in unpack(frame)]
            self.given += [(f"{block.handle}", type(block).__name__, block, number) for block in blocks]
            self.given += [("", "text", text, number) for text in sorted(client._texts)]
            client._frames, client._texts = [], []
        reading = self.service.journal._reading
        kept = [reading.execute(f"SELECT * FROM {table} ORDER BY name").fetchall() for table in ("chunk", "session")]
        about = self.service.outcomes(), self.service.load(), self.service.flags.totals(), self.service.kept_age_s
        known = [(s.order.last_seen_s, s.next_index, s.kept_index, s.latest) for s in self.service.sessions.values()]
        return [sorted(self.given, key=lambda each: each[:2]), kept, about, known]


def drawn_blocks(side: Side, draw: Random, sent: dict[str, int], client: int, samples: Array) -> list[SampleBlock]:
    """Draw a message, mostly of the next samples of all sessions of a client."""
    names = CLIENTS[client] if draw.random() < 0.97 else draw.sample(NAMES, 2)
    wrong, rows, blocks = draw.random() < 0.06, 3 if sent[names[0]] % 400 > 300 else 4, []
    for name in names:
        index, time_s = sent[name], 9.0 + 0.005 * sent[name] + draw.uniform(-0.002, 0.002)
        if wrong and draw.random() < 0.5:
            index = max(0, index + draw.choice((0, 0, 0, 0, 3, 300, -2, -300)))
            time_s = draw.choice((time_s, time_s + 0.004, 0.0, -1.0, 1e300, float("nan")))
        sent[name] = max(sent[name], index + rows)
        part = samples[np.arange(index, index + rows) % len(samples)]
        blocks.append(SampleBlock(side.service.sessions[name].handle, index, time_s, part))
    return blocks


@pytest.mark.parametrize("seed", range(20))
def test_whole_messages_give_what_single_blocks_give(
    engine: Engine, samples: Array, seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    draw, sent, runs, run_frames = Random(seed), dict.fromkeys(NAMES, 0), list[int](), Engine.run_frames
    monkeypatch.setattr(Engine, "run_frames", lambda *given: runs.append(given[2]) or run_frames(*given))
    sides = [Side(engine, tmp_path / f"{whole}.db", whole, watched=seed % 3 == 0) for whole in (True, False)]
    for _ in range(300):
        what, client, name, names = draw.random(), draw.randrange(2), draw.choice(NAMES), draw.sample(NAMES, 3)
        blocks = drawn_blocks(sides[0], draw, sent, client, samples) if what < 0.85 else []
        text = {"session": name, "index": sent[name], "time_s": 1e9, "rows": samples[:2].tolist()}
        asked = json.loads(opening(name))["open"] | {"estimates_from": draw.choice((None, 0, 20))}
        refused = False
        for side in sides:
            side.now_s += 0.1 if what < 0.98 else 601.0
            side.service.overdue()
            if blocks:
                refused = side.send(client, blocks, refused)
            elif what < 0.92:
                side.keep(names, fails=what < 0.865)
            elif what < 0.922:
                side.clients[client]._take(json.dumps({"samples": text}))
            elif what < 0.96:
                side.clients[client]._take(json.dumps({"open": asked}))
                side.open([name] if what > 0.935 else [])
            else:
                side.keep(NAMES, fails=False)
                side.service.close_idle()
                if what > 0.99:
                    side.everything()
                    side.start()
                side.open([each for each in NAMES if each not in side.service.sessions])
                sent |= {each: session.next_index for each, session in side.service.sessions.items()}
    for one, other in zip(*(side.everything() for side in sides), strict=True):
        assert one == other
    assert len(runs) > 30
