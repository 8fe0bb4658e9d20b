"""The sign and the offset that a mapping states for a channel, between a sensor's reading and a recording's column.

Units, electrical signals and the atmosphere do not count: a reading is in the column's unit already, pressures are
gauge. ``ingest`` and ``estimate`` correct what they read, so a recording's columns are corrected. A controller, an FMU
or a client of the live service passes on readings, so a real-time step corrects its sample first. The two meet in
``Recording.readings``, which turns columns back into readings, and in ``StepModel.for_recordings``, the step without
its correction.
"""

from dataclasses import dataclass
from typing import TypeVar

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import PRESSURES

BAR_PA = 1e5
Numbers = TypeVar("Numbers", float, Array)


@dataclass(frozen=True)
class ChannelCorrection:
    """What turns a sensor's reading into a column: ``sign * (reading - offset)``.

    Example:
        >>> from cylinder_friction.recordings.channel_correction import ChannelCorrection
        >>> ChannelCorrection(offset=1.3e5).corrected(2.3e5)  # the vented sensor reads 1.3 bar
        100000.0
    """

    sign: int = 1  # 1 or -1
    offset: float = 0.0  # Reading at which the column is zero, in the column's unit

    def __post_init__(self) -> None:
        if self.sign not in (1, -1):
            raise ValueError(f"sign: expected 1 or -1, but got {self.sign!r}")

    def corrected(self, readings: Numbers) -> Numbers:
        """Turn readings into values of the column."""
        return self.sign * (readings - self.offset)

    def readings(self, values: Numbers) -> Numbers:
        """Turn values of the column back into readings."""
        return self.sign * values + self.offset

    def formula(self, column: str) -> str:
        """State the correction as a formula, pressures in bar."""
        offset, unit = self.offset, f" {column.rpartition('_')[2]}"
        if column in PRESSURES:
            offset, unit = self.offset / BAR_PA, " bar"
        less = f"reading {'-' if offset > 0.0 else '+'} {abs(offset):.5g}{unit}" if offset else "reading"
        return f"{column} = {less if self.sign == 1 else f'-({less})'}"
