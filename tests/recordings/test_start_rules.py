from typing import Any

import numpy as np
import pytest

from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import Start
from cylinder_friction.recordings.start_rules import StartRules

PATTERN = r"(?P<day>\d\d)(?P<month>\d\d)(?P<year>\d\d)(?:_(?P<hour>\d\d)(?P<minute>\d\d))?"


@pytest.mark.parametrize(
    ("path", "text"),
    [
        ("press_270326_1015.csv", "2026-03-27T09:15:00.000Z"),
        ("press_270726_1015.csv", "2026-07-27T08:15:00.000Z"),  # summer time
        ("press_270326.csv", "2026-03-27"),
        ("press_310226.csv", None),
        ("press.csv", None),
    ],
)
def test_a_file_name_states_the_start(path: str, text: str | None) -> None:
    start = StartRules("Europe/Oslo", PATTERN).of(None, path)
    assert (start and start.text()) == text


def test_what_the_log_states_takes_precedence() -> None:
    stated = Start(np.datetime64("2026-01-02T03:04:05", "ns"), utc=True, source="header")
    assert StartRules("Europe/Oslo", PATTERN).of(stated, "press_270326_1015.csv") == stated


@pytest.mark.parametrize("path", ["251026_0230", "290326_0230"])
def test_an_hour_that_was_twice_or_never_stays_local(path: str) -> None:
    start = StartRules("Europe/Oslo", PATTERN).of(None, path)
    assert start is not None
    assert not start.utc
    assert start.source == "file name; in Europe/Oslo that hour was twice or never"


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"zone": "Europe/Oslow"}, "zone: got 'Europe/Oslow', expected a name of the time zone database such as"),
        ({"zone": "../../etc/passwd"}, "zone: got '../../etc/passwd', expected a name"),
        ({"pattern": "("}, "pattern: '\\(' is not a regular expression: missing"),
        (
            {"pattern": "(?P<year>x)"},
            "got groups year, expected year, month, day, and if you like hour, minute, second",
        ),
    ],
)
def test_wrong_settings_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        StartRules(**settings)
