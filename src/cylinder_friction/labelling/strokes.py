"""Strokes in one direction, long enough for friction to settle, and the travel that they cover."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array, Mask
from cylinder_friction.labelling.averages import Averages
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.signals.motion import direction_of_motion, stroke_pieces

POINT_DURATION_S = 0.1
"""Duration of a stroke that is averaged in a point [s]."""

BINS = 100
CELLS_PER_REACH = 2
_EDGE_M = 1e-9
LEAST_SHARE = 0.1
"""Least share of the travel of all strokes that both directions must cover."""


@dataclass(frozen=True)
class StrokePoints(Averages):
    """Means over short pieces of strokes, all of shape ``(points,)``; velocity is never zero."""

    group = "stroke"

    pressure_pa: Array  # Sum of both chambers' pressures, by which seals are pressed [Pa]
    # First and last position of the piece [m]
    first_m: Array
    last_m: Array
    others_m: Array  # Mean of each of the other positions that the load depends on, shape ``(points, others)`` [m]
    stroke: NDArray[np.int64]  # Number of the piece's stroke, counted from 0


def stroke_points(
    force_n: Array,
    position_m: Array,
    velocity_m_s: Array,
    acceleration_m_s2: Array,
    pressure_pa: Array,
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
        pressure_pa=mean(pressure_pa),
        first_m=position_m[pieces.rows[pieces.begins]],
        last_m=position_m[pieces.rows[pieces.begins + pieces.counts - 1]],
        others_m=np.reshape(others, (len(others), len(pieces.begins))).T,
        stroke=pieces.stroke,
    )


@dataclass(frozen=True)
class Covered:
    """Sections of the travel that strokes of both directions passed, with other positions at about the same values."""

    travel_m: tuple[float, float]  # The travel, in ``BINS`` sections [m]
    cell_m: float  # Width of a cell of another position [m]
    # Start of the first cell of each other position [m], and number of its cells
    first_m: tuple[float, ...]
    counts: tuple[int, ...]
    known: tuple[int, ...]  # Flat indices of the cells that strokes passed, row-major over section and cells

    def holds(self, positions_m: Array) -> Mask:
        """Mark positions, shape ``(n, 1 + others)``, at which strokes of both directions passed, ``(n,)``."""
        cells = np.floor((positions_m[:, 1:] - self.first_m) / self.cell_m).astype(np.int64)
        inside = ((cells >= 0) & (cells < self.counts)).all(axis=1)
        cells, (low_m, high_m) = np.clip(cells, 0, np.array(self.counts) - 1), self.travel_m
        held = np.zeros(len(positions_m), dtype=np.bool_)
        for off_m in (_EDGE_M, -_EDGE_M):  # A position between two sections is in both
            section = _sections(positions_m[:, 0] + off_m, self.travel_m)
            held |= np.isin(np.ravel_multi_index((section, *cells.T), (BINS, *self.counts)), self.known)
        return np.asarray(
            inside & held & (positions_m[:, 0] >= low_m - _EDGE_M) & (positions_m[:, 0] <= high_m + _EDGE_M)
        )

    @property
    def range_m(self) -> tuple[float, float]:
        """First and last position of all known sections [m]."""
        section, edges_m = np.array(self.known) // math.prod(self.counts), np.linspace(*self.travel_m, BINS + 1)
        return float(edges_m[section.min()]), float(edges_m[section.max() + 1])

    @property
    def middles_m(self) -> Array:
        """The middle of each known cell, shape ``(cells, 1 + others)``."""
        section, *cells = np.unravel_index(np.array(self.known), (BINS, *self.counts))
        along = self.travel_m[0] + (section + 0.5) / BINS * (self.travel_m[1] - self.travel_m[0])
        others = [first + self.cell_m * (own + 0.5) for first, own in zip(self.first_m, cells, strict=True)]
        return np.column_stack([along, *others])

    @property
    def ranges_m(self) -> list[tuple[float, float]]:
        """Lowest and highest known value of each other position [m]."""
        others_m, half_m = self.middles_m[:, 1:], 0.5 * self.cell_m
        return [(float(own.min() - half_m), float(own.max() + half_m)) for own in others_m.T]


def _sections(position_m: Array, travel_m: tuple[float, float]) -> NDArray[np.int64]:
    share = (np.asarray(position_m) - travel_m[0]) / max(travel_m[1] - travel_m[0], 1e-12)
    return np.clip(BINS * share, 0, BINS - 1).astype(np.int64)


def covered(points: StrokePoints, reach_m: float) -> Covered:
    """Find the travel with strokes in both directions, and the other positions within ``reach_m`` of those strokes.

    Raises:
        RecordingError: One of the directions has no stroke, the directions have hardly any travel in common, or they
            never passed with the other positions within ``2 * reach_m``.
    """
    extending = points.velocity_m_s > 0.0
    for name, own in (("extend", extending), ("retract", ~extending)):
        if not own.any():
            raise RecordingError(
                f"load and friction cannot be separated: got no stroke that {name}s; expected strokes of both "
                "directions over the same travel; record slow strokes up and down, or measure the load"
            )
    cell_m = reach_m / CELLS_PER_REACH
    first_m = points.others_m.min(axis=0) - reach_m
    cells = np.floor((points.others_m - first_m) / cell_m).astype(np.int64)
    counts = tuple(int(each) for each in cells.max(axis=0) + CELLS_PER_REACH + 1)
    ends_m = np.stack([points.first_m, points.last_m])
    travel_m = float(ends_m.min()), float(ends_m.max())
    begins, ends = (_sections(each, travel_m) for each in (ends_m.min(axis=0), ends_m.max(axis=0)))
    piece = np.repeat(np.arange(len(points)), ends - begins + 1)
    section = np.arange(len(piece)) - np.repeat(np.cumsum(ends - begins + 1) - (ends + 1), ends - begins + 1)
    passed, way = np.zeros((2, BINS, *counts), dtype=np.bool_), extending.astype(np.int64)[piece]
    for off in np.ndindex(*(2 * CELLS_PER_REACH + 1,) * len(counts)):
        passed[(way, section, *(cells[piece] + off - CELLS_PER_REACH).T)] = True
    both = passed.any(axis=tuple(range(2, passed.ndim))).all(axis=0)
    if both.sum() < LEAST_SHARE * BINS:
        extend, retract = (
            f"{ends_m[:, way].min():.4g} to {ends_m[:, way].max():.4g} m" for way in (extending, ~extending)
        )
        raise RecordingError(
            f"load and friction cannot be separated: strokes that extend cover {extend} and strokes that retract "
            f"{retract}, with {both.sum()} % of the travel in common; expected at least {100 * LEAST_SHARE:.0f} %; "
            "record slow strokes up and down over the same travel, or measure the load"
        )
    known = np.flatnonzero(passed.all(axis=0))
    if not len(known):
        raise RecordingError(
            "load and friction cannot be separated: nowhere did strokes of both directions pass with the other "
            f"positions within {1e3 * reach_m:g} mm; record slow strokes up and down with the other cylinders at rest"
        )
    return Covered(travel_m, cell_m, tuple(map(float, first_m)), counts, tuple(known.tolist()))
