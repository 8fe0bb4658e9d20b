"""Write the page of a fleet's health, and the panes of its cylinders."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.reporting.frame import NONE, Cell, Table, packed, page_html
from cylinder_friction_monitoring.errors import Refused
from cylinder_friction_monitoring.page.health_figures import TITLES, life_figure, strokes_figure, trend_picture
from cylinder_friction_monitoring.trends.assessment import NE107, Answer, Assessment, Change, Entry
from cylinder_friction_monitoring.trends.cylinder_line import CylinderLine, digits
from cylinder_friction_monitoring.trends.sentences import rate
from cylinder_friction_monitoring.trends.session_row import INDICATORS, SessionRow

BADGES: Mapping[Answer, str] = {
    "alarm": "refused",
    "undecided": "noted",
    "watch": "repaired",
    "not yet": "quiet",
    "fine": "ok",
}
"""Colour of each answer on the page."""
LISTED = 200  # Most refused logs and news on the page; health.json lists all


def write_health_page(
    path: Path, lines: Sequence[CylinderLine], refused: Sequence[Refused], news: Sequence[str]
) -> None:
    """Write the page of a fleet, in the order of ``lines``, the most urgent first. Equal input gives equal bytes."""
    counts = Counter[str](each.answer for each in lines)
    html = page_html(
        "templates/health.html.j2",
        package=__package__,
        title="Health of the fleet",
        lines=lines,
        answers=[(answer, counts[answer], BADGES[answer]) for answer in BADGES if counts[answer]],
        badges=BADGES,
        picture=trend_picture,
        newest=max((each.last_start for each in lines), default="")[:10],
        refused=[(each.where, each.reason) for each in refused[:LISTED]],
        more_refused=max(len(refused) - LISTED, 0),
        news=news[:LISTED],
        more_news=max(len(news) - LISTED, 0),
    )
    write_text(path, html)


def health_pane(
    found: Assessment,
    rows: Sequence[SessionRow],
    entries: Sequence[Entry],
    left_out: Mapping[str, str],
    about: str = "",
) -> str:
    """Draw the pane of one cylinder, as a script that passes it to the page. Equal input gives equal text.

    ``rows`` are all its sessions in the order of time; ``left_out`` states why sessions are not assessed; ``about`` is
    the fleet file's text on the cylinder.
    """
    used = [row for row in rows if row.session not in left_out]
    then, now = _two(found, used)
    html = page_html(
        "templates/health_pane.html.j2",
        package=__package__,
        title=found.cylinder,
        found=found,
        about=about,
        badge=BADGES[found.answer],
        ne107=NE107[found.answer],
        facts=[fact for change in found.changes[:1] for fact in _facts(change, used)],
        changes=_changes(found.changes) if found.changes else None,
        life=life_figure(found, used, entries) if used else None,
        strokes=None if then is None or now is None else strokes_figure(then, now),
        undetermined=_undetermined(used),
        baselines=_baselines(found),
        entries=_entries(entries) if entries else None,
        left_out=list(left_out.items()),
    )
    return f"pane({json.dumps(found.cylinder)}, {json.dumps(packed(html, 6))});\n"


def _two(found: Assessment, rows: Sequence[SessionRow]) -> tuple[SessionRow | None, SessionRow | None]:
    """Select two sessions with strokes in both directions: one of the baseline, or else the first, and the newest."""
    drawn = [row for row in rows if len(row.stroke) == 2]
    if len(drawn) < 2:
        return None, None
    trend = found.trends.get(found.changes[0].indicator if found.changes else "friction_n")
    last = trend.baseline.last if trend and trend.baseline else drawn[0].session
    names = [row.session for row in drawn]
    return drawn[names.index(last) if last in names else 0], drawn[-1]


def _facts(change: Change, rows: Sequence[SessionRow]) -> list[tuple[str, str]]:
    unit, name, _, factor = INDICATORS[change.indicator]
    starts = {row.session: row.start[:10] or row.session for row in rows}

    def day(session: str) -> str:
        return starts.get(session, session)

    facts = [(f"change of {name}", _with_interval(change.change, change.interval, unit, factor))]
    if change.percent is not None:
        facts.insert(0, ("change", _with_interval(change.percent, change.percent_interval, "%")))
    facts.append(("since", f"{day(change.since)} ({' to '.join(map(day, change.since_interval))})"))
    facts.append(("alarm at", day(change.alarm_session)))
    if change.per_year is not None:
        part, period = rate(change)
        words = _with_interval(change.per_year, change.per_year_interval, f"{unit} a {period}", factor * part)
        facts.append(("rate now", words))
    if change.limit_reached:
        title = "limit passed since" if change.limit_passed else "limit reached"
        ends = " to ".join(each or "open" for each in change.limit_interval or ())
        facts.append((title, f"{change.limit_reached} ({ends})" if ends else change.limit_reached))
    if change.beside:
        facts.append(("beside it", "; ".join(change.beside)))
    return facts


def _with_interval(value: float, interval: tuple[float, float] | None, unit: str, factor: float = 1.0) -> str:
    words = f"{digits(factor * value)} {unit}"
    return words if interval is None else f"{words} ({' to '.join(digits(factor * each) for each in interval)})"


def _changes(changes: Sequence[Change]) -> Table:
    columns: dict[str | Cell, Callable[[Change], str | Cell]] = {
        "indicator": lambda it: INDICATORS[it.indicator].name,
        "change (95 %)": lambda it: _with_interval(
            it.change, it.interval, INDICATORS[it.indicator].unit, INDICATORS[it.indicator].factor
        ),
        "of the baseline": lambda it: (
            "–" if it.percent is None else _with_interval(it.percent, it.percent_interval, "%")
        ),
        "since session": lambda it: it.since,
        "alarm at": lambda it: it.alarm_session,
    }
    return Table.of(changes, columns, words=(1, 2, 3, 4))


def _baselines(found: Assessment) -> Table:
    rows: list[list[str | Cell]] = []
    for name, trend in found.trends.items():
        base = trend.baseline
        if base is None:
            rows.append([TITLES[name], *[NONE] * 7, Cell(trend.why, style="words")])
            continue
        factor = INDICATORS[name].factor
        cells = [f"{base.sessions}", f"{factor * base.level:.4g}", f"{factor * base.scatter:.3g}"]
        cells += [f"{factor * base.smallest:.3g}", f"{base.autocorrelation:.2f}", f"{base.threshold:.3g}"]
        named = Cell(f"{base.first} to {base.last}{trend.why and '; '}{trend.why}", style="words")
        rows.append([TITLES[name], *cells, f"{base.false_alarms_per_year:.2g}", named])
    head = (
        "indicator",
        Cell("sessions", tip="of which the baseline is made"),
        Cell("level", tip="at the reference oil, pressure, speed and load, in the indicator's unit"),
        Cell("scatter", tip="standard deviation of single sessions about it"),
        Cell("smallest", tip="lasting change that the test can find, in the indicator's unit"),
        Cell("autocorrelation", tip="of neighbouring sessions"),
        Cell("threshold", tip="of the cumulative sums, in standard deviations"),
        Cell("false alarms a year", tip="that this threshold gives with this baseline"),
        "baseline",
    )
    return Table(head, rows, words=(8,))


def _entries(entries: Sequence[Entry]) -> Table:
    rows = [(each.time[:16].replace("T", " "), each.kind, each.name, each.stated) for each in entries]
    return Table(("time (UTC)", "kind", "name", "words"), rows, words=(1, 2, 3))


def _undetermined(rows: Sequence[SessionRow]) -> list[tuple[str, str]]:
    """List the indicators that the newest session does not determine, and why."""
    known = rows[-1].indicators if rows else {}
    return [(each.name, known[key].why) for key, each in INDICATORS.items() if key in known and known[key].why]
