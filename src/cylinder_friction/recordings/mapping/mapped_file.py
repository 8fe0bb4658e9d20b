"""Convert a file's tables to signals: each mapped column in its own unit, with its time stamps."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import OIL_TEMPERATURE, QUANTITIES, TIME
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import (
    ChannelMapping,
    check_unit,
    quantity_of,
    stated_reference,
    to_column_unit,
    units_agree,
)
from cylinder_friction.recordings.mapping.guessing import ChannelFacts, clocks_of
from cylinder_friction.recordings.recording import RecordingError, Signal, Start

DATES_AGREE = np.timedelta64(2, "s")  # Largest difference of dates and a clock beside them, by resolution and drift
RATE_AGREES = 0.05  # Largest difference of a stated rate from a time channel's, as a share: stamps are rounded or lost
TIME_UNITS_S = (1.0, 1e-3, 1e-6, 1e-7, 1e-9)  # Possible units of a time channel without a stated unit [s]
ENDS_TOGETHER = 0.95  # Least ratio of the lengths of columns with one rate, and of valid values in one without gaps
FEWEST_ROWS = 10  # Fewest rows that show a rate
MOST_TIMES_SLOWER = 20  # Largest ratio of rates that is detected; an earlier end of a column may be chance
MOST_STEPS = 3  # Longest gap of the oil temperature, in usual steps of its values
MOST_NAMES = 40  # Most channels that a message lists; a measurement file may have thousands


class MappedFile(NamedTuple):
    """The mapped content of a file."""

    # Signals by column, in the column's unit; signals of one table share their time stamps (the same object)
    signals: dict[str, Signal]
    notes: tuple[str, ...]  # Repairs by the reader, one sentence each
    start: Start | None = None  # When its clock was at 0 s


class _Clock(NamedTuple):
    """The source of time stamps: a channel of a table, or a stated rate if ``channel`` is empty."""

    table: int
    channel: str


def map_signals(tables: Sequence[LoggedTable], mapping: Mapping[str, ChannelMapping]) -> MappedFile:
    """Read the mapped columns of a file; the mapping has passed ``check_mapping``."""
    there = {str(name) for table in tables for name in (*table.channels.columns, *table.unread)}
    mapping = {
        column: replace(source, channel=next((name for name in source.names if name in there), source.channel))
        for column, source in mapping.items()
    }
    places = {
        column: _find_channel(tables, source.channel, source.table, column)
        for column, source in mapping.items()
        if column != TIME
    }
    clocks = {column: _clock(tables, place, column, mapping) for column, place in places.items()}
    rated = sorted({clock.table for clock in clocks.values() if not clock.channel})
    if len({len(tables[index].channels) for index in rated}) > 1:
        lengths = ", ".join(f"{tables[index].name!r} has {len(tables[index].channels)}" for index in rated)
        raise RecordingError(
            f"tables of different lengths cannot all be at time_s.rate_hz = {mapping[TIME].rate_hz:g} Hz: {lengths} "
            "rows; name the time channel of each as channels.<column>.time"
        )
    for index in rated:
        own_hz, stated_hz = tables[index].rate_hz, mapping[TIME].rate_hz
        if own_hz is not None and stated_hz is not None and abs(own_hz / stated_hz - 1.0) > RATE_AGREES:
            raise RecordingError(
                f"its header states {own_hz:.6g} Hz, but time_s.rate_hz = {stated_hz:.6g} Hz; expected the same; "
                "correct the mapping, or map files of each rate on their own"
            )
    stamps, start = _stamps(tables, clocks, mapping)
    notes = list(dict.fromkeys(note for index in sorted(set(places.values())) for note in tables[index].notes))
    signals = {}
    for column, place in places.items():
        source, time_s = mapping[column], stamps[clocks[column]]
        _check_unit(tables[place], source.channel, source.unit, column, source.absolute)
        raw = _numbers(tables[place].channels[source.channel], source.channel, column, source.unit)
        if len(time_s) != len(raw):
            raise RecordingError(
                f"channel {source.channel!r} (for {column!r}) has {len(raw)} rows, but its time channel "
                f"{clocks[column].channel!r} has {len(time_s)}; name its own as channels.{column}.time"
            )
        signals[column] = Signal(time_s, source.column_values(raw, column))
    _refuse_two_clocks(tables, stamps, signals.values())
    notes += _fill_slow(signals)
    _refuse_two_ends(signals, mapping)
    notes += _take_delays(signals, mapping)
    return MappedFile(signals, tuple(notes), start)


def _fill_slow(signals: dict[str, Signal]) -> list[str]:
    """Fill the oil temperature between its values on the rows of another column; leave it out if it has a long gap."""
    slow = signals.get(OIL_TEMPERATURE)
    beside = [own for own in signals.values() if slow and own is not slow and own.time_s is slow.time_s]
    if not slow or not beside or (valid := np.isfinite(slow.values)).all():
        return []
    rows = np.isfinite(beside[0].values)
    if valid[~rows].any():
        return []
    values, filled = slow.values[rows], np.full(len(rows), np.nan)
    known = np.flatnonzero(valid[rows])
    steps = np.diff(known, prepend=-1, append=len(values))
    if len(known) < 3 or steps.max() > MOST_STEPS * np.median(steps):
        del signals[OIL_TEMPERATURE]
        return [f"{OIL_TEMPERATURE}: left out, because {steps.max() - 1} of {len(values)} rows have no value in a row"]
    filled[rows] = np.interp(np.arange(len(values)), known, values[known])
    signals[OIL_TEMPERATURE] = Signal(slow.time_s, filled)
    return []


def _take_delays(signals: dict[str, Signal], mapping: Mapping[str, ChannelMapping]) -> list[str]:
    """Subtract stated delays from the stamps of sensors; return notes. Equal delays of one clock share an array."""
    notes = []
    earlier: dict[tuple[int, float], Array] = {}
    for column, signal in signals.items():
        sensor, time_s = mapping[column].sensor, signal.time_s
        if sensor is None or sensor.delay_s == 0.0:
            continue
        moved_s = time_s - sensor.delay_s
        begins = int(np.argmax(moved_s >= time_s[0]))  # earlier samples would move the grid of the others
        stamps_s = earlier.setdefault((id(time_s), sensor.delay_s), moved_s[begins:])
        signals[column] = Signal(stamps_s, signal.values[begins:])
        notes.append(f"{column}: moved {1e3 * sensor.delay_s:.4g} ms earlier, the delay stated for its sensor")
    return notes


def _clock(tables: Sequence[LoggedTable], place: int, column: str, mapping: Mapping[str, ChannelMapping]) -> _Clock:
    """Find the clock of a column: the time channel that it names, or else the channel of ``time_s`` in its table."""
    source, time = mapping[column], mapping[TIME]
    if not source.time and time.rate_hz is not None:
        return _Clock(place, "")
    name = source.time or time.channel
    own = list(tables[place].channels.columns).count(name)
    if own == 1:
        return _Clock(place, name)
    if source.time and not own:
        return _Clock(_find_channel(tables, name, time.table if name == time.channel else "", column), name)
    if own or len(tables) == 1:
        _find_channel([tables[place]], name, "", TIME)  # which refuses it
    there = ", ".join(repr(str(other)) for other in tables[place].channels.columns if other != source.channel)
    raise RecordingError(
        f"channel {source.channel!r} (for {column!r}) has no time channel {name!r} in its table "
        f"{tables[place].name!r}, which holds besides {there or 'nothing'}; name the channel that stamps it as "
        f"channels.{column}.time"
    )


def _other_rate(clock: ChannelFacts, own_hz: Sequence[float]) -> float | None:
    """Return a clock's rate if neither mean nor median step confirms any of ``own_hz``, in any unit; else None."""
    if not clock.unit and not clock.dates and clock.counts:
        return None
    known = (1e-9,) if clock.dates else (check_unit(TIME, clock.unit)[0],) if clock.unit else TIME_UNITS_S
    rates_hz = [1.0 / (step * scale) for scale in known for step in (clock.mean_step, clock.step) if step > 0.0]
    nearest_hz = min(rates_hz, key=lambda rate: min(abs(math.log(own / rate)) for own in own_hz), default=None)
    agrees = nearest_hz is None or min(abs(own / nearest_hz - 1.0) for own in own_hz) <= RATE_AGREES
    return None if agrees else nearest_hz


