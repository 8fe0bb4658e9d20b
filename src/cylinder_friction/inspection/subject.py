"""What is inspected: one file, or one piece of it, with what the checks found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from cylinder_friction.recordings import Recording
    from cylinder_friction.recordings.findings import Finding

OUTCOMES = ("ok", "noted", "repaired", "refused")
"""Of a check, mildest first."""


@dataclass(frozen=True)
class Inspected:
    """One logged file and what became of it; a file that a gap has split gives one of these a piece.

    Attributes:
        file: Its path, as the user should see it.
        findings: What every check found.
        recording: The recording it became; None where it was refused.
        repairs: What was done to the file besides what the findings say, one sentence each.
    """

    file: str
    findings: Sequence[Finding]
    recording: Recording | None = None
    repairs: Sequence[str] = ()

    @property
    def outcome(self) -> str:
        """The worst outcome of any check; a file without a recording is refused whatever the checks say."""
        if self.recording is None:
            return "refused"
        return worst([*(finding.outcome for finding in self.findings), *("repaired" for _ in self.all_repairs())])

    def all_repairs(self) -> tuple[str, ...]:
        """Returns every sentence about a repair that no finding says already."""
        told = {finding.text for finding in self.findings}
        of_recording = self.recording.metadata.repairs if self.recording is not None else ()
        return tuple(dict.fromkeys(text for text in (*self.repairs, *of_recording) if text not in told))

    def reasons(self) -> list[str]:
        """Returns, worst outcome first, the texts of the checks that did not simply pass, and the repairs."""
        told = sorted(
            (finding for finding in self.findings if finding.outcome != "ok"),
            key=lambda finding: -OUTCOMES.index(finding.outcome),
        )
        return [finding.text for finding in told] + list(self.all_repairs())


def worst(outcomes: Iterable[str]) -> str:
    """Returns the worst of several outcomes, ``ok`` where there is none."""
    return max(outcomes, key=OUTCOMES.index, default="ok")


def titles(subjects: Sequence[Inspected]) -> list[str]:
    """Returns a title a subject: the file, and for the pieces of one file the recording's name beside it."""
    files = [subject.file for subject in subjects]
    return [
        f"{subject.file} ({subject.recording.name})"
        if subject.recording is not None and files.count(subject.file) > 1
        else subject.file
        for subject in subjects
    ]


def count_outcomes(subjects: Sequence[Inspected]) -> dict[str, int]:
    """Returns how many files had which outcome; the pieces of one file count once, by the worst of them."""
    by_file: dict[str, list[str]] = {}
    for subject in subjects:
        by_file.setdefault(subject.file, []).append(subject.outcome)
    found = [worst(outcomes) for outcomes in by_file.values()]
    return {outcome: found.count(outcome) for outcome in OUTCOMES}
