"""HTML tables whose columns sort and whose cells may be coloured."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

_INK, _WHITE = "#1d2733", "#ffffff"
_BLUE, _ORANGE = (0, 114, 178), (213, 94, 0)


@dataclass(frozen=True)
class Cell:
    """One cell.

    Attributes:
        words: What stands in it.
        small: What stands below that, smaller.
        value: What its column is sorted by; None for words, and for nothing.
        shade: -1 is full blue (good), 1 full orange (bad), 0 white; None leaves it alone.
        style: CSS classes.
        tip: What shows below the mouse.
        link: Where the words lead.
    """

    words: str
    small: str = ""
    value: float | None = None
    shade: float | None = None
    style: str = ""
    tip: str = ""
    link: str = ""

    def html(self, tag: str = "td") -> str:
        attributes = f' class="{self.style}"' if self.style else ""
        if self.value is not None and math.isfinite(self.value):
            attributes += f' data-value="{self.value:.9g}"'
        if self.shade is not None and math.isfinite(self.shade):
            paper, ink = shade(self.shade)
            attributes += f' style="background:{paper};color:{ink}"'
        if self.tip:
            attributes += f' title="{html.escape(self.tip)}"'
        content = html.escape(self.words)
        if self.link:
            content = f'<a href="{html.escape(self.link)}">{content}</a>'
        if self.small:
            content += f"<small>{html.escape(self.small)}</small>"
        return f"<{tag}{attributes}>{content}</{tag}>"


def shade(strength: float) -> tuple[str, str]:
    """Return paper and ink: from blue over white to orange, with letters that stay legible."""
    strength = max(-1.0, min(1.0, strength))
    tone, mix = (_BLUE if strength < 0.0 else _ORANGE), 0.7 * abs(strength)
    paper = [round(255 + mix * (part - 255)) for part in tone]
    light = sum(weight * _linear(part) for weight, part in zip((0.2126, 0.7152, 0.0722), paper, strict=True))
    ink = _WHITE if 1.05 / (light + 0.05) > (light + 0.05) / (_ink_light() + 0.05) else _INK
    return "#" + "".join(f"{part:02x}" for part in paper), ink


def _linear(part: int) -> float:
    """The luminance of one colour part (WCAG 2)."""
    value = part / 255.0
    return float(value / 12.92 if value <= 0.04045 else ((value + 0.055) / 1.055) ** 2.4)


def _ink_light() -> float:
    parts = (int(_INK[index : index + 2], 16) for index in (1, 3, 5))
    return sum(weight * _linear(part) for weight, part in zip((0.2126, 0.7152, 0.0722), parts, strict=True))


def table(
    head: Sequence[Cell],
    rows: Sequence[Sequence[Cell]],
    groups: Sequence[tuple[str, int]] = (),
    style: str = "",
    sortable: bool = True,
) -> str:
    """Return a table; the first column stays in sight where the rest must be scrolled.

    Args:
        head: Of every column; a click sorts by it.
        rows: As many cells each.
        groups: What so many columns, from the left, have in common; stands above the head.
        style: CSS class of the table.
        sortable: Whether a click on the head sorts.
    """
    over = "".join(f'<th class="group" colspan="{width}">{html.escape(words)}</th>' for words, width in groups)
    over = f"<tr>{over}</tr>" if groups else ""
    top = "".join(cell.html("th") for cell in head)
    body = "".join(f"<tr>{''.join(cell.html() for cell in row)}</tr>" for row in rows)
    kind = f"{style} sortable".strip() if sortable else style
    return (
        f'<div class="scroll"><table class="{kind}"><thead>{over}<tr>{top}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )
