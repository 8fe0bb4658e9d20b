import shutil
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.rig.campaign import campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan

CHANNELS = {
    "time_s": {"channel": "t [s]", "unit": "s"},
    "pressure_1_pa": {"channel": "p_A [bar]", "unit": "bar"},
    "pressure_2_pa": {"channel": "p_B [bar]", "unit": "bar"},
    "position_m": {"channel": "x [mm]", "unit": "mm"},
}
NAMES = r"(?P<session>condition(?P<condition>[^_/]+)_session[^_/]+)_"


@pytest.fixture(scope="module")
def rig_tables(cylinder: Cylinder) -> dict[str, pd.DataFrame]:
    """Return three recordings of the simulated rig as the logger saw them."""
    plan = CampaignPlan(seed=11, sessions_per_condition=1, recordings_per_session=2, duration_s=40.0)
    names = {"Time [s]": "t [s]", "P1 [bar]": "p_A [bar]", "P2 [bar]": "p_B [bar]", "Position [mm]": "x [mm]"}
    first = islice(campaign(cylinder, plan), 3)
    return {each.metadata.name: each.logger[list(names)].rename(columns=names) for each in first}


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, rig_tables: dict[str, pd.DataFrame]) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    for name, table in rig_tables.items():
        table.to_csv(folder / f"{name}.csv", index=False)
    return folder


def test_files_become_recordings_by_path(logs: Path, cylinder: Cylinder, rig_tables: dict[str, pd.DataFrame]) -> None:
    recordings = read_recordings(str(logs / "*.csv"), CHANNELS, cylinder)
    assert [recording.name for recording in recordings] == sorted(rig_tables)
    first = recordings[0]
    np.testing.assert_allclose(first.samples() / [1e5, 1e5, 1e-3], rig_tables[first.name].iloc[:, 1:], rtol=1e-12)
    assert (first.metadata.condition, first.metadata.session) == ("1", first.name)
    mapping = {column: ChannelMapping.from_dict(entry) for column, entry in CHANNELS.items()}
    for given, count in ((logs, 3), (sorted(logs.glob("*.csv")), 3), (min(logs.glob("*.csv")), 1)):
        assert list(map(repr, read_recordings(given, mapping, cylinder))) == list(map(repr, recordings[:count]))


def test_files_outside_a_patterns_folders_are_sessions(logs: Path, cylinder: Cylinder, tmp_path: Path) -> None:
    mapping = {"channels": CHANNELS, "name_pattern": r"^(?P<session>(?P<condition>[^_/]+)_[^/]+)/"}
    paths = [Path(shutil.copy(path, tmp_path)) for path in sorted(logs.glob("*.csv"))[:2]]
    with pytest.warns(UserWarning, match=r"finds nothing in any path, such as 'condition1_.*: each file is a sess"):
        flat = read_recordings(paths, mapping, cylinder)
    assert [each.metadata.session for each in flat] == [path.stem for path in paths]
    (tmp_path / "no-load_monday").mkdir()
    shutil.move(paths[0], tmp_path / "no-load_monday")
    with pytest.warns(UserWarning, match="left out .*does not give condition and session"):
        (kept,) = read_recordings([tmp_path], mapping, cylinder)
    assert (kept.metadata.condition, kept.metadata.session) == ("no-load", "no-load_monday")
    (kept,) = read_recordings(paths[1], mapping, cylinder, names=NAMES)  # which take precedence
    assert kept.metadata.session == paths[1].stem.rpartition("_")[0]


def test_a_configuration_brings_its_rules_and_names(logs: Path, cylinder: Cylinder, tmp_path: Path) -> None:
    (tmp_path / "rules").mkdir()
    (tmp_path / "rules/default.yaml").write_text("time: {rate_hz: null}\nchecks: {minimum_duration_s: 5.0}\n")
    (tmp_path / "own.yaml").write_text(
        "defaults: [{rules@_here_: default}, _self_]\n"
        f"source: {logs}\nname_pattern: '{NAMES}'\ntime: {{rate_hz: 100.0}}\nchannels: {CHANNELS}\n"
    )
    (tmp_path / "strict.yaml").write_text("defaults:\n  - own\n  - _self_\nchecks: {minimum_duration_s: 1.0e+3}\n")
    assert {each.sample_time_s for each in read_recordings(logs, tmp_path / "own.yaml", cylinder)} == {0.01}
    with pytest.raises(RecordingError, match=r"no file is usable \(of 3\); the first, \S+csv: lasts 40 s .* 1e\+03 s"):
        read_recordings(logs, tmp_path / "strict.yaml", cylinder)


@pytest.mark.filterwarnings("ignore:left out 0.csv")
def test_a_guessed_mapping_is_stated(logs: Path, cylinder: Cylinder) -> None:
    (logs / "0.csv").touch()  # cannot be read
    with pytest.warns(UserWarning, match=r"(?s)guessed from condition1.*position_m: \{channel: \"x \[mm\]\", unit: mm"):
        guessed = read_recordings(logs, None, cylinder)
    (logs / "0.csv").unlink()
    for one, other in zip(guessed, read_recordings(logs, CHANNELS, cylinder), strict=True):
        pd.testing.assert_frame_equal(one.table, other.table)


WRONG = {
    "chanel.yaml": {"channels": {"time_s": {"chanel": "t"}}},
    "csv.yaml": {"channels": CHANNELS, "csv": 5},
    "defaults.yaml": {"channels": CHANNELS, "defaults": 5},
    "checks.yaml": {"channels": CHANNELS, "checks": {"stroke": 1}},
    "option.yaml": {"channels": CHANNELS, "csv": {"foo": 1}},
    "keys.yaml": {"channels": CHANNELS, "name_table": "names.csv"},
    "empty.yaml": {"source": "here"},
}


