"""What was done to time, in sentences."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.recordings.timeline.channel_timelines import Track
    from cylinder_friction.recordings.timeline.time_rules import TimeRules


def said_of(columns: Sequence[str], all_columns: int, what: str) -> str:
    """Return the sentence with its subject: time, if it is said of every column."""
    return f"{'time' if len(columns) == all_columns else ', '.join(columns)}: {what}"


def gap_note(tracks: Sequence[Track], rules: TimeRules) -> list[str]:
    """Return where gaps split the recording, and which column has nothing there; restarts of the clock are no gaps."""
    gaps: dict[tuple[float, float], list[str]] = {}
    for track in tracks:
        time_s, segments = track.time_s, track.segments
        for place in np.flatnonzero(track.gaps & (np.diff(segments) == 0)):
            gaps.setdefault((float(time_s[place]), float(time_s[place + 1])), []).append(track.column)
    if not gaps:
        return []
    before_s, after_s = min(gaps)
    columns = gaps[(before_s, after_s)]
    without = "" if len(columns) == len(tracks) else f" without {', '.join(columns)}"
    count = "1 gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
    return [
        f"time: split at {count} of more than {_samples(rules.longest_bridge_samples)} (first: "
        f"{after_s - before_s:.4g} s{without} after {before_s:.6g} s)"
    ]


def bridged_note(tracks: Sequence[Track], first_s: float, last_s: float, segment: int) -> list[str]:
    """Return how many lost samples of a piece were interpolated, columns with the same ones together."""
    said: dict[str, list[str]] = {}
    for track in tracks:
        time_s, lost = track.time_s, track.lost_after
        lost = lost[(time_s[lost] < last_s) & (time_s[lost + 1] > first_s) & (track.segments[lost] == segment)]
        if len(lost):
            count = int(track.lost[lost].sum())
            text = (
                f"{count} lost {'sample' if count == 1 else 'samples'} interpolated (at most {track.lost[lost].max()} "
                f"in a row, first after {time_s[lost[0]]:.6g} s)"
            )
            said.setdefault(text, []).append(track.column)
    return [said_of(columns, len(tracks), text) for text, columns in said.items()]


def edge_note(tracks: Sequence[Track], rate_hz: float) -> list[str]:
    """Return how much time at the ends only some of the columns cover."""
    starts_s = ends_s = 0.0
    for segment in range(int(tracks[0].clock.segments[-1]) + 1):
        spans = []
        for track in tracks:
            time_s = track.time_s[track.segments == segment]
            if len(time_s):
                spans.append((float(time_s[0]), float(time_s[-1])))
        if not spans:
            continue
        firsts, lasts = zip(*spans, strict=True)
        if len(spans) < len(tracks):
            ends_s += max(lasts) - min(firsts)
            continue
        starts_s += max(firsts) - min(firsts)
        ends_s += max(lasts) - min(lasts)
    slowest_s = max(1.0 / rate_hz, *(track.step_s for track in tracks))
    if max(starts_s, ends_s) <= 1.5 * slowest_s:
        return []
    start, end = (f"{round(lost_s, 6):.4g} s" for lost_s in (starts_s, ends_s))
    return [f"time: {start} at the start and {end} at the end left out, not covered by every column"]


def _samples(count: int) -> str:
    return "1 lost sample" if count == 1 else f"{count} lost samples"
