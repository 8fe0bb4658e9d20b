"""Logs become friction: the label, an estimator's estimate, offsets taken off, bad files named and left out."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import packed_pages
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.from_logs import LABEL_BOUNDS, estimate_logs
from cylinder_friction.estimation.identification import identify_logs
from cylinder_friction.estimation.results import remarks
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import LowPassForceBalanceEstimator
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.trained_for import OtherCylinderError
from cylinder_friction.recordings.checks.limits import LoadMode
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.storage import read_recording
from cylinder_friction.signals.zero_phase import default_filter
from logger_files import CHANNELS, STATED, made_log, write_log
from noisy_recordings import with_noise


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory, labelled_recordings: list[Recording]) -> Path:
    folder = tmp_path_factory.mktemp("logs")
    for recording in labelled_recordings[:4]:
        write_log(folder / f"{recording.name}.csv", recording)
    return folder


def test_it_is_the_label(tmp_path: Path, logs: Path, cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    result = estimate_logs(logs, cylinder, tmp_path / "out", channels=CHANNELS)
    assert [each.name for each in result.recordings] == [each.name for each in labelled_recordings[:4]]
    assert result.bounds.startswith("none: the accuracy of pressure_1_pa, pressure_2_pa is not stated, so that the")
    assert "pressure_2_pa ± 0.5 % of 250 bar) would mean ± 577 N" in result.bounds
    assert result.refused == []
    for recording in labelled_recordings[:4]:
        written = read_recording(tmp_path / "out" / f"{recording.name}.parquet")
        error = np.abs(written.column("friction_n") - recording.column("friction_n"))[written.usable()]
        assert error.mean() < 25.0
        assert np.isnan(written.column("lower_n")).all()
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    assert summary["recordings"][0]["friction_n"] == pytest.approx(300.0, rel=0.3)
    assert "condition1_session1" in (tmp_path / "out/friction.html").read_text()
    expected = ["", ".html", ".json", *4 * [".parquet"]]  # panes, page, summary, results
    assert sorted(path.suffix for path in (tmp_path / "out").iterdir()) == expected


def test_strokes_show_a_sensor_offset(tmp_path: Path, cylinder: Cylinder, twelve_recordings: list[Recording]) -> None:
    for zero_bar, recording in zip(6 * [0.06, -0.06], twelve_recordings, strict=True):
        write_log(tmp_path / f"logs/{recording.name}.csv", recording, zero_bar)
    result = estimate_logs(tmp_path / "logs", cylinder, tmp_path / "out", channels=STATED)
    assert result.bounds == LABEL_BOUNDS
    shift_n = 0.06e5 * cylinder.piston_area_m2
    for recording in twelve_recordings:
        written = read_recording(tmp_path / "out" / f"{recording.name}.parquet")
        known_n, usable = recording.column("friction_n"), written.usable()
        assert abs((written.column("friction_n") - known_n)[usable].mean()) < 0.5 * shift_n
        held = (known_n >= written.column("lower_n")) & (known_n <= written.column("upper_n"))
        assert held[usable].mean() > 0.9
    assert {each.source for each in result.offsets} == {"strokes in both directions"}


def test_a_model_of_another_cylinder_is_refused_and_what_it_does_not_know_is_named(
    tmp_path: Path, cylinder: Cylinder, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    other = replace(cylinder, bore_diameter_m=0.08, rod_diameter_m=0.045)
    loaded = labelled_recordings[0]
    loaded = loaded.with_columns(pressure_1_pa=loaded.column("pressure_1_pa") + 1500.0 / cylinder.piston_area_m2)
    log = write_log(tmp_path / "log.csv", loaded)
    with pytest.raises(OtherCylinderError, match="the one given has 80 mm and 45 mm"):
        estimate_logs(log, other, tmp_path / "out", channels=CHANNELS, model=small_hybrid)
    assert not (tmp_path / "out").exists()
    (found,) = estimate_logs(log, cylinder, tmp_path / "out", channels=CHANNELS, model=small_hybrid).recordings
    assert re.search(r"friction is about \d", found.not_known)
    assert f"not to be used as it is: {found.not_known}" in remarks(found)
    assert json.loads((tmp_path / "out/summary.json").read_text())["recordings"][0]["not_known"] == found.not_known
    run = partial(estimate_logs, log, other, tmp_path / "other", channels=CHANNELS, model=small_hybrid)
    assert len(run(other_cylinder=True).recordings) == 1


def test_a_model_runs_in_real_time_anew_in_each_part(
    tmp_path: Path, cylinder: Cylinder, small_hybrid: HybridEstimator
) -> None:
    small_hybrid.save(tmp_path / "model")
    made_log(30_000).to_csv(tmp_path / "long.csv", index=False)
    given = {"channels": CHANNELS, "model": tmp_path / "model", "rows_at_once": 10_000}
    result = estimate_logs(tmp_path / "long.csv", cylinder, tmp_path / "out", **given)
    assert small_hybrid.bounds is not None
    assert (result.bounds, result.offsets) == (small_hybrid.bounds.in_words(), [])
    shares = result.recordings[0].flags_percent
    assert shares is not None
    assert 0.0 < shares["WARMING"] < 100.0
    assert len(result.recordings) == 3
    for each in result.recordings:
        written = read_recording(tmp_path / f"out/{each.name}.parquet")
        newtons, flags = small_hybrid.real_time().run(written.samples())
        np.testing.assert_array_equal(written.table[["friction_n", "lower_n", "upper_n"]], newtons)
        np.testing.assert_array_equal(written.column("flags"), flags)
        assert "label_n" in written.table


def test_bounds_widen_with_noise(tmp_path: Path, cylinder: Cylinder, twelve_recordings: list[Recording]) -> None:
    model = LowPassForceBalanceEstimator(cylinder).fit(twelve_recordings[:4])
    model.calibrate(twelve_recordings[:4], twelve_recordings[4:8], cylinder)
    assert model.trained_for is not None
    assert model.bounds is not None
    write_log(tmp_path / "logs/quiet.csv", twelve_recordings[8])
    write_log(tmp_path / "logs/noisy.csv", with_noise(twelve_recordings[8], 15.0 * model.trained_for.pressure_noise_pa))
    result = estimate_logs(tmp_path / "logs", cylinder, tmp_path / "out", channels=CHANNELS, model=model)
    words = {each.name: each.unlike_training for each in result.recordings}
    assert words["quiet"] == ""
    assert re.fullmatch(r"pressures are 1[45]\.\d times as noisy as .* knows, and bounds as much wider", words["noisy"])
    for name, times in (("quiet", 1.0), ("noisy", 15.0)):
        written = read_recording(tmp_path / "out" / f"{name}.parquet")
        steps = model.real_time().run(written.samples())[0]
        label_n, usable = written.column("label_n"), written.usable()
        lower_n, upper_n = written.column("lower_n"), written.column("upper_n")
        np.testing.assert_array_equal(written.column("friction_n"), steps[:, 0])
        np.testing.assert_allclose(upper_n - lower_n, times * (steps[:, 2] - steps[:, 1]), rtol=0.05)
        assert ((lower_n <= label_n) & (label_n <= upper_n))[usable].mean() > 0.85
        held = ((steps[:, 1] <= label_n) & (label_n <= steps[:, 2]))[usable].mean()
        assert (held > 0.85) == (name == "quiet")


def test_bounds_that_fail_are_named(tmp_path: Path, cylinder: Cylinder, twelve_recordings: list[Recording]) -> None:
    model = LowPassForceBalanceEstimator(cylinder).fit(twelve_recordings[:8])
    model.calibrate(twelve_recordings[:8], twelve_recordings[8:11], cylinder)
    assert model.bounds is not None
    log = write_log(tmp_path / "log.csv", twelve_recordings[11])
    tenth = {side: tuple(0.1 * each for each in getattr(model.bounds, side)) for side in ("lower_n", "upper_n")}
    model.bounds = replace(model.bounds, **tenth)
    (found,) = estimate_logs(log, cylinder, tmp_path / "out", channels=CHANNELS, model=model).recordings
    written = read_recording(tmp_path / "out" / f"{found.name}.parquet")
    label_n, counted = written.column("label_n"), written.usable() & (written.column("flags") == 0)
    held = (written.column("lower_n") <= label_n) & (label_n <= written.column("upper_n"))
    expected = f"bounds hold the label in {100.0 * held[counted].mean():.0f} % of the rows, not in 90 %"
    assert found.unlike_training == expected
    assert expected in (tmp_path / "out/friction.html").read_text()


def test_a_recording_beyond_every_range_of_the_model_has_no_friction(
    tmp_path: Path, cylinder: Cylinder, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    far = labelled_recordings[0].with_columns(position_m=labelled_recordings[0].column("position_m") + 0.15)
    log, wide = write_log(tmp_path / "log.csv", far), replace(cylinder, stroke_m=0.5)
    (found,) = estimate_logs(log, wide, tmp_path / "out", channels=CHANNELS, model=small_hybrid).recordings
    assert (found.friction_n, found.usable_percent) == (None, 0.0)
    assert found.not_known.startswith("100 % of the rows have no estimate: no sample with a valid reading")
    written = read_recording(tmp_path / "out" / f"{found.name}.parquet")
    assert all(np.isnan(written.column(f"{name}_n")).all() for name in ("friction", "lower", "upper"))


def test_logs_at_another_rate_are_resampled_to_the_models(
    tmp_path: Path, cylinder: Cylinder, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    slow = Recording(recording.metadata, recording.table.iloc[::2].reset_index(drop=True))
    write_log(tmp_path / "logs/slow.csv", slow)
    result = estimate_logs(tmp_path / "logs", cylinder, tmp_path / "out", channels=CHANNELS, model=small_hybrid)
    written = read_recording(tmp_path / "out/slow.parquet")
    assert written.sample_time_s == small_hybrid.sample_time_s
    assert result.recordings[0].rows == pytest.approx(len(recording), abs=2)


def test_a_class_of_sensors_gives_bounds_with_a_load_cell_too(
    tmp_path: Path, cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    """Friction is held although the pressure sensor and the load cell are off by most of what is assumed."""
    recording, load_n, cell_off_n = labelled_recordings[0], 7848.0, -350.0
    loaded_pa = recording.column("pressure_1_pa") + load_n / cylinder.piston_area_m2
    log = write_log(tmp_path / "log.csv", recording.with_columns(pressure_1_pa=loaded_pa), zero_bar=1.1)
    noise_n = np.random.default_rng(0).normal(0.0, 5.0, len(recording))
    pd.read_csv(log).assign(F=(load_n + cell_off_n + noise_n) / 1e3).to_csv(log, index=False)
    cell = CHANNELS | {"load_force_n": {"channel": "F", "unit": "kN"}}
    silent = estimate_logs(log, cylinder, tmp_path / "silent", channels=cell)
    assert silent.bounds.startswith("none: the accuracy of load_force_n, pressure_1_pa, pressure_2_pa is not")
    assert "load_force_n ± 0.5 % of 77931 N (what the piston exerts at 250 bar)) would mean ± 732 N" in silent.bounds
    one_lacks = STATED | {"load_force_n": cell["load_force_n"]}
    result = estimate_logs(log, cylinder, tmp_path / "one", channels=one_lacks)
    assert result.bounds.startswith("none: the accuracy of load_force_n is not stated")
    result = estimate_logs(log, cylinder, tmp_path / "out", channels=cell, sensor_class=0.5)
    assert "assumed, not stated: pressure_1_pa ± 0.5 % of 250 bar, pressure_2_pa" in result.bounds
    found, usable = read_recording(tmp_path / "out/log.parquet"), recording.usable()
    lower_n, upper_n, true_n = found.column("lower_n"), found.column("upper_n"), recording.column("friction_n")
    assert np.abs(found.column("friction_n") - true_n)[usable].mean() > 500.0
    assert ((lower_n <= true_n) & (true_n <= upper_n))[found.usable()].mean() > 0.9


def test_a_load_by_position_comes_off(tmp_path: Path, cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    recording, weight_n = labelled_recordings[0], 900.0
    loaded_pa = recording.column("pressure_1_pa") + weight_n / cylinder.piston_area_m2
    write_log(tmp_path / "logs/loaded.csv", recording.with_columns(pressure_1_pa=loaded_pa))
    result = estimate_logs(tmp_path / "logs", cylinder, tmp_path / "out", channels=CHANNELS, load="position")
    assert result.recordings[0].load_left_n is None
    without = estimate_logs(tmp_path / "logs", cylinder, tmp_path / "none", channels=CHANNELS)
    assert without.recordings[0].load_left_n == pytest.approx(weight_n, abs=60.0)
    assert "holds a load, a sensor" in (tmp_path / "none/friction.html").read_text()
    written = read_recording(tmp_path / "out/loaded.parquet")
    usable = written.usable()
    assert written.column("load_force_n")[usable].mean() == pytest.approx(weight_n, abs=60.0)
    assert np.abs(written.column("friction_n") - recording.column("friction_n"))[usable].mean() < 60.0
    assert result.recordings[0].load != "position"


def test_the_models_or_sessions_load(tmp_path: Path, cylinder: Cylinder, labelled_recordings: list[Recording]) -> None:
    """Of a crane at another angle only the session's own load is right; ``load="position"`` asks for it."""
    recording = labelled_recordings[0]
    knows = LowPassForceBalanceEstimator(cylinder)
    knows.position_load = PositionLoad(0.08, 0.17, np.array([200.0, 250.0]), np.full(2, 5.0))
    knows.fit(labelled_recordings[:2])
    pressure_pa = recording.column("pressure_1_pa") + 900.0 / cylinder.piston_area_m2
    write_log(tmp_path / "logs/heavy.csv", recording.with_columns(pressure_1_pa=pressure_pa))
    for mode, off_n, words in (("none", 675.0, "a load of 200 to 250 N"), ("position", 0.0, "the load is 8")):
        folder = tmp_path / mode
        result = estimate_logs(tmp_path / "logs", cylinder, folder, channels=CHANNELS, model=knows, load=mode)
        assert result.recordings[0].load.startswith(words)
        written = read_recording(folder / "heavy.parquet")
        error = written.column("friction_n") - recording.column("friction_n")
        assert error[written.usable()].mean() == pytest.approx(off_n, abs=60.0)


