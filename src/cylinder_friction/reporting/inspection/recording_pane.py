"""The pane of one recording: its facts, checks and figures."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.reporting.inspection.drawing import MM_PER_M, PA_PER_BAR
from cylinder_friction.reporting.inspection.filter_costs import FilterCost, filter_costs
from cylinder_friction.reporting.inspection.filters_part import add_filters
from cylinder_friction.reporting.inspection.frequency_figures import spectra
from cylinder_friction.reporting.inspection.friction_figures import against_position, against_velocity
from cylinder_friction.reporting.inspection.friction_view import FrictionView, carries_load, friction_view
from cylinder_friction.reporting.inspection.html_page import Pane, badge, four_digits
from cylinder_friction.reporting.inspection.stribeck_part import add_stribeck
from cylinder_friction.reporting.inspection.subject import OUTCOMES
from cylinder_friction.reporting.inspection.time_figure import over_time

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.reporting.inspection.subject import Inspected
    from cylinder_friction.signals.smooth_signals import SignalFilter


def recording_pane(
    name: str,
    title: str,
    subject: Inspected,
    recording: Recording,
    cylinder: Cylinder,
    filters: Mapping[str, SignalFilter],
    method: str,
    end_stop_margin_m: float,
) -> Pane:
    """Return the pane; where friction cannot be calculated it says why and shows what was measured."""
    pane = Pane(name, title, subject.outcome)
    view, problem = _view(recording, cylinder, filters[method], end_stop_margin_m)
    pane.facts(_facts(recording) + (_found(view) if view is not None and subject.outcome != "refused" else []))
    _checks(pane, subject)
    if view is None:
        pane.text(f"Friction could not be calculated: {problem}", "warning")
    pane.heading("Over time")
    caption = "Drag to zoom: all panels follow. Double click to see everything again."
    if view is not None:
        caption += f" Velocity, force and friction are filtered by {method}; friction has gaps where it is not usable."
    pane.figure(over_time(recording, view), caption)
    if view is not None:
        _friction(pane, view, recording)
        if subject.outcome == "refused":  # what filters make of broken signals says nothing about filters
            _spectra(pane, recording, view, None, method)
            return pane
        costs, left_out = filter_costs(filters, recording)
        _spectra(pane, recording, view, next((cost for cost in costs if cost.name == method), None), method)
        add_filters(pane, costs, left_out)
    return pane


def _view(
    recording: Recording, cylinder: Cylinder, method: SignalFilter, end_stop_margin_m: float
) -> tuple[FrictionView | None, str]:
    try:
        return friction_view(recording, cylinder, method, end_stop_margin_m), ""
    except ValueError as error:
        return None, str(error)


def _facts(recording: Recording) -> list[tuple[str, str]]:
    about = recording.metadata
    facts = [
        ("condition", about.condition),
        ("session", about.session),
        ("cylinder", about.cylinder),
        ("load", about.load or "not stated"),
        ("duration", f"{len(recording) * about.sample_time_s:.5g} s"),
        ("sample rate", f"{1.0 / about.sample_time_s:.6g} Hz ({len(recording)} rows)"),
    ]
    shown = (
        ("P1, piston side", "pressure_1_pa", PA_PER_BAR, "bar"),
        ("P2, rod side", "pressure_2_pa", PA_PER_BAR, "bar"),
        ("position", "position_m", 1.0 / MM_PER_M, "mm"),
        ("drive force", "drive_force_n", 1.0, "N"),
        ("load force", "load_force_n", 1.0, "N"),
        ("oil temperature", "oil_temperature_c", 1.0, "°C"),
    )
    for words, column, scale, unit in shown:
        if column in recording.table.columns:
            values = recording.column(column) / scale
            facts.append((words, f"{four_digits(np.min(values))} to {four_digits(np.max(values))} {unit}"))
            if column in about.zero_offset:
                facts.append((f"{words}: zero taken off", f"{about.zero_offset[column] / scale:.4g} {unit}"))
            if column in about.uncertainty:
                known = about.uncertainty[column]
                facts.append(
                    (f"{words}: uncertainty", f"± {known.zero / scale:.3g} {unit} and {100.0 * known.span:.3g} %")
                )
    return facts


def _found(view: FrictionView) -> list[tuple[str, str]]:
    """Return the one number that a test engineer looks for first, where both directions were seen."""
    if not math.isfinite(view.half_difference_n):
        return []
    return [("friction: half of extending less retracting", f"{four_digits(view.half_difference_n)} N")]


def _checks(pane: Pane, subject: Inspected) -> None:
    """Add every finding, the worst first."""
    pane.heading("Checks")
    if subject.outcome == "refused":
        pane.text("Refused: what follows is drawn to show what is wrong, and is no result.", "warning")
    rows = [(finding.outcome, finding.check, finding.text) for finding in subject.findings]
    rows += [("repaired", "repair", text) for text in subject.all_repairs()]
    rows.sort(key=lambda row: -OUTCOMES.index(row[0]))
    body = "".join(
        f'<tr><td>{badge(outcome)}</td><td>{html.escape(check)}</td><td class="words">{html.escape(text)}</td></tr>'
        for outcome, check, text in rows
    )
    head = "<th>outcome</th><th>check</th><th>found</th>"
    pane.raw(f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>')


def _friction(pane: Pane, view: FrictionView, recording: Recording) -> None:
    pane.heading("Friction against velocity")
    for words in view.assumed:
        pane.text(words, "quiet")
    if carries_load(view.load_n, view.half_difference_n):
        pane.text(
            f"The force holds {four_digits(view.load_n)} N that does not turn with the direction: a load such as a "
            "weight, or a pressure sensor's zero. Half the difference between extending and retracting at equal "
            f"position, {four_digits(view.half_difference_n)} N, is friction all the same. Map a load cell, or let the "
            "load be identified as a function of position.",
            "warning",
        )
    if view.half_difference_n < 0.0:
        pane.text(
            "Extending takes less force than retracting at equal position, so friction would push the piston: the "
            "position counts the other way, or the two pressures are swapped.",
            "warning",
        )
    pane.figure(
        against_velocity(view),
        f"Extension is positive. Slower than {MM_PER_M * view.slowest_m_s:.2g} mm/s counts as standstill, where "
        "friction is whatever holds the piston. Right: dashed and squares while retracting.",
    )
    add_stribeck(pane, view)
    if not np.any(view.usable & (np.abs(view.signals.velocity_m_s) > view.slowest_m_s)):
        return
    pane.heading("Force against position")
    pane.figure(
        against_position(view, recording.column("position_m")),
        "The middle between extending and retracting is load, half the distance between them is friction.",
    )


def _spectra(pane: Pane, recording: Recording, view: FrictionView, cost: FilterCost | None, method: str) -> None:
    pane.heading("Spectra")
    cut_off = f" The cut-off is that of {method}: of pressures at the left, of velocity in the middle and at the right."
    cut_off = "" if cost is None else cut_off
    pane.figure(
        spectra(recording, view, cost),
        f"Amplitude density (Welch). Where a signal meets its floor there is only noise.{cut_off} The dotted floor is "
        "that of the converter's step, where the values show one.",
    )
