"""Find copies of a recording, which would count twice, and recordings of one session that overlap in time.

A copy has the same bytes, or the same samples in another file or format. Only exact copies are searched for.
"""

import hashlib
from dataclasses import dataclass, field

import numpy as np

from cylinder_friction.recordings.columns import DRIVE_FORCE, SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Columns, RecordingError, RecordingMetadata

RESOLUTION = {"position_m": 1e-9, DRIVE_FORCE: 1e-6}
"""Largest difference of samples that count as equal, because units or formats differ [m, N]; pressures: 1e-3 Pa."""
OVERLAP_S = 2.0
"""Shortest overlap that is reported [s], because starts are rounded."""
MOST_NAMED = 3  # Most pairs that a sentence names


@dataclass(frozen=True)
class Samples:
    """The identity of a recording: a hash of its samples, and its time."""

    values: str  # SHA-256 of its samples
    session: str
    start: str  # As in ``RecordingMetadata``
    duration_s: float

    @classmethod
    def of(cls, metadata: RecordingMetadata, columns: Columns) -> "Samples":
        """Hash a recording's columns as logged, because a zero that is subtracted may differ from run to run."""
        digest = hashlib.sha256()
        for name in (*SAMPLE_COLUMNS, DRIVE_FORCE):
            if name in columns:
                digest.update(np.rint(columns[name] / RESOLUTION.get(name, 1e-3)).astype(np.int64).tobytes())
        rows = len(columns["position_m"])
        return cls(digest.hexdigest(), metadata.session, metadata.start, rows * metadata.sample_time_s)


@dataclass
class SeenRecordings:
    """Recordings of this run and of earlier runs."""

    files: dict[str, str] = field(default_factory=dict)  # File by name of its recording
    digests: dict[str, str] = field(default_factory=dict)  # File by SHA-256 of its bytes
    samples: dict[str, Samples] = field(default_factory=dict)  # Samples by name of the recording
    names: dict[str, str] = field(default_factory=dict)  # Name of the recording by SHA-256 of its samples

    def remember(self, name: str, file: str, digest: str, samples: Samples) -> None:
        """Remember a recording of an earlier run, its file and the file's SHA-256."""
        self.files[name], self.digests[digest], self.samples[name] = file, file, samples
        self.names[samples.values] = name

    def refuse(self, name: str, file: str, samples: Samples) -> None:
        """Remember a recording and its file; raise ``RecordingError`` if its name or its samples are known."""
        if name in self.files:
            raise RecordingError(f"has the name {name!r}, which {self.files[name]} has already")
        if (copy := self.names.get(samples.values)) is not None:
            raise RecordingError(
                f"holds the same samples as recording {copy!r} of {self.files[copy]}; a copy would be counted twice, "
                "and a model could be tested on its own training data; keep one of them"
            )
        self.files[name], self.samples[name], self.names[samples.values] = file, samples, name

    def overlaps(self) -> str:
        """Return a sentence on recordings of one session that overlap in time; empty if none do."""
        sessions: dict[tuple[str, bool], list[tuple[float, float, str]]] = {}
        for name, each in self.samples.items():
            if "T" in each.start:  # a day without a time shows no overlap
                utc = each.start.endswith("Z")
                begin_s = float(np.datetime64(each.start.rstrip("Z"), "ms").astype(np.int64)) * 1e-3
                sessions.setdefault((each.session, utc), []).append((begin_s, begin_s + each.duration_s, name))
        pairs: list[str] = []
        for spans in map(sorted, sessions.values()):
            ends_s, longest = spans[0][1:]
            for begin_s, end_s, name in spans[1:]:
                if ends_s - begin_s > OVERLAP_S:
                    pairs.append(f"{longest} and {name} by {min(ends_s, end_s) - begin_s:.4g} s")
                if end_s > ends_s:
                    ends_s, longest = end_s, name
        if not pairs:
            return ""
        more = f" and {len(pairs) - MOST_NAMED} more" if len(pairs) > MOST_NAMED else ""
        return (
            f"recordings of one session overlap in time: {', '.join(pairs[:MOST_NAMED])}{more}; if they are of the "
            "same stretch, keep one of them; otherwise correct the clock, or the session in the names"
        )
