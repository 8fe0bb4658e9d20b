import re
from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.recordings.recording import Recording, RecordingError, Signal
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.recordings.timeline.timestamps import TimeRules

ROWS = 2000
EVEN_S = 0.005 * np.arange(ROWS)
NOISE = np.random.default_rng(0).normal(size=ROWS)
LINE = 2.0 * EVEN_S


def one(time_s: np.ndarray, values: np.ndarray | None = None) -> dict[str, Signal]:
    return {"a": Signal(time_s, NOISE[: len(time_s)] if values is None else values)}


def without(rows: list[int]) -> dict[str, Signal]:
    return one(np.delete(EVEN_S, rows), np.delete(NOISE, rows))


def missing(rows: list[int], *, also: str = "b") -> dict[str, Signal]:
    holes = NOISE.copy()
    holes[rows] = np.nan
    return {"a": Signal(EVEN_S, NOISE), also: Signal(EVEN_S, holes)}


@pytest.mark.parametrize(
    ("time_s", "rate_hz", "sample_time_s"),
    [
        (EVEN_S, None, 0.005),
        (np.arange(ROWS) / 200.003, None, 0.005),
        (np.arange(ROWS) / 200.003, 200.0, 0.005),
        (np.round(np.arange(ROWS) / 600.0, 3), None, 1 / 600.0),
        (np.round(np.arange(ROWS) / 300.0, 3), None, 1 / 300.0),
        (EVEN_S + np.random.default_rng(0).uniform(-5e-5, 5e-5, ROWS), None, 0.005),
        (EVEN_S * (1.0 + 2e-5 * np.arange(ROWS) / ROWS), None, 0.005),
    ],
)
def test_what_needs_nothing_passes_bit_for_bit(time_s: np.ndarray, rate_hz: float | None, sample_time_s: float) -> None:
    columns = {"a": Signal(time_s, NOISE), "b": Signal(time_s, LINE), "c": Signal(time_s.copy(), EVEN_S)}
    (piece,) = align(columns, TimeRules(rate_hz=rate_hz))
    assert list(piece.columns) == ["time_s", "a", "b", "c"]
    assert piece.sample_time_s == pytest.approx(sample_time_s, rel=1e-12)
    assert piece.metadata.repairs == ()
    for column, expected in (("time_s", time_s), ("a", NOISE), ("b", LINE), ("c", EVEN_S)):
        assert piece.columns[column].tobytes() == expected.tobytes()


RESTARTED, SET_BACK = (np.where(np.arange(ROWS) < 1000, EVEN_S, EVEN_S - by_s) for by_s in (5.0, 0.05))
ROLLING = 0.005 * (np.arange(ROWS) % 640)
UNSTAMPED = np.concatenate([EVEN_S[:-2], [np.nan, np.inf]])
IN_MILLISECONDS = np.delete(np.round(np.arange(ROWS) / 300.0, 3), [700])
GAP = "of more than 2 lost samples (first:"
OTHER_CLOCK = {"a": Signal(EVEN_S, NOISE), "b": Signal(EVEN_S[:1500].copy(), NOISE[:1500])}


@pytest.mark.parametrize(
    ("columns", "lengths", "repair"),
    [
        (without([100]), [2000], "1 lost sample interpolated (at most 1 in a row, first after 0.495 s)"),
        (without([100, 101, 102]), [100, 1897], f"split at 1 gap {GAP} 0.02 s after 0.495 s)"),
        (without([*range(100, 110), *range(115, 130)]), [100, 1870], f"split at 2 gaps {GAP} 0.055 s after 0.495 s)"),
        (missing(list(range(500, 510))), [500, 1490], f"split at 1 gap {GAP} 0.055 s without b after 2.495 s)"),
        (one(RESTARTED), [1000, 1000], "split at 1 restart of the clock (first: row 1001, from 4.995 to 0 s)"),
        (one(SET_BACK), [1000, 1000], "split at 1 restart of the clock (first: row 1001, from 4.995 to 4.95 s)"),
        (one(ROLLING), [640, 640, 640, 80], "split at 3 restarts of the clock (first: row 641, from 3.195 to 0 s)"),
        (one(UNSTAMPED), [1998], "2 rows without a time stamp left out (first: row 1999)"),
        (one(IN_MILLISECONDS), [2000], "1 lost sample interpolated (at most 1 in a row, first after 2.33 s)"),
        (OTHER_CLOCK, [1500], "0 s at the start and 2.5 s at the end left out, not covered by every column"),
    ],
)
def test_damaged_time(columns: dict[str, Signal], lengths: list[int], repair: str) -> None:
    pieces = align(columns, TimeRules())
    assert [len(piece.columns["time_s"]) for piece in pieces] == lengths
    assert pieces[0].metadata.repairs == (f"time: {repair}",)
    for piece in pieces:
        assert all(np.isfinite(values).all() for values in piece.columns.values())
        logged = set(columns["a"].values)
        moved = sum(value not in logged for value in piece.columns["a"])
        assert moved <= 4  # nothing but what was interpolated


