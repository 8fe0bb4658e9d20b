"""The table of malformed requests, sent to a small model: each gets what the table states, and no number is wrong."""

from typing import Any

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from cylinder_friction.recordings.recording import Recording


def test_every_request_gets_what_the_table_states(
    script: Any, server: Any, small_model: StepModel, labelled_recordings: list[Recording]
) -> None:
    table = script.cases(labelled_recordings[0].samples()[:700])
    found = script.run(server, table, lambda samples: RealTimeStream(small_model).run(samples))
    wrong = [f"{case.name}: {reply and reply.status} {text}" for case, reply, text in found if text]
    assert wrong == []
    assert server.get("/livez").status == 200
