"""A run as text, as JSON and as metrics: ratios first, then microseconds."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from cylinder_friction.deployment.latency.floor import OPTIONS as FLOOR_OPTIONS
from cylinder_friction.deployment.latency.line_up import NATIVE_OPTIONS
from cylinder_friction.deployment.latency.verdicts import verdicts_on

if TYPE_CHECKING:
    from cylinder_friction.deployment.latency.floor import Floor
    from cylinder_friction.deployment.latency.measuring import Measured, ModelFigures

MEASURED_FIGURES = ("p50_us", "p99_us", "p999_us", "maximum_us", "first_us")


def table(measured: Measured) -> str:
    """Return the whole run as plain text: a table a model, the floor below it, the verdicts last."""
    parts = [_model_table(name, model) for name, model in measured.models.items()]
    parts.append("\n".join(verdict.line() for verdict in verdicts_on(measured)))
    parts.append(_circumstances(measured))
    return "\n\n".join(part for part in parts if part)


def as_dict(measured: Measured) -> dict[str, Any]:
    """Return the whole run for JSON."""
    return {
        "models": {name: _model_dict(model) for name, model in measured.models.items()},
        "verdicts": [asdict(verdict) for verdict in verdicts_on(measured)],
        "machine": measured.machine,
        "options": {**{name: list(options) for name, options in NATIVE_OPTIONS.items()}, "floor": list(FLOOR_OPTIONS)},
        "effort": asdict(measured.effort),
        "core": measured.core,
        "quiet": {**asdict(measured.quiet), "is_quiet": measured.quiet.is_quiet},
    }


def metrics_of(measured: Measured) -> dict[str, float]:
    """Return every ratio and quantile by name, ``model.contender.figure``."""
    result: dict[str, float] = {}
    for name, model in measured.models.items():
        for contender, ratio in _ratios(model).items():
            result[f"{name}.{contender}.ratio_to_c"] = ratio
        for contender, figures in model.contenders.items():
            for figure in MEASURED_FIGURES:
                result[f"{name}.{contender}.{figure}"] = getattr(figures.latency, figure)
        if model.floor is not None:
            result[f"{name}.floor.bandwidth_us"] = model.floor.bandwidth_us
            result[f"{name}.floor.arithmetic_us"] = model.floor.arithmetic_us
        if model.instructions is not None:
            result[f"{name}.c.instructions"] = model.instructions
    return result


def _ratios(model: ModelFigures) -> dict[str, float]:
    own = model.contenders["c"].latency.p50_us
    return {name: figures.latency.p50_us / own if own > 0.0 else 0.0 for name, figures in model.contenders.items()}


def _model_table(name: str, model: ModelFigures) -> str:
    head = f"{'ratio':>9} {'p50':>10} {'p99':>10} {'p99.9':>10} {'max':>10} {'first':>10}  {'steps':>7}  runtime"
    lines = [f"{name}: {model.size} (times in µs)", head]
    ratios = _ratios(model)
    for contender, figures in model.contenders.items():
        values = " ".join(f"{getattr(figures.latency, figure):10.3f}" for figure in MEASURED_FIGURES)
        lines.append(f"{ratios[contender]:9.2f} {values}  {figures.latency.steps:7d}  {figures.title}")
    if model.floor is not None:
        lines += _floor_lines(model.floor)
    if model.instructions is not None:
        lines.append(f"{model.instructions:.0f} instructions a step of the C (-O3, 256 bit wide)")
    return "\n".join(lines)


def _floor_lines(floor: Floor) -> list[str]:
    work = floor.work
    return [
        f"floor, bandwidth:  {floor.bandwidth_us:8.3f} µs = {work.bytes} bytes at {1e-9 * floor.bytes_per_s:.1f} GB/s "
        f"(network {work.network_bytes}, forest {work.forest_bytes}, filters {work.filter_bytes})",
        f"floor, arithmetic: {floor.arithmetic_us:8.3f} µs = {work.multiply_adds} multiply-adds at "
        f"{1e-9 * floor.multiply_adds_per_s:.1f} G/s",
    ]


def _model_dict(model: ModelFigures) -> dict[str, Any]:
    ratios, floor = _ratios(model), model.floor
    return {
        "size": model.size,
        "published_size": model.published,
        "state_bytes": model.state_bytes,
        "operations": model.operations,
        "instructions": model.instructions,
        "contenders": {
            name: {
                "title": figures.title,
                "ratio_to_c": ratios[name],
                **asdict(figures.latency),
                "largest_difference_n": figures.largest_difference_n,
            }
            for name, figures in model.contenders.items()
        },
        "floor": None
        if floor is None
        else {**asdict(floor), "bandwidth_us": floor.bandwidth_us, "arithmetic_us": floor.arithmetic_us},
    }


def _circumstances(measured: Measured) -> str:
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
