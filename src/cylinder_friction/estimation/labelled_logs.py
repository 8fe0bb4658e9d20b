"""The recordings of logger files, each with its friction, by session if load or mass is identified."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.recording_friction import LabelledRecording, RecordingFriction, refused_piece
from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence, known_offsets
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.offset_identification import MOST_SEARCHED
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.checks.duplicates import SeenRecordings
from cylinder_friction.recordings.conversion import ROWS_AT_ONCE
from cylinder_friction.recordings.ingesting import Batch, Converted, Quarantined, batch_of, usable
from cylinder_friction.recordings.reading_logs import Logs
from cylinder_friction.recordings.recording import Recording
from cylinder_friction.recordings.result_folder import existing
from cylinder_friction.recordings.storage import Keeper, Kept
from cylinder_friction.signals.methods import default_filter

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

ROWS_IN_MEMORY = 1 << 20
"""Labelled recordings of more rows than this in all wait on disk for the offset of their session."""


class LabelledLogs:
    """Turns logger files into recordings with their friction.

    Args:
        logs: The files.
        cylinder: Whose recordings they are.
        scratch: A folder that may be removed afterwards.
        model: What friction comes from, or where it is saved; None: the off-line label, less the sensors' offset if it
            is known.
        rows_at_once: A log of more rows is cut into parts of about this many.
        workers: Work on recordings side by side; None: one after the other, here.

    Attributes:
        refused: Files and recordings that could not be used, once ``labelled`` has ended.
        offsets: What is known of the sensors' offset by session, from then on; empty with an estimator.
    """

    def __init__(
        self,
        logs: Logs,
        cylinder: Cylinder,
        scratch: Path,
        model: FrictionEstimator | Path | None,
        rows_at_once: int = ROWS_AT_ONCE,
        workers: Workers | None = None,
    ) -> None:
        self.logs, self.cylinder, self.rows_at_once = logs, cylinder, rows_at_once
        self.workers = workers or Workers()
        self.keeper = Keeper(scratch, ROWS_IN_MEMORY if self.workers.stay_here(len(logs.files)) else 0)
        if not (model is None or isinstance(model, Path) or self.workers.here):
            model.save(scratch / "model")
            model = scratch / "model"  # read once by each worker
        labeller = Labeller(cylinder, load=logs.recipe.limits.load)
        self.friction = RecordingFriction(labeller, default_filter(cylinder), OffsetPlan(), model)
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}

    def recordings(self, most_rows: int) -> Iterator[tuple[Recording, str]]:
        """Yield each usable recording with friction, bounds, velocity and usable rows, and its load in words.

        Of a log with more rows than these only some recordings are yielded, spread evenly over it.
        """
        of_file: dict[str, list[LabelledRecording]] = {}
        for each in self.labelled():
            of_file.setdefault(each.metadata.source_file, []).append(each)
        for own in of_file.values():
            every = -(-sum(each.rows for each in own) // most_rows)
            yield from map(self._finished, own[::every])

    def _finished(self, each: LabelledRecording) -> tuple[Recording, str]:
        return self.friction.finished(each.result.read(), self.offsets.get(each.metadata.session)), each.load

    def labelled(
        self,
        seen: SeenRecordings | None = None,
        evidence: Sequence[OffsetEvidence] = (),
        digests: Mapping[str, str] | None = None,
    ) -> list[LabelledRecording]:
        """Read, check and label each log; return its usable recordings, yet to be ``finished``.

        Args:
            seen: Recordings of earlier runs, with which these are compared.
            evidence: What recordings of earlier runs show of the sensors' offset. Offsets are identified beside those
                of at most ``MOST_SEARCHED`` of their sessions, evenly spread.
            digests: SHA-256 of the files, if they are known.
        """
        logs, workers = self.logs, self.workers
        batch = batch_of(logs.files, logs.recipe, self.rows_at_once, workers, seen, digests, logs.tables)
        outcomes = self._by_session(batch) if self.friction.labeller.needs_identification else self._at_once(batch)
        labelled: list[LabelledRecording] = []
        for outcome in outcomes:
            if isinstance(outcome, Quarantined):
                self.refused.append(outcome)
            else:
                labelled.append(outcome)
        if overlaps := batch.seen.overlaps():
            warnings.warn(overlaps, stacklevel=4)
        shown = [each.evidence for each in labelled if each.evidence is not None]
        if shown:
            known = known_offsets([*_spread(evidence), *shown], self.cylinder, self.friction.plan)
            sessions = {each.session for each in shown}
            self.offsets = {each.session: each for each in known if each.session in sessions}
        return labelled

    def _at_once(self, batch: Batch) -> Iterator[LabelledRecording | Quarantined]:
        """Yield each recording, labelled where its file is read."""
        work = [partial(self.friction.labelled_file, file, self.keeper) for file in batch.files]
        yield from usable(batch, work, self.workers)

    def _by_session(self, batch: Batch) -> Iterator[LabelledRecording | Quarantined]:
        """Yield each recording, labelled once load and mass of its session are known."""
        work = [partial(self.friction.kept_file, file, self.keeper) for file in batch.files]
        outcomes: list[Converted | Quarantined] = list(usable(batch, work, self.workers))
        read = [each for each in outcomes if isinstance(each, Converted)]
        sessions: dict[str, list[Kept]] = {}
        for each in read:
            sessions.setdefault(each.metadata.session, []).append(each.result)
        identified = self.workers.in_order([partial(self.friction.identified, own) for own in sessions.values()])
        found = dict(zip(sessions, identified, strict=True))
        label = [
            partial(self.friction.labelled_in_session, each, self.keeper, found[each.metadata.session]) for each in read
        ]
        for each, labelled in zip(read, self.workers.in_order(label), strict=True):
            yield refused_piece(each.metadata, labelled) if isinstance(labelled, Died) else labelled
            each.result.remove()
        yield from (each for each in outcomes if isinstance(each, Quarantined))


def _spread(evidence: Sequence[OffsetEvidence]) -> list[OffsetEvidence]:
    sessions = sorted({each.session for each in evidence})
    chosen = set(sessions[:: -(-len(sessions) // MOST_SEARCHED) or 1])
    return [each for each in evidence if each.session in chosen]


def inputs(files: Any, channels: Any, model: Any, logs: Logs) -> tuple[Path, ...]:
    """Return every file and folder that a run on logs reads, as far as they were given as paths."""
    given = [files] if isinstance(files, str | Path) else list(files)
    paths = [path for path in (*given, channels, model) if isinstance(path, str | Path)]
    return (*existing(paths), *logs.files.values())
