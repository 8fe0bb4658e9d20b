"""The pane of one recording: its facts, checks and figures."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.inspection.drawing import MM_PER_M, PA_PER_BAR
from cylinder_friction.inspection.filter_costs import MOTION_HZ, FilterCost, filter_costs
from cylinder_friction.inspection.frequency_figures import MS_PER_S, filter_figure, spectra
from cylinder_friction.inspection.friction_figures import against_position, against_velocity
from cylinder_friction.inspection.friction_view import FrictionView, carries_load, friction_view
from cylinder_friction.inspection.html_page import Pane, badge
from cylinder_friction.inspection.time_figure import over_time

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.inspection.subject import Inspected
    from cylinder_friction.recordings import Recording
    from cylinder_friction.signals.smooth import SignalFilter


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
    """Returns the pane; where friction cannot be calculated it says why and shows what was measured."""
    pane = Pane(name, title, subject.outcome)
    pane.facts(_facts(recording))
    _checks(pane, subject)
    view, problem = _view(recording, cylinder, filters[method], end_stop_margin_m)
    if view is None:
        pane.text(f"Friction could not be calculated: {problem}", "warning")
    pane.heading("Over time")
    caption = "Drag to zoom: all panels follow. Double click to see everything again."
    if view is not None:
        caption += f" Velocity, force and friction are filtered by {method}; friction has gaps where it is not usable."
    pane.figure(over_time(recording, view), caption)
    if view is not None:
        _friction(pane, view, recording)
        costs, left_out = filter_costs(filters, recording)
        _spectra(pane, recording, view, next((cost for cost in costs if cost.name == method), None), method)
        _filters(pane, costs, left_out)
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
        ("test", about.test),
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
            facts.append((words, f"{np.min(values):.4g} to {np.max(values):.4g} {unit}"))
            if column in about.zero_offset:
                facts.append((f"{words}: zero taken off", f"{about.zero_offset[column] / scale:.4g} {unit}"))
            if column in about.uncertainty:
                known = about.uncertainty[column]
                facts.append(
                    (f"{words}: uncertainty", f"± {known.zero / scale:.3g} {unit} and {100.0 * known.span:.3g} %")
                )
    return facts


def _checks(pane: Pane, subject: Inspected) -> None:
    pane.heading("Checks")
    rows = [(finding.outcome, finding.check, finding.text) for finding in subject.findings]
    rows += [("repaired", "repair", text) for text in subject.all_repairs()]
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
            f"The force holds {_si(view.load_n)} N that does not turn with the direction: a load such as a weight, or "
            f"a pressure sensor's zero. Half the difference between extending and retracting at equal position, "
            f"{_si(view.half_difference_n)} N, is friction all the same. Map a load cell, or let the load be "
            "identified as a function of position.",
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
    _stribeck(pane, view)
    pane.heading("Force against position")
    pane.figure(
        against_position(view, recording.column("position_m")),
        "The middle between extending and retracting is load, half the distance between them is friction.",
    )


def _stribeck(pane: Pane, view: FrictionView) -> None:
    pane.heading("Stribeck curve")
    curve = view.curve
    if curve is None:
        pane.text(f"No curve: {view.no_curve}.", "warning")
        return
    slowest_m_s = min(abs(point.velocity_m_s) for point in view.points)
    unseen = " (extrapolated)" if slowest_m_s > curve.stribeck_velocity_m_s else ""
    rows = [
        ("Coulomb friction, extending", "Fc", _si(curve.coulomb_n), "N"),
        ("Coulomb friction, retracting", "ratio · Fc", _si(curve.retract_ratio * curve.coulomb_n), "N"),
        (f"static friction, extending{unseen}", "Fs", _si(curve.static_n), "N"),
        (f"Stribeck velocity{unseen}", "vs", _si(MM_PER_M * curve.stribeck_velocity_m_s), "mm/s"),
        ("Stribeck exponent", "a", _si(curve.stribeck_exponent), "–"),
        ("viscous coefficient", "s2", _si(curve.viscous_n_s_m), "N·s/m"),
        ("retracting over extending", "ratio", _si(curve.retract_ratio), "–"),
    ]
    pane.table(("parameter", "symbol", "value", "unit"), rows, words=(0, 1, 3))
    pane.text(
        f"F = sgn(v)·[Fc + (Fs - Fc)·exp(-|v/vs|^a)] + s2·v, the bracket times the ratio while retracting; fitted to "
        f"{len(view.points)} points of steady sliding, "
        f"{_speed_range(view)}, and drawn no further.",
        "quiet",
    )


def _speed_range(view: FrictionView) -> str:
    speeds = [MM_PER_M * abs(point.velocity_m_s) for point in view.points]
    return f"{min(speeds):.2g} to {max(speeds):.3g} mm/s"


def _spectra(pane: Pane, recording: Recording, view: FrictionView, cost: FilterCost | None, method: str) -> None:
    pane.heading("Spectra")
    pane.figure(
        spectra(recording, view, cost),
        f"Amplitude density (Welch). Where a signal meets its floor there is only noise. The cut-off is that of "
        f"{method}: of pressures at the left, of velocity in the middle and at the right. The dotted floor is that of "
        "the converter's step, where the values show one.",
    )


def _filters(pane: Pane, costs: Sequence[FilterCost], left_out: Sequence[str]) -> None:
    pane.heading("What each filter costs")
    head = (
        "filter",
        "use",
        "pressure late [ms]",
        "velocity late [ms]",
        "acceleration late [ms]",
        f"velocity late at {MOTION_HZ:g} Hz [ms]",
        "pressure -3 dB [Hz]",
        "velocity -3 dB [Hz]",
        "velocity noise at standstill [mm/s]",
        "velocity noise from sensor's floor [mm/s]",
    )
    rows = [
        (
            cost.name,
            "real\u00a0time" if cost.causal else "off\u00a0line",
            *(
                _ms(delay_s)
                for delay_s in (
                    cost.pressure_delay_s,
                    cost.velocity_delay_s,
                    cost.acceleration_delay_s,
                    cost.velocity_delay_in_motion_s,
                )
            ),
            _hz(cost.pressure_bandwidth_hz),
            _hz(cost.velocity_bandwidth_hz),
            _noise(cost.velocity_noise_m_s),
            _noise(cost.velocity_noise_from_floor_m_s),
        )
        for cost in costs
    ]
    pane.table(head, rows, words=(0, 1))
    pane.figure(
        filter_figure(costs),
        "Solid: runs in real time. Dotted: off line, looks as far ahead as back, so it is never late. Negative lag: "
        "ahead of the motion, at the cost of noise.",
    )
    told = [f"Left out: {words}." for words in left_out]
    if any(math.isnan(cost.velocity_noise_m_s) for cost in costs):
        told.append("Noise at standstill needs a second of it in all; this recording rests less.")
    pane.text(
        "Late: for slow motion, unless a frequency is given. Noise: root mean square of the filtered velocity. "
        + " ".join(told),
        "quiet",
    )


def _ms(delay_s: float) -> str:
    return "–" if math.isnan(delay_s) else f"{round(MS_PER_S * delay_s, 1) + 0.0:.1f}"


def _hz(frequency_hz: float) -> str:
    return "all" if math.isinf(frequency_hz) else f"{frequency_hz:.1f}"


def _noise(noise_m_s: float) -> str:
    return "–" if math.isnan(noise_m_s) else f"{MM_PER_M * noise_m_s:.2g}"


def _si(value: float) -> str:
    """Returns a number with four digits and no power of ten in between."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"
