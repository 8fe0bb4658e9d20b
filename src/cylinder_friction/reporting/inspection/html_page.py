"""One HTML file that needs nothing from outside: a list of panes at the left, one pane shown at a time."""

from __future__ import annotations

import html
import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plotly.offline import get_plotlyjs

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    import plotly.graph_objects as go

_CSS = """
:root { --ink: #1d2733; --quiet: #5b6876; --line: #dfe4ea; --accent: #0072B2; --paper: #ffffff; --wash: #f5f7f9; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--wash); color: var(--ink);
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
.frame { display: grid; grid-template-columns: 17rem minmax(0, 78rem); max-width: 98rem; margin: 0 auto; }
nav { position: sticky; top: 0; align-self: start; height: 100vh; overflow-y: auto; padding: 1.6rem 1rem 2rem 1.2rem;
  font-size: .88rem; }
nav a { display: flex; gap: .5rem; align-items: baseline; padding: .25rem .5rem; border-radius: 4px; color: var(--ink);
  text-decoration: none; overflow-wrap: anywhere; }
nav a:hover { background: #e8edf2; }
nav a[aria-current] { background: #dcebf5; font-weight: 600; }
nav .dot { flex: none; width: .6rem; height: .6rem; border-radius: 50%; }
main { background: var(--paper); padding: 1.6rem 2rem 4rem; border: 1px solid var(--line); border-width: 0 1px;
  min-height: 100vh; min-width: 0; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .4rem; overflow-wrap: anywhere; }
h2 { font-size: 1.12rem; margin: 2rem 0 .4rem; padding-top: .7rem; border-top: 1px solid var(--line); }
p, li { max-width: 56rem; }
p.quiet, figcaption { color: var(--quiet); font-size: .92rem; max-width: 60rem; }
p.warning { background: #fdf3e1; border-left: 4px solid #c77700; padding: .6rem .9rem; }
.scroll { overflow-x: auto; margin: .6rem 0 1rem; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th { text-align: left; vertical-align: bottom; border-bottom: 2px solid var(--ink); padding: .35rem .6rem; }
td { text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); padding: .32rem .6rem; }
th.number, td.number { text-align: right; } th.number { max-width: 7.2rem; } td.number { white-space: nowrap; }
th.group { text-align: center; border-bottom: 1px solid var(--line); padding-bottom: .15rem; color: var(--quiet);
  font-weight: 500; white-space: nowrap; }
.compact th, .compact td { padding-left: .35rem; padding-right: .35rem; } .compact th:not(.group) { font-size: .82rem; }
td.words { min-width: 16rem; max-width: 46rem; overflow-wrap: anywhere; }
tbody tr:hover { background: var(--wash); }
.badge { display: inline-block; padding: .02rem .5rem; border-radius: 1rem; font-size: .82rem; font-weight: 600;
  white-space: nowrap; }
.ok { background: #d9f0e4; color: #00573f; } .noted { background: #dcebf5; color: #004f7c; }
.repaired { background: #fbe7c6; color: #7a4a00; } .refused { background: #f8d8d3; color: #8c1d0c; }
.counts { display: flex; gap: .8rem; flex-wrap: wrap; margin: .8rem 0 1.2rem; padding: 0; }
.counts button { border: 1px solid var(--line); border-radius: 6px; background: var(--paper); padding: .4rem .9rem;
  font: inherit; cursor: pointer; } .counts button[aria-pressed=true] { border-color: var(--accent);
  box-shadow: inset 0 0 0 1px var(--accent); } .counts strong { font-size: 1.25rem; margin-right: .35rem; }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(11rem, 1fr)); gap: .7rem 1.2rem; margin: 1rem 0; }
dt { color: var(--quiet); font-size: .82rem; }
dd { margin: 0; overflow-wrap: anywhere; font-variant-numeric: tabular-nums; }
section { scroll-margin-top: 10rem; }
figure { margin: .6rem 0 1rem; }
details { margin: .2rem 0; } summary { cursor: pointer; color: var(--accent); }
@media (max-width: 62rem) { .frame { display: block; } nav { position: static; height: auto; max-height: 14rem; }
  main { padding: 1rem; } }
"""

