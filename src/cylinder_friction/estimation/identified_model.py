"""An identified model: each parameter with its interval, or the reason why it has no number.

The parameters can be written for simulators as a Modelica record and a MATLAB script.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.steady_intervals import VISCOSITY_FALL_1_K, lines_uncertain_n, steady_intervals
from cylinder_friction.friction_models.identification.procedure import Identification
from cylinder_friction.friction_models.identification.steady_points import (
    SteadyPoint,
    StribeckPoint,
    is_breakaway_known,
    known_curve,
    steady_sliding_by_speed,
)
from cylinder_friction.friction_models.lugre import LuGre
from cylinder_friction.friction_models.parameters import ParameterSpec
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.labelling.apparent_loss import ApparentLoss
from cylinder_friction.labelling.known_offset import NINE_OF_TEN, KnownOffset
from cylinder_friction.recordings.columns import OIL_TEMPERATURE
from cylinder_friction.recordings.conversion import Quarantined
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.signals.motion import steady_rows
from cylinder_friction.wording import counted, four_digits, with_unit

SLOW_PARAMETERS = ("static_n", "stribeck_velocity_m_s", "stribeck_exponent")
"""Parameters that only slow sliding determines."""
LEAST_RISE = 0.05
"""Friction rises towards standstill if the slowest sliding exceeds Coulomb friction by this share of it."""
STEADY_VARIATION = 0.4
"""Greatest variation of velocity within ``STEADY_DURATION_S``, over its mean, while sliding counts as steady."""
SYMBOLS = {
    "coulomb_n": "Fc",
    "static_n": "Fs",
    "stribeck_velocity_m_s": "vs",
    "stribeck_exponent": "a",
    "viscous_n_s_m": "s2",
    "bristle_stiffness_n_m": "s0",
    "bristle_damping_n_s_m": "s1",
    "damping_velocity_m_s": "vc",
    "retract_ratio": "r",
    "pressure_slope_n_pa": "k",
}
EQUATION = (
    "dz/dt = v - s0*|v|*z/g",
    "F = s0*z + s1*exp(-(v/vc)^2)*dz/dt + s2*v",
    "g = side*{scale}(Fc + (Fs - Fc)*exp(-|v/vs|^a)), side = 1 for v > 0 and r for v < 0",
)
PRESSURE_SCALE = "(1 + k*p/Fc)*"
MATLAB_VARIABLE = "friction"
"""Name of the structure that the script defines. The script's own name would hide the script."""
SIGNS = (
    "F [N] opposes positive velocity v [m/s] when positive; extension is positive.",
    "p [Pa] is the sum of both gauge pressures, at least 0.",
)
CONFIDENCE = 0.95
INTERVALS = (
    f"intervals of {100.0 * CONFIDENCE:g} % hold the scatter of recordings like these and what the sensors' zeros and "
    "the stated losses of lines may shift, that of viscous friction its values from the coldest to the warmest oil if "
    "temperatures are recorded; unstated delays of sensors and errors of the model itself come on top"
)
OIL_UNKNOWN = "oil temperature unknown"
WIDEST = 4.0
"""Largest ratio of an interval's upper to its lower limit if the parameter is determined: a factor of 2 either way."""
LEAST_PRESSURE_SPAN = 1.5
"""Least ratio of greatest to least sum of pressures in usable rows. Below it, pressure and preload are inseparable."""
TOO_WIDE_PERCENT = 50.0
"""Half the width of an interval, over the value, above which the value is too wide to use."""
MORE_STROKES = "record more strokes of each speed, in several recordings"
SLOWER = "record more strokes, several as slow as the piston moves evenly"
NARROWED_BY = {
    "static_n": SLOWER,
    "stribeck_velocity_m_s": SLOWER,
    "stribeck_exponent": SLOWER,
    "bristle_stiffness_n_m": "smoothing makes bristles seem up to twice as soft, which more strokes do not narrow",
    "pressure_slope_n_pa": "record more loads, each as a condition of its own (--names)",
}
"""What narrows the interval of a parameter; for the others, ``MORE_STROKES``."""
STATE_ZEROS = "state how exact the sensors are and whether they are zeroed, or weigh the load"
STATE_LINES = "state the losses of lines more exactly (line_loss.uncertainty_percent)"
STATE_LOSS = "state the loss of the line (sensor.line_loss)"
UNSEPARATED = (
    "strokes do not tell it from dry friction, which changes with speed, pressure and place; record more strokes at "
    "constant speed, slow ones and fast ones, and other loads"
)
UNSEPARATED_FROM_LINES = (
    "strokes do not tell it from what lines between sensors and cylinder lose, as that is stated too inexactly "
    "(line_loss.uncertainty_percent)"
)
SHAPELESS = "it is the shape of a fall of friction over the speed stribeck_velocity_m_s, which is not determined"
SHIFTED_BY_ZEROS = ("coulomb_n", "static_n", "retract_ratio", "pressure_slope_n_pa")
"""Parameters that a shift of all friction changes: it adds while extending and subtracts while retracting."""
LEAST_SPEEDS = 5
"""Least number of speeds of steady sliding in one direction: a direction's Stribeck curve has five parameters."""
_AT_THE_LIMIT = 0.05
"""Distance from a search limit, as a share of it, within which the end of an interval counts as that limit."""
DAMPING_RATIO = 0.5
_FOLLOWS_FROM = {
    "bristle_damping_n_s_m": (
        "bristle_stiffness_n_m",
        f"not measured: from the stiffness and a damping ratio of {DAMPING_RATIO:g}, which is assumed",
    ),
    "damping_velocity_m_s": (
        "stribeck_velocity_m_s",
        "not measured: the Stribeck velocity, or less where passivity asks",
    ),
}
"""Parameters that are not searched for: the parameter that they follow from, and how."""


