"""The one interface behind every analytical friction model."""

from collections.abc import Callable
from typing import ClassVar

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.parameters import ModelParameters, ParameterSpec
from cylinder_friction.friction_models.stribeck import StribeckCurve

Kernel = Callable[[Array, Array, Array, Array, float, Array, Array], None]

_BLOCK_ROWS = 8192
"""Rows that a kernel gets at once. Its dozen arrays of intermediate results then stay in the processor's cache."""

_PRESLIDING_S = 0.02
"""Duration of presliding in quick motion [s]; converts a stiffness to a speed for a model without state."""


class FrictionModel:
    """Friction as a function of motion, stepped at a velocity that is held over each sample.

    A subclass sets the class attributes. Compiled code takes the parameters as an array, in the order of
    ``parameter_class.specs``; ``parameters`` and ``ModelParameters.packed`` convert between object and array.

    With ``pressure_scaled``, dry friction grows with pressure, and identification also searches for the slope.

    Attributes:
        name: Name in files; ``pressure_`` is its prefix with pressure scaling.
        title: Name for people.
        parameter_class: Class of its parameters.
        start: State before the first sample.
        kernel: Function ``(values, velocity, log_speed, pressure, sample_time_s, state, friction)``, which changes
            ``state`` and fills ``friction``. ``log_speed`` is from ``log_speed_of``; a search over parameters computes
            it once.
        multiply_adds: Operations of one step; an exponential, a logarithm or a power counts as 16.
    """

    short_name: ClassVar[str]
    short_title: ClassVar[str]
    parameter_class: ClassVar[type[ModelParameters]]
    start: ClassVar[tuple[float, ...]] = (0.0,)
    kernel: Kernel
    multiply_adds: ClassVar[int]

    def __init__(self, pressure_scaled: bool = False) -> None:
        self.pressure_scaled = pressure_scaled

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name!r})"

    def new_state(self) -> Array:
        """Make the state before the first sample; ``simulate`` updates it in place."""
        return np.array(self.start)

    @property
    def name(self) -> str:
        return f"pressure_{self.short_name}" if self.pressure_scaled else self.short_name

    @property
    def title(self) -> str:
        return f"{self.short_title}, pressure-scaled" if self.pressure_scaled else self.short_title

    @property
    def specs(self) -> tuple[ParameterSpec, ...]:
        """Specs of its numbers, in the order in which ``simulate`` takes them."""
        return self.parameter_class.specs

    @property
    def searched(self) -> tuple[ParameterSpec, ...]:
        """Specs of the numbers that identification searches; the others follow from these, or are zero."""
        return tuple(
            spec for spec in self.specs if spec.searched and (self.pressure_scaled or spec.relative_to != "pressure")
        )

    def parameters(self, values: Array) -> ModelParameters:
        """Convert the numbers to parameters; raises ``ValueError`` if one is impossible."""
        return self.parameter_class(*(float(value) for value in values))

    def simulate(
        self, values: Array, velocity_m_s: Array, sample_time_s: float, state: Array, pressure_pa: Array | None = None
    ) -> Array:
        """Simulate friction [N], shape ``(n,)``, at the end of each sample, positive when it opposes positive velocity.

        Velocity and pressure are held over a sample. Steps are stable however stiff presliding is, and cutting the
        samples into pieces does not change one bit.

        Args:
            values: The numbers, shape ``(k,)``, in the order of ``specs``.
            velocity_m_s: Shape ``(n,)``.
            sample_time_s: Time between two samples [s].
            state: From ``new_state``; changed in place.
            pressure_pa: Gauge pressure that scales dry friction, shape ``(n,)``; None means zero.

        Raises:
            ValueError: Pressure has another shape than velocity.
        """
        velocity = np.ascontiguousarray(velocity_m_s, dtype=np.float64)
        pressure = np.zeros_like(velocity) if pressure_pa is None else np.ascontiguousarray(pressure_pa, np.float64)
        if pressure.shape != velocity.shape:
            raise ValueError(
                f"pressure_pa has shape {pressure.shape}, but velocity_m_s has {velocity.shape}; expected one"
            )
        friction = np.empty_like(velocity)
        self.step_through(values, velocity, log_speed_of(velocity), pressure, sample_time_s, state, friction)
        return friction

    def step_through(
        self,
        values: Array,
        velocity: Array,
        log_speed: Array,
        pressure: Array,
        sample_time_s: float,
        state: Array,
        friction: Array,
    ) -> None:
        """Run the kernel on blocks of rows; the arguments are the kernel's."""
        for start in range(0, len(velocity), _BLOCK_ROWS):
            rows = slice(start, start + _BLOCK_ROWS)
            self.kernel(values, velocity[rows], log_speed[rows], pressure[rows], sample_time_s, state, friction[rows])

    def first_guess(
        self, curve: StribeckCurve, stiffness_n_m: float, reference_pressure_pa: float = 0.0
    ) -> ModelParameters:
        """Choose the start of a search; the reference pressure causes part of the curve's Coulomb friction."""
        share = next((spec.first or 0.0 for spec in self.searched if spec.relative_to == "pressure"), 0.0)
        slope = share * curve.coulomb_n / reference_pressure_pa if reference_pressure_pa > 0.0 else 0.0
        kept = 1.0 - slope * reference_pressure_pa / curve.coulomb_n
        measured = vars(curve) | {
            "coulomb_n": kept * curve.coulomb_n,
            "static_n": kept * curve.static_n,
            "bristle_stiffness_n_m": stiffness_n_m,
            "bristle_damping_n_s_m": 0.0,
            "damping_velocity_m_s": curve.stribeck_velocity_m_s,
            "film_velocity_m_s": curve.speed_of_least_friction(),
            "regularising_velocity_m_s": curve.coulomb_n / stiffness_n_m / _PRESLIDING_S,
            "pressure_slope_n_pa": slope,
        }
        return self.parameter_class(**{spec.name: measured.get(spec.name, spec.first) for spec in self.specs})


def log_speed_of(velocity_m_s: Array) -> Array:
    """Compute ``ln |velocity|``, and 0 at standstill, where no model needs it."""
    return np.asarray(np.log(np.abs(velocity_m_s), out=np.zeros_like(velocity_m_s), where=velocity_m_s != 0.0))
