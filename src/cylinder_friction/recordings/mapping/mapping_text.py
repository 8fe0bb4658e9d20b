"""Write a guessed mapping as YAML with a comment on every guess, or refuse it if columns or units remain open."""

import glob
import re
from collections.abc import Mapping
from pathlib import Path

import yaml

from cylinder_friction.cylinder import ONE_CHAMBER
from cylinder_friction.recordings.columns import PRESSURE_1, PRESSURE_2, QUANTITIES, SAMPLE_COLUMNS, TIME
from cylinder_friction.recordings.mapping.channel_mapping import ANOTHER_UNIT, NOT_FOUND, electrical, units_agree
from cylinder_friction.recordings.mapping.guessing import GuessedColumn, GuessedMapping, size_in_words, usual_unit
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.wording import printable

LISTED = 60  # Most unused channels that are listed
TEMPLATE = """\
# First mapping of {file}, made from its names, units and values.
# Look at every line marked guess, CHECK, AMBIGUOUS or NOT FOUND; then take the remark away.
defaults:
  - rules@_here_: default  # usual rules of time, spikes, zeros, limits; in a project conf/ingest/rules/default.yaml
  - _self_
source: {source}
pattern: {pattern}
# guess: the name of the {named} is the session, what comes before its first _ the condition.
name_pattern: {name_pattern}
{database}channels:
{channels}
"""
"""Text of the mapping file. The lines in place of ``{channels}`` are indented by two blanks."""
SESSION_FOLDERS = r"^(?P<session>(?P<condition>[^_/]+)_[^/]+)/"
"""Name pattern of own recordings with a folder per session, as the guide to them recommends."""


def mapping_yaml(guess: GuessedMapping, database: Path | None = None) -> str:
    """Write the text of ``conf/ingest/<name>.yaml``; ``database`` is a bus's DBC file.

    The mapping is for all files beside this one, or, if this one is in a folder of its session such as
    ``data/raw/own/no-load_monday``, for the folders of all sessions.
    """
    folder = guess.path.parent
    in_a_data_set = folder.parts[-4:-2] == ("data", "raw")
    by_folder = in_a_data_set and re.match(SESSION_FOLDERS, f"{folder.name}/")
    ending = re.search(r"(?<=.)(\.[A-Za-z0-9]+)?\.gz$|(?<=.)\.[A-Za-z0-9]+$", guess.path.name)
    suffix = ending[0] if ending else ""
    by_file = rf"(?P<session>(?P<condition>[^/]+?)(?:_[^/]*)?){re.escape(suffix)}$"
    filled = {
        "file": printable(guess.path.name),
        "source": quoted((folder.parent if by_folder else folder).as_posix()),
        "pattern": quoted(f"**/*{glob.escape(suffix)}"),
        "named": "folder" if by_folder else "file",
        "name_pattern": quoted(SESSION_FOLDERS if by_folder else by_file),
        "database": "" if database is None else f"database: {quoted(database.as_posix())}\n",
        "channels": "\n".join(f"  {line}" for line in channel_lines(guess)),
    }
    return re.sub(r"\{(\w+)\}", lambda match: filled[match[1]], TEMPLATE)


def channel_lines(guess: GuessedMapping) -> list[str]:
    """Write the lines below ``channels:`` without indentation; unused channels are listed at the end."""
    lines = [line for column in guess.columns.values() for line in _column_lines(column)]
    if guess.unused:
        lines.append("# Not used:")
        for channel in guess.unused[:LISTED]:
            unit = f" [{channel.unit}]" if channel.unit and channel.words.unit != channel.unit else ""
            place = f" in table {channel.table_name}" if channel.table_name else ""
            lines.append(f"#   {printable(f'{channel.name}{unit}{place}: {channel.described()}')}")
        if len(guess.unused) > LISTED:
            lines.append(f"#   and {len(guess.unused) - LISTED} more")
    return lines