def test_a_clock_of_six_digits_is_coarse_until_midnight() -> None:
    stamps_s = np.array([float(f"{each:.6g}") for each in (86395.0 + EVEN_S) % 86400.0])
    pieces = align(one(stamps_s), TimeRules())
    assert [(len(piece), piece.sample_time_s) for piece in pieces] == [(1000, 0.005), (1000, 0.005)]


def test_a_lost_sample_is_bridged_between_its_neighbours_as_far_as_the_rules_say() -> None:
    (piece,) = align(without([100]), TimeRules())
    values = piece.columns["a"]
    assert min(NOISE[99], NOISE[101]) <= values[100] <= max(NOISE[99], NOISE[101])
    np.testing.assert_array_equal(np.delete(values, 100), np.delete(NOISE, 100))
    np.testing.assert_allclose(piece.columns["time_s"], EVEN_S, atol=1e-12)
    assert len(align(without([100]), TimeRules(longest_bridge_samples=0))) == 2
    assert len(align(without(list(range(100, 105))), TimeRules(longest_bridge_samples=5))) == 1


def sine(time_s: np.ndarray, frequency_hz: float = 3.0) -> np.ndarray:
    return np.sin(2.0 * np.pi * frequency_hz * time_s)


def inner(piece: Recording) -> pd.DataFrame:
    """Without the second at either end, where the continuation plays a part."""
    time_s = piece.columns["time_s"]
    return pd.DataFrame(piece.columns)[(time_s > time_s[0] + 1.0) & (time_s < time_s[-1] - 1.0)]


