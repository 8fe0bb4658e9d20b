"""The recordings of logger files, each with its friction, by session where load or mass is identified."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.earlier import (
    Processed,
)
from cylinder_friction.estimation.recording_friction import RecordingFriction
from cylinder_friction.estimation.results import FrictionOfRecording
from cylinder_friction.execution.workers import Died, Workers
from cylinder_friction.labelling.known_offset import (
    KnownOffset,
    OffsetEvidence,
    known_offsets,
)
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.offset_identification import MOST_SEARCHED
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.checks.duplicate_detection import DuplicateDetection
from cylinder_friction.recordings.ingesting import ConvertedPiece, Quarantined, worked_on
from cylinder_friction.recordings.long_logs import ROWS_AT_ONCE, LongRecording
from cylinder_friction.recordings.reading_logs import Logs
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.recordings.result_folder import existing
from cylinder_friction.signals.methods import default_filter, warn_of_rates

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator


class LabelledLogs:
    """The recordings of logger files with their friction, each kept in ``scratch`` between two passes.

    Args:
        logs: The files.
        cylinder: Whose recordings they are.
        scratch: A folder that may be removed afterwards.
        estimator: What friction comes from; None: the off-line label, less the sensors' offset where it is known.
        rows_at_once: A log of more rows is processed in parts of about so many, so that memory holds one of them.
        workers: Work on recordings side by side; None: one after the other, here.
        depends_on: SHA-256 of what results depend on beside the logs, for their metadata.

    Attributes:
        refused: Files and recordings that could not be used, once ``recordings`` has ended.
        offsets: What is known of the sensors' offset by session, from then on; empty with an estimator.
        loads: By recording, which load was taken off, in words.
        evidence: By recording, what it shows of the sensors' offset.
        seen: All recordings, by the hashes of their windows.
    """

    def __init__(
        self,
        logs: Logs,
        cylinder: Cylinder,
        scratch: Path,
        estimator: FrictionEstimator | None,
        rows_at_once: int = ROWS_AT_ONCE,
        workers: Workers | None = None,
        depends_on: Mapping[str, str] | None = None,
    ) -> None:
        self.logs, self.cylinder, self.scratch = logs, cylinder, scratch
        self.rows_at_once, self.workers = rows_at_once, workers or Workers()
        model: FrictionEstimator | Path | None = estimator
        if estimator is not None and not self.workers.here:
            model = scratch / "model"  # read once by each worker
            estimator.save(model)
        labeller = Labeller(cylinder, load=logs.recipe.limits.load)
        self.friction = RecordingFriction(
            labeller, default_filter(cylinder), OffsetPlan(), scratch, model, depends_on or {}
        )
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}
        self.loads: dict[str, str] = {}
        self.evidence: dict[str, list[OffsetEvidence]] = {}
        self.seen = DuplicateDetection()

    def recordings(self) -> Iterator[Recording]:
        """Yield each usable recording with friction, bounds, velocity and usable rows; of a long one an excerpt."""
        for labelled in self.labelled():
            parts = labelled.excerpt()
            for number, part in enumerate(parts, start=1):
                name = f"{part.name}, excerpt {number} of {len(parts)}" if len(parts) > 1 else part.name
                part = replace(part, metadata=replace(part.metadata, name=name))
                yield self.friction.finished(part, self.offsets.get(part.metadata.session))

    def labelled(self, earlier: Sequence[Processed] = ()) -> list[LongRecording]:
        """Return each usable recording with its friction, on disk; what is read of it is yet to be ``finished``.

        Recordings of ``earlier`` runs are not worked on. New ones are compared with them, and offsets are identified
        beside those of at most ``MOST_SEARCHED`` of their sessions, evenly spread.
        """
        about = [(each.entry, each.hashes) for each in earlier]
        self.seen.remember((one.name, one.source_file, one.source_sha256, hashes) for one, hashes in about)
        shown = [own for each in earlier for own in each.evidence]
        spread = sorted({each.session for each in shown})
        spread = spread[:: -(-len(spread) // MOST_SEARCHED) or 1]
        evidence = [each for each in shown if each.session in set(spread)]
        labelled: list[LongRecording] = []
        refused: list[Quarantined] = []
        sessions: set[str] = set()
        for outcome in self._by_session() if self.friction.labeller.needs_identification else self._at_once():
            if isinstance(outcome, Quarantined):
                refused.append(outcome)
            elif not isinstance(outcome.result, tuple):
                refused.append(refused_piece(outcome.metadata, outcome.result))
            else:
                recording, own = outcome.result
                labelled.append(recording)
                evidence += own
                self.evidence[recording.metadata.name] = own
                sessions |= {each.session for each in own}
        self.refused = refused
        warn_of_rates(self.friction.filter, {each.metadata.sample_time_s for each in labelled})
        if sessions:
            known = known_offsets(evidence, self.cylinder, self.friction.plan)
            self.offsets = {each.session: each for each in known if each.session in sessions}
        return labelled

    def _at_once(self) -> Iterator[ConvertedPiece | Quarantined]:
        """Yield each recording, labelled where its file is converted."""
        return self._worked_on(self.friction.labelled_alone)

    def _by_session(self) -> Iterator[ConvertedPiece | Quarantined]:
        """Yield each recording, labelled once load and mass of its session are known."""
        outcomes = list(self._worked_on(self.friction.kept))
        sessions: dict[str, list[LongRecording]] = {}
        for each in outcomes:
            if not isinstance(each, Quarantined):
                sessions.setdefault(each.metadata.session, []).append(each.result)
        work = [partial(self.friction.identified, own) for own in sessions.values()]
        found = dict(zip(sessions, self.workers.in_order(work), strict=True))
        pieces = [
            partial(self.friction.labelled_in_session, each.result, found[each.metadata.session])
            for each in outcomes
            if not isinstance(each, Quarantined)
        ]
        results = self.workers.in_order(pieces)
        for each in outcomes:
            if isinstance(each, Quarantined):
                yield each
                continue
            identified = found[each.metadata.session]
            if isinstance(identified, SessionIdentification) and identified.load is not None:
                self.loads[each.metadata.name] = identified.load.sentence()
            yield replace(each, result=next(results))
            each.result.remove()

    def _worked_on(self, work: Callable[[Recording | LongRecording], Any]) -> Iterator[ConvertedPiece | Quarantined]:
        folder = self.scratch / "converted"
        how = self.logs.recipe, folder, self.rows_at_once, self.workers, self.seen, work
        return worked_on(self.logs.files, *how)

    def entry(self, excerpt: Sequence[Recording]) -> FrictionOfRecording:
        """Return what became of a recording; ``excerpt`` is all of it, or parts of it."""
        return self.friction.entry(excerpt, self.loads.get(excerpt[0].name, ""))


def refused_piece(about: RecordingMetadata, reason: str | Died) -> Quarantined:
    return Quarantined(about.source_file, reason.reason if isinstance(reason, Died) else reason, about.name)


def inputs(files: Any, channels: Any, model: Any, logs: Logs) -> tuple[Path, ...]:
    """Return every file and folder that a run on logs reads, as far as they were given as paths."""
    given = [files] if isinstance(files, str | Path) else list(files)
    paths = [path for path in (*given, channels, model) if isinstance(path, str | Path)]
    return (*existing(paths), *logs.files.values())
