"""What the page shows of one recording: its facts, checks, figures and parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.reporting.inspection.filter_costs import MOTION_HZ, FilterCost, filter_costs
from cylinder_friction.reporting.inspection.frequency_figures import MS_PER_S, filter_figure, spectra
from cylinder_friction.reporting.inspection.friction_figures import against_position, against_velocity
from cylinder_friction.reporting.inspection.friction_view import FrictionView, friction_view
from cylinder_friction.reporting.inspection.known_curve import is_breakaway_known
from cylinder_friction.reporting.inspection.subject import OUTCOMES, Inspected
from cylinder_friction.reporting.page import Cell, Table, four_digits
from cylinder_friction.reporting.style import BLUE, GREEN, INK, ORANGE, QUIET
from cylinder_friction.reporting.time_figure import LINE_POINTS, Line, Panel, over_time
from cylinder_friction.signals.smooth_signals import SignalFilter, has_pressures

if TYPE_CHECKING:
    import plotly.graph_objects as go

PA_PER_BAR = 1e5
MM_PER_M = 1e3

COLUMNS = (
    ("P1, piston side", "pressure_1_pa", PA_PER_BAR, "bar"),
    ("P2, rod side", "pressure_2_pa", PA_PER_BAR, "bar"),
    ("position", "position_m", 1.0 / MM_PER_M, "mm"),
    ("drive force", "drive_force_n", 1.0, "N"),
    ("load force", "load_force_n", 1.0, "N"),
    ("oil temperature", "oil_temperature_c", 1.0, "°C"),
)
"""What a recording may hold: in words, its column, how much of its unit one of the shown unit is, the shown unit."""


@dataclass
class Pane:
    """One recording's part of the page."""

    name: str  # Its anchor
    # Of the recording
    title: str
    outcome: str
    warnings: list[str]
    facts: list[tuple[str, str]]  # Name and value
    view: FrictionView | None  # Its friction; None where it could not be calculated, and then ``problem`` states why
    problem: str
    # ``time``, and as far as they apply ``velocity``, ``position``, ``spectra`` and ``filters``
    figures: dict[str, go.Figure]
    tables: dict[str, Table]  # ``checks`` and, as far as they apply, ``curve``, ``points`` and ``filters``
    friction_n: float = math.nan  # Half of extending less retracting [N]; NaN where unknown
    # Sentences about steady sliding, and about what the filters' figures leave out
    seen: list[str] = field(default_factory=list)
    filter_notes: list[str] = field(default_factory=list)


def recording_pane(
    name: str,
    title: str,
    subject: Inspected,
    cylinder: Cylinder,
    filters: Mapping[str, SignalFilter],
    method: str,
    end_stop_margin_m: float,
    detail: float = 1.0,
) -> Pane:
    """Return the pane; where friction cannot be calculated it states why and shows what was measured.

    Args:
        name, title: Anchor and head of the pane.
        subject: A file or a piece of one, with its recording.
        cylinder: Its areas, stroke and moving mass.
        filters: By name.
        method: Which of them velocity and friction are shown with.
        end_stop_margin_m: Rows this near an end stop are not usable [m].
        detail: Share of the points that figures have at most.
    """
    recording = subject.recording
    assert recording is not None
    try:
        view, problem = friction_view(recording, cylinder, filters[method], end_stop_margin_m), ""
    except ValueError as error:
        view, problem = None, str(error)
    refused = subject.outcome == "refused"
    panels = measured_panels(recording) + (calculated_panels(view) if view is not None else [])
    time_s, points = recording.column("time_s"), max(200, round(detail * LINE_POINTS))
    figures = {"time": over_time(time_s, panels, 2, points)}
    tables = {"checks": _checks(subject)}
    reasons, facts = subject.reasons(), _facts(recording)
    pane = Pane(name, title, subject.outcome, reasons, facts, view, problem, figures, tables)
    if view is None:
        return pane
    if math.isfinite(view.half_difference_n) and not refused:
        pane.friction_n = view.half_difference_n
        pane.facts.insert(0, ("friction: half of extending less retracting", f"{four_digits(pane.friction_n)} N"))
    figures["velocity"] = against_velocity(view, detail)
    stribeck, pane.seen = stribeck_tables(view)
    pane.tables |= stribeck
    if np.any(view.usable & (np.abs(view.signals.velocity_m_s) > view.slowest_m_s)):
        figures["position"] = against_position(view, recording.column("position_m"), detail)
    # What filters make of broken signals states nothing about filters.
    costs, left_out = ([], []) if refused else filter_costs(filters, recording)
    figures["spectra"] = spectra(recording, view, next((cost for cost in costs if cost.name == method), None))
    if not refused:
        _add_filters(pane, costs, left_out)
    return pane