def _refuse_two_clocks(
    tables: Sequence[LoggedTable], stamps: Mapping[_Clock, Array], signals: Collection[Signal]
) -> None:
    """Refuse a table with an unused clock that contradicts the stated rate, or a clock in use that is no master."""
    for clock, time_s in stamps.items():
        others = clocks_of(tables[clock.table], [each.channel for each in stamps if each.table == clock.table])
        steps_s = np.diff(time_s[np.isfinite(time_s)]) if others else time_s[:0]
        if len(steps_s) < FEWEST_ROWS or clock.channel == tables[clock.table].master != "":
            continue
        own_hz = [1.0 / step_s for step_s in (steps_s.mean(), np.median(steps_s)) if step_s > 0.0]
        if not own_hz:
            continue
        counts = [np.count_nonzero(np.isfinite(each.values)) for each in signals if each.time_s is time_s]
        for other in others:
            shorter = other.count < ENDS_TOGETHER * min(counts)  # it stamps channels that are not mapped
            unknown = not (clock.channel or other.unit or other.dates)  # a stated rate wins over a guessed unit
            if not (shorter or unknown) and (other_hz := _other_rate(other, own_hz)):
                own = repr(clock.channel) if clock.channel else "the stated rate"
                raise RecordingError(
                    f"the table has two clocks, {own} with {own_hz[-1]:.4g} Hz and {other.name!r} with {other_hz:.4g} "
                    f"Hz, and no column is stamped by {other.name!r}; name it as the channel of time_s, or as "
                    "channels.<column>.time (and time_unit) of the columns that it stamps, or export one of the two"
                )


