"""What a mapping states about when its logs were made: the time zone of the logger's clock, and dates in names."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cached_property
from zoneinfo import ZoneInfo

import numpy as np

from cylinder_friction.recordings.epochs import is_future
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.start import START_PARTS, Start, start_of_parts


@dataclass(frozen=True)
class StartRules:
    """What a mapping states about when logs were made."""

    zone: str | None = None  # Of the logger's clock, such as Europe/Oslo, where the logs state none
    # Regular expression on the path below the source with the groups ``year`` (two or four digits), ``month``, ``day``,
    # optionally ``hour``, ``minute`` and ``second``, for logs that state no start themselves
    pattern: str | None = None

    def __post_init__(self) -> None:
        _ = self._zone, self._pattern  # refuses what is wrong at once

    @cached_property
    def _zone(self) -> ZoneInfo | None:
        try:
            return None if self.zone is None else ZoneInfo(self.zone)
        except (KeyError, ValueError, OSError) as error:
            raise RecordingError(
                f"start: zone: got {self.zone!r}, expected a name of the time zone database such as Europe/Oslo"
            ) from error

    @cached_property
    def _pattern(self) -> re.Pattern[str] | None:
        try:
            compiled = None if self.pattern is None else re.compile(self.pattern)
        except re.error as error:
            raise RecordingError(f"start: pattern: {self.pattern!r} is not a regular expression: {error}") from None
        if compiled is not None and not {"year", "month", "day"} <= compiled.groupindex.keys() <= {*START_PARTS}:
            raise RecordingError(
                f"start: pattern: got groups {', '.join(compiled.groupindex) or 'none'}, expected year, month, day, "
                "and if you like hour, minute, second"
            )
        return compiled

    def of(self, stated: Start | None, relative_path: str) -> Start | None:
        """Return when a file's clock was at 0 s: as the file states it, else as its name does; in UTC if known."""
        start = stated or self._named(relative_path)
        if start is None or start.utc or self._zone is None or np.datetime_data(start.at.dtype)[0] == "D":
            return start
        local = start.at.astype("datetime64[us]").item()
        offsets = {local.replace(tzinfo=self._zone, fold=fold).utcoffset() for fold in (0, 1)}
        if len(offsets) > 1:
            return replace(start, source=f"{start.source}; in {self.zone} that hour was twice or never")
        return replace(
            start, at=start.at - np.timedelta64(offsets.pop(), "ns"), utc=True, source=f"{start.source}, {self.zone}"
        )

    def _named(self, path: str) -> Start | None:
        match = self._pattern.search(path) if self._pattern is not None else None
        start = None if match is None else start_of_parts(match.groupdict(), "file name")
        return None if start is None or is_future(start.at) else start
