"""Stage ``label``: friction from the equation of motion, usable rows, and the audit of labels against truth."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from cylinder_friction.evaluation.truth import read_truth
from cylinder_friction.execution.progress import progress
from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.files.whole_files import read_json, whole_folder, write_json, write_text
from cylinder_friction.labelling.audit import Audit, AuditRow
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.storage import read_metadata, read_recording, recording_paths, write_recording
from cylinder_friction.run_record import RunRecord
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.stages._stage import (
    AUDIT_FILE,
    AUDIT_FOLDER,
    FILTERS_FILE,
    IDENTIFIED_FILE,
    INGESTED_FILE,
    LABELLED_FOLDER,
    SIGNALS_FOLDER,
    artifacts,
    datasets,
    flat,
)

if TYPE_CHECKING:
    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.params.checking import Params
    from cylinder_friction.recordings.checks.limits import LoadMode
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.signals.smooth_signals import SignalFilter

NOTHING_IDENTIFIED = "the load does not depend on position, and the moving mass is given, so nothing was identified"

NO_TRUTH = "true friction of no recording is known, so labels cannot be audited"


def run(params: Params) -> RunRecord:
    """Read ``data/interim/signals``; write ``data/processed/{labelled,audit}`` and ``identified.json``.

    Files of earlier stages state the filter that smoothed the signals, the folder of the truth and the source of load.

    Raises:
        RecordingError: Truth does not belong to its recording, or a session does not determine a load that is to be
            identified.
    """
    settings = params.label
    ingested, filtering = read_json(INGESTED_FILE), read_json(FILTERS_FILE)
    method, load = filtering.pop("method"), ingested["load"]
    filters = filters_by_method(params.cylinder, **filtering)
    labelling = Labelling(labeller_from(params, load), filters, method, ingested["truth"], settings.event_window_s)
    metadata = [read_metadata(path) for path in recording_paths(SIGNALS_FOLDER)]
    names = [each.name for each in metadata]
    sessions: dict[str, list[str]] = {}
    for each in sorted(metadata, key=lambda each: each.session) if labelling.labeller.needs_identification else ():
        sessions.setdefault(each.session, []).append(each.name)
    with workers_from_environment() as workers, whole_folder(LABELLED_FOLDER) as folder:
        found = workers.all_in_order([partial(labelling.identify, *each) for each in sessions.items()], list(sessions))
        shown = progress(found, "identify", len(sessions), unit="session")
        identified = dict(zip(sessions, shown, strict=True))
        pieces = [partial(labelling.write, each.name, identified.get(each.session), folder) for each in metadata]
        done = workers.all_in_order(pieces, names)
        written = list(progress(done, "label", len(names), unit="recording"))
    write_json(
        IDENTIFIED_FILE,
        {session: each.to_dict() for session, each in identified.items()} or {"note": NOTHING_IDENTIFIED},
    )
    audited = [audit for _, _, audit in written if audit is not None]
    audit = Audit(settings.event_window_s)
    for own in audited:
        audit.merge(own)
    write_audit(audit.rows())
    return RunRecord(
        name="label",
        params=flat(settings) | {"filter": method, "load": load},
        metrics={
            "recordings": float(len(names)),
            "rows": float(sum(rows for rows, _, _ in written)),
            "usable_rows": float(sum(usable for _, usable, _ in written)),
            "audited_recordings": float(len(audited)),
            **_audit_metrics(audit.rows(), method),
        },
        artifacts=artifacts(AUDIT_FOLDER, IDENTIFIED_FILE),
        datasets=datasets({"signals": SIGNALS_FOLDER}),
    )


def labeller_from(params: Params, load: LoadMode) -> Labeller:
    """Make the labeller from the configuration and the source of the load."""
    settings = params.label
    stiffness = Stiffness(
        mode=settings.stiffness,
        bulk_modulus_pa=settings.bulk_modulus_pa,
        external_stiffness_n_m=settings.external_stiffness_n_m,
        reference_m=settings.stiffness_reference_m,
        dead_volume_m3=settings.dead_volume_m3,
    )
    return Labeller(params.cylinder, stiffness, settings.end_stop_margin_m, load, settings.inertia, settings.identify)


@dataclass(frozen=True)
class Labelling:
    """The work on each session and each recording, in a form that can be sent to workers."""

    labeller: Labeller
    filters: Mapping[str, SignalFilter]  # All filters by method, for the audit
    method: str  # Method of the filter that smoothed the signals
    truth: str  # Folder of true friction, as far as it is known
    event_window_s: float  # Time around an event that the audit counts as near it [s]

    def identify(self, session: str, names: Sequence[str]) -> SessionIdentification:
        """Identify load and mass of a session from its recordings.

        A session has one role as a whole, so no held-out recording contributes to a training label.

        Raises:
            RecordingError: The session does not determine its load.
        """
        recordings = {session: map(_signals, names)}
        return self.labeller.identify_sessions(recordings, self.filters[self.method])[session]

    def write(self, name: str, identified: SessionIdentification | None, folder: Path) -> tuple[int, int, Audit | None]:
        """Write one recording with its label into a folder.

        Returns:
            Number of rows, of usable rows, and the audit of every filter, or None if the recording has no truth.
        """
        recording = _signals(name)
        labelled = self.labeller.labelled(recording, self.filters[self.method], identified)
        write_recording(folder, labelled)
        truth = read_truth(Path(self.truth), recording)
        audit = None if truth is None else Audit(self.event_window_s)
        if truth is not None and audit is not None:
            self.labeller.audit(recording, truth, self.filters, audit, identified)
        return len(labelled), int(labelled.usable().sum()), audit


def write_audit(rows: Sequence[AuditRow]) -> None:
    """Write ``audit.json``, nested by filter, condition and stratum, and ``audit.csv``, one line per entry."""
    nested: dict[str, Any] = {} if rows else {"note": NO_TRUTH}
    for row in rows:
        content = asdict(row)
        place = nested.setdefault(content.pop("filter"), {}).setdefault(content.pop("condition"), {})
        place[content.pop("stratum")] = content
    table = pd.DataFrame(map(asdict, rows), columns=[field.name for field in fields(AuditRow)])
    with whole_folder(AUDIT_FOLDER) as folder:
        write_json(folder / AUDIT_FILE.name, nested)
        write_text(folder / "audit.csv", table.to_csv(index=False, lineterminator="\n"))


def _signals(name: str) -> Recording:
    return read_recording(SIGNALS_FOLDER / f"{name}.parquet")


def _audit_metrics(rows: Sequence[AuditRow], method: str) -> dict[str, float]:
    """Select the label's error by stratum, for the filter in use over all conditions; ``audit.csv`` has the rest."""
    return {
        f"label_mae_n/{row.stratum}": row.mae_n
        for row in rows
        if (row.filter, row.condition) == (method, ALL_CONDITIONS) and math.isfinite(row.mae_n)
    }
