"""The part of the sensors' zeros that sensors keep, and how uncertain a mean offset of several sessions is.

A sensor keeps its zero from session to session, unless it is zeroed before each. What it keeps is one draw, common to
all sessions and as uncertain as stated, however many sessions there are. What else changes from session to session is
as large as their scatter shows, at most as large as stated. Of zeros that are drawn anew in each session, the mean is
as uncertain as stated, divided by the square root of the number of sessions.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from cylinder_friction.labelling.sliding_blocks import SlidingBlocks


@dataclass(frozen=True)
class KeptZero:
    """The part of the zeros that all sessions share, because sensors keep it."""

    stated_n: float = 0.0  # Standard uncertainty as stated, as friction [N]
    own_n: float = math.inf  # Greatest standard deviation of what else changes from session to session [N]
    offset_n: float = 0.0  # Part of each session's offset, if friction is about as symmetric as planned [N]
    uncertainty_n: float = 0.0  # Standard uncertainty of ``offset_n`` [N]

    @classmethod
    def of(cls, sessions: Sequence[SlidingBlocks]) -> Self:
        """Take the greatest part that is stated as kept, and what the scatter of sessions shows of the rest."""
        halves_n = np.array([each.halves_n()[0] for each in sessions])
        halves_n = halves_n[np.isfinite(halves_n)]
        scatter_n = float(halves_n.std(ddof=1)) if len(halves_n) > 1 else 0.0
        return cls(max(each.kept_n for each in sessions), scatter_n)

    def own_part_n(self, session: SlidingBlocks) -> float:
        """Compute the standard deviation of the part of a session's zeros that its sensors do not keep [N]."""
        if not session.kept_n:
            return session.prior_n
        zeroed_n = math.sqrt(max(session.prior_n**2 - session.kept_n**2, 0.0))
        return math.hypot(zeroed_n, min(session.kept_n, self.own_n))


def of_mean_n(uncertainties_n: Iterable[float]) -> float:
    """Compute the uncertainty of the mean of independent numbers, weighted by theirs."""
    return 1.0 / math.sqrt(np.array([1.0 / max(each, 1e-9) ** 2 for each in uncertainties_n]).sum())


def together_n(stated_n: float, asymmetry_n: float) -> float:
    """Compute the uncertainty of an offset of which strokes show the sum with an asymmetry [N]."""
    return 1.0 / math.hypot(1.0 / max(stated_n, 1e-9), 1.0 / max(asymmetry_n, 1e-9))


def one_draw_n(stated_n: float, asymmetry_n: float) -> float:
    """Compute the same of an offset that all sessions of a cylinder share, as they share the asymmetry [N].

    Zero and asymmetry are one draw each in the life of a cylinder, so that their errors do not average out over its
    sessions. They therefore add without squares, which holds for nearly every cylinder instead of for most.
    """
    share = stated_n**2 / (stated_n**2 + max(asymmetry_n, 1e-9) ** 2)
    return (1.0 - share) * stated_n + share * asymmetry_n
