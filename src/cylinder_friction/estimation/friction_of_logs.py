"""Label recordings with friction: each by itself, or session by session if load or mass is identified."""

from __future__ import annotations

import math
import uuid
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from cylinder_friction.estimation.results import FrictionOfRecording, known_number
from cylinder_friction.evaluation.friction_levels import friction_levels
from cylinder_friction.execution.workers import LostPiece, Workers
from cylinder_friction.labelling.apparent_loss import ApparentLoss, missing_loss, named_loss
from cylinder_friction.labelling.known_offset import KnownOffset, OffsetEvidence, known_offsets, offset_evidence
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.mass import missing_mass
from cylinder_friction.labelling.offset_identification import MOST_SEARCHED
from cylinder_friction.labelling.pooled_load import pooled_load
from cylinder_friction.labelling.session import SessionIdentification
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan, holds_load, unknown_friction, up_and_down
from cylinder_friction.realtime.flags import LEAST_ROWS, Flag, unknown_in_words
from cylinder_friction.realtime.trained_for import pressure_noise_pa
from cylinder_friction.recordings.columns import COVERAGE_FACTOR, LOAD_FORCE, UNCERTAINTY_COLUMN
from cylinder_friction.recordings.conversion import (
    Converted,
    LoggedFile,
    Quarantined,
    SeenRecordings,
    converted,
    usable,
)
from cylinder_friction.recordings.logs import Logs
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.recordings.storage import read_recording, write_recording
from cylinder_friction.signals.smooth_signals import SignalFilter, filtered
from cylinder_friction.signals.zero_phase import default_filter

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.realtime.model import Bounds

Outcome = TypeVar("Outcome", bound=Converted | Quarantined)
PLAN = OffsetPlan()
ROWS_IN_MEMORY = 1 << 22
"""Most rows that wait in memory, in equal parts for all logs; further recordings of a log wait on disk."""
OFTEN_MISSED = 3.0
"""Bounds are reported if they miss the label this many times as often as stated."""


@lru_cache(maxsize=1)
def loaded_once(folder: Path) -> FrictionEstimator:
    """Load a saved estimator; the one loaded last stays in memory."""
    from cylinder_friction.estimators.loading import load_estimator  # ONNX: labels need no estimator

    return load_estimator(folder)


@dataclass(frozen=True)
class LabelledRecording(Converted):
    """A recording with its friction, kept until the offset of its session is known."""

    result: Recording | Path
    evidence: OffsetEvidence | None  # Evidence on the sensors' offset; None with an estimator
    load: str  # The load that was identified and subtracted, in words; empty if none was
    rows: int
    load_uncertainty_n: float = 0.0  # Expanded uncertainty (k = 2) of an identified or stated load [N]


