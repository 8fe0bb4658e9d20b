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
"""Status signal of NAMUR NE 107 of each answer, in the names of OPC UA's ``DeviceHealth``."""

EntryKind = Literal["service", "reset", "acknowledge", "comment", "reference", "withdraw"]


@dataclass(frozen=True)
class Entry:
    """What a person did or noted. It is never changed; another entry may withdraw it."""

    cylinder: str
    time: str  # ISO 8601, UTC
    name: str  # Who
    kind: EntryKind  # service: seals or oil changed; reset, reference: a new baseline begins at ``time``
    words: str = ""
    until: str = ""  # Of an acknowledgement: when the alarm returns, ISO 8601, UTC; empty: as the fleet file states
    withdraws: str = ""  # Of a withdrawal: kind and time of the entry that it withdraws
    withdrawn: str = ""  # Who withdrew this entry and why; it then counts for nothing

    @property
    def stated(self) -> str:
        """Its content in words."""
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
    scatter: float  # Standard deviation of sessions about it, after compensation
    autocorrelation: float  # Of neighbouring sessions (lag 1)
    threshold: float  # Of the CUSUM, in standard deviations
    false_alarms_per_year: float  # Of the cylinder, all indicators together, at the sessions per year seen
    smallest: float  # Smallest lasting change that the test can find, in the indicator's unit
    reference: Mapping[str, float] = field(default_factory=dict)  # Covariates at which ``level`` holds


@dataclass(frozen=True)
class Change:
    """A change of an indicator."""

    indicator: str
    change: float  # From the baseline to now, in the indicator's unit
    interval: tuple[float, float]  # 95 %
    percent: float | None  # Of the baseline's level
    percent_interval: tuple[float, float] | None
    since: str  # Session at which it began, dated after the alarm
    since_interval: tuple[str, str]  # First and last session at which it may have begun
    alarm_session: str  # At which the test alarmed
    per_year: float | None = None  # Rate now, in the indicator's unit
    per_year_interval: tuple[float, float] | None = None
    # ISO date at which the user's limit is reached, or since which it is passed; None without a limit or trend
    limit_reached: str | None = None
    limit_interval: tuple[str | None, str | None] | None = None
    limit_passed: bool = False
    beside: tuple[str, ...] = ()  # What else changed at that time, in words


@dataclass(frozen=True)
class IndicatorTrend:
    """One indicator over a cylinder's life."""

    baseline: Baseline | None  # None while there are too few sessions
    sessions: tuple[str, ...]
    compensated: tuple[float | None, ...]  # At the reference covariates, in the indicator's unit
    upward: tuple[float | None, ...]  # CUSUM statistics, in standard deviations
    downward: tuple[float | None, ...]
    why: str = ""  # Why there is no baseline, in words


@dataclass(frozen=True)
class ModelBounds:
    """The share of later labels within a model's bounds, and whether the model should be trained anew."""

    stated_percent: float  # Share of the label's rows that the bounds should hold
    sessions: int  # Number that this model estimated
    words: str  # The conclusion and the evidence
    proposed: bool = False  # Whether retraining is proposed
    before_percent: float | None = None  # Held in the baseline's sessions; None while there are too few
    before_interval: tuple[float, float] | None = None  # 95 %, given that sessions differ
    now_percent: float | None = None  # Held since ``since``; None if the bounds hold as before
    now_interval: tuple[float, float] | None = None
    since: str = ""  # Session from which they hold less
    since_interval: tuple[str, str] | None = None  # First and last session at which that may have begun
    alarm_session: str = ""  # At which the test alarmed

    @property
    def lost(self) -> bool:
        """Whether the bounds surely hold less than they state, and less than before."""
        return self.now_interval is not None and self.now_interval[1] < self.stated_percent


@dataclass(frozen=True)
class Assessment:
    """The state of one cylinder by its latest session."""

    cylinder: str
    answer: Answer
    words: str  # One sentence: what, how much, since when, what to do
    changes: tuple[Change, ...] = ()
    trends: Mapping[str, IndicatorTrend] = field(default_factory=dict)
    would_decide: tuple[str, ...] = ()  # For ``undecided``: what would decide it
    questions: tuple[str, ...] = ()  # To the user, such as whether a seal was changed
    acknowledged: str = ""  # Who acknowledged the alarm, and when; empty without an alarm, or if it has returned
    model: ModelBounds | None = None  # None if no model estimated the newest session

    def to_dict(self) -> dict[str, Any]:
        """Convert to JSON-compatible values."""
        return asdict(self) | {"ne107": NE107[self.answer]}
