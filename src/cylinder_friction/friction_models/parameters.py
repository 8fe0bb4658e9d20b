"""Parameters of friction models: their units, meaning and search bounds, and the classes that hold them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import ClassVar, Literal

import numpy as np

from cylinder_friction.arrays import Array


@dataclass(frozen=True)
class ParameterSpec:
    """One parameter of a friction model: its unit, its meaning, and how identification searches for it.

    A friction model of your own lists one for each field of its parameters, in their order. Bounds are in the
    parameter's own unit unless ``relative_to`` states another one; the search never leaves them.
    """

    name: str  # Field of the model's parameters, with its unit at the end
    unit: str  # SI, such as ``N s/m``
    meaning: str  # Meaning in a few words
    # Bounds of the search
    lower: float
    upper: float
    # Start of the search; None if the Stribeck curve or the presliding stiffness gives it
    first: float | None = None
    logarithmic: bool = True  # Whether the search uses its logarithm
    # Unit of ``lower``, ``upper`` and ``first``. Empty: the parameter's own. "curve": a factor on the steady curve's
    # Coulomb friction. "coulomb_n": the excess over ``coulomb_n``, relative to ``coulomb_n``. "pressure": the share of
    # friction at the reference pressure that is due to pressure
    relative_to: Literal["", "curve", "coulomb_n", "pressure"] = ""
    searched: bool = True  # Whether it is identified by search; otherwise it follows from the others
    may_be_zero: bool = False  # Whether zero is valid

    def __post_init__(self) -> None:
        if not self.lower < self.upper or (self.logarithmic and self.lower <= 0.0):
            raise ValueError(f"expected lower < upper, above 0 if logarithmic, but got {self}")


STIFFNESS_RANGE_N_M = (1e5, 1e8)
"""Bounds of the bristle stiffness of cylinder seals."""

COULOMB = ParameterSpec(
    "coulomb_n",
    "N",
    "Coulomb friction while extending, at zero gauge pressure",
    math.exp(-1.5),
    math.exp(1.0),
    relative_to="curve",
)
STATIC = ParameterSpec(
    "static_n",
    "N",
    "static friction while extending, at zero gauge pressure",
    0.0,
    1.5,
    logarithmic=False,
    relative_to="coulomb_n",
)
STRIBECK_VELOCITY = ParameterSpec("stribeck_velocity_m_s", "m/s", "speed over which friction falls", 1e-3, 0.1)
STRIBECK_EXPONENT = ParameterSpec(
    "stribeck_exponent", "1", "shape of the fall from static to Coulomb friction", 0.5, 3.0, logarithmic=False
)
VISCOUS = ParameterSpec("viscous_n_s_m", "N s/m", "viscous coefficient", 1.0, 5e4, may_be_zero=True)
STIFFNESS = ParameterSpec("bristle_stiffness_n_m", "N/m", "stiffness of presliding at its start", *STIFFNESS_RANGE_N_M)
DAMPING = ParameterSpec(
    "bristle_damping_n_s_m",
    "N s/m",
    "bristle damping at standstill, from the damping ratio",
    1.0,
    1e6,
    searched=False,
    may_be_zero=True,
)
DAMPING_VELOCITY = ParameterSpec(
    "damping_velocity_m_s", "m/s", "speed over which bristle damping fades, for passivity", 1e-6, 10.0, searched=False
)
RETRACT_RATIO = ParameterSpec(
    "retract_ratio", "1", "dry friction while retracting over dry friction while extending", 0.4, 2.5
)
PRESSURE_SLOPE = ParameterSpec(
    "pressure_slope_n_pa",
    "N/Pa",
    "Coulomb friction per pascal of the sum of both pressures",
    1e-3,
    0.95,
    0.3,
    logarithmic=False,
    relative_to="pressure",
    may_be_zero=True,
)

STRIBECK = (COULOMB, STATIC, STRIBECK_VELOCITY, STRIBECK_EXPONENT, VISCOUS)
"""Parameters of the curve of steady sliding: the first five of every model with a Stribeck curve, in this order."""
SCALING = (RETRACT_RATIO, PRESSURE_SLOPE)
"""Parameters that scale dry friction by direction and pressure: the last two of every model, in this order."""


@dataclass(frozen=True)
class ModelParameters:
    """The parameters of a friction model; a subclass has one field for each of its ``specs``, in their order.

    Raises:
        ValueError: A number is not finite or has an impossible sign, or static is below Coulomb friction.
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = ()

    def value(self, name: str) -> float:
        """Look up one number by name."""
        return float(getattr(self, name))

    def __post_init__(self) -> None:
        refuse_impossible(self, self.specs)

    def packed(self) -> Array:
        """Pack the numbers in the order of the fields, shape ``(k,)``, for the compiled functions."""
        return np.array([getattr(self, field.name) for field in fields(self)], dtype=np.float64)


@dataclass(frozen=True)
class StribeckParameters(ModelParameters):
    """The numbers of a model that slides along the Stribeck curve; a subclass adds its own and those of ``SCALING``.

    Example:
        >>> from cylinder_friction.friction_models.parameters import StribeckParameters
        >>> StribeckParameters(300.0, 420.0, 0.01, 1.0, 800.0).packed().tolist()
        [300.0, 420.0, 0.01, 1.0, 800.0]
    """

    specs: ClassVar[tuple[ParameterSpec, ...]] = STRIBECK

    coulomb_n: float  # Coulomb friction Fc while extending, at zero gauge pressure [N]
    static_n: float  # Static friction Fs while extending, at zero gauge pressure [N], at least ``coulomb_n``
    stribeck_velocity_m_s: float  # Stribeck velocity vs [m/s]
    stribeck_exponent: float  # Exponent a of the Stribeck curve
    viscous_n_s_m: float  # Viscous coefficient s2 [N s/m]


def refuse_impossible(numbers: object, specs: Sequence[ParameterSpec]) -> None:
    """Raise ``ValueError`` naming the first invalid parameter of an object with a field for each of ``specs``.

    Example:
        >>> from cylinder_friction.friction_models.parameters import StribeckParameters
        >>> StribeckParameters(300.0, 200.0, 0.01, 1.0, 800.0)
        Traceback (most recent call last):
        ValueError: StribeckParameters: static_n must be at least coulomb_n (300.0 N), but got 200.0 N
    """
    owner = type(numbers).__name__
    for spec in specs:
        value = getattr(numbers, spec.name)
        if not (math.isfinite(value) and (value > 0.0 or (spec.may_be_zero and value == 0.0))):
            kind = "zero or a positive number" if spec.may_be_zero else "a positive number"
            raise ValueError(f"{owner}: {spec.name} must be {kind}, but got {value!r}")
    static, coulomb = getattr(numbers, "static_n", math.inf), getattr(numbers, "coulomb_n", 0.0)
    if static < coulomb:
        raise ValueError(f"{owner}: static_n must be at least coulomb_n ({coulomb} N), but got {static} N")