@dataclass(frozen=True)
class RecordingFriction:
    """Labels recordings, runs an estimator over them if there is one, and applies the offset of their session."""

    labeller: Labeller
    filter: SignalFilter
    # The estimator or its folder. With None, friction is the label less the sensors' offset, if that is known
    model: FrictionEstimator | Path | None
    stated_load: str  # The constant load that the user stated, in words; empty if none
    scratch: Path  # Folder of recordings that wait on disk
    rows_in_memory: int  # Most rows of a log that wait in memory

    @property
    def estimator(self) -> FrictionEstimator | None:
        return loaded_once(self.model) if isinstance(self.model, Path) else self.model

    def of_file(self, file: LoggedFile) -> list[Converted | Quarantined]:
        """Convert a file and label its recordings, unless ``of_session`` must first identify load or mass."""
        outcomes, rows = list[Converted | Quarantined](), 0
        for each in converted(file):
            outcome = each
            if isinstance(each, Converted):
                rows += len(each.result)
                outcome = each if self.labeller.needs_identification else self.labelled(each)
            outcomes.append(self._waiting(outcome, on_disk=rows > self.rows_in_memory))
        return outcomes

    def _waiting(self, each: Outcome, *, on_disk: bool) -> Outcome:
        if isinstance(each, Quarantined) or not on_disk:
            return each
        return replace(each, result=write_recording(self.scratch, each.result, uuid.uuid4().hex))

    def of_session(self, session: Sequence[Converted]) -> list[LabelledRecording | Quarantined]:
        """Identify load and mass of a session, and label its recordings; refuse all if they do not determine them."""
        try:
            smooth = (filtered(waiting(each.result), self.filter) for each in session)
            identified = self.labeller.identify(smooth, self.filter)
        except ValueError as error:
            return [refused_piece(each.metadata, str(error)) for each in session]
        found = []
        for each in session:
            labelled = self.labelled(replace(each, result=waiting(each.result)), identified)
            found.append(self._waiting(labelled, on_disk=isinstance(each.result, Path)))
        return found

    def labelled(
        self, each: Converted, identified: SessionIdentification | None = None
    ) -> LabelledRecording | Quarantined:
        """Smooth and label a recording, and run the estimator over it if there is one."""
        recording: Recording = each.result
        estimator, of_session = self.estimator, None if identified is None else identified.load
        try:
            labelled = self.labeller.labelled(filtered(recording, self.filter), self.filter, identified)
            if estimator is not None:
                if of_session is not None and estimator.position_load is not None:
                    estimator = estimator.with_position_load(pooled_load([of_session]))
                labelled = estimated(labelled, estimator.with_bounds_for([recording]))
        except ValueError as error:  # the recording is shorter than the filter, or the estimator does not accept it
            return refused_piece(each.metadata, str(error))
        evidence = None
        if estimator is None:
            known = LOADED.get(self.labeller.load, "")
            evidence = offset_evidence(labelled, self.labeller.cylinder, PLAN, *self._halves(labelled), known)
        load = "" if of_session is None else of_session.sentence(recording, self.labeller.cylinder)
        off_n = self._stated_load_n(labelled) if of_session is None else of_session.expanded_n
        return LabelledRecording(each.metadata, labelled, each.samples, evidence, load, len(labelled), off_n)

    def _stated_load_n(self, recording: Recording) -> float:
        """Return the expanded uncertainty (k = 2) of a load that the user stated, which all sessions share [N]."""
        return COVERAGE_FACTOR * recording.metadata.uncertainty[LOAD_FORCE].zero if self.stated_load else 0.0

    def _halves(self, recording: Recording) -> tuple[float, float]:
        """Return half the sum and half the difference of extending and retracting friction at equal positions [N]."""
        position_m, velocity_m_s, friction_n = map(recording.column, ("position_m", "velocity_m_s", "friction_n"))
        return up_and_down(position_m, velocity_m_s, friction_n, recording.usable(), PLAN.slowest_m_s)

    def finished(self, recording: Recording, known: KnownOffset | None, loss: ApparentLoss | None = None) -> Recording:
        """Add bounds to a recording, and subtract the offset of its session if strokes determine one.

        An unstated ``loss`` between sensors and cylinder widens the bounds.
        """
        if known is None:
            return recording.without_columns(UNCERTAINTY_COLUMN)
        friction_n, half_n = recording.column("friction_n") - known.correction_n, np.full(len(recording), math.nan)
        if UNCERTAINTY_COLUMN in recording.columns:
            half_n = known.half_n(recording.column(UNCERTAINTY_COLUMN), self._stated_load_n(recording))
        if loss is not None:
            half_n = half_n + loss.most_n(recording.column("velocity_m_s"))
        bounds = {"lower_n": friction_n - half_n, "upper_n": friction_n + half_n}
        return recording.with_columns(friction_n=friction_n, **bounds).without_columns(UNCERTAINTY_COLUMN)

    def entry(self, recording: Recording, load: str) -> FrictionOfRecording:
        """Summarize a finished recording. ``load`` names the load that was identified and subtracted."""
        load_n, half_n = self._halves(recording)
        estimator, rows, flags = self.estimator, len(recording), recording.columns.get("flags")
        counts = Counter({str(flag.name): 0 if flags is None else int((flags & flag != 0).sum()) for flag in Flag})
        about, given = recording.metadata, None if estimator is None else estimator.position_load
        known = (self.stated_load or self.labeller.load) if given is None else given.in_words()
        other, noisy, missed, fits = "", "", "", True
        mass = missing_mass(recording, self.labeller.cylinder) if estimator is None else ""
        another_load = given is not None and self.labeller.load == "none"
        if estimator is not None and estimator.bounds is not None and estimator.offset is None and not another_load:
            missed = label_missed(recording, estimator.bounds)  # The label has the same offset and load
        if estimator is not None and (trained_for := estimator.trained_for) is not None:
            fits = trained_for.fits(self.labeller.cylinder)  # with other areas, no load is looked for
            noise_pa = pressure_noise_pa([recording])
            if (level := estimator.noise_level(noise_pa)) is not None:
                trained = replace(trained_for, pressure_noise_pa=level.noise_pa)
                other, noisy = trained.differences([recording], noise_pa)
        shares = {name: 100.0 * count / rows for name, count in counts.items() if count}
        same = ("name", "source_file", "source_sha256", "session", "condition", "asset", "start", "start_source")
        return FrictionOfRecording(
            **{name: getattr(about, name) for name in same},
            sensors=dict(about.sensors),
            rows=rows,
            duration_s=rows * about.sample_time_s,
            usable_percent=100.0 * int(recording.usable().sum()) / rows,
            friction_n=known_number(half_n),
            unknown="" if math.isfinite(half_n) else unknown_friction(recording, PLAN, self.labeller.cylinder),
            flags_percent=None if estimator is None else shares,
            load=load or known,
            not_known=other or ("" if flags is None else unknown_in_words(rows, counts)),
            unlike_training="; ".join(filter(None, (noisy, missed))),
            load_left_n=known_number(load_n) if fits and holds_load(load_n, half_n) else None,
            repairs=(*about.remarks, *filter(None, [mass])),
            levels=friction_levels([recording]),
        )


