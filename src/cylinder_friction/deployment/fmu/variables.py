"""The variables of the FMU: one list for modelDescription.xml and for the value references in C."""

from dataclasses import dataclass
from typing import Literal

from cylinder_friction.deployment.descriptions import described_inputs, flags_of, stated_uncertainty_n
from cylinder_friction.realtime.model import StepModel

Kind = Literal["real", "integer", "boolean"]
Causality = Literal["independent", "input", "output", "parameter", "calculatedParameter"]
Variability = Literal["continuous", "discrete", "fixed"]


@dataclass(frozen=True)
class Unit:
    """A unit as FMI defines it."""

    base: dict[str, float]  # Exponents of the SI base units, and an offset to them
    shown_as: tuple[str, float] | None = None  # Display unit and its factor: displayed value = factor x value


UNITS = {
    "s": Unit({"s": 1}),
    "Pa": Unit({"kg": 1, "m": -1, "s": -2}, ("bar", 1e-5)),
    "m": Unit({"m": 1}, ("mm", 1e3)),
    "m/s": Unit({"m": 1, "s": -1}, ("mm/s", 1e3)),
    "m/s2": Unit({"m": 1, "s": -2}),
    "N": Unit({"kg": 1, "m": 1, "s": -2}, ("kN", 1e-3)),
    "degC": Unit({"K": 1, "offset": 273.15}),
}


@dataclass(frozen=True)
class FmuVariable:
    """One scalar variable of the FMU."""

    name: str  # Name that the host shows
    kind: Kind  # Real is Float64 in FMI 3, integer is Int32
    # Causality and variability in FMI's words
    causality: Causality
    variability: Variability
    description: str  # One sentence
    unit: str | None = None  # A name from ``UNITS``, or None
    start: float | int | None = None  # Start value of inputs and parameters; None for others
    minimum: int | None = None  # Smallest value of the integer parameter; None for others
    initial_from: str | None = None  # Parameter that decides an output before the first step

    def attributes(self, reference: int) -> dict[str, str | None]:
        """Collect the attributes of any variable; inputs and time must not state an initial value's kind."""
        calculated = self.causality in ("output", "calculatedParameter")
        return {
            "name": self.name,
            "valueReference": str(reference),
            "description": self.description,
            "causality": self.causality,
            "variability": self.variability,
            "initial": "calculated" if calculated else "exact" if self.causality == "parameter" else None,
        }

    def typed_attributes(self) -> dict[str, str | None]:
        """Collect the attributes that depend on the variable's type."""
        shown_as = None if self.unit is None else UNITS[self.unit].shown_as
        return {
            "unit": self.unit,
            "displayUnit": shown_as[0] if shown_as else None,
            "min": None if self.minimum is None else str(self.minimum),
            "start": None if self.start is None else repr(self.start),
        }


def fmu_variables(model: StepModel) -> tuple[FmuVariable, ...]:
    """List the variables; a variable's place in the tuple is its value reference."""
    holds = model.bounds.in_words()
    earlier = f", {1e3 * model.lag_s:g} ms earlier" if model.lag_s > 0.0 else ""
    load = "" if model.position_load is None else f"; {model.position_load.in_words()}"
    warm_up = "For how many steps the samples set before the simulation starts have stood already; 0: not at all"
    step = "Time between two samples: the only communication step size that is taken"
    estimates = {
        "friction": "Friction, positive when it opposes positive velocity, of the sample set before the "
        f"step{earlier}{load}",
        "friction_lower": f"Lower bound of friction: {holds}",
        "friction_upper": f"Upper bound of friction: {holds}",
    }
    offset_parameters, offset_outputs = _offset(model)
    return (
        FmuVariable("time", "real", "independent", "continuous", "Simulation time", "s"),
        *_inputs(model),
        FmuVariable("warm_up_steps", "integer", "parameter", "fixed", warm_up, start=0, minimum=0),
        FmuVariable("sample_time", "real", "calculatedParameter", "fixed", step, "s"),
        *offset_parameters,
        *(FmuVariable(name, "real", "output", "continuous", text, "N") for name, text in estimates.items()),
        *offset_outputs,
        FmuVariable("flags", "integer", "output", "discrete", "How far to trust the estimate, as bits; 0: all is well"),
        FmuVariable("trusted", "boolean", "output", "discrete", "No flag is set"),
        *(
            FmuVariable(str(flag.name).lower(), "boolean", "output", "discrete", f"Flag {flag.value}: {flag.meaning}")
            for flag in flags_of(model)
        ),
    )


def _offset(model: StepModel) -> tuple[list[FmuVariable], list[FmuVariable]]:
    """List the parameters of a known offset and the outputs of the learned one; none if no offset is learned."""
    if model.offset is None:
        return [], []
    stated = f"below 0: as stated for the sensors, {stated_uncertainty_n(model):.3g} N"
    starts = {
        "start_offset": (0.0, "Offset of the sensors' zeros in friction to start from, if it is known"),
        "start_offset_uncertainty": (-1.0, f"Standard uncertainty of start_offset; {stated}"),
    }
    learned = {
        "offset": "Offset of the sensors' zeros in friction, as learned so far: the next step takes it off",
        "offset_uncertainty": "Standard uncertainty of that offset",
    }
    return (
        [FmuVariable(name, "real", "parameter", "fixed", text, "N", at) for name, (at, text) in starts.items()],
        [
            FmuVariable(name, "real", "output", "continuous", text, "N", initial_from=f"start_{name}")
            for name, text in learned.items()
        ],
    )


def _inputs(model: StepModel) -> list[FmuVariable]:
    """List the inputs; they start in the middle of the training range, as a piston at rest that the model knows."""
    result = []
    for each, lower, upper in zip(
        described_inputs(model.inputs), *(ends.tolist() for ends in model.trained_readings), strict=True
    ):
        text = each.meaning[0].upper() + each.meaning[1:]
        text += f", as the sensor gives it; no flag from {lower:.6g} to {upper:.6g}"
        start = float(f"{0.5 * (lower + upper):.6g}")
        result.append(FmuVariable(each.quantity, "real", "input", "continuous", text, each.unit, start))
    return result
