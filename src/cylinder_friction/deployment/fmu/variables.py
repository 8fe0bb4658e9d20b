"""The variables of the FMU: one list, from which modelDescription.xml and the C sources' value references are made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from cylinder_friction.realtime.flags import Flag

if TYPE_CHECKING:
    from cylinder_friction.realtime.model import StepModel

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["independent", "input", "output", "parameter", "calculatedParameter"]
Variability = Literal["continuous", "discrete", "fixed"]

FLAG_MEANINGS = {
    Flag.NOT_READY: "No step yet, or no sample yet with all three channels valid; friction and bounds are 0",
    Flag.WARMING: "The state still remembers the start; wait, or set warm_up_steps",
    Flag.OUTSIDE: "A channel lies outside the training range widened by 5 %; the estimate is an extrapolation",
    Flag.INVALID_PRESSURE_1: "pressure_1 is not a working sensor's reading; its last valid value stands in",
    Flag.INVALID_PRESSURE_2: "pressure_2 is not a working sensor's reading; its last valid value stands in",
    Flag.INVALID_POSITION: "position is not a working sensor's reading; its last valid value stands in",
    Flag.FROZEN: "A channel repeats one value although it cannot be constant",
    Flag.RECOVERING: "Channels are sound again, but the state still remembers invalid or frozen ones",
    Flag.INVALID_OTHER: "Another input is not a working sensor's reading; its last valid value stands in",
}


@dataclass(frozen=True)
class FmuVariable:
    """One scalar variable of the FMU.

    Attributes:
        name: As the host shows it.
        kind: Real is Float64 in FMI 3, integer is Int32.
        causality, variability: As FMI names them.
        description: One sentence.
        unit, display_unit: Names from ``units.UNITS``, or None.
        start: Value before anything is set, for inputs and parameters alone.
        minimum: Smallest value, for the integer parameter alone.
    """

    name: str
    kind: Kind
    causality: Causality
    variability: Variability
    description: str
    unit: str | None = None
    display_unit: str | None = None
    start: float | int | None = None
    minimum: int | None = None

    @property
    def calculated(self) -> bool:
        """Whether the FMU computes its first value: what FMI lists as an initial unknown."""
        return self.causality in ("output", "calculatedParameter")


def fmu_variables(model: StepModel) -> tuple[FmuVariable, ...]:
    """Return the variables; a variable's place in the tuple is its value reference."""
    return (
        FmuVariable("time", "real", "independent", "continuous", "Simulation time", "s"),
        *_inputs(model),
        FmuVariable(
            "warm_up_steps",
            "integer",
            "parameter",
            "fixed",
            "For how many steps the samples set before the simulation starts have stood already; 0: not at all",
            start=0,
            minimum=0,
        ),
        FmuVariable(
            "sample_time",
            "real",
            "calculatedParameter",
            "fixed",
            "Time between two samples: the only communication step size that is taken",
            "s",
        ),
        *_estimates(model.bounds.probability),
        FmuVariable("flags", "integer", "output", "discrete", "How far to trust the estimate, as bits; 0: all is well"),
        FmuVariable("trusted", "boolean", "output", "discrete", "No flag is set"),
        *(
            FmuVariable(
                str(flag.name).lower(), "boolean", "output", "discrete", f"Flag {flag.value}: {FLAG_MEANINGS[flag]}"
            )
            for flag in Flag
        ),
    )


def _inputs(model: StepModel) -> list[FmuVariable]:
    """The raw samples; they start in the middle of the training range: a piston at rest that the model knows."""
    guard = model.guard
    channels = (
        ("pressure_1", "Gauge pressure on the piston side", "Pa", "bar"),
        ("pressure_2", "Gauge pressure on the rod side", "Pa", "bar"),
        ("position", "Piston position, growing as the rod extends", "m", "mm"),
    )
    return [
        FmuVariable(
            name,
            "real",
            "input",
            "continuous",
            f"{what}, as the sensor gives it; no flag from {guard.trained_lower[i]:.6g} "
            f"to {guard.trained_upper[i]:.6g} {unit}",
            unit,
            shown,
            start=float(f"{0.5 * (guard.trained_lower[i] + guard.trained_upper[i]):.6g}"),
        )
        for i, (name, what, unit, shown) in enumerate(channels)
    ]


def _estimates(probability: float) -> list[FmuVariable]:
    holds = f"friction lies between the bounds with probability {probability:g}"
    if probability == 1.0:
        holds = "so wide that it says nothing, as this model's errors were never calibrated"
    texts = (
        ("friction", "Friction, positive when it opposes positive velocity, of the sample set before the step"),
        ("friction_lower", f"Lower bound of friction: {holds}"),
        ("friction_upper", f"Upper bound of friction: {holds}"),
    )
    return [FmuVariable(name, "real", "output", "continuous", text, "N", "kN") for name, text in texts]
