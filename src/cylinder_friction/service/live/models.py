"""Which model gives a session's newtons, which one runs beside it, and from which sample on they change places."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.frames import SampleBlock

LEAD_S = 1.0
"""How far ahead of the samples a change is set, so that it is kept before it comes into effect [s]."""


@dataclass(frozen=True)
class SavedState:
    """A model's whole state for one session."""

    model: str  # SHA-256 of the model
    state: bytes


@dataclass(frozen=True, slots=True)
class Running:
    """One model's state for one session."""

    engine: Engine
    slot: int

    def saved(self) -> SavedState:
        """Return the whole state, and whose it is."""
        return SavedState(self.engine.model, self.engine.saved(self.slot))


@dataclass(frozen=True)
class Switch:
    """A second model beside the one that gives the newtons; all of it by sample index, so that a restart repeats it.

    Attributes:
        model: The second one.
        begins_at: First sample that it gets.
        takes_over_at: First sample whose newtons are its own, the other then runs beside it; None: not yet.
        recorded: Whether its newtons are kept beside the other's.
    """

    model: str
    begins_at: int
    takes_over_at: int | None = None
    recorded: bool = False


PiecePart = tuple[SampleBlock, Running, Running | None, bool]
"""Samples of one session, the model that gives the newtons, the second one, and whether that one's are recorded."""


class SessionModels:
    """The models of one session.

    Args:
        current: Gives the newtons.
        shadow: Runs beside it.
        switch: What is to happen, and when.
    """

    def __init__(self, current: Running, shadow: Running | None = None, switch: Switch | None = None) -> None:
        self.current, self.shadow, self.switch = current, shadow, switch
        self._lead_rows = round(LEAD_S / current.engine.sample_time_s)
        self.switch_kept = True
        """Whether a restart would know the switch; until then it does not come into effect."""

    def run_beside(self, model: str, next_index: int, recorded: bool) -> None:
        """Let a model run beside the present one from about a second on, in place of the one that did."""
        self.end_shadow()
        self._ask(Switch(model, next_index + self._lead_rows, None, recorded))

    def take_over(self, index: int) -> None:
        """Let both models change places at a sample, or about a second from now where that has gone by."""
        assert self.switch is not None
        self._ask(replace(self.switch, takes_over_at=max(index, self.switch.begins_at)))

    @property
    def begins_at(self) -> int:
        """First sample that the second model gets, or got."""
        return 0 if self.switch is None else self.switch.begins_at

    def end_shadow(self) -> None:
        """Stop the second model."""
        if self.shadow is not None:
            self.shadow.engine.remove(self.shadow.slot)
        self.shadow = None
        self._ask(None)

    def _ask(self, switch: Switch | None) -> None:
        self.switch, self.switch_kept = switch, False

    def change_to(self, model: str, index: int, warm_rows: int) -> None:
        """Let a model begin at once beside the present one, and take over when it is warm."""
        self.switch = Switch(model, index, index + warm_rows)

    def parts(self, piece: SampleBlock, engines: Mapping[str, Engine]) -> list[PiecePart]:
        """Return successive samples with the models that step them."""
        if self.switch is None:
            return [(piece, self.current, None, False)]
        parts = []
        for index in self._due(piece):
            if index > piece.index:
                before, piece = _cut(piece, index, self.current.engine.sample_time_s)
                parts.append(self._part(before))
            self._change(index, engines[self.switch.model])
        return [*parts, self._part(piece)]

    def close(self) -> None:
        """Give all slots back."""
        for running in filter(None, (self.current, self.shadow)):
            running.engine.remove(running.slot)

    def _part(self, piece: SampleBlock) -> PiecePart:
        if self.shadow is None or self.switch is None:
            return piece, self.current, None, False
        return piece, self.current, self.shadow, self.switch.recorded

    def _due(self, piece: SampleBlock) -> list[int]:
        """Return the samples of a piece before which something changes."""
        assert self.switch is not None
        end = piece.index + piece.rows
        begins = [] if self.shadow is not None else [self.switch.begins_at]
        over = [] if self.switch.takes_over_at is None else [self.switch.takes_over_at]
        due = [index for index in begins + over if index < end]
        if due and not self.switch_kept:
            self._put_off(end + self._lead_rows - due[0])
            return []
        return sorted({max(index, piece.index) for index in due})

    def _put_off(self, rows: int) -> None:
        assert self.switch is not None
        begins_at = self.switch.begins_at + (rows if self.shadow is None else 0)
        over_at = self.switch.takes_over_at
        over_at = None if over_at is None else over_at + rows
        self.switch = replace(self.switch, begins_at=begins_at, takes_over_at=over_at)
        self._lead_rows *= 2  # a fast replay would be ahead of every keeping otherwise

    def _change(self, index: int, second: Engine) -> None:
        assert self.switch is not None
        if self.shadow is None:
            self.shadow = Running(second, second.add())
        over_at = self.switch.takes_over_at
        if over_at is not None and index >= over_at:
            self.switch = replace(self.switch, model=self.current.engine.model, takes_over_at=None)
            self.current, self.shadow = self.shadow, self.current


def _cut(piece: SampleBlock, index: int, sample_time_s: float) -> tuple[SampleBlock, SampleBlock]:
    """Return what of a piece lies before an index within it, and the rest."""
    rows = index - piece.index
    rest = SampleBlock(0, index, piece.time_s + rows * sample_time_s, piece.samples[rows:])
    return SampleBlock(0, piece.index, piece.time_s, piece.samples[:rows], reset=piece.reset), rest
