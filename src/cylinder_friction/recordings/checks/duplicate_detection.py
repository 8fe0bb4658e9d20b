"""Detect a recording that repeats another one: in another format, printed coarser, cut or shifted.

Otherwise a model could be tested on its own training data.

No two sensors make the same noise twice. A recording is known by hashes of short windows of its two pressures, coarsely
rounded: a window that occurs in two recordings with all its noise is the same measurement. Of all windows those whose
hash happens to end in zeros are kept, so that both recordings keep the same ones wherever either begins (winnowing:
Schleimer, Wilkerson and Aiken 2003, SIGMOD, and its simpler forerunner, hashes 0 mod p).
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.recordings.columns import DRIVE_FORCE
from cylinder_friction.recordings.recording import Columns, RecordingError

Hashes = NDArray[np.uint64]

WINDOW = 24  # rows per window
KEPT = 64  # one window in so many is kept; a power of two
LEAST_CHANGES = 8  # a window in which rounded values change less often is too common to identify a recording
LEAST_MATCHES = 4  # fewer windows in common may be chance
LEAST_SHARE = 0.02  # so may a smaller share of the shorter recording's windows

FINEST = {"pressure": 512.0, "force": 0.125}
"""Rounding is never finer than this, in the column's unit: 0.001 bar is what exports keep [Pa, N]."""

PLACES = 4096  # samples at most from which the noise is estimated

BLOCK_RATIO = 4
"""Each block of known hashes is larger than the next one by more than this factor."""

OFFSET = 0.3819
"""Moves the borders of rounding away from zero and from round numbers, where sensors rest, in roundings."""


class Match(NamedTuple):
    """An earlier recording that holds the same measurement, and the share of the shorter one's windows in both."""

    name: str
    share: float


class DuplicateDetection:
    """Recordings seen so far, by a few bytes of hash for every 64 rows in motion.

    The rounding is tied to the recording's own noise, to the next power of two; as a part of a recording may show a
    little more or less noise than the whole, each is hashed at two roundings, of which the other shares one.
    """

    def __init__(self) -> None:
        self.files: dict[str, str] = {}  # The file of each recording
        self.digests: dict[str, str] = {}  # The file of each SHA-256
        self.hashes: dict[str, Mapping[int, Hashes]] = {}  # Of each recording's windows
        self._names: list[str] = []
        self._counts: list[dict[int, int]] = []
        # Hashes, sorted, and the number of each one's recording
        self._blocks: list[tuple[Hashes, NDArray[np.int64]]] = []

    def add(self, name: str, hashed: dict[int, Hashes]) -> Match | None:
        """Return the earlier recording that this one repeats. If none, remember it as ``name`` and return None.

        A recording is not compared with itself: a motion may repeat within one recording. ``hashed`` are its
        ``window_hashes``.
        """
        match = self._best_match(hashed)
        if match is None:
            self._keep([(name, hashed)])
        return match

    def remember(self, recordings: Iterable[tuple[str, str, str, Mapping[int, Hashes]]]) -> None:
        """Remember recordings that were compared with each other before: name, file, SHA-256 of it, and hashes."""
        recordings = list(recordings)
        for name, file, digest, hashed in recordings:
            self.files[name], self.digests[digest], self.hashes[name] = file, file, hashed
        self._keep([(name, hashed) for name, _, _, hashed in recordings])

    def refuse(self, name: str, file: str, hashed: dict[int, Hashes]) -> None:
        """Remember a recording and its file; raise ``RecordingError`` if its name or its measurement is known."""
        if name in self.files:
            raise RecordingError(f"has the name {name!r}, which {self.files[name]} has already")
        match = self.add(name, hashed)
        if match is not None:
            raise RecordingError(
                f"is the same measurement as recording {match.name!r}, or overlaps it ({100.0 * match.share:.0f} % of "
                "its windows are equal, noise and all); a model could be tested on its own training data; keep one of "
                "them"
            )
        self.files[name], self.hashes[name] = file, hashed

    def _keep(self, recordings: Sequence[tuple[str, Mapping[int, Hashes]]]) -> None:
        """Add a block; smaller ones are joined to it, so that there are few and each hash is moved seldom."""
        known, owners = [np.empty(0, dtype=np.uint64)], [np.empty(0, dtype=np.int64)]
        for name, hashed in recordings:
            known += hashed.values()
            owners.append(np.full(sum(map(len, hashed.values())), len(self._names)))
            self._names.append(name)
            self._counts.append({exponent: len(hashes) for exponent, hashes in hashed.items()})
        while self._blocks and len(self._blocks[-1][0]) < BLOCK_RATIO * sum(map(len, known)):
            more, theirs = self._blocks.pop()
            known.append(more)
            owners.append(theirs)
        hashes = np.concatenate(known)
        order = np.argsort(hashes, kind="stable")
        self._blocks.append((hashes[order], np.concatenate(owners)[order]))

    def _best_match(self, hashed: dict[int, Hashes]) -> Match | None:
        best: Match | None = None
        for exponent, hashes in hashed.items():
            in_common = self._in_common(hashes)
            for owner in np.flatnonzero(in_common >= LEAST_MATCHES):
                shorter = min(len(hashes), self._counts[owner].get(exponent, 0))
                share = float(in_common[owner]) / max(shorter, 1)
                if share >= LEAST_SHARE and (best is None or share > best.share):
                    best = Match(self._names[owner], share)
        return best

    def _in_common(self, hashes: Hashes) -> NDArray[np.int64]:
        """Return how many of these hashes each earlier recording has."""
        found = [np.empty(0, dtype=np.int64)]
        for known, owners in self._blocks:
            begin, end = (np.searchsorted(known, hashes, side=side) for side in ("left", "right"))
            found += [owners[begin[place] : end[place]] for place in np.flatnonzero(end > begin)]
        return np.bincount(np.concatenate(found), minlength=len(self._names))