def waiting(result: Recording | Path) -> Recording:
    """Return a recording that waits in memory, or read one that waits on disk."""
    return read_recording(result) if isinstance(result, Path) else result


def discard(result: Recording | Path) -> None:
    if isinstance(result, Path):  # it waits on disk
        result.unlink()


def refused_piece(about: RecordingMetadata, reason: str | LostPiece) -> Quarantined:
    return Quarantined(about.source_file, reason.reason if isinstance(reason, LostPiece) else reason, about.name)


def estimated(labelled: Recording, estimator: FrictionEstimator) -> Recording:
    """Run an estimator's real-time step over a recording; add friction, bounds and flags, and keep the label.

    Rows before the first valid sample have no estimate: their friction is NaN, and they are not usable.
    """
    from cylinder_friction.realtime.stream import CompiledRun  # Numba: labels need no estimator

    step = estimator.step_model().for_recordings()
    newtons, flags = CompiledRun(step).run(labelled.samples(estimator.inputs))
    known_n = np.where((flags & Flag.NOT_READY == 0)[:, None], newtons, np.nan)
    own = dict(zip(("friction_n", "lower_n", "upper_n"), estimator.aligned(known_n).T, strict=True))
    usable = labelled.usable() & np.isfinite(own["friction_n"])
    return labelled.with_columns(label_n=labelled.column("friction_n"), **own, flags=flags, usable=usable)


def label_missed(recording: Recording, bounds: Bounds) -> str:
    """State how rarely bounds contain a recording's label; empty if they contain it about as often as stated.

    ``bounds_count`` selects the rows.
    """
    from cylinder_friction.realtime.bounds import bounds_count  # Numba

    label_n = recording.column("label_n")
    held = (recording.column("lower_n") <= label_n) & (label_n <= recording.column("upper_n"))
    held = held[bounds_count(recording)]
    share = float(held.mean()) if len(held) >= LEAST_ROWS else 1.0
    if 1.0 - share <= OFTEN_MISSED * (1.0 - bounds.probability):
        return ""
    return f"bounds hold the label in {100.0 * share:.0f} % of the rows, not in {100.0 * bounds.probability:.0f} %"


