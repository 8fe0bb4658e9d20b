"""The assessment of a cylinder: one of five answers, and the trends and changes behind it."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

Answer = Literal["fine", "watch", "alarm", "not yet", "undecided"]

NE107: Mapping[str, str] = {
    "fine": "NORMAL",
    "watch": "CHECK_FUNCTION",
    "alarm": "MAINTENANCE_REQUIRED",
    "not yet": "NORMAL",
    "undecided": "OFF_SPEC",
}
"""NAMUR NE 107 status signal of each answer, with the names of OPC UA's ``DeviceHealth``."""

EntryKind = Literal["service", "reset", "acknowledge", "comment", "reference", "withdraw"]


@dataclass(frozen=True)
class Entry:
    """An action or note of a person. An entry never changes; another entry may withdraw it."""

    cylinder: str
    time: str  # ISO 8601, UTC
    name: str  # Name of the person
    kind: EntryKind  # service: seals or oil changed; reset, reference: a new baseline begins at ``time``
    words: str = ""
    until: str = ""  # End of an acknowledgement (ISO 8601, UTC), when the alarm returns; empty: as in the fleet file
    withdraws: str = ""  # Kind and time of the entry that a withdrawal withdraws
    withdrawn: str = ""  # Who withdrew this entry and why; it is then ignored

    @property
    def stated(self) -> str:
        """The content of the entry in words."""
        words = f"{self.withdraws}: {self.words}" if self.withdraws else self.words
        words += f" (until {self.until[:10]})" if self.until else ""
        return f"{words} (withdrawn by {self.withdrawn})".lstrip() if self.withdrawn else words


@dataclass(frozen=True)
class Baseline:
    """The sessions that an indicator is compared with."""

    sessions: int
    first: str  # Name of the first and last session
    last: str
    level: float  # Mean at the reference covariates, in the indicator's unit
    scatter: float  # Standard deviation of sessions from the level, after compensation
    autocorrelation: float  # Autocorrelation of neighbouring sessions (lag 1)
    threshold: float  # Threshold of the CUSUM, in standard deviations
    false_alarms_per_year: float  # Rate for the cylinder, all indicators together, at the observed sessions per year
    smallest: float  # Smallest lasting change that the test can find, in the indicator's unit
    reference: Mapping[str, float] = field(default_factory=dict)  # Covariates at which ``level`` holds


@dataclass(frozen=True)
class Change:
    """A change of an indicator."""

    indicator: str
    change: float  # From the baseline to now, in the indicator's unit
    interval: tuple[float, float]  # 95 % interval of the change
    percent: float | None  # Change in percent of the baseline's level
    percent_interval: tuple[float, float] | None
    since: str  # Session at which it began, dated after the alarm
    since_interval: tuple[str, str]  # First and last session at which it may have begun
    alarm_session: str  # Session at which the test alarmed
    per_year: float | None = None  # Present rate, in the indicator's unit per year
    per_year_interval: tuple[float, float] | None = None
    # ISO date at which the user's limit is or was reached; None without a limit or trend
    limit_reached: str | None = None
    limit_interval: tuple[str | None, str | None] | None = None
    limit_passed: bool = False
    beside: tuple[str, ...] = ()  # What else changed at that time, in words


@dataclass(frozen=True)
class IndicatorTrend:
    """One indicator over a cylinder's life."""

    baseline: Baseline | None  # None while there are too few sessions
    sessions: tuple[str, ...]
    compensated: tuple[float | None, ...]  # Values at the reference covariates, in the indicator's unit
    upward: tuple[float | None, ...]  # CUSUM statistics, in standard deviations
    downward: tuple[float | None, ...]
    why: str = ""  # Why there is no baseline, in words


@dataclass(frozen=True)
class ModelBounds:
    """The share of later labels within a model's bounds, and whether the model should be trained again."""

    stated_percent: float  # Share of the label's rows that the bounds should hold
    sessions: int  # Number of sessions that this model estimated
    words: str  # The conclusion and the evidence
    proposed: bool = False  # Whether retraining is proposed
    before_percent: float | None = None  # Share in the baseline's sessions; None while there are too few
    before_interval: tuple[float, float] | None = None  # 95 % interval, including the scatter of sessions
    now_percent: float | None = None  # Share from ``since`` on; None if it has not changed
    now_interval: tuple[float, float] | None = None
    since: str = ""  # Session from which the share is lower
    since_interval: tuple[str, str] | None = None  # First and last session at which the loss may have begun
    alarm_session: str = ""  # Session at which the test alarmed

    @property
    def lost(self) -> bool:
        """Whether the share is certainly below the stated one, and below that of the baseline."""
        return self.now_interval is not None and self.now_interval[1] < self.stated_percent


@dataclass(frozen=True)
class Assessment:
    """The state of one cylinder as of its latest session."""

    cylinder: str
    answer: Answer
    words: str  # One sentence: what changed, how much, since when, and what to do
    changes: tuple[Change, ...] = ()
    trends: Mapping[str, IndicatorTrend] = field(default_factory=dict)
    would_decide: tuple[str, ...] = ()  # What would decide an ``undecided`` answer
    questions: tuple[str, ...] = ()  # To the user, such as whether a seal was changed
    acknowledged: str = ""  # Who acknowledged the alarm, and when; empty without an alarm, or if it has returned
    model: ModelBounds | None = None  # None if no model estimated the newest session

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON-compatible values."""
        return asdict(self) | {"ne107": NE107[self.answer]}