def window_hashes(columns: Columns) -> dict[int, Hashes]:
    """Return a recording's hashes, sorted and each once, by the power of two that its pressures were rounded to.

    Args:
        columns: ``position_m`` and both pressures or ``drive_force_n``, as logged: a zero offset that is subtracted may
            differ between two exports.
    """
    position_m = np.asarray(columns["position_m"], dtype=np.float64)
    force = DRIVE_FORCE in columns
    first, second = (DRIVE_FORCE, DRIVE_FORCE) if force else ("pressure_1_pa", "pressure_2_pa")
    one, other = (np.asarray(columns[name], dtype=np.float64) for name in (first, second))
    noise = math.sqrt(_noise(one) * _noise(other))
    finest = FINEST["force" if force else "pressure"]
    exponent = math.floor(math.log2(max(2.0 * noise, finest)))
    least_m = max(5.0 * _noise(position_m), 2e-5)
    return {
        power: np.unique(_kept(one, other, position_m, 2.0**power, least_m, power + 1024))
        for power in (exponent, exponent + 1)
    }


def _noise(values: Array) -> float:
    """Return the standard deviation of a signal's white noise while it changes, from its second differences."""
    end, step = max(len(values) - 2, 0), max(1, len(values) // PLACES)
    before, here, after = (values[first : end + first : step] for first in (0, 1, 2))
    bend = np.abs(after - 2.0 * here + before)
    bend = bend[bend > 0.0]
    return float(np.median(bend)) / 1.65 if len(bend) else 0.0


def _kept(one: Array, other: Array, position: Array, step: float, least: float, salt: int) -> Hashes:
    """Return the hashes of windows in motion that end in zeros.

    A window's hash is a polynomial in the words of its rows, made from those of shorter windows: of 2, 4, 8, 24 rows.
    """
    first, second = (np.floor(each * (1.0 / step) + OFFSET).astype(np.int64).view(np.uint64) for each in (one, other))
    hashes = _mixed(first * np.uint64(0xD6E8FEB86659FD93) + second)
    length = 1
    for times in (2, 2, 2, 3):
        factor, rows = np.uint64(pow(0x9E3779B97F4A7C15, length, 1 << 64)), max(len(hashes) - (times - 1) * length, 0)
        joined = hashes[:rows]
        for start in range(length, times * length, length):
            joined = joined * factor + hashes[start : start + rows]
        hashes, length = joined, times * length
    hashes = _mixed(hashes[1:] + np.uint64(salt * 0xA0761D6478BD642F % (1 << 64)))
    at = np.flatnonzero(hashes & np.uint64(KEPT - 1) == 0)
    at = at[np.abs(position[at + WINDOW] - position[at + 1]) >= least]
    steps = at[:, None] + np.arange(WINDOW)
    changed = np.concatenate([(each[1:] != each[:-1])[steps] for each in (first, second)], axis=1)
    return hashes[at[np.count_nonzero(changed, axis=1) >= LEAST_CHANGES]]


def _mixed(word: Hashes) -> Hashes:
    """Mix a word's bits, so that each bit depends on all of them (splitmix64: Steele, Lea and Flood 2014)."""
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))
