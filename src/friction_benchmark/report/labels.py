"""Names beside marks, placed one after the other so that none covers a mark, a line or another name."""

from __future__ import annotations

from dataclasses import dataclass, field

from friction_benchmark.report.drawing import Drawing, text_width

LABEL = 11.0
_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (1, -1), (-1, 1), (-1, -1))
_ANCHORS = {1: "start", 0: "middle", -1: "end"}


@dataclass(frozen=True)
class Box:
    """A rectangle [px]."""

    left: float
    top: float
    right: float
    bottom: float

    def meets(self, other: Box) -> bool:
        across = self.left < other.right and other.left < self.right
        return across and self.top < other.bottom and other.top < self.bottom

    def within(self, other: Box) -> bool:
        across = other.left <= self.left and self.right <= other.right
        return across and other.top <= self.top and self.bottom <= other.bottom


@dataclass
class Labels:
    """Places names on a drawing.

    Attributes:
        drawing: What they are written on.
        frame: Left, top, right and bottom that names stay within [px].
        taken: What names keep clear of, those already written among it.
    """

    drawing: Drawing
    frame: tuple[float, float, float, float]
    taken: list[Box] = field(default_factory=list)

    def keep_clear(self, place: tuple[float, float], reach: float) -> None:
        """No name will cover the square around a place."""
        x, y = place
        self.taken.append(Box(x - reach, y - reach, x + reach, y + reach))

    def keep_clear_line(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """No name will cover a level or upright line."""
        (x1, y1), (x2, y2) = start, end
        self.taken.append(Box(min(x1, x2) - 1.0, min(y1, y2) - 1.0, max(x1, x2) + 1.0, max(y1, y2) + 1.0))

    def add(self, place: tuple[float, float], words: str, strong: bool) -> bool:
        """Write a name beside its mark, or near it with a thin line to it; returns whether there was room.

        A strong name is bold and looks for room further away than others.
        """
        width, half = text_width(words, LABEL) * (1.12 if strong else 1.0), 0.5 * LABEL + 0.5
        for away in (10.0, 22.0, 36.0, 52.0, 70.0) if strong else (10.0, 22.0):
            for side, rise in _SIDES:
                x, y = place[0] + away * side, place[1] - rise * (away + 2.0)
                left = x - 0.5 * width * (1 - side)
                box = Box(left, y - half, left + width, y + half)
                if not box.within(Box(*self.frame)) or any(box.meets(other) for other in self.taken):
                    continue
                if away > 10.0:
                    self.drawing.line(*place, x - 2.0 * side, y + half * rise, "#9AA4AF", 0.8)
                style = "strong" if strong else "quiet"
                self.drawing.text(x, y + 0.35 * LABEL, words, _ANCHORS[side], LABEL, style)
                self.taken.append(box)
                return True
        return False