def _column_lines(column: GuessedColumn) -> list[str]:
    name, channel = column.column, column.channel
    checks = [f"# CHECK: {printable(check)}" for check in column.checks]
    if "rate_hz" in column.entry:
        return [f"{name}: {{rate_hz: {column.entry['rate_hz']:g}}}"]
    if channel is None:
        rate = ", or write {rate_hz: ...} if the rows come at a constant rate" if name == TIME else ""
        unknown = f'{name}: {{channel: "{NOT_FOUND}", unit: {usual_unit(name)}}}'
        return [f"# {NOT_FOUND}: name the channel{rate}", *checks, unknown]
    lines = [f"# guess: {printable(', '.join(column.reasons))}"]
    if column.others:
        named = [f"{each.name} ({each.described()})" for each in (channel, *column.others)]
        lines.append(f"# AMBIGUOUS: {printable(' or '.join(named))}")
    entry = {key: _unit(text) if key == "unit" else quoted(text) for key, text in column.entry.items()}
    lines += checks
    if column.doubtful:  # which a mapping refuses until one of them is left
        entry["unit"] = quoted(" or ".join(column.fitting or [NOT_FOUND]))
    if not column.known:
        lines.append(f"# {NOT_FOUND}: the sensor's range, and what the channel holds at its two ends")
        signal = {"mA": "[4, 20]", "count": "[0, 4095]"}.get(electrical(channel.unit) or "", "[0, 10]")
        entry["sensor"] = f"{{range: [0, 1], unit: {_unit(usual_unit(name))}, signal: {signal}}}"
    return [*lines, f"{name}: {{{', '.join(f'{key}: {value}' for key, value in entry.items())}}}"]


def _unit(unit: str) -> str:
    return unit if re.fullmatch(r"[A-Za-z°]+", unit) and yaml.safe_load(unit) == unit else quoted(unit)


def quoted(text: str) -> str:
    """Write any text as a quoted YAML scalar on one line."""
    return yaml.safe_dump(text, default_style='"', allow_unicode=True, width=10**9).rstrip("\n")


def refuse_unknown(guess: GuessedMapping, units: Mapping[str, str]) -> None:
    """Refuse a guess with open columns or units, or ``units`` (by quantity) that the file contradicts."""
    unknown = {name: each.checks for name, each in guess.columns.items() if not each.known}
    alike = [(name, guess.columns[name]) for name in SAMPLE_COLUMNS if name in guess.columns]
    problems = [f"{name} may be {' or '.join(map(repr, each.names))}" for name, each in alike if len(each.names) > 1]
    if unknown:
        why = "".join([f": {check}" for checks in unknown.values() for check in checks][:1])
        why += f" ({ONE_CHAMBER})" if PRESSURE_2 in unknown and PRESSURE_1 not in unknown else ""
        problems = [f"that of {', '.join(unknown)} cannot be guessed{why}"]
    if problems:
        raise RecordingError(
            f"no mapping was given, and {problems[0]}; write a mapping and give it by --channels, starting from "
            "channels:\n" + "\n".join(channel_lines(guess))
        )
    doubtful: dict[str, list[GuessedColumn]] = {}
    for name, each in guess.columns.items():
        quantity, channel = QUANTITIES[name], each.channel
        if channel is not None and channel.unit and not units_agree(channel.unit, units.get(quantity, channel.unit)):
            raise RecordingError(
                f"channel {channel.name!r} states {channel.unit}, but {quantity}={units[quantity]} was given as its "
                "unit; leave it out, or correct the file"
            )
        if each.doubtful:
            doubtful.setdefault(quantity, []).append(each)
    if doubtful:
        words, options = list[str](), list[str]()
        for quantity, own in doubtful.items():
            named = [
                f"{each.channel.name!r} ({size_in_words(each.column, each.channel)})" for each in own if each.channel
            ]
            fits = own[0].fitting or []
            words.append(f"{quantity} of {' and '.join(named)} fits {' or '.join(fits or ['no usual unit'])}")
            rate = ["the rate of the rows, such as --unit time=200Hz"] if quantity == "time" else []
            stated = [f"--unit {quantity}={unit}" for unit in fits or ["UNIT"] * (not rate) if unit != ANOTHER_UNIT]
            options.append(" or ".join([*stated, *rate]))
        raise RecordingError(
            f"no mapping was given, and units that the file does not state cannot be guessed: {'; '.join(words)}; "
            f"state what they are: {'; '.join(options)} (in Python units={{quantity: unit}}), or give a mapping"
        )