_SCRIPT = """
function draw(pane) {
  pane.querySelectorAll('script[data-figure]').forEach(function (source) {
    var place = document.getElementById(source.dataset.figure);
    if (place.dataset.drawn) return;
    place.dataset.drawn = '1';
    var figure = JSON.parse(source.textContent);
    Plotly.newPlot(place, figure.data, figure.layout, {responsive: true, displaylogo: false});
  });
}
function show() {
  var wanted = location.hash.slice(1), panes = document.querySelectorAll('main > section');
  var chosen = document.getElementById(wanted) || panes[0];
  panes.forEach(function (pane) { pane.hidden = pane !== chosen; });
  document.querySelectorAll('nav a').forEach(function (link) {
    if (link.hash === '#' + chosen.id) link.setAttribute('aria-current', 'page');
    else link.removeAttribute('aria-current');
  });
  window.scrollTo(0, 0);
  draw(chosen);
}
function only(button) {
  var was = button.getAttribute('aria-pressed') === 'true';
  document.querySelectorAll('.counts button').forEach(function (other) {
    other.setAttribute('aria-pressed', 'false');
  });
  button.setAttribute('aria-pressed', was ? 'false' : 'true');
  document.querySelectorAll('tr[data-outcome]').forEach(function (row) {
    row.hidden = !was && row.dataset.outcome !== button.dataset.outcome;
  });
}
window.addEventListener('hashchange', show);
window.addEventListener('DOMContentLoaded', show);
"""

DOTS = {"ok": "#009E73", "noted": "#0072B2", "repaired": "#E69F00", "refused": "#C6361F"}


@dataclass
class Pane:
    """One screen of the page; parts are added in order.

    Attributes:
        name: Its anchor: letters, digits and hyphens.
        title: Head of the pane and its entry in the list.
        outcome: Colour of the dot beside that entry; empty for none.
    """

    name: str
    title: str
    outcome: str = ""
    parts: list[str] = field(default_factory=list)
    figures: int = 0

    def heading(self, words: str) -> None:
        self.parts.append(f"<h2>{html.escape(words)}</h2>")

    def text(self, words: str, style: str = "") -> None:
        self.parts.append(f'<p class="{style}">{html.escape(words)}</p>')

    def raw(self, content: str) -> None:
        """Add HTML as it is; the caller has escaped what needs it."""
        self.parts.append(content)

    def facts(self, facts: Iterable[tuple[str, str]]) -> None:
        entries = "".join(f"<div><dt>{html.escape(a)}</dt><dd>{html.escape(b)}</dd></div>" for a, b in facts)
        self.parts.append(f"<dl>{entries}</dl>")

    def table(
        self,
        head: Sequence[str],
        rows: Iterable[Sequence[str]],
        words: Sequence[int] = (0,),
        groups: Sequence[tuple[str, int]] = (),
    ) -> None:
        """Add a table; columns named in ``words`` hold text, the others numbers, to the right.

        ``groups`` stand above the head: what so many columns, from the left, have in common.
        """
        style = ["" if column in words else "number" for column in range(len(head))]
        top = "".join(f'<th class="{style[column]}">{html.escape(cell)}</th>' for column, cell in enumerate(head))
        kind = ' class="compact"' if groups else ""
        if groups:
            over = "".join(f'<th class="group" colspan="{width}">{html.escape(name)}</th>' for name, width in groups)
            top = f"{over}</tr><tr>{top}"
        body = "".join(
            "<tr>"
            + "".join(f'<td class="{style[column]}">{html.escape(cell)}</td>' for column, cell in enumerate(row))
            + "</tr>"
            for row in rows
        )
        self.parts.append(
            f'<div class="scroll"><table{kind}><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'
        )

    def figure(self, figure: go.Figure, caption: str) -> None:
        """Add an interactive figure; it is drawn when the pane is first shown."""
        self.figures += 1
        name = f"{self.name}-figure-{self.figures}"
        content = figure.to_json(validate=False).replace("<", "\\u003c")
        self.parts.append(
            f'<figure><div id="{name}" style="height:{int(figure.layout.height)}px"></div>'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            f'<script type="application/json" data-figure="{name}">{content}</script>'
        )

    def html(self) -> str:
        return f'<section id="{self.name}"><h1>{html.escape(self.title)}</h1>{"".join(self.parts)}</section>'


def breakable(path: str) -> str:
    """Return a path as HTML that may be broken into lines behind its separators."""
    return re.sub(r"([/_-])", r"\1<wbr>", html.escape(path))


def badge(outcome: str) -> str:
    """Return an outcome as HTML: its word on its colour."""
    return f'<span class="badge {html.escape(outcome)}">{html.escape(outcome)}</span>'


def four_digits(value: float) -> str:
    """Return a number with four digits and no power of ten in between."""
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def page_html(title: str, panes: Sequence[Pane]) -> str:
    """Return the whole page."""
    links = "".join(_link(pane) for pane in panes)
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{html.escape(title)}</title><style>{_CSS}</style>"
        f"<script>{get_plotlyjs()}</script><script>{_SCRIPT}</script></head>"
        f'<body><div class="frame"><nav>{links}</nav><main>{"".join(pane.html() for pane in panes)}</main></div>'
        "</body></html>\n"
    )


def _link(pane: Pane) -> str:
    colour = DOTS.get(pane.outcome, "transparent")
    return (
        f'<a href="#{pane.name}"><span class="dot" style="background:{colour}" title="{html.escape(pane.outcome)}">'
        f"</span><span>{breakable(pane.title)}</span></a>"
    )