@pytest.mark.parametrize("load", ["none", "position"])
def test_a_long_log_becomes_parts_that_lose_a_filters_length_at_their_ends(
    tmp_path: Path, cylinder: Cylinder, load: LoadMode
) -> None:
    made_log(50_000).to_csv(tmp_path / "long.csv", index=False)
    run = partial(estimate_logs, tmp_path / "long.csv", cylinder, channels=STATED, load=load)
    (whole,), parts = (run(tmp_path / f"{rows}", rows_at_once=rows).recordings for rows in (1_000_000, 10_000))
    assert [each.name for each in parts] == [f"long_part{number:02d}" for number in range(1, 6)]
    assert {each.session for each in parts} == {whole.session} == {"long"}
    written = [read_recording(tmp_path / f"10000/{each.name}.parquet") for each in parts]
    joined = pd.concat([each.table for each in written], ignore_index=True)
    expected = read_recording(tmp_path / "1000000/long.parquet").table
    pd.testing.assert_frame_equal(joined[["time_s", "position_m"]], expected[["time_s", "position_m"]])
    lost = expected["usable"] & ~joined["usable"]
    support = default_filter(cylinder).support(0.005)
    assert lost.sum() <= 4 * (support.before + support.after)
    usable = joined["usable"]
    off_n = (joined["friction_n"] - expected["friction_n"])[usable]
    assert off_n.abs().mean() < (0.5 if load == "none" else 3.0)


