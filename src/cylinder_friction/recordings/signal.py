"""One quantity as it was sampled, and a stretch of a recording at one constant rate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray


@dataclass(frozen=True)
class Signal:
    """Values of one column, each with the logger's time stamp.

    Columns of one logged table share their ``time_s`` array (the same object), so that what is done to time is done
    once.

    Attributes:
        time_s: Time stamps as logged, shape ``(n,)`` [s]: perhaps uneven, doubled, backward or not finite.
        values: In the column's own unit (Pa, m, N, °C), shape ``(n,)``; NaN where a sample is missing.
    """

    time_s: NDArray[np.float64]
    values: NDArray[np.float64]


@dataclass(frozen=True)
class Piece:
    """An unbroken stretch of a file at one constant rate.

    Attributes:
        table: ``time_s`` and one column a signal, without NaN.
        sample_time_s: Constant time between two rows [s].
        repairs: What was done to get there, one sentence each with its numbers; empty if nothing was.
    """

    table: pd.DataFrame
    sample_time_s: float
    repairs: tuple[str, ...] = ()