def measured_panels(recording: Recording) -> list[Panel]:
    """Return the panels of what sensors gave, in bar, mm, N and °C."""
    panels = []
    if has_pressures(recording):
        sides = (
            Line("P1, piston side", recording.column("pressure_1_pa") / PA_PER_BAR, ORANGE),
            Line("P2, rod side", recording.column("pressure_2_pa") / PA_PER_BAR, BLUE),
        )
        panels.append(Panel("pressure [bar]", sides))
    position_mm = MM_PER_M * recording.column("position_m")
    panels.append(Panel("position [mm]", (Line("position, 0 retracted", position_mm, INK),)))
    for axis, words, column in (
        ("load [N]", "load force", "load_force_n"),
        ("oil [°C]", "oil temperature", "oil_temperature_c"),
    ):
        if column in recording.table.columns:
            panels.append(Panel(axis, (Line(words, recording.column(column), QUIET),)))
    return panels


def calculated_panels(view: FrictionView) -> list[Panel]:
    """Return the panels of velocity, driving force and friction; friction has gaps where it is not usable."""
    friction_n = np.where(view.usable, view.friction_n, np.nan)
    return [
        Panel(
            "velocity [mm/s]",
            (Line("velocity, extending positive", MM_PER_M * view.signals.velocity_m_s, BLUE),),
        ),
        Panel("force [N]", (Line(view.force_name, view.force_n, QUIET),)),
        Panel("friction [N]", (Line(view.friction_name, friction_n, GREEN),), 1.3),
    ]


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
    for words, column, scale, unit in COLUMNS:
        if column not in recording.table.columns:
            continue
        values = recording.column(column) / scale
        facts.append((words, f"{four_digits(np.min(values))} to {four_digits(np.max(values))} {unit}"))
        if column in about.zero_offset:
            facts.append((f"{words}: zero offset subtracted", f"{about.zero_offset[column] / scale:.4g} {unit}"))
        if column in about.uncertainty:
            known = about.uncertainty[column]
            facts.append((f"{words}: uncertainty", f"± {known.zero / scale:.3g} {unit} and {100.0 * known.span:.3g} %"))
    return facts


def _checks(subject: Inspected) -> Table:
    rows = [(finding.outcome, finding.check, finding.text) for finding in subject.findings]
    rows += [("repaired", "repair", text) for text in subject.all_repairs()]
    rows.sort(key=lambda row: -OUTCOMES.index(row[0]))
    cells = [(Cell(outcome, badge=True, style="words badged"), check, text) for outcome, check, text in rows]
    return Table(("outcome", "check", "found"), cells, words=(1, 2))


