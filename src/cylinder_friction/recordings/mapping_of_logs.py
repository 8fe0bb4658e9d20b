"""The mapping of logs that came without one: guessed from the first, and stated with every guess."""

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from cylinder_friction.cylinder import ONE_CHAMBER, Cylinder
from cylinder_friction.recordings.columns import PRESSURE_1, PRESSURE_2, QUANTITIES, TIME
from cylinder_friction.recordings.conversion import ROWS_AT_ONCE
from cylinder_friction.recordings.formats.logged_table import LoggedTable, LongTable
from cylinder_friction.recordings.formats.reading import open_logged_file
from cylinder_friction.recordings.mapping.guessing import GuessedColumn, GuessedMapping, guess_mapping
from cylinder_friction.recordings.mapping.mapping_text import channel_lines
from cylinder_friction.recordings.mapping.units import check_unit, stated_rate, units_agree
from cylinder_friction.recordings.recording import RecordingError


def guessed(
    path: Path, cylinder: Cylinder, units: Mapping[str, str], database: Path | None
) -> tuple[GuessedMapping, list[LoggedTable]]:
    """Guess a mapping from the first log and warn of every guess; return it, and what that log holds.

    Tables of a log that is read in parts are not returned.

    Raises:
        RecordingError: A column, a sensor's range or a unit cannot be guessed.
    """
    for quantity, unit in units.items():
        if quantity not in QUANTITIES.values():
            known = ", ".join(dict.fromkeys(QUANTITIES.values()))
            raise RecordingError(f"units: got {quantity!r}, expected one of {known}, such as pressure=bar")
        if quantity != "time" or stated_rate(unit) is None:
            check_unit(next(column for column in QUANTITIES if QUANTITIES[column] == quantity), unit)
    try:
        tables = open_logged_file(path, ROWS_AT_ONCE, database=database)
        first = [next(tables.chunks())] if isinstance(tables, LongTable) else tables
        guess = guess_mapping(first, path, cylinder, units)
    except RecordingError as error:
        raise RecordingError(f"{path}: {error}") from error
    unknown = {name: each.checks for name, each in guess.columns.items() if not each.known}
    if unknown:
        why = "".join(f": {check}" for check in unknown.get(TIME, ()))
        why += f" ({ONE_CHAMBER})" if PRESSURE_2 in unknown and PRESSURE_1 not in unknown else ""
        raise RecordingError(
            f"{path}: no mapping was given, and that of {', '.join(unknown)} cannot be guessed{why}; state channels, "
            f"starting from\n" + "\n".join(channel_lines(guess))
        )
    _refuse_units(path, guess, units)
    lines = "\n".join(channel_lines(guess))
    warnings.warn(f"no mapping was given; guessed from {path.name}:\n{lines}", stacklevel=4)
    return guess, [] if isinstance(tables, LongTable) else tables


def _refuse_units(path: Path, guess: GuessedMapping, units: Mapping[str, str]) -> None:
    """Refuse units that the values leave open, and given units that the file contradicts."""
    doubtful: dict[str, list[GuessedColumn]] = {}
    for name, each in guess.columns.items():
        quantity, channel = QUANTITIES[name], each.channel
        if channel is not None and channel.unit and not units_agree(channel.unit, units.get(quantity, channel.unit)):
            raise RecordingError(
                f"{path}: channel {channel.name!r} states {channel.unit}, but {quantity}={units[quantity]} was given "
                "as its unit; leave it out, or correct the file"
            )
        # Friction does not depend on temperature.
        if each.fitting is not None and len(each.fitting) != 1 and quantity != "temperature":
            doubtful.setdefault(quantity, []).append(each)
    if doubtful:
        words = "; ".join(f"{quantity} of {_and_their_fit(each)}" for quantity, each in doubtful.items())
        unknown = {"time": "200Hz"}  # the rate of the rows
        options = "; ".join(
            " or ".join(f"--unit {quantity}={unit}" for unit in each[0].fitting or [unknown.get(quantity, "UNIT")])
            for quantity, each in doubtful.items()
        )
        raise RecordingError(
            f"{path}: no mapping was given, and units that the file does not state cannot be guessed: {words}; state "
            f"what they are: {options} (in Python units={{quantity: unit}}), or give a mapping"
        )


def _and_their_fit(columns: Sequence[GuessedColumn]) -> str:
    named = [f"{each.channel.name!r} ({each.reasons[1].partition(' fit ')[0]})" for each in columns if each.channel]
    fitting = columns[0].fitting
    return f"{' and '.join(named)} fits {' or '.join(fitting) if fitting else 'no usual unit'}"