@dataclass(frozen=True)
class IdentifiedParameter:
    """One parameter of a model."""

    name: str
    symbol: str
    unit: str
    meaning: str
    value: float | None  # Value in ``unit``; None if the motion does not determine it
    interval: tuple[float, float] | None  # Confidence interval in ``unit``; None without a value or a search for it
    note: str = ""  # Why there is no value, or where a value comes from that was not searched for
    narrowed_by: str = MORE_STROKES  # What would narrow the interval

    @property
    def shown_unit(self) -> str:
        return with_unit("", self.unit).strip()

    @property
    def half_percent(self) -> float | None:
        """Half the width of the interval over the value [%]; None without an interval, or if the value is 0."""
        if not self.value or self.interval is None:
            return None
        return 50.0 * (self.interval[1] - self.interval[0]) / abs(self.value)

    @property
    def remark(self) -> str:
        if self.value is None:
            return f"not determined: {self.note}"
        if self.half_percent is not None and self.half_percent > TOO_WIDE_PERCENT:
            return f"too wide to use: {self.narrowed_by}"
        return self.note


@dataclass(frozen=True)
class Zeros:
    """How far the sensors' zeros, or a load identified with them, may shift all friction."""

    half_n: float  # Expanded uncertainty (k = 2) of the shift [N]; infinite if nothing is known of it
    why_not: str = ""  # Why parameters that a large shift moves are not known; empty if it is small


@dataclass(frozen=True)
class OilTemperature:
    """Oil temperatures of the recordings that a curve or model was found from."""

    range_c: tuple[float, float] | None  # Coldest and warmest oil in usable rows [°C]; None if a recording has none

    @classmethod
    def of(cls, recordings: Sequence[Recording]) -> Self:
        if not all(OIL_TEMPERATURE in each.columns and each.usable().any() for each in recordings):
            return cls(None)
        own_c = np.concatenate([each.column(OIL_TEMPERATURE)[each.usable()] for each in recordings])
        return cls((float(own_c.min()), float(own_c.max())))

    @property
    def widest(self) -> float:
        """Largest ratio of viscous friction's limits if it is determined: ``WIDEST`` in oil of one temperature."""
        cold_c, warm_c = self.range_c or (0.0, 0.0)
        return WIDEST * math.exp(VISCOSITY_FALL_1_K * (warm_c - cold_c))

    def in_words(self) -> str:
        return OIL_UNKNOWN if self.range_c is None else "oil of {:.0f} to {:.0f} °C".format(*self.range_c)


NO_OIL_TEMPERATURE = OilTemperature(None)


