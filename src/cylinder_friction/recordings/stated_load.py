"""A constant load that somebody weighed, in place of a load cell."""

import math
from dataclasses import dataclass
from typing import Self

from cylinder_friction.recordings.recording import RecordingError


@dataclass(frozen=True)
class StatedLoad:
    """A constant load on the rod, positive if it resists extension."""

    force_n: float  # Load [N]
    within_n: float = 0.0  # Largest error of the load [± N]

    @classmethod
    def parsed(cls, text: str) -> Self:
        """Parse a load written as ``4218`` or ``4218+-40``, in newtons.

        Raises:
            RecordingError: The text has neither form.
        """
        force, _, within = text.replace("±", "+-").partition("+-")
        try:
            force_n, within_n = float(force), float(within or 0.0)
        except ValueError:
            force_n = within_n = math.nan
        if not (math.isfinite(force_n) and 0.0 <= within_n < math.inf):
            raise RecordingError(
                f"load: got {text!r}, expected none, measured, position, or a constant load in newtons: 4218 or "
                "4218+-40"
            )
        return cls(force_n, within_n)

    def in_words(self) -> str:
        """Describe the load in words."""
        return f"{self.force_n:g} ± {self.within_n:g} N, as stated"
