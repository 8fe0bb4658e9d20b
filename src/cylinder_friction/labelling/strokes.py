"""Strokes in one direction, long enough for friction to settle, and the travel that they cover."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask, true_runs
from cylinder_friction.labelling.averages import Averages
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.signals.motion import direction_of_motion, stroke_pieces

POINT_DURATION_S = 0.1
"""Duration of a stroke that is averaged in a point [s]."""

BINS = 100
CELLS_PER_REACH = 2
LEAST_SHARE = 0.1
"""Least share of the travel of all strokes that both directions must cover."""


@dataclass(frozen=True)
class StrokePoints(Averages):
    """Means over short pieces of strokes, all of shape ``(points,)``; velocity is never zero."""

    group = "stroke"

    # First and last position of the piece [m]
    first_m: Array
    last_m: Array
    others_m: Array  # Mean of each of the other positions that the load depends on, shape ``(points, others)`` [m]
    stroke: NDArray[np.int64]  # Number of the piece's stroke, counted from 0


@dataclass(frozen=True)
class TravelCovered:
    """Sections of the travel that strokes of both directions passed through."""

    stretches_m: tuple[tuple[float, float], ...]  # Disjoint pairs of first and last position, ascending [m]

    @property
    def range_m(self) -> tuple[float, float]:
        """First and last position of all sections [m]."""
        return self.stretches_m[0][0], self.stretches_m[-1][1]

    def holds(self, position_m: Array) -> Mask:
        """Mark the positions that lie in one of the sections, in the shape of ``position_m``."""
        inside = np.zeros(np.shape(position_m), dtype=np.bool_)
        for first, last in self.stretches_m:
            inside |= (position_m >= first) & (position_m <= last)
        return inside


def stroke_points(
    force_n: Array,
    position_m: Array,
    velocity_m_s: Array,
    acceleration_m_s2: Array,
    usable: Mask,
    sample_time_s: float,
    slowest_m_s: float,
    settling_travel_m: float,
    others_m: Array | None = None,
) -> StrokePoints:
    """Average the strokes of one recording into points.

    A stroke is an unbroken run of usable rows that move in one direction at ``slowest_m_s`` or faster. Its first
    ``settling_travel_m``, in which bristles bend and the rig takes up its backlash, is left out. All arrays have shape
    ``(n,)``; velocity and acceleration are smooth, and the drive force is valid in ``usable`` rows. ``others_m`` are
    the other positions on which the load depends, shape ``(n, others)``.
    """
    direction = np.where(usable, direction_of_motion(velocity_m_s, slowest_m_s), 0.0)
    path_m = np.cumsum(np.abs(velocity_m_s)) * sample_time_s
    pieces = stroke_pieces(direction, path_m, settling_travel_m, max(1, round(POINT_DURATION_S / sample_time_s)))
    mean = pieces.mean
    others = [] if others_m is None else [mean(values) for values in others_m.T]
    return StrokePoints(
        force_n=mean(force_n),
        position_m=mean(position_m),
        velocity_m_s=mean(velocity_m_s),
        acceleration_m_s2=mean(acceleration_m_s2),
        first_m=position_m[pieces.rows[pieces.begins]],
        last_m=position_m[pieces.rows[pieces.begins + pieces.counts - 1]],
        others_m=np.reshape(others, (len(others), len(pieces.begins))).T,
        stroke=pieces.stroke,
    )


def coverage_of(points: StrokePoints) -> TravelCovered:
    """Find the travel with strokes in both directions.

    Raises:
        RecordingError: One of the directions has no stroke, or the directions have hardly any travel in common.
    """
    spans = {}
    for name, sign in (("extend", 1.0), ("retract", -1.0)):
        own = points.where(points.velocity_m_s * sign > 0.0)
        if not len(own):
            raise RecordingError(
                f"load and friction cannot be separated: got no stroke that {name}s; expected strokes of both "
                "directions over the same travel; record slow strokes up and down, or measure the load"
            )
        spans[name] = np.minimum(own.first_m, own.last_m), np.maximum(own.first_m, own.last_m)
    low = float(min(firsts.min() for firsts, _ in spans.values()))
    high = float(max(lasts.max() for _, lasts in spans.values()))
    both = np.logical_and(*(_visited(*span, low, high) for span in spans.values()))
    if both.sum() < LEAST_SHARE * BINS:
        extend, retract = (f"{firsts.min():.4g} to {lasts.max():.4g} m" for firsts, lasts in spans.values())
        raise RecordingError(
            f"load and friction cannot be separated: strokes that extend cover {extend} and strokes that retract "
            f"{retract}, with {both.sum()} % of the travel in common; expected at least {100 * LEAST_SHARE:.0f} %; "
            "record slow strokes up and down over the same travel, or measure the load"
        )
    edges = np.linspace(low, high, BINS + 1)
    return TravelCovered(tuple((float(edges[first]), float(edges[end])) for first, end in true_runs(both)))


@dataclass(frozen=True)
class OthersCovered:
    """Values of the other positions at which strokes of both directions passed each section of the travel."""

    range_m: tuple[float, float]  # The travel, in ``BINS`` sections [m]
    cell_m: float  # Width of a cell of another position [m]
    # Start of the first cell of each other position [m], and number of its cells
    first_m: tuple[float, ...]
    counts: tuple[int, ...]
    known: tuple[int, ...]  # Flat indices of the cells that strokes passed, row-major over section and cells

    def holds(self, positions_m: Array) -> Mask:
        """Mark positions, shape ``(n, 1 + others)``, at which strokes of both directions passed, ``(n,)``."""
        cells = np.floor((positions_m[:, 1:] - self.first_m) / self.cell_m).astype(np.int64)
        inside = ((cells >= 0) & (cells < self.counts)).all(axis=1)
        section = _sections(positions_m[:, 0], self.range_m)
        place = np.column_stack([section, np.clip(cells, 0, np.array(self.counts) - 1)])
        return np.asarray(inside & np.isin(np.ravel_multi_index(tuple(place.T), (BINS, *self.counts)), self.known))

    @property
    def middles_m(self) -> Array:
        """The middle of each known cell, shape ``(cells, 1 + others)``."""
        section, *cells = np.unravel_index(np.array(self.known), (BINS, *self.counts))
        along = self.range_m[0] + (section + 0.5) / BINS * (self.range_m[1] - self.range_m[0])
        others = [first + self.cell_m * (own + 0.5) for first, own in zip(self.first_m, cells, strict=True)]
        return np.column_stack([along, *others])

    @property
    def extents_m(self) -> list[tuple[float, float]]:
        """Range of all cells of each other position, known or not [m]."""
        of_each = zip(self.first_m, self.counts, strict=True)
        return [(first_m, first_m + count * self.cell_m) for first_m, count in of_each]

    @property
    def ranges_m(self) -> list[tuple[float, float]]:
        """Lowest and highest known value of each other position [m]."""
        others_m, half_m = self.middles_m[:, 1:], 0.5 * self.cell_m
        return [(float(own.min() - half_m), float(own.max() + half_m)) for own in others_m.T]


def _sections(position_m: Array, range_m: tuple[float, float]) -> NDArray[np.int64]:
    share = (np.asarray(position_m) - range_m[0]) / (range_m[1] - range_m[0])
    return np.clip(BINS * share, 0, BINS - 1).astype(np.int64)


def others_covered(points: StrokePoints, reach_m: float) -> OthersCovered:
    """Find the other positions within ``reach_m`` of those at which strokes of both directions passed.

    Raises:
        RecordingError: Strokes of both directions never passed with the other positions within ``2 * reach_m``.
    """
    cell_m = reach_m / CELLS_PER_REACH
    first_m = points.others_m.min(axis=0) - reach_m
    cells = np.floor((points.others_m - first_m) / cell_m).astype(np.int64)
    counts = tuple(int(each) for each in cells.max(axis=0) + CELLS_PER_REACH + 1)
    ends_m = np.stack([points.first_m, points.last_m])
    range_m = float(ends_m.min()), float(ends_m.max())
    begins, ends = (_sections(each, range_m) for each in (ends_m.min(axis=0), ends_m.max(axis=0)))
    piece = np.repeat(np.arange(len(points)), ends - begins + 1)
    section = np.arange(len(piece)) - np.repeat(np.cumsum(ends - begins + 1) - (ends + 1), ends - begins + 1)
    passed = np.zeros((2, BINS, *counts), dtype=np.bool_)
    way = (points.velocity_m_s > 0.0).astype(np.int64)[piece]
    for off in np.ndindex(*(2 * CELLS_PER_REACH + 1,) * len(counts)):
        passed[(way, section, *(cells[piece] + off - CELLS_PER_REACH).T)] = True
    known = np.flatnonzero(passed.all(axis=0))
    if not len(known):
        raise RecordingError(
            "load and friction cannot be separated: nowhere did strokes of both directions pass with the other "
            f"positions within {1e3 * reach_m:g} mm; record slow strokes up and down with the other cylinders at rest"
        )
    return OthersCovered(range_m, cell_m, tuple(map(float, first_m)), counts, tuple(known.tolist()))


def _visited(firsts_m: Array, lasts_m: Array, low: float, high: float) -> Mask:
    """Mark the bins between ``low`` and ``high`` that a piece touches, shape ``(BINS,)``."""
    scale = BINS / (high - low) if high > low else 0.0
    first, last = (np.clip(((ends - low) * scale).astype(np.int64), 0, BINS - 1) for ends in (firsts_m, lasts_m))
    change = np.bincount(first, minlength=BINS + 1) - np.bincount(last + 1, minlength=BINS + 1)
    return np.asarray(np.cumsum(change[:BINS]) > 0)
