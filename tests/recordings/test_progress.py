"""The progress bar: for a terminal alone."""

import io
from typing import Any

import pytest

from cylinder_friction.recordings.progress import shown


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize(("stream", "seen"), [(Terminal(), True), (io.StringIO(), False), (None, False)])
def test_a_bar_is_drawn_on_a_terminal_and_the_items_are_the_same(
    stream: Any, seen: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr", stream)
    assert list(shown(iter("abc"), "ingest", 3, "file")) == ["a", "b", "c"]
    drawn = "" if stream is None else stream.getvalue()
    assert ("ingest" in drawn and "3/3" in drawn) == seen
