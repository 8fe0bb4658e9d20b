"""One HTML page that needs nothing from outside: typography, contents, sections, plotly.js at most once."""

from __future__ import annotations

import html
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from plotly.offline import get_plotlyjs

if TYPE_CHECKING:
    import plotly.graph_objects as go

    from cylinder_friction.reporting.comparison_tables import Table

_CSS = """
:root { --ink: #1d2733; --quiet: #5b6876; --line: #dfe4ea; --accent: #0072B2; --paper: #ffffff; --wash: #f5f7f9; }
* { box-sizing: border-box; }
body { margin: 0; background: var(--wash); color: var(--ink);
  font: 16px/1.6 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
.frame { display: grid; grid-template-columns: 12rem minmax(0, 72rem); gap: 1.5rem; max-width: 90rem;
  margin: 0 auto; padding: 0 1.5rem; }
nav { position: sticky; top: 0; align-self: start; max-height: 100vh; overflow-y: auto;
  padding: 2.2rem 0; font-size: .92rem; }
nav strong { display: block; margin-bottom: .6rem; }
nav a { display: block; padding: .22rem 0 .22rem .8rem; border-left: 3px solid var(--line); color: var(--quiet);
  text-decoration: none; }
nav a:hover, nav a:focus { color: var(--accent); border-color: var(--accent); }
main { background: var(--paper); padding: 2rem 2rem 4rem; border-left: 1px solid var(--line);
  border-right: 1px solid var(--line); }
h1 { font-size: 1.9rem; line-height: 1.2; margin: .4rem 0 .3rem; }
h2 { font-size: 1.35rem; margin: 2.8rem 0 .6rem; padding-top: .8rem; border-top: 1px solid var(--line); }
h3 { font-size: 1.05rem; margin: 1.6rem 0 .4rem; }
p, li { max-width: 48rem; }
.lead { color: var(--quiet); margin-top: 0; }
ul.summary { background: var(--wash); border-left: 4px solid var(--accent); padding: .9rem 1rem .9rem 2.2rem; }
ul.summary li { margin: .3rem 0; }
.scroll { overflow-x: auto; margin: .8rem 0 1.2rem; }
table { border-collapse: collapse; font-size: .84rem; font-variant-numeric: tabular-nums; }
th { text-align: right; vertical-align: bottom; font-weight: 600; border-bottom: 2px solid var(--ink);
  padding: .35rem .5rem; max-width: 10rem; }
td { text-align: right; border-bottom: 1px solid var(--line); padding: .32rem .5rem; white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: .2rem; }
td.best { font-weight: 700; background: #e4f1f9; }
tbody tr:hover { background: var(--wash); }
figure { margin: 1rem 0 1.6rem; }
figcaption { color: var(--quiet); font-size: .9rem; max-width: 46rem; }
details { margin: .3rem 0; }
summary { cursor: pointer; color: var(--accent); }
code { font-size: .92em; background: var(--wash); padding: .05em .3em; }
@media (max-width: 60rem) { .frame { display: block; padding: 0; } nav { position: static; padding: 1rem; }
  main { padding: 1rem; } }
@media print { nav { display: none; } .frame { display: block; } body { background: #fff; } main { border: 0; } }
"""


@dataclass
class Page:
    """Sections are added in order; ``html`` is the whole page.

    Attributes:
        title: Head of the page.
        lead: One sentence below it.
        interactive: Whether plotly.js, three quarters of such a page, goes along; ``figure`` needs it.
        head: More of the page's head as HTML: styles and scripts.
    """

    title: str
    lead: str
    interactive: bool = True
    head: str = ""
    _contents: list[tuple[str, str]] = field(default_factory=list)
    _body: list[str] = field(default_factory=list)
    _figures: int = 0

    def section(self, words: str) -> None:
        anchor = f"section-{len(self._contents) + 1}"
        self._contents.append((anchor, words))
        self._body.append(f'<h2 id="{anchor}">{html.escape(words)}</h2>')

    def heading(self, words: str) -> None:
        self._body.append(f"<h3>{html.escape(words)}</h3>")

    def text(self, words: str) -> None:
        self._body.append(f"<p>{html.escape(words)}</p>")

    def points(self, sentences: list[str], style: str = "") -> None:
        items = "".join(f"<li>{html.escape(sentence)}</li>" for sentence in sentences)
        self._body.append(f'<ul class="{style}">{items}</ul>')

    def table(self, table: Table) -> None:
        self._body.append(table.html())

    def folded(self, words: str, table: Table) -> None:
        self._body.append(f"<details><summary>{html.escape(words)}</summary>{table.html()}</details>")

    def figure(self, figure: go.Figure, caption: str) -> None:
        """Add an interactive figure; its data stand in the page.

        Raises:
            ValueError: The page goes without plotly.js.
        """
        if not self.interactive:
            raise ValueError(f"expected an interactive page for the figure {caption!r}, but got one without plotly.js")
        self._figures += 1
        name = f"figure-{self._figures}"
        figure.update_layout(
            template="simple_white",
            font={"family": "system-ui, Segoe UI, Roboto, DejaVu Sans, sans-serif", "size": 13},
            margin={"l": 70, "r": 50, "t": figure.layout.margin.t or 80, "b": 50},
            modebar={"orientation": "v"},
            legend={"orientation": "h", "yref": "container", "y": 1.0, "yanchor": "top"},
        )
        figure.update_xaxes(showgrid=True, gridcolor="#E8ECF0", automargin=True)
        figure.update_yaxes(showgrid=True, gridcolor="#E8ECF0", automargin=True)
        content = figure.to_json(validate=False).replace("</", "<\\/")
        height = int(figure.layout.height or 420)
        self._body.append(
            f'<figure><div id="{name}" style="height:{height}px"></div>'
            f"<figcaption>{html.escape(caption)}</figcaption></figure>"
            f'<script>draw("{name}", {content});</script>'
        )

    def html(self) -> str:
        links = "".join(f'<a href="#{anchor}">{html.escape(words)}</a>' for anchor, words in self._contents)
        plotly = f"<script>{get_plotlyjs()}</script>" if self.interactive else ""
        return (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{html.escape(self.title)}</title><style>{_CSS}</style>{plotly}"
            "<script>function draw(name, figure) { Plotly.newPlot(name, figure.data, figure.layout,"
            f" {{responsive: true, displaylogo: false, showSendToCloud: false}}); }}</script>{self.head}</head>"
            f'<body><div class="frame"><nav><strong>Contents</strong>{links}</nav>'
            f"<main><h1>{html.escape(self.title)}</h1>"
            f'<p class="lead">{html.escape(self.lead)}</p>{"".join(self._body)}</main></div></body></html>\n'
        )
