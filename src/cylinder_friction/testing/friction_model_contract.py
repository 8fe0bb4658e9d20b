"""The promises that every friction model keeps, as checks to run on a friction model of your own.

    check_friction_model(MyModel, MyParameters(240.0, 360.0, ...))

or as one test per promise, with pytest:

    @pytest.mark.parametrize("check", CHECKS, ids=lambda check: check.__name__)
    def test_my_model_keeps(check): check(FrictionModelCase(MyModel, MyParameters(240.0, 360.0, ...)))
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from cylinder_friction.arrays import Array
from cylinder_friction.friction_models.model import FrictionModel
from cylinder_friction.friction_models.parameters import ModelParameters
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction.testing.estimator_contract import ContractError

STEP_S = 5e-3
RATIO, SLOPE_SHARE = 1.2, 0.5
"""Ratio of friction retracting to extending, and relative growth of friction at ``PRESSURE_PA``, in the checks."""
PRESSURE_PA = 3e6
RATE_DEPENDENT = ("viscous_n_s_m", "bristle_damping_n_s_m")
SEED, PATHS = 0, 40


@dataclass(frozen=True)
class FrictionModelCase:
    """A friction model under test, with physical parameters.

    Args:
        kind: Class of the model.
        parameters: Its parameters, with a ``retract_ratio`` of 1 and a ``pressure_slope_n_pa`` of 0.
        steady_n: Dry friction [N] of steady sliding at a speed [m/s] while extending, without pressure; None: the
            Stribeck curve of the numbers, or ``coulomb_n`` if they have none.
    """

    kind: type[FrictionModel]
    parameters: ModelParameters
    steady_n: Callable[[float], float] | None = None

    @property
    def sided(self) -> ModelParameters:
        """The parameters with friction that differs by direction and pressure."""

        slope = SLOPE_SHARE * self.parameters.value("coulomb_n") / PRESSURE_PA
        return replace(self.parameters, retract_ratio=RATIO, pressure_slope_n_pa=slope)  # type: ignore[call-arg]

    @property
    def breakaway_n(self) -> float:
        """Greatest dry friction while extending, without pressure [N]."""
        return self.parameters.value("static_n" if hasattr(self.parameters, "static_n") else "coulomb_n")

    def friction(
        self, parameters: ModelParameters, velocity_m_s: Sequence[float] | Array, pressure_pa: float | Array = 0.0
    ) -> Array:
        """Simulate friction [N] from a fresh state, shape ``(n,)``."""
        model, velocity = self.kind(pressure_scaled=True), np.asarray(velocity_m_s, dtype=np.float64)
        pressure = np.broadcast_to(pressure_pa, velocity.shape)
        return model.simulate(parameters.packed(), velocity, STEP_S, model.new_state(), pressure)

    def require(self, holds: bool, message: str) -> None:
        """Refuse a broken promise."""
        if not holds:
            raise ContractError(f"{self.kind.short_name}: {message}")


def without_rates(parameters: ModelParameters) -> ModelParameters:
    """Set viscous friction and bristle damping to zero, so that only dry friction is left."""
    own = {field.name for field in fields(parameters)}
    return replace(parameters, **dict.fromkeys(own.intersection(RATE_DEPENDENT), 0.0))


def random_paths() -> list[Array]:
    """Draw velocities with rest, creep, sliding and reversals [m/s]."""
    generator = np.random.default_rng(SEED)
    paths = []
    for _ in range(PATHS):
        speeds = np.exp(generator.uniform(np.log(1e-5), np.log(0.3), 12)) * generator.choice([-1.0, 0.0, 1.0], 12)
        paths.append(np.repeat(speeds, generator.integers(1, 12, 12)))
    return paths


def numbers_stand_in_the_order_of_their_specs(case: FrictionModelCase) -> None:
    names, specs = [field.name for field in fields(case.parameters)], [spec.name for spec in case.kind().specs]
    case.require(names == specs, f"fields are {names}, but specs name {specs}")
    scaling = ["retract_ratio", "pressure_slope_n_pa"]
    case.require(specs[-2:] == scaling, f"the last specs are {specs[-2:]}, but expected {scaling}")
    for spec in case.kind().specs:
        case.require(bool(spec.unit and spec.meaning), f"the spec of {spec.name} has no unit or no meaning")


def a_first_guess_lies_within_the_bounds_of_the_search(case: FrictionModelCase) -> None:
    curve = StribeckCurve(240.0, 360.0, 8e-3, 1.5, 1500.0, 1.2)
    for scaled in (False, True):
        model = case.kind(pressure_scaled=scaled)
        guess = model.first_guess(curve, 5e6, PRESSURE_PA if scaled else 0.0)
        case.require(model.parameters(guess.packed()) == guess, "numbers differ after packing and unpacking")
        slope = guess.value("pressure_slope_n_pa")
        case.require((slope > 0.0) == scaled, f"the first pressure slope is {slope}, with pressure scaling {scaled}")
        for spec in model.searched:
            value = guess.value(spec.name)
            inside = spec.relative_to != "" or spec.lower <= value <= spec.upper
            case.require(inside, f"{spec.name} starts at {value}, outside {spec.lower} to {spec.upper}")


def impossible_numbers_are_refused_by_name(case: FrictionModelCase) -> None:
    for spec in case.kind().specs:
        for value in (-1.0, float("nan"), *([] if spec.may_be_zero else [0.0])):
            try:
                replace(case.parameters, **{spec.name: value})
            except ValueError as error:
                case.require(spec.name in str(error), f"{spec.name} of {value}: message is {str(error)!r}")
            else:
                case.require(False, f"{spec.name} of {value} is accepted, but expected a ValueError that names it")


def without_direction_friction_is_odd(case: FrictionModelCase) -> None:
    for path in random_paths():
        there, back = case.friction(case.parameters, path), case.friction(case.parameters, -path)
        case.require(np.array_equal(there, -back), "friction of the opposite motion is not the opposite")


def cutting_the_samples_changes_no_bit(case: FrictionModelCase) -> None:
    model, values = case.kind(pressure_scaled=True), case.sided.packed()
    generator = np.random.default_rng(SEED)
    for path in random_paths():
        pressure = generator.uniform(-1e5, 6e6, len(path))
        cut, state = int(generator.integers(0, len(path))), model.new_state()
        pieces = [
            model.simulate(values, path[part], STEP_S, state, pressure[part]) for part in (slice(cut), slice(cut, None))
        ]
        whole = case.friction(case.sided, path, pressure)
        case.require(np.array_equal(np.concatenate(pieces), whole), f"friction differs when samples are cut at {cut}")


def dry_friction_never_exceeds_breakaway(case: FrictionModelCase) -> None:
    most_n = RATIO * (1.0 + 1e-9) * case.breakaway_n
    for path in [np.full(4000, -1e-4), *random_paths()]:
        found = float(np.abs(case.friction(without_rates(case.sided), path)).max())
        case.require(found <= most_n, f"dry friction reaches {found:.6g} N, above {most_n:.6g} N of breakaway")


def at_standstill_friction_stays(case: FrictionModelCase) -> None:
    rest = case.friction(without_rates(case.parameters), [0.0, 0.02, 0.02, *[0.0] * 20])
    case.require(rest[0] == 0.0, f"friction is {rest[0]} N before any motion, but expected 0")
    drift = float(np.ptp(rest[3:]))
    case.require(drift == 0.0, f"friction changes by {drift:.3g} N at rest")


def steady_sliding_ends_on_the_curve(case: FrictionModelCase) -> None:
    numbers = case.sided
    viscous = numbers.value("viscous_n_s_m") if hasattr(numbers, "viscous_n_s_m") else 0.0
    for speed in (0.02, 0.05, 0.1, 0.5):
        dry_n = _curve(numbers, speed) if case.steady_n is None else case.steady_n(speed)
        for way, pressure_pa in ((1.0, 0.0), (-1.0, 0.0), (1.0, PRESSURE_PA), (-1.0, 2.0 * PRESSURE_PA)):
            factor = (1.0 if way > 0.0 else RATIO) * (1.0 + SLOPE_SHARE * pressure_pa / PRESSURE_PA)
            expected = way * (factor * dry_n + viscous * speed)
            found = float(case.friction(numbers, np.full(4000, way * speed), pressure_pa)[-1])
            close = abs(found - expected) <= 1e-6 * abs(expected)
            where = f"at {way * speed} m/s and {pressure_pa:.3g} Pa"
            case.require(close, f"steady friction is {found:.6g} N {where}, but expected {expected:.6g} N")


def below_zero_gauge_pressure_relieves_the_seal_no_further(case: FrictionModelCase) -> None:
    """A noisy sensor on an open port reads below zero; dry friction is then that of zero pressure, never less."""
    for path in random_paths():
        below, zero = (case.friction(case.sided, path, pressure) for pressure in (-2e5, 0.0))
        case.require(np.array_equal(below, zero), "friction at a pressure below zero is not that at zero")


def a_closed_loop_of_travel_takes_energy(case: FrictionModelCase) -> None:
    generator = np.random.default_rng(SEED)
    numbers, rows = replace(case.sided, **dict.fromkeys(_own(case, "viscous_n_s_m"), 0.0)), 2000
    phase = 2.0 * np.pi * (np.arange(4 * rows) + 0.5) / rows
    for amplitude_m in np.exp(generator.uniform(np.log(1e-6), np.log(0.05), PATHS)):
        velocity = amplitude_m * 2.0 * np.pi / (rows * STEP_S) * np.cos(phase)
        last = slice(3 * rows, None)
        work_j = float(np.sum(case.friction(numbers, velocity)[last] * velocity[last]) * STEP_S)
        enough = work_j >= -1e-6 * case.breakaway_n * amplitude_m
        case.require(enough, f"a loop of {amplitude_m:.3g} m gives {-work_j:.3g} J, but friction can only take energy")


def _own(case: FrictionModelCase, name: str) -> list[str]:
    return [name] if hasattr(case.parameters, name) else []


def _curve(numbers: ModelParameters, speed_m_s: float) -> float:
    """Compute dry friction of steady sliding while extending [N]."""
    coulomb = numbers.value("coulomb_n")
    if not hasattr(numbers, "static_n"):
        return coulomb
    fall = np.exp(-((speed_m_s / numbers.value("stribeck_velocity_m_s")) ** numbers.value("stribeck_exponent")))
    return float(coulomb + (numbers.value("static_n") - coulomb) * fall)


CHECKS: tuple[Callable[[FrictionModelCase], None], ...] = (
    numbers_stand_in_the_order_of_their_specs,
    a_first_guess_lies_within_the_bounds_of_the_search,
    impossible_numbers_are_refused_by_name,
    without_direction_friction_is_odd,
    cutting_the_samples_changes_no_bit,
    dry_friction_never_exceeds_breakaway,
    at_standstill_friction_stays,
    steady_sliding_ends_on_the_curve,
    below_zero_gauge_pressure_relieves_the_seal_no_further,
    a_closed_loop_of_travel_takes_energy,
)
"""All promises; each check takes a ``FrictionModelCase`` and raises ``ContractError`` if one is broken."""


def check_friction_model(
    kind: type[FrictionModel], parameters: ModelParameters, steady_n: Callable[[float], float] | None = None
) -> None:
    """Check all promises of a friction model; arguments are those of ``FrictionModelCase``.

    Raises:
        ContractError: A promise is broken.

    Example:
        >>> from cylinder_friction.friction_models.lugre import LuGre, LugreParameters
        >>> from cylinder_friction.testing.friction_model_contract import check_friction_model
        >>> parameters = LugreParameters(300.0, 420.0, 0.01, 1.0, 800.0, 1e7, 2e4, damping_velocity_m_s=0.05)
        >>> check_friction_model(LuGre, parameters)
    """
    case = FrictionModelCase(kind, parameters, steady_n)
    for check in CHECKS:
        check(case)