@pytest.mark.parametrize("run", [estimate_logs, partial(identify_logs, generations=1)], ids=["estimate", "identify"])
def test_results_are_not_written_into_the_input(logs: Path, cylinder: Cylinder, run: Callable[..., object]) -> None:
    before = sorted(logs.iterdir())
    with pytest.raises(FileExistsError, match="lies in the input"):
        run(logs, cylinder, logs / "friction", channels=CHANNELS)
    assert sorted(logs.iterdir()) == before


def test_results_state_their_origin(tmp_path: Path, cylinder: Cylinder) -> None:
    sensor = {"range": [0, 250], "unit": "bar", "serial": 4711, "calibrated": "2026-01-31"}
    channels = CHANNELS | {"pressure_1_pa": CHANNELS["pressure_1_pa"] | {"sensor": sensor}}
    (tmp_path / "press_7.csv").write_text(f"Date: 2026-03-27\n\n{made_log(4000).to_csv(index=False)}")
    made_log(2000).to_csv(tmp_path / "press.csv", index=False)
    mapping = {"channels": channels, "asset": "press 3"}
    estimate_logs(tmp_path / "press*.csv", cylinder, tmp_path / "out", channels=mapping)
    summary = json.loads((tmp_path / "out/summary.json").read_text())
    unknown, known = summary["recordings"]
    assert (unknown["start"], unknown["start_source"]) == ("", "")
    source = "header line 'Date: 2026-03-27', a date without a time of day"
    assert (known["start"], known["start_source"]) == ("2026-03-27", source)
    assert known["asset"] == "press 3"
    assert known["sensors"] == {"pressure_1_pa": {"serial": "4711", "calibrated": "2026-01-31"}}
    about = read_recording(tmp_path / "out/press_7.parquet").metadata
    assert about.depends_on == summary["depends_on"]
    assert (about.start, about.asset, about.sensors) == (known["start"], known["asset"], known["sensors"])
    pane = packed_pages.unpacked_pane(tmp_path / "out/panes/press_7.js")
    assert "2026-03-27 (header line" in pane
    assert "serial 4711, calibrated 2026-01-31" in pane
    assert about.depends_on["mapping"][:12] in pane
