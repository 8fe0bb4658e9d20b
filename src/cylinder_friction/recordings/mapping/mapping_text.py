"""Write a guessed mapping as YAML with a comment on every guess, and refuse a guess that leaves something open."""

import glob
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from cylinder_friction.cylinder import ONE_CHAMBER
from cylinder_friction.recordings.columns import OTHER_POSITIONS, POSITION, PRESSURE_1, PRESSURE_2, QUANTITIES, TIME
from cylinder_friction.recordings.mapping.channel_facts import ChannelFacts, usual_unit
from cylinder_friction.recordings.mapping.guessing import GuessedColumn, GuessedMapping
from cylinder_friction.recordings.mapping.units import electrical, units_agree
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.wording import printable

NOT_FOUND = "NOT FOUND"
"""Placeholder for a channel's name that the user must fill in; ingest refuses it and lists the file's channels."""

OTHERWISE = {"time": "200Hz"}  # Example of a rate of the rows, if no unit of time fits
LISTED = 60  # Most channels that the comment below the mapping lists

TEMPLATE = """\
# First mapping of {file}, made from its names, units and values.
# Look at every line marked guess, CHECK, AMBIGUOUS or NOT FOUND; then take the remark away.
defaults:
  - rules@_here_: default  # usual rules of time, spikes, zeros, limits; in a project conf/ingest/rules/default.yaml
  - _self_
source: {source}
truth: data/raw/rig_truth  # for the simulated rig alone: nobody knows your true friction
pattern: {pattern}
# guess: the name of the file is the session, what comes before its first _ the condition.
name_pattern: {name_pattern}
{database}channels:
{channels}
"""
"""Text of the mapping file. The lines in place of ``{channels}`` are indented by two blanks."""


def mapping_yaml(guess: GuessedMapping, database: Path | None = None) -> str:
    """Write the text of ``conf/ingest/<name>.yaml``, with the file's folder as the source.

    ``database`` is the DBC file of the bus, if the file contains CAN frames.
    """
    suffix = _suffix(guess.path.name)
    filled = {
        "file": printable(guess.path.name),
        "source": quoted(guess.path.parent.as_posix()),
        "pattern": quoted(f"**/*{glob.escape(suffix)}"),
        "name_pattern": quoted(rf"(?P<session>(?P<condition>[^/]+?)(?:_[^/]*)?){re.escape(suffix)}$"),
        "database": "" if database is None else f"database: {quoted(database.as_posix())}\n",
        "channels": "\n".join(f"  {line}" for line in channel_lines(guess)),
    }
    return re.sub(r"\{(\w+)\}", lambda match: filled[match[1]], TEMPLATE)


def channel_lines(guess: GuessedMapping) -> list[str]:
    """Write the lines below ``channels:`` without indentation; unused channels are listed at the end."""
    lines = []
    for column in guess.columns.values():
        lines += _column_lines(column, guess)
    if guess.unused:
        lines.append("# Not used:")
        for channel in guess.unused[:LISTED]:
            unit = f" [{channel.unit}]" if channel.unit and channel.words.unit != channel.unit else ""
            place = f" in table {channel.table_name}" if channel.table_name else ""
            lines.append(f"#   {printable(f'{channel.name}{unit}{place}: {channel.described()}')}")
        if len(guess.unused) > LISTED:
            lines.append(f"#   and {len(guess.unused) - LISTED} more")
    return lines


def _column_lines(column: GuessedColumn, guess: GuessedMapping) -> list[str]:
    if column.rate_hz is not None:
        return [f"{column.column}: {{rate_hz: {column.rate_hz:g}}}"]
    if column.channel is None:
        return _not_found(column)
    lines = [f"# guess: {printable(', '.join(column.reasons))}"]
    if column.others:
        named = [f"{channel.name} ({channel.described()})" for channel in (column.channel, *column.others)]
        lines.append(f"# AMBIGUOUS: {printable(' or '.join(named))}")
        if column.column == POSITION:
            other = f"{OTHER_POSITIONS[0]}: {{channel: {quoted(column.others[0].name)}, unit: {_unit(column.unit)}}}"
            lines.append(f"# if it is another cylinder's, on which the load depends, add {printable(other)}")
    lines += [f"# CHECK: {printable(check)}" for check in column.checks]
    entry = {"channel": quoted(column.channel.name), "unit": _unit(column.unit)}
    places = zip(("table", "time"), guess.place_of(column.column), strict=True)
    entry |= {key: quoted(place) for key, place in places if place}
    if not column.known:
        lines.append(f"# {NOT_FOUND}: the sensor's range, and what the channel holds at its two ends")
        entry["sensor"] = _sensor(column.column, column.channel)
    return [*lines, f"{column.column}: {{{', '.join(f'{key}: {value}' for key, value in entry.items())}}}"]


