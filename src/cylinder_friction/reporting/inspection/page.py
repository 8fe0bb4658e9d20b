"""The inspection of a file or a folder as one HTML page: friction and verdict of every file, and a pane for each."""

import math
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean

from cylinder_friction.evaluation.inspection.filter_costs import MOTION_HZ, FilterCost
from cylinder_friction.evaluation.inspection.sliding_friction import WAYS
from cylinder_friction.evaluation.inspection.subject import OUTCOMES, VERDICTS, count_outcomes
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.reporting.friction_page import offset_table
from cylinder_friction.reporting.inspection.frequency_figures import MM_PER_M, MS_PER_S, filter_figure
from cylinder_friction.reporting.inspection.friction_figures import compared, of_files
from cylinder_friction.reporting.inspection.recording_pane import Pane, Panes
from cylinder_friction.reporting.page import NONE, Cell, Table, page_html


def write_page(path: Path, panes: Sequence[Pane], made_by: Panes, offsets: Sequence[KnownOffset] = ()) -> None:
    """Write the page whole; equal input makes equal bytes."""
    counts = count_outcomes([pane.subject for pane in panes])
    html = page_html(
        "templates/inspection.html.j2",
        title="Inspection of recordings",
        counts=[(outcome, counts[outcome], VERDICTS[outcome]) for outcome in OUTCOMES if counts[outcome]],
        means=_means(panes),
        files=_files(panes),
        friction=of_files([(pane.subject.title, pane.friction) for pane in panes]),
        offsets=offset_table(offsets) if offsets else None,
        comparison=compared({pane.subject.title: pane.points for pane in panes}),
        panes=panes,
        filters=[
            (f"{1.0 / step_s:g}", title, filter_figure(costs), _filter_table(costs), _filter_notes(costs, left_out))
            for step_s, (title, costs, left_out) in made_by.costs.items()
            if costs
        ],
    )
    write_text(path, html)


def _means(panes: Sequence[Pane]) -> list[tuple[str, str]]:
    """List each condition and the mean friction of its files, by direction, in words."""
    conditions: dict[str, dict[str, list[float]]] = {}
    for pane in panes:
        for way, friction in pane.friction.items():
            conditions.setdefault(pane.condition, {}).setdefault(way, []).append(friction.mean_n)
    return [(name, ", ".join(_mean(way, n) for way, n in ways.items())) for name, ways in conditions.items()]


def _mean(way: str, values: Sequence[float]) -> str:
    spread = f" ({min(values):z.0f} to {max(values):z.0f} N)" if len(values) > 1 else ""
    return f"{fmean(values):z.0f} N {way}{spread}"


def _files(panes: Sequence[Pane]) -> Table:
    """Tabulate the files or pieces: friction, outcome and verdict."""
    rows: list[list[str | Cell]] = []
    for number, pane in enumerate(panes, start=1):
        subject = pane.subject
        friction = [
            Cell(str(pane.friction[way]), value=pane.friction[way].mean_n) if way in pane.friction else NONE
            for way in WAYS
        ]
        title = Cell(f"{number}. {subject.title}", value=number, link=f"#{pane.name}")
        outcome = Cell(subject.outcome, badge=True, style="words badged")
        verdict = Cell(subject.verdict, more=subject.reasons[1:], style="words")
        rows.append([title, *friction, outcome, verdict])
    tip = "mean against the motion while sliding, with its 95 % interval"
    head: list[str | Cell] = ["file", *(Cell(f"{way} [N]", tip=tip) for way in WAYS), "outcome", "verdict"]
    outcomes = [pane.subject.outcome for pane in panes]
    return Table(head, rows, words=(3, 4), style="stacked", sortable=True, outcomes=outcomes)


def _filter_notes(costs: Sequence[FilterCost], left_out: Sequence[str]) -> str:
    notes = [f"Left out: {words}." for words in left_out]
    if any(math.isnan(cost.velocity_noise_m_s) for cost in costs):
        notes.append("Noise at standstill needs a second of it in all; that recording rests less.")
    return " ".join(notes)


def _filter_table(costs: Sequence[FilterCost]) -> Table:
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
    return Table(head, rows, groups=groups)