@pytest.mark.parametrize("rate_hz", [None, 100.0, 200.0, 150.0])
@pytest.mark.parametrize("offset_s", [0.0, 0.0013])
def test_tables_at_two_rates_come_to_one(rate_hz: float | None, offset_s: float) -> None:
    slow_s = 0.01 * np.arange(ROWS // 2) + offset_s
    columns = {"a": Signal(EVEN_S, sine(EVEN_S)), "b": Signal(slow_s, sine(slow_s))}
    (piece,) = align(columns, TimeRules(rate_hz=rate_hz))
    assert piece.sample_time_s == 1.0 / (rate_hz or 100.0)
    time_s = piece.columns["time_s"]
    np.testing.assert_allclose(np.diff(time_s), piece.sample_time_s, rtol=1e-9)
    steps = time_s / piece.sample_time_s
    np.testing.assert_allclose(steps, np.rint(steps), atol=1e-6)
    table = inner(piece)
    for column in "ab":
        assert np.abs(table[column] - sine(table["time_s"].to_numpy())).max() < 1e-3
    expected = f"a: resampled from 200 to {piece.sample_time_s**-1:g} Hz (windowed sinc, cut-off "
    assert rate_hz == 200.0 or piece.metadata.repairs[0].startswith(expected)


def test_a_slow_channel_in_one_table_is_no_gap() -> None:
    slow = np.full(ROWS, np.nan)
    slow[::4] = NOISE[::4]
    (piece,) = align({"a": Signal(EVEN_S, NOISE), "b": Signal(EVEN_S, slow)}, TimeRules())
    assert piece.sample_time_s == 0.02
    np.testing.assert_array_equal(piece.columns["b"], NOISE[::4])
    assert piece.metadata.repairs == ("a: resampled from 200 to 50 Hz (windowed sinc, cut-off 22.5 Hz)",)


@pytest.mark.parametrize(
    "time_s",
    [
        EVEN_S + np.random.default_rng(3).uniform(0.0, 0.0005, ROWS),
        EVEN_S + np.random.default_rng(3).uniform(0.0, 0.002, ROWS),
        EVEN_S + 0.0015 * (np.arange(ROWS) == 77),
    ],
)
def test_uneven_stamps_come_to_an_even_grid(time_s: np.ndarray) -> None:
    (piece,) = align(one(time_s, sine(time_s, 1.0)), TimeRules())
    assert piece.sample_time_s == 0.005
    np.testing.assert_allclose(np.diff(piece.columns["time_s"]), 0.005, rtol=1e-9)
    assert np.abs(inner(piece)["a"] - sine(inner(piece)["time_s"].to_numpy(), 1.0)).max() < 2e-3
    assert re.fullmatch(r"time: resampled from uneven stamps \(\S+ to \S+ ms\) to 200 Hz .*", piece.metadata.repairs[0])


@pytest.mark.parametrize(
    ("columns", "rules", "message"),
    [
        (one(1.7e18 + 5e6 * np.arange(ROWS)), {}, "time_s is not a number, or beyond 1e+11 s, in 2000 of 2000 rows"),
        (one(EVEN_S, np.full(ROWS, np.nan)), {}, "a has 0 finite values in 2000 rows, expected at least 3"),
        (missing(list(range(2, ROWS))), {}, "b has 2 finite values in 2000 rows, expected at least 3"),
        (missing([row for row in range(ROWS) if row % 9 < 4]), {}, "(time: split at 221 gaps of more than 2 lost"),
        ({"a": Signal(EVEN_S, NOISE), "b": Signal(EVEN_S + 1000.0, NOISE)}, {}, "(the columns do not overlap in"),
        ({"a": Signal(EVEN_S, NOISE), "b": Signal(np.mod(EVEN_S, 4.0), NOISE)}, {}, "a restarts 0 times, but the"),
        (one(EVEN_S), {"rate_hz": 20000.0}, "its fastest channel is sampled at 200 Hz, expected at most 10 times that"),
    ],
)
def test_what_cannot_be_aligned_is_refused(columns: dict[str, Signal], rules: dict[str, float], message: str) -> None:
    with pytest.raises(RecordingError, match=re.escape(message)):
        align(columns, TimeRules(**rules))  # type: ignore[arg-type]


def _damaged(draw: st.DrawFn) -> tuple[np.ndarray, list[np.ndarray]]:
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = draw(st.integers(3, 400))
    rate_hz = draw(st.sampled_from([20.0, 100.0, 200.0, 333.3, 1000.0]))
    time_s = np.arange(rows) / rate_hz + draw(st.sampled_from([0.0, 12.345, 1e5]))
    time_s = time_s + rng.uniform(0.0, draw(st.sampled_from([0.0, 0.01, 0.3, 3.0])), rows) / rate_hz
    values = [rng.normal(size=rows) for _ in range(2)]
    for kind in draw(st.lists(st.sampled_from(["gap", "lost", "twice", "restart", "swap", "nan", "wild", "blank"]))):
        if len(time_s) < 4:
            break
        row = int(rng.integers(1, len(time_s)))
        some = slice(row, row + int(rng.integers(1, 12)))
        if kind == "gap":
            time_s[row:] += rng.uniform(0.0, 100.0 / rate_hz)
        elif kind == "lost":
            time_s, values = np.delete(time_s, some), [np.delete(column, some) for column in values]
        elif kind == "twice":
            time_s, values = np.insert(time_s, row, time_s[row]), [np.insert(c, row, c[row]) for c in values]
        elif kind == "restart" and np.isfinite(time_s).all():
            time_s[row:] -= time_s[row] * rng.choice([1.0, 0.01])
        elif kind == "swap":
            time_s[[row - 1, row]] = time_s[[row, row - 1]]
        elif kind == "nan":
            values[int(rng.integers(2))][some] = np.nan
        elif kind == "wild":
            time_s[row] = rng.choice([0.0, 1e6, -1.0, 1e300, np.inf])
        elif kind == "blank":
            time_s[some] = np.nan
    digits = draw(st.sampled_from([None, 1, 2, 3, 6]))
    return (time_s if digits is None else np.round(time_s, digits)), values


@st.composite
def damaged_signals(draw: st.DrawFn) -> dict[str, Signal]:
    time_s, (a, b) = _damaged(draw)
    columns = {"a": Signal(time_s, a), "b": Signal(time_s, b)}
    if draw(st.booleans()):
        other_s, (c, _) = _damaged(draw)
        columns["c"] = Signal(other_s, c)
    return columns


@given(damaged_signals(), st.sampled_from([None, None, 50.0, 200.0, 150.0]), st.integers(0, 5))
@settings(max_examples=400, deadline=None)
def test_pieces_are_sound_or_refused(columns: Mapping[str, Signal], rate_hz: float | None, bridge: int) -> None:
    before = {column: signal.values.copy() for column, signal in columns.items()}
    try:
        pieces = align(columns, TimeRules(rate_hz=rate_hz, longest_bridge_samples=bridge))
    except RecordingError:
        return
    assert pieces
    for piece in pieces:
        table = pd.DataFrame(piece.columns)
        assert list(table.columns) == ["time_s", *columns]
        assert np.isfinite(table.to_numpy()).all()
        steps = np.diff(table["time_s"]) / piece.sample_time_s
        assert (steps > 0.0).all()
        if rate_hz is not None:
            assert piece.sample_time_s == 1.0 / rate_hz
        if any("resampled" in repair or "moved" in repair for repair in piece.metadata.repairs):
            np.testing.assert_allclose(
                steps, 1.0, rtol=1e-9, atol=1e-9 * np.abs(table["time_s"]).max() / piece.sample_time_s
            )
        for column, signal in columns.items():
            good = signal.values[np.isfinite(signal.values)]
            middle, half = (good.max() + good.min()) / 2.0, (good.max() - good.min()) / 2.0
            # The continuation beyond an end may triple the range, of which a resampled value overshoots by 2.2.
            assert np.abs(table[column] - middle).max() <= 3.0 * 2.2 * half + 1e-9
            stamps_s = signal.time_s[np.isfinite(signal.time_s)]
            slack_s = 1e-6 * piece.sample_time_s
            if not any("coarse" in repair for repair in piece.metadata.repairs):
                assert stamps_s.min() - slack_s <= table["time_s"].iloc[0]
                assert table["time_s"].iloc[-1] <= stamps_s.max() + slack_s
    for column, signal in columns.items():
        np.testing.assert_array_equal(signal.values, before[column])


def test_stamps_of_two_tables_that_differ_by_rounding_are_one_clock() -> None:
    time_s = np.arange(4000) * 0.005
    other_s = 0.1 + np.arange(4000 - 20) * 0.005
    assert not np.isin(other_s, time_s).all()
    (piece,) = align({"a": Signal(time_s, sine(time_s)), "b": Signal(other_s, sine(other_s))}, TimeRules())
    assert piece.metadata.repairs == (
        "time: 0.1 s at the start and 0 s at the end left out, not covered by every column",
    )
    assert np.array_equal(piece.columns["a"], sine(time_s)[20:])
    assert np.array_equal(piece.columns["b"], sine(other_s))


@pytest.mark.parametrize("lost", [0.0, 0.02, 0.04])
def test_the_rate_of_stamps_with_jitter_does_not_depend_on_what_was_lost(lost: float) -> None:
    generator = np.random.default_rng(4)
    time_s = np.arange(12_000) * 0.005 + generator.normal(0.0, 5e-4, 12_000)
    time_s = time_s[generator.random(12_000) >= lost]
    assert {piece.sample_time_s for piece in align(one(time_s, sine(time_s)), TimeRules())} == {0.005}


@pytest.mark.parametrize("rate_hz", [50.0, 123.4, 250.0, 1000.0])
@pytest.mark.parametrize("seed", range(4))
def test_jitter_of_up_to_half_a_step_invents_no_sample(rate_hz: float, seed: int) -> None:
    rows = round(10.0 * rate_hz)
    time_s = (np.arange(rows) + np.random.default_rng(seed).uniform(-0.5, 0.5, rows)) / rate_hz
    for stamps_s in (time_s, np.round(time_s, 3)):
        (piece,) = align(one(stamps_s, sine(time_s)), TimeRules())
        assert piece.sample_time_s == pytest.approx(1.0 / rate_hz, rel=1e-12)
        assert not any("lost" in repair or "left out" in repair for repair in piece.metadata.repairs)
    lost = rows // 2
    (piece,) = align(one(np.delete(time_s, lost), sine(np.delete(time_s, lost))), TimeRules())
    assert "1 lost sample interpolated" in " ".join(piece.metadata.repairs)


def test_a_clock_that_changes_its_rate_has_that_of_the_whole_stretch() -> None:
    time_s = np.where(EVEN_S < 5.0, EVEN_S, 5.0 + 1.02 * (EVEN_S - 5.0))
    (piece,) = align(one(time_s, sine(time_s, 1.0)), TimeRules())
    assert piece.sample_time_s == 1.0 / 198.0
    assert np.abs(inner(piece)["a"] - sine(inner(piece)["time_s"].to_numpy(), 1.0)).max() < 2e-3