def stribeck_tables(view: FrictionView) -> tuple[dict[str, Table], list[str]]:
    """Return the curve's parameters, or the points of steady sliding where none are stated, and what was seen."""
    points, curve = view.points, view.curve
    tables: dict[str, Table] = {}
    seen: list[str] = []
    if curve is not None:
        speeds = [MM_PER_M * abs(point.velocity_m_s) for point in points]
        known = is_breakaway_known(curve, points)
        seen.append(
            f"Fitted to {len(points)} points of steady sliding, {min(speeds):.2g} to {max(speeds):.3g} mm/s, and drawn "
            "no further."
        )
        if not known:
            seen.append("Not seen: friction that rises towards standstill, for which slower sliding is needed.")
        slow = (curve.static_n, MM_PER_M * curve.stribeck_velocity_m_s, curve.stribeck_exponent)
        static, velocity, exponent = (four_digits(value) if known else "not seen" for value in slow)
        rows = [
            ("Coulomb friction, extending", "Fc", four_digits(curve.coulomb_n), "N"),
            ("Coulomb friction, retracting", "ratio · Fc", four_digits(curve.retract_ratio * curve.coulomb_n), "N"),
            ("static friction, extending", "Fs", static, "N"),
            ("Stribeck velocity", "vs", velocity, "mm/s"),
            ("Stribeck exponent", "a", exponent, "–"),
            ("viscous coefficient", "s2", four_digits(curve.viscous_n_s_m), "N·s/m"),
            ("retracting over extending", "ratio", four_digits(curve.retract_ratio), "–"),
        ]
        tables["curve"] = Table(("parameter", "symbol", "value", "unit"), rows, words=(1, 3))
        return tables, seen
    for way, words in ((1.0, "Extending"), (-1.0, "Retracting")):
        sliding = [point for point in points if way * point.velocity_m_s > 0.0]
        if sliding:
            forces = [way * point.friction_n for point in sliding]
            speeds = [MM_PER_M * way * point.velocity_m_s for point in sliding]
            seen.append(
                f"{words}: {four_digits(min(forces))} to {four_digits(max(forces))} N against the motion, at "
                f"{min(speeds):.2g} to {max(speeds):.2g} mm/s."
            )
    if points:
        head = ("velocity [mm/s]", f"{view.friction_name} [N]", "lower quartile [N]", "upper quartile [N]", "rows")
        rows_of_points = [
            (
                f"{MM_PER_M * point.velocity_m_s:.3g}",
                *(four_digits(value) for value in (point.friction_n, point.lower_quartile_n, point.upper_quartile_n)),
                str(point.rows),
            )
            for point in points
        ]
        tables["points"] = Table(head, rows_of_points)
    return tables, seen


def _add_filters(pane: Pane, costs: Sequence[FilterCost], left_out: Sequence[str]) -> None:
    pane.filter_notes = [f"Left out: {words}." for words in left_out]
    if any(math.isnan(cost.velocity_noise_m_s) for cost in costs):
        pane.filter_notes.append("Noise at standstill needs a second of it in all; this recording rests less.")
    if not costs:
        return
    head = ["filter", "use", "pressure", "velocity", "acceleration", f"velocity, {MOTION_HZ:g}\u00a0Hz"]
    head += ["pressure", "velocity", "standstill", "sensor"]
    rows = []
    for cost in costs:
        late = (
            cost.pressure_delay_s,
            cost.velocity_delay_s,
            cost.acceleration_delay_s,
            cost.velocity_delay_in_motion_s,
        )
        rows.append(
            (
                cost.name,
                "real\u00a0time" if cost.causal else "off\u00a0line",
                *(f"{MS_PER_S * delay_s:z.1f}" if math.isfinite(delay_s) else "–" for delay_s in late),
                *(
                    "all" if math.isinf(hz) else f"{hz:.1f}"
                    for hz in (cost.pressure_bandwidth_hz, cost.velocity_bandwidth_hz)
                ),
                *(
                    "–" if math.isnan(noise) else f"{MM_PER_M * noise:.2g}"
                    for noise in (cost.velocity_noise_m_s, cost.velocity_noise_from_sensor_m_s)
                ),
            )
        )
    groups = (("", 2), ("late by [ms]", 4), ("-3 dB at [Hz]", 2), ("velocity noise [mm/s]", 2))
    pane.tables["filters"] = Table(head, rows, words=(1,), groups=groups)
    pane.figures["filters"] = filter_figure(costs)
