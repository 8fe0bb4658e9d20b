"""A small SVG canvas: marks, lines, text, and axes with a linear or a logarithmic scale."""

from __future__ import annotations

import html
import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

WIDTH = 560.0
"""Of every figure [px]; two stand side by side on a wide screen, so that letters keep their size."""

LETTER = 0.52
"""Mean width of a letter as a share of its size."""

_LOG_STEPS = ((1,), (1, 2, 5), (1, 1.5, 2, 3, 4, 5, 7))
"""Ticks within a decade, from coarse to fine."""


@dataclass(frozen=True)
class Scale:
    """Values to pixels."""

    low: float
    high: float
    start: float
    end: float
    logarithmic: bool = False

    def __call__(self, value: float) -> float:
        a, b = (math.log(self.low), math.log(self.high)) if self.logarithmic else (self.low, self.high)
        v = math.log(max(value, 1e-300)) if self.logarithmic else value
        share = min(1.0, max(0.0, (v - a) / (b - a)))
        return self.start + share * (self.end - self.start)

    def ticks(self, most: int = 9) -> list[float]:
        """Return round values within the scale: as many as ``most``, where that is possible."""
        if self.logarithmic:
            powers = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
            choices = [
                [tick for power in powers for step in steps if self.low <= (tick := step * 10.0**power) <= self.high]
                for steps in _LOG_STEPS
            ]
            return max((ticks for ticks in choices if len(ticks) <= most), key=len, default=choices[0])
        step = next(
            s for s in (k * 10.0**p for p in range(-4, 6) for k in (1, 2, 5)) if (self.high - self.low) / s < most
        )
        first = math.ceil(self.low / step - 1e-9)
        return [n * step for n in range(first, math.floor(self.high / step + 1e-9) + 1)]


def logarithmic(values: Iterable[float], start: float, end: float, room: float = 1.15, least: float = 3.0) -> Scale:
    """Return a logarithmic scale that holds the positive values with some room and spans a factor ``least``."""
    inside = [value for value in values if math.isfinite(value) and value > 0.0] or [1.0]
    low, high = min(inside) / room, max(inside) * room
    if high / low < least:
        widen = math.sqrt(least * low / high)
        low, high = low / widen, high * widen
    return Scale(low, high, start, end, logarithmic=True)


def text_width(words: str, size: float) -> float:
    """Return about how wide words are [px]."""
    return LETTER * size * len(words)


@dataclass
class Drawing:
    """Elements are drawn in the order they are added; ``svg`` is the picture."""

    height: float
    words: str
    width: float = WIDTH
    _parts: list[str] = field(default_factory=list)

    def line(self, x1: float, y1: float, x2: float, y2: float, colour: str, width: float = 1.0, dash: str = "") -> None:
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(
            f'<line x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}" stroke="{colour}" '
            f'stroke-width="{width:g}"{dashed}/>'
        )

    def path(self, points: Sequence[tuple[float, float]], colour: str, width: float = 1.5, dash: str = "") -> None:
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        route = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self._parts.append(
            f'<polyline points="{route}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashed}/>'
        )

    def box(self, x: float, y: float, width: float, height: float, colour: str, opacity: float = 1.0) -> None:
        self._parts.append(
            f'<rect x="{x:.1f}" y="{y:.1f}" width="{max(width, 0.0):.1f}" height="{height:.1f}" fill="{colour}" '
            f'opacity="{opacity:g}"/>'
        )

    def text(
        self, x: float, y: float, words: str, anchor: str = "start", size: float = 12.0, style: str = "", tip: str = ""
    ) -> None:
        """Add words; ``style`` is ``quiet``, ``strong`` or nothing, ``tip`` shows below the mouse."""
        shown = f' class="{style}"' if style else ""
        hint = f"<title>{html.escape(tip)}</title>" if tip else ""
        self._parts.append(
            f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size:g}"{shown}>{hint}'
            f"{html.escape(words)}</text>"
        )

    def mark(
        self, x: float, y: float, shape: str, colour: str, size: float = 5.0, tip: str = "", hollow: bool = False
    ) -> None:
        """Add a circle, square, triangle, diamond or cross of about ``size`` pixels' radius."""
        hint = f"<title>{html.escape(tip)}</title>" if tip else ""
        paint = f'fill="#fff" stroke="{colour}" stroke-width="1.8"' if hollow else f'fill="{colour}" stroke="#fff"'
        if shape == "circle":
            self._parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{size:g}" {paint}>{hint}</circle>')
            return
        route = " ".join(f"{x + size * a:.1f},{y + size * b:.1f}" for a, b in SHAPES[shape])
        self._parts.append(f'<polygon points="{route}" {paint}>{hint}</polygon>')

    def legend(self, entries: Iterable[tuple[str, str, str]], x: float, y: float, hollow: Sequence[str] = ()) -> None:
        """Add words behind their marks in one row: (words, colour, shape) each."""
        for words, colour, shape in entries:
            self.mark(x + 5.0, y - 4.0, shape, colour, 4.6, hollow=words in hollow)
            self.text(x + 14.0, y, words, size=11.5)
            x += 30.0 + text_width(words, 11.5)

    def across(self, scale: Scale, top: float, bottom: float, form: Callable[[float], str], words: str) -> None:
        """Add a horizontal axis: grid lines from top to bottom, numbers below, words below them."""
        for tick in scale.ticks(8):
            self.line(scale(tick), top, scale(tick), bottom, "#E3E8ED")
            self.text(scale(tick), bottom + 14.0, form(tick), "middle", 11.0, "quiet")
        self.text(0.5 * (scale.start + scale.end), bottom + 31.0, words, "middle", 11.5, "quiet")

    def up(self, scale: Scale, left: float, right: float, form: Callable[[float], str], words: str) -> None:
        """Add a vertical axis: grid lines from left to right, numbers at the left, words above the numbers."""
        for tick in scale.ticks(8):
            self.line(left, scale(tick), right, scale(tick), "#E3E8ED")
            self.text(left - 6.0, scale(tick) + 4.0, form(tick), "end", 11.0, "quiet")
        self.text(4.0, scale.end - 12.0, words, "start", 11.5, "quiet")

    def svg(self) -> str:
        return (
            f'<svg viewBox="0 0 {self.width:g} {self.height:g}" role="img" aria-label="{html.escape(self.words)}">'
            f"{''.join(self._parts)}</svg>"
        )


SHAPES: dict[str, tuple[tuple[float, float], ...]] = {
    "square": ((-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)),
    "triangle": ((0.0, -1.15), (1.05, 0.8), (-1.05, 0.8)),
    "down": ((0.0, 1.15), (1.05, -0.8), (-1.05, -0.8)),
    "diamond": ((0.0, -1.25), (1.25, 0.0), (0.0, 1.25), (-1.25, 0.0)),
    "cross": (
        (-0.4, -1.15),
        (0.4, -1.15),
        (0.4, -0.4),
        (1.15, -0.4),
        (1.15, 0.4),
        (0.4, 0.4),
        (0.4, 1.15),
        (-0.4, 1.15),
        (-0.4, 0.4),
        (-1.15, 0.4),
        (-1.15, -0.4),
        (-0.4, -0.4),
    ),
}
"""Corners of every shape but the circle, in units of its size."""
