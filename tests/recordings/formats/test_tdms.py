from pathlib import Path
from typing import Any

import numpy as np
from nptdms import ChannelObject, TdmsWriter

from cylinder_friction.recordings.formats.reading import read_logged_file


def written(folder: Path, *channels: tuple[str, str, Any, dict[str, Any]]) -> Path:
    path = folder / "log.tdms"
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([ChannelObject(*place, data, properties=more) for *place, data, more in channels])
    return path


def wave(step: float, start: str, offset: float = 0.0) -> dict[str, Any]:
    return {"wf_increment": step, "wf_start_offset": offset, "wf_start_time": np.datetime64(start)}


def test_waveforms_get_a_time_that_groups_share(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        ("fast", "P1", np.arange(6.0), wave(0.005, "2026-03-14T08:15:00", 0.1) | {"unit_string": "bar"}),
        ("slow", "x", np.arange(3, dtype=np.int32), wave(0.01, "2026-03-14T08:15:02")),
    )
    fast, slow = read_logged_file(path)
    assert (fast.name, slow.name) == ("fast", "slow")
    np.testing.assert_allclose(fast.channels["time"], 0.1 + np.arange(6) * 0.005, rtol=1e-12)
    np.testing.assert_allclose(slow.channels["time"], 2.0 + np.arange(3) * 0.01, rtol=1e-12)
    assert fast.units == {"time": "s", "P1": "bar"}


def test_channels_of_other_lengths_make_another_table(tmp_path: Path) -> None:
    stamps = np.array(["2026-03-14T08:15:00", "2026-03-14T08:15:01"], dtype="datetime64[us]")
    channels = {"P1": np.arange(6.0), "when": stamps, "state": ["up", "down"]}
    path = written(tmp_path, *(("bench", name, values, {}) for name, values in channels.items()))
    long, short = read_logged_file(path)
    assert list(long.channels.columns) == ["P1"]
    assert short.channels["when"].dtype == np.dtype("datetime64[ns]")
    np.testing.assert_array_equal(short.channels["when"].to_numpy(), stamps.astype("datetime64[ns]"))
    assert short.channels["state"].tolist() == ["up", "down"]


def test_a_segment_that_is_cut_off_is_said(tmp_path: Path) -> None:
    path = written(tmp_path, ("bench", "t", np.arange(400.0), {}), ("bench", "P1", np.arange(400.0), {}))
    content = path.read_bytes()
    path.write_bytes(content[: -8 * 100])
    tables = read_logged_file(path)
    assert any(len(table.channels) < 400 for table in tables)
    assert all("ends within its last segment, and the samples behind are lost" in table.notes[0] for table in tables)


def test_a_logged_clock_takes_precedence_over_that_of_the_waveforms(tmp_path: Path) -> None:
    made_up, stamps = wave(0.001, "2026-03-14T08:15:00"), 0.005 * np.arange(40)
    for name, unit in (("Time (s)", ""), ("Zeit", ""), ("Elapsed", "s"), ("Untitled", "")):
        path = written(
            tmp_path,
            ("Log", name, stamps, made_up | {"unit_string": unit}),
            ("Log", "count", np.arange(40.0), made_up),
            ("Log", "P1", np.sin(stamps), made_up),
        )
        (table,) = read_logged_file(path)
        assert list(table.channels) == [name, "count", "P1"]
        assert table.start is not None
        assert table.start.text() == "2026-03-14T08:15:00.000Z"
