"""Bounds for each level of noise that the pressures of calibration sessions have.

Conformal prediction needs exchangeable sessions, and only sessions of similar noise are: noise makes most of the errors
in noisy sessions, and few in quiet ones. So each level has its own bounds, as each regime of motion has
(``realtime.bounds``).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from cylinder_friction.arrays import Array
from cylinder_friction.realtime.bounds import LearnedOffset, calibrated_bounds
from cylinder_friction.realtime.flags import LEAST_ROWS
from cylinder_friction.realtime.model import Bounds, from_json
from cylinder_friction.realtime.trained_for import pressure_noise_pa
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import OTHER_NOISE, times_as_noisy

LEAST_SESSIONS = 2
"""Fewest sessions of a level: one session does not show how sessions differ."""


@dataclass(frozen=True)
class NoiseBounds:
    """Bounds from the calibration sessions of one level of noise."""

    noise_pa: float  # Standard deviation of the pressures' noise, the median of these sessions' recordings [Pa]
    sessions: tuple[str, ...]  # Their names
    bounds: Bounds

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """Rebuild the bounds from ``dataclasses.asdict``."""
        bounds = from_json(Bounds, dict(values["bounds"]))
        assert bounds is not None
        return cls(float(values["noise_pa"]), tuple(map(str, values["sessions"])), bounds)

    def widened(self, noise_pa: float) -> Self:
        """Widen the bounds for this noise: if it is k times the level's own, with k above 1.5, by the factor k.

        The result is right if noise makes all of the errors, and too wide if something else makes part of them.
        """
        times = times_as_noisy(noise_pa, self.noise_pa)
        lower_n, upper_n = (tuple(times * each for each in side) for side in (self.bounds.lower_n, self.bounds.upper_n))
        bounds = replace(self.bounds, lower_n=lower_n, upper_n=upper_n)
        return replace(self, noise_pa=times * self.noise_pa, bounds=bounds)


def calibrated_by_noise(
    recordings: Sequence[Recording],
    estimates_n: Sequence[Array],
    sample_time_s: float,
    warm_up_samples: int,
    offsets: Sequence[LearnedOffset] | None = None,
) -> list[NoiseBounds]:
    """Calibrate bounds for each level of noise, the quietest first; arguments as for ``calibrated_bounds``.

    A level with fewer than ``LEAST_SESSIONS``, or fewer than ``LEAST_ROWS`` usable rows, is left out. If no level is
    left, all sessions together make one.
    """
    every, known = list(range(len(recordings))), []
    rows = [int(each.usable()[warm_up_samples:].sum()) for each in recordings]
    sessions = [level for level in noise_levels(recordings) if len(level) >= LEAST_SESSIONS]
    levels = [[place for place in every if recordings[place].metadata.session in level] for level in sessions]
    for own in [level for level in levels if sum(rows[place] for place in level) >= LEAST_ROWS] or [every]:
        some, some_n = [recordings[place] for place in own], [estimates_n[place] for place in own]
        learned = None if offsets is None else [offsets[place] for place in own]
        bounds = calibrated_bounds(some, some_n, sample_time_s, warm_up_samples, offsets=learned)
        names = tuple(sorted({each.metadata.session for each in some}))
        known.append(NoiseBounds(pressure_noise_pa(some), names, bounds))
    return known


def noise_levels(recordings: Sequence[Recording]) -> list[list[str]]:
    """Group sessions by level of noise, the quietest first.

    A level ends if the next noisier session is more than ``OTHER_NOISE`` times as noisy.
    """
    names = sorted({each.metadata.session for each in recordings})
    noise_pa = {name: pressure_noise_pa(each for each in recordings if each.metadata.session == name) for name in names}
    levels: list[list[str]] = []
    for name in sorted(names, key=lambda each: noise_pa[each]):
        if levels and times_as_noisy(noise_pa[name], noise_pa[levels[-1][-1]]) == 1.0:
            levels[-1].append(name)
        else:
            levels.append([name])
    return levels


def level_for(known: Sequence[NoiseBounds], noise_pa: float) -> NoiseBounds | None:
    """Choose the quietest level that is at least as noisy, or else the noisiest; None without levels."""
    return next((each for each in known if noise_pa <= OTHER_NOISE * each.noise_pa), known[-1] if known else None)