@pytest.mark.parametrize(
    ("files", "channels", "units", "words"),
    [
        ([], CHANNELS, None, "no logger file was given; expected a path, a pattern or a folder, or"),
        ("nothing*.csv", CHANNELS, None, r"nothing\*.csv: no such file, and no file matches it as a pattern"),
        ("usb", CHANNELS, None, r"usb: is an empty folder; expected logs in it"),
        ("half.csv", None, None, "half.csv: no mapping was given, and that of pressure_2_pa, position_m"),
        ("counted.csv", None, None, "time_s, .* cannot be guessed: 'row' steps by exactly 1, .*--unit time=200Hz"),
        ("twice.csv", None, None, r"position_m may be 'x \[mm\]' or 'pos \[mm\]'; write a mapping and give it"),
        ("log.csv", "chanel.yaml", None, "mapping: key 'chanel' is not known; expected some of channel, unit, sign"),
        *[("log.csv", file, None, f"{file}: is no mapping of channels to ") for file in list(WRONG)[1:3]],
        ("log.csv", "option.yaml", None, "key 'foo' is not known; expected some of delimiter, decimal"),
        ("log.csv", "checks.yaml", None, "key 'stroke' is not known; expected some of minimum_duration_s"),
        ("log.csv", "keys.yaml", None, "key 'name_table' is not known; expected some of channels, source"),
        ("log.csv", "empty.yaml", None, "expected a key 'channels' with one entry per column, but got source"),
        ("log.csv", None, {"presure": "bar"}, "units: got 'presure', expected one of time, pressure, .*pressure=bar"),
        ("log.csv", None, {"pressure": "inch"}, "unit 'inch' measures length, but the column holds a pressure"),
        ("log.csv", None, {"pressure": "psi"}, r"'p_A \[bar\]' states bar, but pressure=psi was given as its unit"),
        ("log.csv", CHANNELS, {"pressure": "bar"}, r"units: got \{'pressure': 'bar'\} beside a mapping; state them in"),
    ],
)
def test_what_is_missing_or_wrong_is_refused(
    logs: Path, cylinder: Cylinder, tmp_path: Path, files: Any, channels: Any, units: Any, words: str
) -> None:
    half = pd.DataFrame({"t [s]": np.arange(9.0), "p_A [bar]": 1.0, "p_B [mA]": 2.0})
    half.to_csv(tmp_path / "half.csv", index=False)
    half.rename(columns={"t [s]": "row"}).to_csv(tmp_path / "counted.csv", index=False)
    shutil.copy(min(logs.glob("*.csv")), tmp_path / "log.csv")
    half.assign(**{"p_B [bar]": 2.0, "x [mm]": 1.0, "pos [mm]": 2.0}).to_csv(tmp_path / "twice.csv", index=False)
    (tmp_path / "usb").mkdir()
    for name, mapping in WRONG.items():
        (tmp_path / name).write_text(yaml.safe_dump(mapping))
    given = tmp_path / channels if isinstance(channels, str) else channels
    with pytest.raises(RecordingError, match=words):
        read_recordings(tmp_path / files if files else files, given, cylinder, units=units)


def plain(logs: Path, folder: Path, pressure: float = 1.0, position: float = 1.0, time: float = 1.0) -> Path:
    """Write a log whose names state no units, its values scaled from s, bar and mm."""
    table = pd.read_csv(sorted(logs.glob("*.csv"))[0]).mul([time, pressure, pressure, position])
    table.set_axis(["t", "p1", "p2", "x"], axis="columns").to_csv(folder / "plain.csv", index=False)
    return folder / "plain.csv"


@pytest.mark.parametrize(
    ("scales", "words"),
    [
        ({"pressure": 1.0}, r"pressure of 'p1' .* and 'p2' .* fits bar or psi or MPa; .*: --unit pressure=bar or --u"),
        ({"pressure": 100.0}, r"fits kPa or psi or mbar; .* \(in Python units=\{quantity: unit\}\)"),
        ({"pressure": 1e5, "position": 0.1}, r"length of 'x' \(values .*\) fits mm or cm; .*--unit length=mm"),
        ({"pressure": 1e5, "time": 20.0}, r"time of 't' \(steps of 0.1\) fits s or ms; .*--unit time=s or --unit ti"),
        ({"pressure": 1e5, "time": 1e3}, r"fits ms or another unit; .* time=ms or the rate .* time=200Hz \(in Py"),
    ],
)
def test_units_that_the_values_leave_open_are_refused(
    logs: Path, cylinder: Cylinder, tmp_path: Path, scales: dict[str, float], words: str
) -> None:
    with pytest.raises(RecordingError, match=words):
        read_recordings(plain(logs, tmp_path, **scales), None, cylinder)


@pytest.mark.filterwarnings("ignore:no mapping was given")
@pytest.mark.parametrize(
    ("scale", "units"),
    [(1.0, {"pressure": "bar"}), (100.0, {"pressure": "kPa"}), (14.5038, {"pressure": "psi"}), (1e5, None)],
)
def test_units_that_are_given_or_that_alone_fit_are_taken(
    logs: Path, cylinder: Cylinder, tmp_path: Path, scale: float, units: dict[str, str] | None
) -> None:
    (recording,) = read_recordings(plain(logs, tmp_path, scale), None, cylinder, units=units)
    first = read_recordings(sorted(logs.glob("*.csv"))[0], CHANNELS, cylinder)[0]
    np.testing.assert_allclose(recording.samples(), first.samples(), rtol=1e-5)
