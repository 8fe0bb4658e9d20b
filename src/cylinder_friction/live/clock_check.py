"""Whether a sender's clock agrees with the sample time that its model was trained at."""

from dataclasses import dataclass

LIMIT_PPM = 200.0
"""Beyond it a sender's clock is reported: velocities, and so friction, would be wrong by as much."""
SHORTEST_S = 60.0
"""Over less than that, jitter of some milliseconds would look like a wrong rate."""


@dataclass
class ClockCheck:
    """Compares the times that a sender states with the indices that it counts.

    Args:
        sample_time_s: Time between two samples by the model [s].
    """

    sample_time_s: float

    def __post_init__(self) -> None:
        self._begin: tuple[int, float] | None = None
        self.jumps = 0
        """How often the stated time went back, or ahead by more than a second."""
        self._last_s = 0.0
        self.deviation_ppm: float | None = None
        """By how much the stated times run ahead of the indices; None until a minute without a jump has passed."""

    def note(self, index: int, time_s: float) -> None:
        """Take in when the sample of an index was taken, by its sender."""
        if self._begin is None:
            self._begin = index, time_s
        expected_s = (index - self._begin[0]) * self.sample_time_s
        late_s = time_s - self._begin[1] - expected_s
        if abs(late_s - self._last_s) > 1.0:
            self.jumps += 1
            self._begin, self._last_s, self.deviation_ppm = (index, time_s), 0.0, None
        else:
            self._last_s = late_s
            if expected_s >= SHORTEST_S:
                self.deviation_ppm = 1e6 * late_s / expected_s

    @property
    def wrong(self) -> bool:
        """Whether the sender's clock is off by more than the limit."""
        return self.deviation_ppm is not None and abs(self.deviation_ppm) > LIMIT_PPM
