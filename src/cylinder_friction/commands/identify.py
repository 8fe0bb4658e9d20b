"""The command ``identify``: from logger files to a Stribeck curve, LuGre parameters, and files for simulators."""

from __future__ import annotations

import argparse
from functools import partial

from cylinder_friction.commands.log_options import print_result, run_on_logs
from cylinder_friction.estimation.identification import PAGE_FILE, identify_logs
from cylinder_friction.estimation.identified_model import (
    INTERVALS,
    FrictionModels,
    IdentifiedParameter,
    half_percent,
)
from cylinder_friction.wording import counted

EXPECTED = (ValueError, OSError)


def run(options: argparse.Namespace) -> int:
    result, notes = run_on_logs(partial(identify_logs, generations=options.generations), options)
    beside = [INTERVALS]
    beside += [f"{name:<8} {words}" for name in ("simpler", "loss", "zeros") if (words := getattr(result, name))]
    print_result(result, notes, options.json, _lines(result), PAGE_FILE, beside)
    return 1 if result.refused or all(model.found is None for model in result.models) else 0


def _lines(result: FrictionModels) -> list[str]:
    lines = []
    for curve in result.curves:
        fitted = "no curve: " if curve.curve is None else "curve fitted; " if curve.reasons else "curve fitted"
        points = counted(len(curve.points), "point")
        sliding = f"{points} of steady sliding, {curve.oil.in_words()}"
        halves = [half for point in curve.points if (half := half_percent(point)) is not None]
        beside = f", ± {min(halves):.0f} to {max(halves):.0f} %" if halves else ""
        lines.append(f"condition {curve.condition}: {sliding}{beside}, {fitted}{curve.reasons}")
        lines += [f"  {curve.too_wide}"] * bool(curve.too_wide)
    for model in result.models:
        if model.found is None:
            lines += ["", f"{model.title}: not identified: {model.why_not}"]
            continue
        count = counted(len(model.recordings), "recording")
        conditions = [each.condition for each in result.curves if {*each.recordings} & {*model.recordings}]
        count += f" of condition{'s' * (len(conditions) > 1)} {', '.join(conditions)}"
        count += f", {model.oil.in_words()}"
        lines += ["", f"{model.title}: {count}, error {model.found.error_percent:.1f} % of mean |friction|"]
        lines += [_line(each) for each in model.parameters]
    return lines


def _line(each: IdentifiedParameter) -> str:
    if each.value is None:
        return f"  {each.name:<22} {each.remark}"
    words = each.remark
    if each.interval is not None:
        half = "" if each.half_percent is None else f", ± {each.half_percent:.0f} %"
        limits = f"{each.interval[0]:.4g} to {each.interval[1]:.4g}{half}"
        words = f"{limits}, {words}" if words else limits
    return f"  {each.name:<22} {each.value:<10.4g} {each.shown_unit:<6} {words}"
