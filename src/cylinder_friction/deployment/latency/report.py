"""A run as text, as JSON and as metrics: ratios first, then microseconds."""

from dataclasses import asdict
from typing import Any

from cylinder_friction.deployment.latency.measuring import Measured, ModelFigures
from cylinder_friction.deployment.latency.runtimes import COMPILER_OPTIONS

MEASURED_FIGURES = ("p50_us", "p99_us", "p999_us", "maximum_us", "first_us")


def table(measured: Measured) -> str:
    """Return the whole run as plain text: one table per model, and the circumstances last."""
    parts = [model_table(name, model) for name, model in measured.models.items()]
    return "\n\n".join([*parts, circumstances(measured)])


def as_dict(measured: Measured) -> dict[str, Any]:
    """Return the whole run for JSON."""
    return {
        "models": {name: _model_dict(model) for name, model in measured.models.items()},
        "machine": measured.machine,
        "options": {name: list(options) for name, options in COMPILER_OPTIONS.items()},
        "effort": asdict(measured.effort),
        "core": measured.core,
        "quiet": {**asdict(measured.quiet), "is_quiet": measured.quiet.is_quiet},
    }


def metrics_of(measured: Measured) -> dict[str, float]:
    """Return every ratio and quantile by name, ``model.runtime.figure``."""
    result: dict[str, float] = {}
    for name, model in measured.models.items():
        ratios = _ratios(model)
        for runtime, figures in model.runtimes.items():
            result[f"{name}.{runtime}.ratio_to_c"] = ratios[runtime]
            result |= {f"{name}.{runtime}.{each}": getattr(figures.latency, each) for each in MEASURED_FIGURES}
    return result


def model_table(name: str, model: ModelFigures) -> str:
    """Return the table of one model, a runtime per line."""
    head = f"{'ratio':>9} {'p50':>10} {'p99':>10} {'p99.9':>10} {'max':>10} {'first':>10}  {'steps':>7}  runtime"
    lines = [f"{name}: {model.size} (times in µs)", head]
    ratios = _ratios(model)
    for runtime, figures in model.runtimes.items():
        values = " ".join(f"{getattr(figures.latency, figure):10.3f}" for figure in MEASURED_FIGURES)
        lines.append(f"{ratios[runtime]:9.2f} {values}  {figures.latency.steps:7d}  {figures.title}")
    return "\n".join(lines)


def circumstances(measured: Measured) -> str:
    """Return processor, compiler, core, scheduling and how quiet the machine was, in one line."""
    quiet = measured.quiet
    if quiet.core_share is None:
        how = "how quiet the machine was is not known"
    else:
        how = f"others had {100.0 * quiet.core_share:.1f} % of that core"
        if quiet.other_cores_share is not None:
            how += f", the other cores were {100.0 * quiet.other_cores_share:.0f} % busy"
        if not quiet.is_quiet:
            how += ": a BUSY machine, its tails are not the runtimes' own"
    core = "no core of its own" if measured.core is None else f"core {measured.core}"
    core += f", scheduling {measured.machine['scheduling']}"
    return f"{measured.machine['processor']}; {measured.machine['compiler']}; {core}; {how}"


def _ratios(model: ModelFigures) -> dict[str, float]:
    own = model.runtimes["c"].latency.p50_us
    return {name: figures.latency.p50_us / own if own > 0.0 else 0.0 for name, figures in model.runtimes.items()}


def _model_dict(model: ModelFigures) -> dict[str, Any]:
    ratios = _ratios(model)
    runtimes = {
        name: {
            "title": figures.title,
            "ratio_to_c": ratios[name],
            **asdict(figures.latency),
            "largest_difference_n": figures.largest_difference_n,
        }
        for name, figures in model.runtimes.items()
    }
    return asdict(model) | {"runtimes": runtimes}
