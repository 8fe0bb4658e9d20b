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
        **asdict(measured),
        "options": {name: list(options) for name, options in COMPILER_OPTIONS.items()},
        "quiet": {**asdict(measured.quiet), "is_quiet": measured.quiet.is_quiet},
    }


def metrics_of(measured: Measured) -> dict[str, float]:
    """Return every ratio and quantile by name, ``model.runtime.figure``."""
    return {
        f"{name}.{runtime}.{figure}": getattr(figures, figure)
        for name, model in measured.models.items()
        for runtime, figures in model.runtimes.items()
        for figure in ("ratio_to_c", *MEASURED_FIGURES)
    }


def model_table(name: str, model: ModelFigures) -> str:
    """Return the table of one model, a runtime per line."""
    head = f"{'ratio':>9} {'p50':>10} {'p99':>10} {'p99.9':>10} {'max':>10} {'first':>10}  {'steps':>7}  runtime"
    lines = [f"{name}: {model.size} (times in µs)", head]
    for figures in model.runtimes.values():
        values = " ".join(f"{getattr(figures, figure):10.3f}" for figure in MEASURED_FIGURES)
        lines.append(f"{figures.ratio_to_c:9.2f} {values}  {figures.steps:7d}  {figures.title}")
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
