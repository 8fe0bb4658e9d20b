"""What becomes of each sample of one session, decided by its index alone, never by when it arrives."""

from collections.abc import Iterator
from dataclasses import dataclass, field, fields

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.settings import SessionRules


@dataclass
class Counts:
    """How many samples met which outcome; every sample that arrives is in exactly one of ``stepped`` to ``late``,
    or is held."""

    stepped: int = 0  # Stepped in their turn
    duplicate: int = 0  # Had been stepped before; dropped
    late: int = 0  # Came after their gap had been given up; not stepped, but kept
    missing: int = 0  # Of short gaps: stepped as no numbers
    skipped: int = 0  # Of long gaps: not stepped, the session began anew
    waited: int = 0  # Stepped after having waited for samples before them, which came or did not
    resets: int = 0  # How often the session began anew

    @classmethod
    def from_dict(cls, content: dict[str, int]) -> "Counts":
        """Return what ``vars`` wrote; unknown names are ignored, missing ones are 0."""
        return cls(**{each.name: int(content.get(each.name, 0)) for each in fields(cls)})


@dataclass
class _Held:
    index: int
    time_s: float
    samples: Array
    since_s: float


@dataclass(slots=True)
class SessionOrder:
    """Brings the samples of one session into the order of their indices.

    Args:
        sample_time_s: Time between two samples [s].
        columns: Inputs of the model.
        next_index: Index that is stepped next; None until the first sample states where the session begins.
    """

    sample_time_s: float
    columns: int
    rules: SessionRules = field(default_factory=SessionRules)
    next_index: int | None = None
    counts: Counts = field(default_factory=Counts)
    late: list[SampleBlock] = field(default_factory=list, init=False)
    """Samples that came after their gap had been given up, until somebody takes them away."""
    _held: list[_Held] = field(default_factory=list, init=False)  # By index; never overlapping
    _gaps: list[tuple[int, int]] = field(default_factory=list, init=False)  # Given up, newest last

    def receive(self, block: SampleBlock, now_s: float) -> list[SampleBlock]:
        """Take samples in; return what can be stepped, in order."""
        if block.index == self.next_index and not self._held and block.rows:  # nearly always
            return [self._stepped(block)]
        index, time_s, samples = block.index, block.time_s, block.samples
        if self.next_index is None:
            self.next_index = index
        begun = max(0, min(len(samples), self.next_index - index))
        if begun:
            self._sort_old(SampleBlock(0, index, time_s, samples[:begun]))
            index, time_s, samples = index + begun, time_s + begun * self.sample_time_s, samples[begun:]
        if not len(samples):
            return []
        if index > self.next_index:
            self._hold(_Held(index, time_s, samples, now_s))
            return self.overdue(now_s)
        return [self._stepped(SampleBlock(0, index, time_s, samples)), *self._released()]

    def overdue(self, now_s: float) -> list[SampleBlock]:
        """Return what is to be stepped although samples before it are missing: they were waited for long enough."""
        pieces: list[SampleBlock] = []
        while self._held and self._must_go_on(now_s):
            pieces += self._over_the_gap()
        return pieces

    @property
    def held_rows(self) -> int:
        """Samples that wait for ones before them."""
        return sum(len(each.samples) for each in self._held)

    def _must_go_on(self, now_s: float) -> bool:
        waited_s = now_s - min(each.since_s for each in self._held)
        return waited_s >= self.rules.hold_s or self.held_rows > self.rules.hold_rows

    def _over_the_gap(self) -> Iterator[SampleBlock]:
        first, begin = self._held[0], self._next()
        missing = first.index - begin
        self._gaps = [*self._gaps[-63:], (begin, first.index)]
        short = missing * self.sample_time_s <= self.rules.short_gap_s
        if short:
            self.counts.missing += missing
            time_s = first.time_s - missing * self.sample_time_s
            yield SampleBlock(0, begin, time_s, np.full((missing, self.columns), np.nan))
        else:
            self.counts.skipped += missing
            self.counts.resets += 1
        self.next_index = first.index
        yield from self._released(reset=not short)

    def _released(self, reset: bool = False) -> Iterator[SampleBlock]:
        while self._held and self._held[0].index <= self._next():
            first = self._held.pop(0)
            known = min(len(first.samples), self._next() - first.index)  # Stepped since, as part of another block
            self.counts.duplicate += known
            if known < len(first.samples):
                self.counts.waited += len(first.samples) - known
                time_s = first.time_s + known * self.sample_time_s
                yield self._stepped(SampleBlock(0, first.index + known, time_s, first.samples[known:], reset=reset))
                reset = False

    def _next(self) -> int:
        assert self.next_index is not None
        return self.next_index

    def _stepped(self, piece: SampleBlock) -> SampleBlock:
        self.counts.stepped += piece.rows
        self.next_index = piece.index + piece.rows
        return piece

    def _sort_old(self, old: SampleBlock) -> None:
        """Sort samples that lie in a gap, each once, from duplicates."""
        end, late = old.index + old.rows, 0
        gaps: list[tuple[int, int]] = []
        for first, last in self._gaps:
            begin, stop = max(old.index, first), min(end, last)
            if begin >= stop:
                gaps.append((first, last))
                continue
            late += stop - begin
            part = slice(begin - old.index, stop - old.index)
            time_s = old.time_s + part.start * self.sample_time_s
            self.late.append(SampleBlock(0, begin, time_s, old.samples[part]))
            gaps += [gap for gap in ((first, begin), (stop, last)) if gap[0] < gap[1]]
        self._gaps = gaps
        self.counts.late += late
        self.counts.duplicate += old.rows - late

    def _hold(self, new: _Held) -> None:
        """Keep what is not held yet of new samples."""
        parts = [new]
        for held in self._held:
            parts = [rest for part in parts for rest in _without(part, held, self.sample_time_s)]
        self.counts.duplicate += len(new.samples) - sum(len(part.samples) for part in parts)
        self._held = sorted([*self._held, *parts], key=lambda each: each.index)


def _without(part: _Held, held: _Held, sample_time_s: float) -> Iterator[_Held]:
    """Yield what of ``part`` lies before and after ``held``."""
    end, held_end = part.index + len(part.samples), held.index + len(held.samples)
    before, after = min(end, held.index), max(part.index, held_end)
    if before > part.index:
        yield _Held(part.index, part.time_s, part.samples[: before - part.index], part.since_s)
    if after < end:
        behind = after - part.index
        yield _Held(after, part.time_s + behind * sample_time_s, part.samples[behind:], part.since_s)