@dataclass(frozen=True)
class IdentifiedCurve:
    """Points of steady sliding in one condition, and the line through them."""

    condition: str
    recordings: tuple[str, ...]  # Names of the recordings
    points: tuple[StribeckPoint, ...]
    curve: StribeckCurve | None  # None if the points do not determine one
    zeros: Zeros
    why_not: str  # Why there is none
    unknown: Mapping[str, str]  # Why steady sliding does not show parameters of the line, by name
    oil: OilTemperature
    too_wide: str = ""  # How many points are too wide to use, and what would narrow them; else empty

    @classmethod
    def through(
        cls,
        recordings: Sequence[Recording],
        points: Sequence[StribeckPoint],
        zeros: Zeros,
        loss: ApparentLoss | None,
        cylinder: Cylinder,
    ) -> Self:
        """Fit the line through points of one condition, and widen the points by zeros and by losses of lines.

        ``loss`` is an unstated loss. If zeros or loss are unknown, there is no line: its friction in each direction
        would be taken as known.
        """
        curve, why_not = known_curve(points)
        slow = why_not if curve is None else no_rise_seen(curve, points)
        if loss is not None or math.isinf(zeros.half_n):
            curve, why_not = None, zeros.why_not if loss is None else loss.unknown_viscous
        lines_n = lines_uncertain_n(recordings[0], cylinder, np.array([point.velocity_m_s for point in points]))
        own, wide = list[StribeckPoint](), list[int]()
        unknown = dict.fromkeys(SLOW_PARAMETERS if slow else (), slow)
        oil = OilTemperature.of(recordings)
        if curve is not None:
            interval = steady_intervals(recordings, cylinder, CONFIDENCE)["viscous_n_s_m"]
            if viscous := no_viscous_seen((*interval, curve.viscous_n_s_m), lines_n, oil):
                unknown["viscous_n_s_m"] = f"viscous friction has no number: {viscous}"
        for each, line_n in zip(points, lines_n.tolist(), strict=True):
            lost_n = 0.0 if loss is None else float(loss.most_n(np.array(each.velocity_m_s)))
            half_n = math.hypot(each.half_width_n, zeros.half_n, line_n)
            half_n = max(half_n, line_n + NINE_OF_TEN * math.hypot(each.half_width_n, zeros.half_n))
            own.append(replace(each, half_width_n=half_n + lost_n))
            if (half_percent(own[-1]) or 0.0) > TOO_WIDE_PERCENT:
                parts_n = each.half_width_n, zeros.half_n, line_n, lost_n
                wide.append(int(np.argmax(parts_n)))
        advice = MORE_STROKES, STATE_ZEROS, STATE_LINES, STATE_LOSS
        named = [advice[place] for place in sorted(set(wide))]
        too_wide = f"± more than {TOO_WIDE_PERCENT:g} % in {len(wide)} of {counted(len(own), 'point')}, too wide to use"
        too_wide = f"{too_wide}: {'; '.join(named)}" if wide else ""
        names = tuple(each.name for each in recordings)
        return cls(recordings[0].metadata.condition, names, tuple(own), curve, zeros, why_not, unknown, oil, too_wide)

    @property
    def reasons(self) -> str:
        """Why there is no curve, and what steady sliding does not show of it; else empty."""
        return "; ".join(dict.fromkeys(filter(None, (self.why_not, *self.unknown.values()))))

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; unknown values are None.

        The curve's numbers draw its line, but for the parts that steady sliding does not show.
        """
        curve = None if self.curve is None else asdict(self.curve) | dict.fromkeys(self.unknown)
        points = [
            {**asdict(point), "half_width_n": point.known_half_width_n, "half_width_percent": half_percent(point)}
            for point in self.points
        ]
        about = {"recordings": list(self.recordings), "oil_temperature_c": self.oil.range_c}
        return {**about, "points": points, "too_wide": self.too_wide, "curve": curve, "why_not": self.reasons}


def half_percent(point: StribeckPoint) -> float | None:
    """Compute half the width of a point's interval over its friction [%]; None if it is unknown."""
    half_n = point.known_half_width_n
    return None if half_n is None else 100.0 * half_n / max(abs(point.friction_n), 1e-9)


def no_rise_seen(curve: StribeckCurve, points: Sequence[SteadyPoint]) -> str:
    """State why steady sliding does not show how friction rises towards standstill; empty if it does."""
    slowest_m_s = min(abs(point.velocity_m_s) for point in points)
    rise = float(curve.dry_friction(np.array([slowest_m_s]))[0]) / curve.coulomb_n - 1.0
    rises = rise >= LEAST_RISE
    if rises and is_breakaway_known(curve, points):
        speeds = max(sum(way * point.velocity_m_s > 0.0 for point in points) for way in (1.0, -1.0))
        few = f"{speeds} speeds of steady sliding do not show how friction falls with speed; record strokes at others"
        return few if speeds < LEAST_SPEEDS else ""
    seen = "still rises towards standstill, how far is not seen" if rises else "does not rise towards standstill"
    return f"at the slowest steady sliding, {1e3 * slowest_m_s:.2g} mm/s, friction {seen}; record slower strokes"


