"""The pane of one recording on the page: its facts, checks, figures and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from cylinder_friction.evaluation.inspection.filter_costs import FilterCost, filter_costs
from cylinder_friction.evaluation.inspection.friction_view import FrictionView, friction_view
from cylinder_friction.evaluation.inspection.sliding_friction import MeanFriction, friction_finding, sliding_friction
from cylinder_friction.evaluation.inspection.spectra import signal_spectra
from cylinder_friction.evaluation.inspection.subject import Inspected, worst_first
from cylinder_friction.friction_models.identification.steady_points import SteadyPoint
from cylinder_friction.labelling.known_offset import OffsetEvidence, offset_evidence
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.sliding_blocks import OffsetPlan, zero_uncertainty_n
from cylinder_friction.recordings.checks.limits import Finding
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.reporting.inspection.frequency_figures import spectra
from cylinder_friction.reporting.inspection.friction_figures import (
    COLUMNS,
    against_position,
    against_velocity,
    calculated_panels,
    measured_panels,
    stribeck_table,
)
from cylinder_friction.reporting.page import Cell, Table, over_time, packed, page_html
from cylinder_friction.signals.methods import windows_at
from cylinder_friction.signals.smooth_signals import SignalFilter
from cylinder_friction.wording import four_digits

FULL_DETAIL, LEAST_DETAIL = 6, 0.05
"""Most files that are drawn with all points, and the least share of the points of each if there are more."""
LINE_POINTS = 12_000
CLOUD_POINTS = 3000


@dataclass(frozen=True)
class Pane:
    """The pane of a file, or of a piece of one, with its figures drawn: kilobytes, whatever its length."""

    name: str  # Anchor on the page
    subject: Inspected  # The inspected file, without its recording
    html: str  # Packed part of the page
    condition: str = ""  # Condition of its recording
    # From ``sliding_friction``; empty if it could not be calculated, or is not friction alone
    friction: Mapping[str, MeanFriction] = field(default_factory=dict)
    points: tuple[SteadyPoint, ...] = ()  # Points of steady sliding
    offset: OffsetEvidence | None = None  # Evidence of the pressure sensors' offset; None for a refused file


class Panes:
    """Makes panes one after the other; it keeps only the costs of filters at each rate.

    Velocity and friction are shown with the filter ``method``. With more ``files`` each gets fewer points, so that the
    page stays small. ``plan`` and ``no_offset`` are those of ``offset_evidence``, ``in_pipeline`` is that of
    ``windows_at``.

    Attributes:
        costs: By sample time [s]: title of the first usable recording, costs of the filters there, and the filters that
            are left out with the reasons.

    Raises:
        ValueError: The method is not one of the filters.
    """

    def __init__(
        self,
        labeller: Labeller,
        filters: Mapping[str, SignalFilter],
        method: str,
        files: int = 1,
        plan: OffsetPlan | None = None,
        no_offset: str = "",
        *,
        in_pipeline: bool = False,
    ) -> None:
        if method not in filters:
            raise ValueError(f"method: expected one of {', '.join(filters)}, but got {method!r}")
        self.labeller, self.filters, self.method = labeller, filters, method
        self.plan, self.no_offset, self.in_pipeline = plan or OffsetPlan(), no_offset, in_pipeline
        self.detail = min(1.0, max(LEAST_DETAIL, FULL_DETAIL / max(1, files)))
        self.costs: dict[float, tuple[str, list[FilterCost], list[str]]] = {}

    def pane(self, number: int, subject: Inspected) -> Pane:
        """Build the pane of a subject, the page's pane ``number``; if there is no friction it states why."""
        recording, name = subject.recording, f"recording-{number}"
        if recording is None:
            return Pane(name, subject, _packed(subject))
        view, friction, offset, method = None, {}, None, self.filters[self.method]
        if windows := windows_at(method, recording.sample_time_s, in_pipeline=self.in_pipeline):
            subject = replace(subject, findings=[*subject.findings, Finding("filter_windows", "noted", windows)])
        try:
            view = friction_view(recording, self.labeller, method)
        except ValueError as error:
            if subject.outcome != "refused":
                subject = subject.with_findings(_without_friction(error, self.labeller))
        if view is not None and subject.outcome != "refused":
            cylinder, halves = self.labeller.cylinder, (view.load_n, view.half_difference_n)
            offset = offset_evidence(view.labelled, cylinder, self.plan, *halves, self.no_offset)
            friction = sliding_friction(view)
            zero_n = zero_uncertainty_n(view.labelled, cylinder)
            subject = subject.with_findings(friction_finding(view, friction, zero_n, self.plan))
            if self.labeller.load == "position":
                subject = replace(subject, findings=[*subject.findings, Finding("load", "ok", view.load)])
        if subject.outcome == "refused":
            friction = {}
        elif recording.sample_time_s not in self.costs:
            self.costs[recording.sample_time_s] = (subject.title, *filter_costs(self.filters, recording))
        html = _packed(subject, friction=friction, method=self.method, **self._content(recording, view))
        points = view.points if view is not None and friction else ()
        return Pane(
            name, replace(subject, recording=None), html, recording.metadata.condition, friction, points, offset
        )

    def _content(self, recording: Recording, view: FrictionView | None) -> dict[str, Any]:
        """Collect the template's content for a recording that was read."""
        panels = measured_panels(recording) + (calculated_panels(view) if view is not None else [])
        lines, cloud = round(self.detail * LINE_POINTS), round(self.detail * CLOUD_POINTS)
        figures = {"time": over_time(recording.column("time_s"), panels, 2, lines)}
        content = {"facts": _facts(recording), "view": view, "figures": figures}
        if view is None:
            return content
        figures["velocity"] = against_velocity(view, cloud)
        if view.direction.any():
            figures["position"] = against_position(view, recording.column("position_m"), cloud)
        _, costs, _ = self.costs.get(recording.sample_time_s, ("", [], []))
        cost = next((each for each in costs if each.name == self.method), None)
        figures["spectra"] = spectra(signal_spectra(recording, view.signals.velocity_m_s), cost)
        return content | {"curve": stribeck_table(view), "has_cut_off": cost is not None}


def _without_friction(error: ValueError, labeller: Labeller) -> Finding:
    """State why there is no friction. A session may determine a load or mass that one recording does not."""
    if labeller.needs_identification and isinstance(error, RecordingError):
        return Finding("friction", "noted", f"friction is not known from this recording alone: {error}")
    return Finding("friction", "refused", f"friction cannot be calculated: {error}")


def _packed(subject: Inspected, **content: Any) -> str:
    shown = {"facts": [], "figures": {}, "view": None, "friction": {}} | content
    return packed(page_html("templates/pane.html.j2", subject=subject, checks=_checks(subject), **shown))


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
    for _, words, column, scale, unit, _ in COLUMNS:
        if column not in recording.columns:
            continue
        values = recording.column(column) / scale
        facts.append((words, f"{four_digits(np.min(values))} to {four_digits(np.max(values))} {unit}"))
        if column in about.uncertainty:
            known = about.uncertainty[column]
            facts.append((f"{words}: uncertainty", f"± {known.zero / scale:.3g} {unit} and {100.0 * known.span:.3g} %"))
    return facts


def _checks(subject: Inspected) -> Table:
    rows = [
        (Cell(each.outcome, badge=True, style="words badged"), each.check, each.text)
        for each in worst_first(subject.findings)
    ]
    return Table(("outcome", "check", "found"), rows, words=(1, 2))