def _not_found(column: GuessedColumn) -> list[str]:
    line = f"# {NOT_FOUND}: name the channel"
    if column.column == "time_s":
        line += ", or write {rate_hz: ...} if the rows come at a constant rate"
    checks = [f"# CHECK: {printable(check)}" for check in column.checks]
    return [line, *checks, f'{column.column}: {{channel: "{NOT_FOUND}", unit: {usual_unit(column.column)}}}']


def _sensor(column: str, channel: ChannelFacts) -> str:
    """Write a sensor for the user to correct: the usual signal of its unit, and an implausible range."""
    kind = electrical(channel.unit)
    signal = {"mA": "[4, 20]", "count": "[0, 4095]"}.get(kind or "", "[0, 10]")
    return f"{{range: [0, 1], unit: {_unit(usual_unit(column))}, signal: {signal}}}"


def _unit(unit: str) -> str:
    return unit if re.fullmatch(r"[A-Za-z°]+", unit) and yaml.safe_load(unit) == unit else quoted(unit)


def _suffix(name: str) -> str:
    """Find the ending of a file's name; both endings of ``log.csv.gz``."""
    match = re.search(r"(\.[A-Za-z0-9]+)?\.[A-Za-z0-9]+$", name) if name.endswith(".gz") else None
    match = match or re.search(r"(?<=.)\.[A-Za-z0-9]+$", name)
    return match[0] if match else ""


def quoted(text: str) -> str:
    """Write any text as a quoted YAML scalar on one line."""
    return yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**9).rstrip("\n")


def refuse_unknown(guess: GuessedMapping, units: Mapping[str, str]) -> None:
    """Refuse a guess with open columns or units, or ``units`` (by quantity) that the file contradicts.

    Raises:
        RecordingError: A column, a sensor's range or a unit cannot be guessed; the message states what to write.
    """
    unknown = {name: each.checks for name, each in guess.columns.items() if not each.known}
    if unknown:
        why = "".join(f": {check}" for check in unknown.get(TIME, ()))
        why += f" ({ONE_CHAMBER})" if PRESSURE_2 in unknown and PRESSURE_1 not in unknown else ""
        raise RecordingError(
            f"no mapping was given, and that of {', '.join(unknown)} cannot be guessed{why}; state channels, starting "
            "from\n" + "\n".join(channel_lines(guess))
        )
    doubtful: dict[str, list[GuessedColumn]] = {}
    for name, each in guess.columns.items():
        quantity, channel = QUANTITIES[name], each.channel
        if channel is not None and channel.unit and not units_agree(channel.unit, units.get(quantity, channel.unit)):
            raise RecordingError(
                f"channel {channel.name!r} states {channel.unit}, but {quantity}={units[quantity]} was given as its "
                "unit; leave it out, or correct the file"
            )
        # Friction does not depend on temperature.
        if each.fitting is not None and len(each.fitting) != 1 and quantity != "temperature":
            doubtful.setdefault(quantity, []).append(each)
    if doubtful:
        words = "; ".join(f"{quantity} of {_and_their_fit(each)}" for quantity, each in doubtful.items())
        options = "; ".join(
            " or ".join(f"--unit {quantity}={unit}" for unit in each[0].fitting or [OTHERWISE.get(quantity, "UNIT")])
            for quantity, each in doubtful.items()
        )
        raise RecordingError(
            f"no mapping was given, and units that the file does not state cannot be guessed: {words}; state what they "
            f"are: {options} (in Python units={{quantity: unit}}), or give a mapping"
        )


def _and_their_fit(columns: Sequence[GuessedColumn]) -> str:
    named = [f"{each.channel.name!r} ({each.reasons[1].partition(' fit ')[0]})" for each in columns if each.channel]
    fitting = columns[0].fitting
    return f"{' and '.join(named)} fits {' or '.join(fitting) if fitting else 'no usual unit'}"
