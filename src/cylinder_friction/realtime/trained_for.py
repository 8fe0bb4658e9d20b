"""What a model was trained for: cylinder, noise and level of friction, and how another cylinder differs from it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.columns import PRESSURES
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.noise import OTHER_NOISE, median_noise, times_as_noisy

ALIKE, OTHER_LEVEL = 0.02, 2.0
"""Share by which diameters may differ, and factor on friction beyond which estimates are not to be used as they are."""

TEXTS = ("adapted", "line_loss")  # The fields that are no numbers
ROD_1 = "rod_diameter_1_m"


class OtherCylinderError(ValueError):
    """A model is to estimate friction of another cylinder than it was trained for."""


@dataclass(frozen=True)
class TrainedFor:
    """The cylinder, noise and level of friction that a model was trained for."""

    bore_diameter_m: float
    rod_diameter_m: float
    friction_n: float  # Mean absolute label of the usable rows [N]
    # Greatest standard deviation of white noise at which its bounds hold, converter's steps included [Pa]; 0: unknown
    pressure_noise_pa: float
    adapted: str = ""  # The model that it was adapted from, in words; empty if it was trained from scratch
    rod_diameter_1_m: float = 0.0  # 0 without a rod on side 1
    line_loss: str = ""  # Loss between sensors and cylinder that was removed from its labels, in words; empty if none

    def __post_init__(self) -> None:
        if not all(0.0 <= value < np.inf for name, value in vars(self).items() if name not in TEXTS):
            raise ValueError(f"trained_for: got {vars(self)}; expected finite numbers of at least 0")

    @classmethod
    def of(cls, recordings: Sequence[Recording], cylinder: Cylinder) -> Self:
        """Describe labelled recordings of a cylinder, as measured."""
        friction_n = _mean_level_n(recordings)
        diameters, rod_1_m = (cylinder.bore_diameter_m, cylinder.rod_diameter_m), cylinder.rod_diameter_1_m
        lines = next((each.metadata.line_loss for each in recordings if each.metadata.line_loss), {})
        words = ", ".join(f"{name} {line.in_words()}" for name, line in lines.items() if line.bar != 0.0)
        noise_pa = pressure_noise_pa(recordings)
        return cls(*diameters, friction_n, noise_pa, rod_diameter_1_m=rod_1_m, line_loss=words)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any] | None) -> Self | None:
        """Read what ``to_dict`` gave; None for None."""
        if values is None:
            return None
        known: dict[str, Any] = {name: float(value) for name, value in values.items() if name not in TEXTS}
        return cls(**known | {name: str(values.get(name, "")) for name in TEXTS})

    def to_dict(self) -> dict[str, float | str]:
        """List the content as JSON-compatible values, without what is empty by default."""
        return {name: value for name, value in asdict(self).items() if value or name not in (*TEXTS, ROD_1)}

    def in_words(self) -> str:
        """State in words what the model was trained for."""
        low_n, high_n = self.friction_n / OTHER_LEVEL, self.friction_n * OTHER_LEVEL
        noisy = f"; if pressures are noisier than {1e-3 * self.pressure_noise_pa:.2g} kPa, its bounds are too narrow"
        return (
            f"a cylinder of {self._sizes()}, with friction of {self.friction_n:.0f} N on average; if it leaves "
            f"{low_n:.0f} to {high_n:.0f} N, its estimates are not to be used as they are"
            f"{noisy if self.pressure_noise_pa > 0.0 else ''}{self.adapted and '; '}{self.adapted}{self._lines()}"
        )

    def _lines(self) -> str:
        return f"; with sensors behind lines that lose pressure: {self.line_loss}" if self.line_loss else ""

    def _sizes(self) -> str:
        second = f" and {1e3 * self.rod_diameter_1_m:g} mm rod on side 1" if self.rod_diameter_1_m else ""
        return f"{1e3 * self.bore_diameter_m:g} mm bore and {1e3 * self.rod_diameter_m:g} mm rod{second}"

    def fits(self, cylinder: Cylinder) -> bool:
        """Check whether a cylinder has the areas of training."""
        own = self.bore_diameter_m, self.rod_diameter_m, self.rod_diameter_1_m
        given = cylinder.bore_diameter_m, cylinder.rod_diameter_m, cylinder.rod_diameter_1_m
        return np.allclose(given, own, rtol=ALIKE)

    def refuse(self, cylinder: Cylinder) -> None:
        """Raise ``OtherCylinderError`` for a cylinder of other areas."""
        if not self.fits(cylinder):
            given = cylinder.bore_diameter_m, cylinder.rod_diameter_m, cylinder.rod_diameter_1_m
            sizes = " and ".join(f"{1e3 * each:g} mm" for each in given if each)
            raise OtherCylinderError(
                f"the model was trained for a cylinder of {self._sizes()}, but the one given has {sizes}"
                "; train one on its recordings, or correct the cylinder; "
                "--other-cylinder (in Python other_cylinder=True) estimates all the same"
            )

    def differences(self, recordings: Sequence[Recording], noise_pa: float) -> tuple[str, str]:
        """State why estimates are not to be used as they are, and what else is unlike training; empty if nothing is.

        The recordings of a session are labelled, and their ``label_n`` is known beside the estimate; ``noise_pa`` is
        their ``pressure_noise_pa``.
        """
        level = _mean_level_n(recordings, "label_n")
        times = times_as_noisy(noise_pa, self.pressure_noise_pa)
        ratio = level / self.friction_n if self.friction_n > 0.0 else 1.0
        other = noisy = ""
        if np.isfinite(ratio) and not 1.0 / OTHER_LEVEL <= ratio <= OTHER_LEVEL:
            other = f"friction is about {ratio:.2g} of what this model knows ({level:.0f} N, {self.friction_n:.0f} N)"
        if times > 1.0:
            noisy = f"pressures are {times:.1f} times as noisy as those that this model knows, and bounds as much wider"
        return other, noisy

    def calibrated_on(self, recordings: Iterable[Recording]) -> Self:
        """Replace the noise by that of the recordings that calibrated the bounds, if it is clearly different."""
        noise_pa = pressure_noise_pa(recordings)
        alike = noise_pa <= OTHER_NOISE * self.pressure_noise_pa and self.pressure_noise_pa <= OTHER_NOISE * noise_pa
        return self if alike or noise_pa == 0.0 else replace(self, pressure_noise_pa=noise_pa)


def _mean_level_n(recordings: Iterable[Recording], column: str = "friction_n") -> float:
    """Average a column's magnitude over the recordings that have usable rows; NaN without any."""
    levels = [np.abs(each.column(column)[each.usable()]).mean() for each in recordings if each.usable().any()]
    return float(np.mean(levels)) if levels else np.nan


def pressure_noise_pa(recordings: Iterable[Recording]) -> float:
    """Measure the standard deviation of the pressures' noise [Pa]: the recordings' median, 0 without a pressure."""
    return median_noise(each.column(name) for each in recordings for name in PRESSURES if name in each.columns)