def no_viscous_seen(held_n_s_m: Sequence[float], lines_n: Array, oil: OilTemperature) -> str:
    """State why strokes do not determine viscous friction; empty if they do.

    ``held_n_s_m`` are numbers that its interval holds [N s/m]. ``lines_n`` is the expanded uncertainty of the stated
    losses of lines at some speeds [N].
    """
    if max(held_n_s_m) <= oil.widest * min(held_n_s_m):
        return ""
    return UNSEPARATED_FROM_LINES if lines_n.any() else UNSEPARATED


def stribeck_points(
    recordings: Sequence[Recording], slowest_m_s: float, confidence: float
) -> tuple[StribeckPoint, ...]:
    """Compute points with intervals, in the order of velocity. Starts and stops of strokes are not used.

    Below ``slowest_m_s`` the piston counts as at rest.
    """
    steady = []
    for each in recordings:
        rows = steady_rows(each.column("velocity_m_s"), each.sample_time_s, slowest_m_s, STEADY_VARIATION)
        steady.append(each.with_columns(usable=each.usable() & rows))
    return tuple(rows.point_with_interval(confidence) for rows in steady_sliding_by_speed(steady, slowest_m_s))


@dataclass(frozen=True)
class IdentifiedModel:
    """A LuGre model identified from recordings."""

    name: str
    title: str
    recordings: tuple[str, ...]  # Names of the recordings that it was identified from
    why_not: str = ""  # Why nothing could be identified
    parameters: tuple[IdentifiedParameter, ...] = ()
    found: Identification | None = None
    oil: OilTemperature = NO_OIL_TEMPERATURE

    @property
    def pressure_scaled(self) -> bool:
        return any(each.name == "pressure_slope_n_pa" for each in self.parameters)

    @property
    def equation(self) -> tuple[str, ...]:
        return tuple(line.format(scale=PRESSURE_SCALE if self.pressure_scaled else "") for line in EQUATION)

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values."""
        content: dict[str, Any] = {"recordings": list(self.recordings)}
        if self.found is None:
            return content | {"why_not": self.why_not}
        return content | {
            "oil_temperature_c": self.oil.range_c,
            "equation": list(self.equation),
            "velocity": self.found.velocity,
            "mean_absolute_error_n": self.found.error_n,
            "error_percent": self.found.error_percent,
            "parameters": {
                each.name: {k: v for k, v in vars(each).items() if k not in ("name", "narrowed_by")}
                | {"half_percent": each.half_percent, "note": each.note if each.value is None else each.remark}
                for each in self.parameters
            },
        }


@dataclass(frozen=True)
class FrictionModels:
    """Curves and models that were identified from logs."""

    folder: Path  # Folder of the files
    recordings: tuple[str, ...]  # Names of the recordings
    curves: tuple[IdentifiedCurve, ...]  # One per condition
    models: tuple[IdentifiedModel, ...]  # LuGre, plain and pressure-scaled
    refused: list[Quarantined] = field(default_factory=list)
    offsets: list[KnownOffset] = field(default_factory=list)
    guessed: dict[str, Any] | None = None  # As in ``FrictionOfLogs``
    loss: str = ""  # As in ``FrictionOfLogs``
    simpler: str = ""  # A sentence if the model with fewer parameters describes all recordings as well; else empty
    zeros: str = ""  # What to do if zeros, or a load, leave parameters without a number; else empty

    def to_dict(self) -> dict[str, Any]:
        """Return the content as JSON-compatible values; unknown values are None."""
        return {
            "confidence": CONFIDENCE,
            "intervals": INTERVALS,
            "recordings": list(self.recordings),
            "stribeck": {each.condition: each.to_dict() for each in self.curves},
            "models": {each.name: each.to_dict() for each in self.models},
            "offsets": {each.session: each.value for each in self.offsets},
            "refused": [asdict(each) for each in self.refused],
            **{name: getattr(self, name) for name in ("guessed", "loss", "simpler", "zeros")},
        }


def determined(
    model: LuGre,
    found: Identification,
    zeros: Zeros,
    unknown: Mapping[str, str],
    oil: OilTemperature = NO_OIL_TEMPERATURE,
) -> tuple[IdentifiedParameter, ...]:
    """List every parameter of the model. One that the motion does not determine, or is ``unknown``, has no number.

    ``unknown`` has reasons by parameter; an empty one does not count.
    """
    why_not = {spec.name: unknown.get(spec.name) or _unknown(spec, found, zeros, oil) for spec in model.searched}
    if why_not["stribeck_velocity_m_s"] and not why_not["stribeck_exponent"]:
        why_not["stribeck_exponent"] = SHAPELESS
    shifted = zeros.half_n > 0.5 * 0.01 * TOO_WIDE_PERCENT * found.parameters.value("coulomb_n")
    narrowed_by = NARROWED_BY | (dict.fromkeys(SHIFTED_BY_ZEROS, STATE_ZEROS) if shifted else {})
    parameters = []
    for spec in model.specs:
        if spec.relative_to == "pressure" and not model.pressure_scaled:
            continue
        source, note = _FOLLOWS_FROM.get(spec.name, (spec.name, ""))
        known: tuple[Any, ...] = found.parameters.value(spec.name), found.intervals.get(spec.name), note
        if why := why_not[source]:
            known = None, None, f"follows from {source}, which is not determined" if note else why
        words = spec.meaning if model.pressure_scaled else spec.meaning.replace("at zero gauge", "at the recorded")
        parameter = IdentifiedParameter(spec.name, SYMBOLS[spec.name], spec.unit, words, *known)
        parameters.append(replace(parameter, narrowed_by=narrowed_by.get(spec.name, MORE_STROKES)))
    return tuple(parameters)


def pressure_problem(pressure_pa: Sequence[np.ndarray]) -> str:
    """State why the sums of pressures in usable rows [Pa] do not show how friction grows with them; else empty."""
    usable_pa = np.concatenate(pressure_pa)
    if not len(usable_pa):
        return "no row is usable"
    least, greatest = (1e-5 * np.quantile(usable_pa, [0.05, 0.95])).tolist()
    if greatest >= LEAST_PRESSURE_SPAN * max(least, 0.0) and greatest > 0.0:
        return ""
    return (
        f"the sum of both pressures runs from {least:.3g} to {greatest:.3g} bar; how friction grows with it is "
        f"determined from a factor of {LEAST_PRESSURE_SPAN:g} on; record other loads too, each as a condition of "
        "its own (--names)"
    )


def _unknown(spec: ParameterSpec, found: Identification, zeros: Zeros, oil: OilTemperature) -> str:
    lower, upper = found.intervals[spec.name]
    shifted, widest = spec.name in SHIFTED_BY_ZEROS, oil.widest if spec.name == "viscous_n_s_m" else WIDEST
    if upper > widest * lower or (shifted and math.isinf(zeros.half_n)):
        return (zeros.why_not if shifted else "") or f"its interval spans more than a factor of {widest:.2g}"
    if spec.relative_to != "" or spec.may_be_zero:
        return ""
    at_limit = upper >= (1.0 - _AT_THE_LIMIT) * spec.upper or lower <= (1.0 + _AT_THE_LIMIT) * spec.lower
    limits = f"{four_digits(spec.lower)} to {with_unit(four_digits(spec.upper), spec.unit)}"
    return f"its interval ends at a limit of the search, {limits}" if at_limit else ""


def modelica_record(model: IdentifiedModel, cylinder: Cylinder) -> str:
    """Write a record with the model's name. A parameter without a number has no default, so that users must set it."""
    origin, *comments = _comments(model, cylinder)
    lines = [f'record {model.name} "{_modelica_text(origin)}"', *(f"  // {line}" for line in comments)]
    for each in model.parameters:
        value, words = "" if each.value is None else f" = {each.value:.9g}", _modelica_text(_words(each))
        lines.append(f'  parameter Real {each.name}(unit = "{each.unit.replace(" ", ".")}"){value} "{words}";')
    return "\n".join([*lines, f"end {model.name};", ""])


def matlab_script(model: IdentifiedModel, cylinder: Cylinder) -> str:
    """Write a script that defines a structure. Unknown parameters are NaN."""
    lines = [f"% {line}" for line in _comments(model, cylinder)]
    for each in model.parameters:
        value = "NaN" if each.value is None else f"{each.value:.9g}"
        lines.append(f"{MATLAB_VARIABLE}.{each.name} = {value}; % [{each.unit}] {_words(each)}")
    return "\n".join([*lines, ""])


def _comments(model: IdentifiedModel, cylinder: Cylinder) -> list[str]:
    assert model.found is not None
    count = counted(len(model.recordings), "recording")
    origin = (
        f"{model.title}: friction of {cylinder.name}, identified from {count}; "
        f"{model.oil.in_words()}; mean error {model.found.error_percent:.1f} % of mean friction"
    )
    return [origin, *model.equation, *(SIGNS if model.pressure_scaled else SIGNS[:1])]


def _words(each: IdentifiedParameter) -> str:
    known = each.interval and "{:g} % interval {:.4g} to {:.4g}".format(100.0 * CONFIDENCE, *each.interval)
    return f"{each.symbol}, {each.meaning}; {'; '.join(filter(None, (known, each.remark)))}"


def _modelica_text(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"')
