"""One quantity as it was sampled, and a stretch of a recording at one constant rate."""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from cylinder_friction.arrays import Array


@dataclass(frozen=True)
class Signal:
    """Values of one column, each with the logger's time stamp.

    Columns of one logged table share their ``time_s`` array (the same object), so that what is done to time is done
    once.
    """

    # Time stamps as logged, shape ``(n,)`` [s]: perhaps uneven, doubled, backward or not finite
    time_s: Array
    # In the column's own unit (Pa, m, N, °C), shape ``(n,)``; NaN where a sample is missing
    values: Array


@dataclass(frozen=True)
class Piece:
    """An unbroken stretch of a file at one constant rate."""

    table: pd.DataFrame  # ``time_s`` and one column a signal, without NaN
    sample_time_s: float  # Constant time between two rows [s]
    # What was done to get there, one sentence each with its numbers; empty if nothing was
    repairs: tuple[str, ...] = ()