class LabelledLogs:
    """Turns logger files into recordings with their friction.

    It processes those ``files`` of ``logs``, one after the other without ``workers``. ``scratch`` is a folder that may
    be removed afterwards. Without a model, friction is the off-line label less the sensors' offset, if that is known.

    Attributes:
        refused: Files and recordings that could not be used. This and the following are complete after ``labelled``.
        offsets: The sensors' offset in each session, as far as it is known; empty with an estimator.
        load_uncertainty_n: Greatest expanded uncertainty (k = 2) of a load that was identified or stated [N].
        loss: An apparent loss between sensors and cylinder; None if there is none.
    """

    def __init__(
        self,
        logs: Logs,
        files: Sequence[LoggedFile],
        scratch: Path,
        model: FrictionEstimator | Path | None,
        workers: Workers | None = None,
    ) -> None:
        self.logs, self.files, self.scratch, self.workers = logs, files, scratch, workers or Workers()
        self.cylinder = logs.recipe.limits.cylinder
        if not (model is None or isinstance(model, Path) or self.workers.here):
            model.save(scratch / "model")
            model = scratch / "model"  # each worker reads it once
        labeller = Labeller(self.cylinder, load=logs.recipe.limits.load)
        stated = logs.recipe.limits.stated_load
        words, share = "" if stated is None else stated.in_words(), ROWS_IN_MEMORY // max(1, len(files))
        rows = min([share, *(file.rows or share for file in files)])
        self.friction = RecordingFriction(labeller, default_filter(self.cylinder), model, words, scratch, rows)
        self.refused: list[Quarantined] = []
        self.offsets: dict[str, KnownOffset] = {}
        self.loss: ApparentLoss | None = None
        self.missing_loss = ""
        self.load_uncertainty_n = 0.0

    def recordings(self, most_rows: int) -> Iterator[tuple[Recording, str]]:
        """Yield each usable recording with friction, bounds, velocity and usable rows, and a text on its load.

        If a log has more than ``most_rows`` rows, only some of its recordings are yielded, evenly spread over it.
        """
        of_file: dict[str, list[LabelledRecording]] = {}
        for each in self.labelled():
            of_file.setdefault(each.metadata.source_file, []).append(each)
        for own in of_file.values():
            every = -(-sum(each.rows for each in own) // most_rows)
            for each in own[::every]:
                offset = self.offsets.get(each.metadata.session)
                yield self.friction.finished(waiting(each.result), offset, self.loss), each.load

    def loss_in_words(self) -> str:
        """Describe the apparent loss, or what a stated loss does not explain; empty if there is none."""
        return self.missing_loss if self.loss is None else self.loss.sentence(self.cylinder)

    def labelled(
        self, seen: SeenRecordings | None = None, evidence: Sequence[OffsetEvidence] = ()
    ) -> list[LabelledRecording]:
        """Read, check and label each log. Return its usable recordings, which ``finished`` then completes.

        Copies are also searched for among ``seen`` recordings of earlier runs. At most ``MOST_SEARCHED`` sessions of
        their ``evidence`` on offsets, evenly spread, are used together with the new ones.
        """
        found = list(usable(self.files, self.friction.of_file, seen or SeenRecordings(), self.workers))
        if self.friction.labeller.needs_identification:
            found += self._labelled_by_session([each for each in found if isinstance(each, Converted)])
        self.refused += [each for each in found if isinstance(each, Quarantined)]
        labelled = [each for each in found if isinstance(each, LabelledRecording)]
        self.load_uncertainty_n = max((each.load_uncertainty_n for each in labelled), default=0.0)
        shown = [each.evidence for each in labelled if each.evidence is not None]
        if shown:
            known = sorted({each.session for each in evidence})
            spread = set(known[:: -(-len(known) // MOST_SEARCHED) or 1])
            every = [*(each for each in evidence if each.session in spread), *shown]
            offsets = known_offsets(every, self.cylinder, PLAN)
            self.loss, self.missing_loss = named_loss(every), missing_loss(every)
            sessions = {each.session for each in shown}
            self.offsets = {each.session: each for each in offsets if each.session in sessions}
        return labelled

    def _labelled_by_session(self, read: Sequence[Converted]) -> Iterator[LabelledRecording | Quarantined]:
        """Label recordings, session by session, in their order."""
        sessions: dict[str, list[Converted]] = {}
        for each in read:
            sessions.setdefault(each.metadata.session, []).append(each)
        work = [partial(self.friction.of_session, own) for own in sessions.values()]
        outcomes: dict[str, LabelledRecording | Quarantined] = {}
        for own, found in zip(sessions.values(), self.workers.in_order(work), strict=True):
            lost = [refused_piece(each.metadata, found) for each in own] if isinstance(found, LostPiece) else found
            outcomes |= zip((each.metadata.name for each in own), lost, strict=True)
            for each in own:
                discard(each.result)
        return (outcomes[each.metadata.name] for each in read)