def _refuse_two_ends(signals: Mapping[str, Signal], mapping: Mapping[str, ChannelMapping]) -> None:
    """Refuse columns of one clock that end at different rows, because they were logged at different rates."""
    ends: dict[int, dict[str, int]] = {}
    for column, signal in signals.items():
        valid = np.isfinite(signal.values)
        if np.count_nonzero(valid) >= FEWEST_ROWS:
            ends.setdefault(id(signal.time_s), {})[column] = len(valid) - int(valid[::-1].argmax())
    for of_columns in ends.values():
        longest, last = max(of_columns.items(), key=lambda item: item[1])
        for column, end in of_columns.items():
            share = last / end
            whole = 1 < round(share) <= MOST_TIMES_SLOWER and abs(end * round(share) - last) <= round(share)
            packed = whole and np.isfinite(signals[column].values[:end]).mean() > ENDS_TOGETHER
            stated = mapping[TIME].rate_hz is not None and end < ENDS_TOGETHER * last
            if stated or packed:
                raise RecordingError(
                    f"columns end at different rows: {column} ({mapping[column].channel!r}) at row {end}, {longest} "
                    f"({mapping[longest].channel!r}) at row {last}; they were logged at different rates, and on one "
                    f"clock {column} would run {share:.3g} times too fast; export a time column for each rate and name "
                    f"it as channels.{column}.time, or cut the file at row {end} if it was only lost"
                )


def _stamps(
    tables: Sequence[LoggedTable], clocks: Mapping[str, _Clock], mapping: Mapping[str, ChannelMapping]
) -> tuple[dict[_Clock, Array], Start | None]:
    """Convert each clock to seconds since the file's earliest date, and find when its clock was at 0 s."""
    time = mapping[TIME]
    columns = {clock: column for column, clock in reversed(list(clocks.items()))}
    raw = {clock: tables[clock.table].channels[clock.channel] for clock in columns if clock.channel}
    dates = {clock: stamps for clock, stamps in raw.items() if stamps.dtype.kind == "M"}
    if dates and len(dates) < len(columns):
        others = ", ".join(repr(clock.channel) for clock in columns if clock not in dates)
        raise RecordingError(
            f"time channel {next(iter(dates)).channel!r} holds dates, but {others or 'the rate'} does not; "
            "expected one kind of time in a file, or nobody knows how they lie to each other"
        )
    known = {clock: stamps.min() for clock, stamps in dates.items() if stamps.notna().any()}
    origin = min(known.values(), default=pd.NaT)
    starts = {own.at: own for clock in columns if (own := tables[clock.table].start) is not None}
    start = next(iter(starts.values()), None)
    if len(starts) > 1 and not known:
        texts = " and ".join(sorted(each.text() for each in starts.values()))
        raise RecordingError(
            f"its tables state different starts, {texts}, and their clocks count from there; expected one start; write "
            "dates in the rows, or let all clocks count from one start"
        )
    if known:
        first, at = next(iter(known)), origin.to_datetime64().astype("datetime64[ns]")
        start = Start(at, tables[first.table].utc, f"time stamps of {first.channel!r}", dated_rows=True)
    stamps_s: dict[_Clock, Array] = {}
    for clock, column in columns.items():
        if clock in dates:
            since = dates[clock].to_numpy("datetime64[ns]") - origin.to_datetime64()
            stamps_s[clock] = np.where(np.isnat(since), np.nan, since.astype(np.int64) / 1e9)
        elif clock.channel:
            stamps_s[clock] = _seconds(tables[clock.table], clock.channel, column, time, mapping[column].time_unit)
        else:
            assert time.rate_hz is not None
            stamps_s[clock] = np.arange(len(tables[clock.table].channels)) / time.rate_hz
    if not known:
        beside = (_start_beside(tables[clock.table], time_s) for clock, time_s in stamps_s.items())
        start = next(filter(None, beside), start)
    return stamps_s, start


