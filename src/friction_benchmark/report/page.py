"""The report's page with SVG figures side by side and tables that sort."""

from __future__ import annotations

import html
from dataclasses import dataclass

from cylinder_friction.reporting.report.page import Page

_CSS = """
.frame { grid-template-columns: 12.5rem minmax(0, 76rem); max-width: 94rem; }
nav { overflow-wrap: anywhere; }
svg { display: block; width: 100%; max-width: 640px; height: auto;
  font-family: system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
svg text { fill: #1d2733; } svg text.quiet { fill: #5b6876; } svg text.strong { font-weight: 700; }
main td a { color: var(--accent); text-decoration: none; } main td a:hover { text-decoration: underline; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 29rem), 1fr)); gap: 0 1.6rem; }
.pair figure { min-width: 0; break-inside: avoid; }
figcaption { font-size: .85rem; line-height: 1.4; }
p.facts { color: var(--quiet); font-size: .9rem; }
p.finding { background: var(--wash); border-left: 4px solid var(--accent); padding: .8rem 1.1rem; max-width: 54rem; }
table { font-size: .82rem; }
th { max-width: 8rem; line-height: 1.25; }
th:first-child, td:first-child { position: sticky; left: 0; background: var(--paper); z-index: 1; max-width: 17rem;
  white-space: normal; min-width: 9rem; }
td { vertical-align: baseline; line-height: 1.3; }
td small, th small { display: block; color: inherit; opacity: .78; font-size: .86em; font-weight: 400; }
td.good { color: #004f7c; font-weight: 600; } td.bad { color: #9a3b00; font-weight: 600; }
td.best { background: none; font-weight: 700; outline: 2px solid #1d2733; outline-offset: -2px; }
td.floor { outline: 2px dashed #1d2733; outline-offset: -2px; } tr:has(> td.isfloor) > td { background-color: #f1f3f5; }
td.none { color: #7b8794; text-align: center; }
td.words, th.words { text-align: left; white-space: normal; min-width: 11rem; max-width: 30rem; }
th.group { text-align: center; border-bottom: 1px solid var(--line); color: var(--quiet); font-weight: 500; }
table.heat td { border: 1px solid #fff; text-align: center; vertical-align: middle; }
table.heat td:first-child { text-align: left; }
table.heat th { text-align: center; } table.heat th:first-child { text-align: left; }
table.heat a { color: inherit; }
table.winners td:first-child { min-width: 13rem; max-width: 22rem; }
.sortable thead tr:last-child th { cursor: pointer; }
.sortable th[aria-sort]::after { content: " ▲"; font-size: .75em; }
.sortable th[aria-sort=descending]::after { content: " ▼"; }
.key { display: flex; flex-wrap: wrap; gap: .3rem 1.1rem; font-size: .85rem; color: var(--quiet); align-items: center; }
.key i { display: inline-block; width: 1.1rem; height: .8rem; margin-right: .35rem; vertical-align: -1px; }
dl { display: grid; grid-template-columns: repeat(auto-fill, minmax(12rem, 1fr)); gap: .7rem 1.2rem; }
dt { color: var(--quiet); font-size: .82rem; } dd { margin: 0; }
@media (max-width: 60rem) { body { overflow-x: hidden; } nav { columns: 2; padding: 1rem; }
  nav strong { column-span: all; } nav a { break-inside: avoid; }
  table.heat { font-size: .76rem; } table.heat td, table.heat th { padding: .25rem .3rem; }
  th:first-child, td:first-child { min-width: 7.5rem; max-width: 11rem; } }
@media print { @page { margin: 12mm; } * { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
  html, body { font-size: 11px; } main { padding: 0; } .frame { padding: 0; max-width: none; }
  .scroll { overflow: visible; } table, table.heat { font-size: 8.6px; }
  td, th, table.heat td, table.heat th { padding: .14rem .24rem; min-width: 0 !important; }
  th:first-child, td:first-child { position: static; max-width: 15rem; min-width: 11rem !important; }
  .pair { grid-template-columns: 1fr 1fr; gap: 0 .6rem; } tr, figure { break-inside: avoid; }
  h2, h3, summary { break-after: avoid; } }
"""

_SCRIPT = """
document.addEventListener('click', function (event) {
  var head = event.target.closest('.sortable thead tr:last-child th');
  if (!head) return;
  var column = head.cellIndex, body = head.closest('table').tBodies[0];
  var down = head.getAttribute('aria-sort') === 'ascending';
  head.parentNode.querySelectorAll('[aria-sort]').forEach(function (th) { th.removeAttribute('aria-sort'); });
  head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
  function key(row) {
    var cell = row.cells[column];
    return cell.dataset.value !== undefined ? Number(cell.dataset.value)
      : cell.classList.contains('none') ? null : cell.textContent;
  }
  Array.from(body.rows).map(function (row) { return [key(row), row]; }).sort(function (a, b) {
    if (a[0] === null || b[0] === null) return (a[0] === null) - (b[0] === null);
    var order = typeof a[0] === 'number' && typeof b[0] === 'number' ? a[0] - b[0]
      : String(a[0]).localeCompare(String(b[0]));
    return down ? -order : order;
  }).forEach(function (pair) { body.appendChild(pair[1]); });
});
window.addEventListener('beforeprint', function () {
  document.querySelectorAll('details').forEach(function (fold) { fold.open = true; });
});
"""


@dataclass
class BenchmarkPage(Page):
    """The report's page, which draws nothing with plotly: its figures print, and the file stays small."""

    interactive: bool = False
    head: str = f"<style>{_CSS}</style><script>{_SCRIPT}</script>"

    def part(self, words: str, anchor: str) -> None:
        """Begins a section that links lead to by ``anchor``."""
        self._contents.append((anchor, words))
        self._body.append(f'<h2 id="{html.escape(anchor)}">{html.escape(words)}</h2>')

    def styled(self, words: str, style: str) -> None:
        self._body.append(f'<p class="{style}">{html.escape(words)}</p>')

    def raw(self, content: str) -> None:
        """Add HTML as it is; the caller has escaped what needs it."""
        self._body.append(content)

    def folded_content(self, words: str, content: str) -> None:
        self._body.append(f"<details><summary>{html.escape(words)}</summary>{content}</details>")

    def figures(self, *figures: tuple[str, str]) -> None:
        """Add SVG pictures with their captions; two stand side by side where there is room."""
        self._body.append(figures_html(*figures))


def figures_html(*figures: tuple[str, str]) -> str:
    """Return SVG pictures with their captions; two stand side by side where there is room."""
    shown = "".join(
        f"<figure>{svg}<figcaption>{html.escape(caption)}</figcaption></figure>" for svg, caption in figures
    )
    return f'<div class="pair">{shown}</div>'
