"""What is inspected: one file, or one piece of it, with what the checks found."""

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

from cylinder_friction.recordings.checks.finding import Finding
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.sensor_offsets import OffsetEvidence

OUTCOMES = ("ok", "noted", "repaired", "refused")
"""Of a check, mildest first."""


@dataclass(frozen=True)
class Extent:
    """What stays of a recording whose signals are no longer held."""

    name: str  # Of the recording
    rows: int  # How many samples it has
    sample_time_s: float
    least_position_m: float
    greatest_position_m: float
    repairs: tuple[str, ...] = ()  # What was done to it, one sentence each

    @classmethod
    def of(cls, recording: Recording) -> Self:
        position_m = recording.column("position_m")
        ends = float(position_m.min()), float(position_m.max())
        return cls(recording.name, len(recording), recording.sample_time_s, *ends, recording.metadata.repairs)


@dataclass(frozen=True)
class Inspected:
    """One logged file and what became of it; a file that a gap has split gives one of these a piece."""

    file: str  # Its path, as the user should see it
    findings: Sequence[Finding]  # What every check found
    # What it holds, wherever that can be read, so that also what is refused can be looked at
    recording: Recording | None = None
    repairs: Sequence[str] = ()  # What was done to the file besides what the findings state, one sentence each
    extent: Extent | None = None  # Of a recording that is no longer held
    # Half of extending less retracting at equal position [N]; NaN where it was not calculated
    friction_n: float = math.nan
    offset: OffsetEvidence | None = None  # Of the pressure sensors; None where friction was not calculated

    @property
    def seen(self) -> Extent | None:
        """What is known of its recording, held or not; None where it became none."""
        return self.extent if self.recording is None else Extent.of(self.recording)

    def without_signals(self) -> Self:
        """Return the same without the recording, of which only its extent stays."""
        return replace(self, recording=None, extent=self.seen)

    @property
    def outcome(self) -> str:
        """The worst outcome of any check; a file without a recording is refused whatever the checks find."""
        if self.recording is None and self.extent is None:
            return "refused"
        return worst([*(finding.outcome for finding in self.findings), *("repaired" for _ in self.all_repairs())])

    def all_repairs(self) -> tuple[str, ...]:
        """Return every sentence about a repair that no finding states already."""
        stated = {finding.text for finding in self.findings}
        seen = self.seen
        of_recording = seen.repairs if seen is not None else ()
        return tuple(dict.fromkeys(text for text in (*self.repairs, *of_recording) if text not in stated))

    def reasons(self) -> list[str]:
        """Return, worst outcome first, the texts of the checks that did not simply pass, and the repairs."""
        stated = sorted(
            (finding for finding in self.findings if finding.outcome != "ok"),
            key=lambda finding: -OUTCOMES.index(finding.outcome),
        )
        return [finding.text for finding in stated] + list(self.all_repairs())


def worst(outcomes: Iterable[str]) -> str:
    """Return the worst of several outcomes, ``ok`` where there is none."""
    return max(outcomes, key=OUTCOMES.index, default="ok")


def titles(subjects: Sequence[Inspected]) -> list[str]:
    """Return a title a subject: the file, and for the pieces of one file which it is, or the recording's name."""
    files = [subject.file for subject in subjects]
    seen = [subject.seen for subject in subjects]
    return [
        f"{file} ({_piece(extent.name)})" if extent is not None and files.count(file) > 1 else file
        for file, extent in zip(files, seen, strict=True)
    ]


def _piece(name: str) -> str:
    part = re.search(r"_part(\d+)$", name)
    return f"part {part[1]}" if part else name


def count_outcomes(subjects: Sequence[Inspected]) -> dict[str, int]:
    """Return how many files had which outcome; the pieces of one file count once, by the worst of them."""
    by_file: dict[str, list[str]] = {}
    for subject in subjects:
        by_file.setdefault(subject.file, []).append(subject.outcome)
    found = [worst(outcomes) for outcomes in by_file.values()]
    return {outcome: found.count(outcome) for outcome in OUTCOMES}
