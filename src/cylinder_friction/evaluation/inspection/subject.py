"""What is inspected: one file, or one piece of it, with what the checks found."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Self

from cylinder_friction.recordings.checks.limits import Finding, Outcome
from cylinder_friction.recordings.recording import Recording

OUTCOMES: tuple[Outcome, ...] = ("ok", "noted", "repaired", "refused")
"""Of a check, mildest first."""

VERDICTS = {
    "ok": "usable for labelling",
    "noted": "usable for labelling; worth knowing",
    "repaired": "usable with these repairs",
    "refused": "not usable",
}
"""By the worst outcome of the checks."""


@dataclass(frozen=True)
class Inspected:
    """One logged file and what became of it; a file that a gap has split gives one of these a piece."""

    file: str  # Its path, as the user should see it
    findings: Sequence[Finding]  # What every check found
    # What it holds, wherever that can be read, so that also what is refused can be looked at
    recording: Recording | None = None
    part: int = 0  # Which piece of its file, counted from 1; 0 for a whole file

    @property
    def title(self) -> str:
        return f"{self.file} (part {self.part})" if self.part else self.file

    def with_findings(self, *findings: Finding) -> Self:
        """Add further findings ahead of the others."""
        return replace(self, findings=[*findings, *self.findings])

    @property
    def outcome(self) -> Outcome:
        """The worst outcome of any check."""
        return worst(finding.outcome for finding in self.findings)

    @property
    def reasons(self) -> list[str]:
        """The texts of the checks that did not simply pass, worst outcome first."""
        return [finding.text for finding in worst_first(self.findings) if finding.outcome != "ok"]

    @property
    def verdict(self) -> str:
        """What the file is good for, with the first of ``reasons``."""
        return ": ".join([VERDICTS[self.outcome], *self.reasons[:1]])


def worst(outcomes: Iterable[Outcome]) -> Outcome:
    """Choose the worst of several outcomes, ``ok`` without any."""
    return max(outcomes, key=OUTCOMES.index, default="ok")


def worst_first(findings: Iterable[Finding]) -> list[Finding]:
    """Sort findings by outcome, the worst first; equals keep their order."""
    return sorted(findings, key=lambda finding: -OUTCOMES.index(finding.outcome))


def count_outcomes(subjects: Sequence[Inspected]) -> dict[Outcome, int]:
    """Count files by outcome; the pieces of one file count once, by their worst outcome."""
    by_file: dict[str, list[Outcome]] = {}
    for subject in subjects:
        by_file.setdefault(subject.file, []).append(subject.outcome)
    found = [worst(outcomes) for outcomes in by_file.values()]
    return {outcome: found.count(outcome) for outcome in OUTCOMES}