def _start_beside(table: LoggedTable, time_s: Array) -> Start | None:
    """Find when a clock was at 0 s from dates beside it; None if the two do not run alike."""
    for name, raw in table.channels.items():
        if raw.dtype.kind == "M" and (rows := raw.notna().to_numpy() & np.isfinite(time_s)).any():
            since = np.rint(1e9 * time_s[rows]).astype("timedelta64[ns]")
            starts = raw.to_numpy("datetime64[ns]")[rows] - since
            if starts.max() - starts.min() < DATES_AGREE:
                return Start(starts.max(), table.utc, f"dates of {name!r}")  # a coarse clock shows a past time
    return None


def _seconds(table: LoggedTable, channel: str, column: str, time: ChannelMapping, time_unit: str) -> Array:
    """Read a time channel in seconds; its unit is that of ``time_s`` or ``time_unit``, or the file states it."""
    raw, stated = table.channels[channel], table.units.get(channel, "")
    of_time = channel == time.channel
    configured = time_unit or (time.unit if of_time else "")
    if configured:
        _check_unit(table, channel, configured, TIME if of_time else column)
    unit = configured or (stated if of_time or quantity_of(stated) == "time" else time.unit)
    if not unit:
        raise RecordingError(
            f"time channel {channel!r} (for {column!r}) holds {raw.dtype} and states no unit; "
            "expected dates, or numbers with channels.time_s.unit"
        )
    values = _numbers(raw, channel, TIME, unit)
    return to_column_unit(values - time.offset if time.offset else values, unit, TIME)


def _check_unit(table: LoggedTable, channel: str, configured: str, column: str, absolute: bool = False) -> None:
    """Refuse a channel if the file contradicts the mapping's unit."""
    stated = table.units.get(channel, "")
    if not units_agree(stated, configured):
        raise RecordingError(
            f"channel {channel!r} (for {column!r}): the file states the unit {stated!r}, but it is read in "
            f"{configured!r}; expected the same; correct channels.{column}.unit in the mapping, or the file"
        )
    reference = stated_reference(stated) if QUANTITIES[column] == "pressure" else None
    if reference is not None and (reference == "absolute") != absolute:
        raise RecordingError(
            f"channel {channel!r} (for {column!r}): the file states {stated!r}, which is {reference} pressure, "
            f"but it is read as {'absolute' if absolute else 'gauge'} pressure; "
            f"correct channels.{column}.unit: bara is absolute, bar gauge pressure"
        )


def _find_channel(tables: Sequence[LoggedTable], name: str, table: str, column: str) -> int:
    """Find the index of the table with the channel for ``column``; an empty ``table`` allows any table."""
    searched = [index for index, entry in enumerate(tables) if table in ("", entry.name)]
    if not searched:
        raise RecordingError(
            f"table {table!r} (for {column!r}) is missing; got tables {_listed([entry.name for entry in tables])}; "
            f"correct the file or channels.{column}.table"
        )
    holding = [index for index in searched for other in tables[index].channels.columns if other == name]
    if len(holding) == 1:
        return holding[0]
    key = "channel"
    there = [str(other) for index in searched for other in (*tables[index].channels.columns, *tables[index].unread)]
    if not holding:
        by_folded = {"".join(other.split()).casefold(): other for other in there}
        close = get_close_matches("".join(name.split()).casefold(), by_folded, n=1, cutoff=0.6)
        nearest = f" (nearest: {by_folded[close[0]]!r})" if close else ""
        problem = f"is missing; got channels {_listed(there)}{nearest}; correct the file or"
    elif len(set(holding)) == 1:
        problem = f"occurs {len(holding)} times; got channels {_listed(there)}; rename one in the file or correct"
    else:
        problem, key = f"occurs in tables {_listed([tables[each].name for each in holding])}; state which as", "table"
    raise RecordingError(f"channel {name!r} (for {column!r}) {problem} channels.{column}.{key} in the mapping")


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMES} more" if len(names) > MOST_NAMES else ""
    return ", ".join(map(repr, names[:MOST_NAMES])) + more


def _numbers(raw: pd.Series[Any], channel: str, column: str, unit: str) -> Array:
    """Read a channel's cells as numbers, shape ``(n,)``; an empty cell becomes NaN. A float64 array is not copied."""
    if raw.dtype.kind in "iufb":
        return raw.to_numpy(dtype=np.float64)
    if raw.dtype.kind == "M":
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds dates; expected numbers in {unit}; correct "
            f"channels.{column}.channel"
        )
    values: Array = pd.to_numeric(raw, errors="coerce").to_numpy(dtype=np.float64, na_value=np.nan)
    rows = np.flatnonzero(np.isnan(values) & raw.notna().to_numpy())
    if len(rows) and column != OIL_TEMPERATURE:
        raise RecordingError(
            f"channel {channel!r} (for {column!r}) holds {str(raw.iloc[rows[0]])[:80]!r} in row {rows[0] + 1} "
            f"({len(rows)} in all); expected numbers in {unit}; repair or cut the log"
        )
    return values
