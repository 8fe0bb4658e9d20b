"""The order of one session's samples, decided by their indices and never by their arrival."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.settings import SessionRules


@dataclass
class Counts:
    """Counts of samples by outcome; each arriving sample is in exactly one of ``stepped`` to ``late``, or is held."""

    stepped: int = 0  # Stepped in order
    duplicate: int = 0  # Dropped, as they were stepped before
    late: int = 0  # Kept but not stepped, as they came after the wait for their gap was over
    missing: int = 0  # Missing in short gaps: stepped as NaN
    skipped: int = 0  # Missing in long gaps: not stepped, and the session began anew
    waited: int = 0  # Stepped after a wait for earlier samples, whether these came or not
    resets: int = 0  # Number of times that the session began anew


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
        next_index: Index that is stepped next; None until the first sample states the session's first index.
    """

    sample_time_s: float
    columns: int
    rules: SessionRules = field(default_factory=SessionRules)
    next_index: int | None = None
    counts: Counts = field(default_factory=Counts)
    last_seen_s: float = 0.0  # Time of the last message, on the monotonic clock
    late: list[SampleBlock] = field(default_factory=list, init=False)
    """Samples that came too late for their gap, until the service takes them."""
    _held: list[_Held] = field(default_factory=list, init=False)  # Waiting blocks by index; they never overlap
    _gaps: list[tuple[int, int]] = field(default_factory=list, init=False)  # Gaps whose wait is over, newest last

    def receive(self, block: SampleBlock, now_s: float) -> list[SampleBlock]:
        """Take samples; return the samples that can be stepped, in order."""
        self.last_seen_s = now_s
        if block.index == self.next_index and not self._held and block.rows:
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
        """Take the samples to step although earlier ones are missing, because the wait for those is over."""
        pieces: list[SampleBlock] = []
        while self._held and self._is_wait_over(now_s):
            pieces += self._skip_gap()
        return pieces

    @property
    def held_rows(self) -> int:
        """Number of samples that wait for earlier ones."""
        return sum([len(each.samples) for each in self._held])

    def _is_wait_over(self, now_s: float) -> bool:
        waited_s = now_s - min(each.since_s for each in self._held)
        return waited_s >= self.rules.hold_s or self.held_rows > self.rules.hold_rows

    def _skip_gap(self) -> Iterator[SampleBlock]:
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
            known = min(len(first.samples), self._next() - first.index)  # Stepped meanwhile, as part of another block
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
        """Separate samples that lie in a gap, each once, from duplicates."""
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
        """Hold the samples that are not held yet."""
        parts = [new]
        for held in self._held:
            parts = [rest for part in parts for rest in _without(part, held, self.sample_time_s)]
        self.counts.duplicate += len(new.samples) - sum(len(part.samples) for part in parts)
        self._held = sorted([*self._held, *parts], key=lambda each: each.index)


def _without(part: _Held, held: _Held, sample_time_s: float) -> Iterator[_Held]:
    """Yield the pieces of ``part`` before and after ``held``."""
    end, held_end = part.index + len(part.samples), held.index + len(held.samples)
    before, after = min(end, held.index), max(part.index, held_end)
    if before > part.index:
        yield _Held(part.index, part.time_s, part.samples[: before - part.index], part.since_s)
    if after < end:
        behind = after - part.index
        yield _Held(after, part.time_s + behind * sample_time_s, part.samples[behind:], part.since_s)
