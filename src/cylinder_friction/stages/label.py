"""Stage ``label``: friction from the equation of motion, usable rows, splits, and the audit of labels against truth."""

from __future__ import annotations

import csv
import io
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cylinder_friction.labelling.audit import Audit, AuditRow
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.recordings.files import whole_folder, write_json, write_text
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.splits import split_sessions
from cylinder_friction.recordings.storage import read_metadata, read_recording, recording_paths, write_recording
from cylinder_friction.recordings.truth import read_truth
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.stages._stage import (
    AUDIT_FOLDER,
    PROCESSED_FOLDERS,
    SIGNALS_FOLDER,
    artifacts,
    cylinder_from,
    flat,
    hash_of,
)
from cylinder_friction.tracking.run_record import RunRecord

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.data import LabelParams
    from cylinder_friction.recordings.recording import Recording, RecordingMetadata
    from cylinder_friction.signals.smooth_signals import SignalFilter

IDENTIFIED_FILE = Path("data/processed/identified.json")
"""Load and moving mass of each session."""

NOTHING_IDENTIFIED = "the load is not asked of position, and the moving mass is given, so nothing was identified"

NO_TRUTH = "true friction of no recording is known, so labels cannot be audited"


def run(params: Params) -> RunRecord:
    """Read ``data/interim/signals``, writes ``data/processed/{train,validation,test,audit}`` and ``identified.json``.

    Raises:
        RecordingError: A test has too few sessions to split, truth does not belong to its recording, or a session does
            not tell the load that it is asked.
    """
    settings = params.label
    filters = filters_by_method(**params.filter.model_dump(exclude={"method"}))
    labeller = labeller_from(params)
    metadata = [read_metadata(path) for path in recording_paths(SIGNALS_FOLDER)]
    refuse_unknown_condition(params.lugre.condition, [entry.condition for entry in metadata])
    split = split_sessions(metadata, **settings.split.model_dump())
    identified = identify_sessions(metadata, labeller, filters[params.filter.method])
    write_identified(identified)
    metrics: dict[str, float] = {}
    for role, names in split.items():
        metrics |= write_labelled(role, names, labeller, filters[params.filter.method], identified)
    audit, audited = audit_labels([entry.name for entry in metadata], params, labeller, filters, identified)
    write_audit(audit)
    return RunRecord(
        name="label",
        params=flat(settings) | {"filter": params.filter.method},
        metrics=metrics | {"audited_recordings": float(audited)} | _audit_metrics(audit),
        artifacts=artifacts(AUDIT_FOLDER, IDENTIFIED_FILE),
        datasets={role: hash_of(folder) for role, folder in PROCESSED_FOLDERS.items()},
    )


def refuse_unknown_condition(lugre_condition: str, conditions: Sequence[str]) -> None:
    """Refuse ``lugre.condition`` here already: the stage that needs it comes after hours of search and training.

    Raises:
        RecordingError: No recording is of that test.
    """
    if lugre_condition not in conditions:
        raise RecordingError(
            f"lugre.condition is {lugre_condition!r}, but the recordings are of conditions {sorted(set(conditions))}; "
            "name the one without load: LuGre is identified on it"
        )


def stiffness_from(settings: LabelParams) -> Stiffness:
    """Return which spring enters the equation of motion, from the configuration."""
    return Stiffness(
        mode=settings.stiffness,
        bulk_modulus_pa=settings.bulk_modulus_pa,
        external_stiffness_n_m=settings.external_stiffness_n_m,
        reference_m=settings.stiffness_reference_m,
        dead_volume_m3=settings.dead_volume_m3,
    )


def labeller_from(params: Params) -> Labeller:
    """Return how labels are made, from the configuration."""
    settings = params.label
    return Labeller(
        cylinder_from(params.cylinder),
        stiffness_from(settings),
        settings.end_stop_margin_m,
        settings.load,
        settings.inertia,
        LoadPlan(**settings.identify.model_dump()),
    )


def identify_sessions(
    metadata: Sequence[RecordingMetadata], labeller: Labeller, used_filter: SignalFilter
) -> dict[str, SessionIdentification]:
    """Return load and mass of each session; nothing where neither is to be identified.

    A session is whole in one role, so no held-out recording contributes to a training label.

    Raises:
        RecordingError: A session does not determine its load.
    """
    names: dict[str, list[str]] = {}
    for entry in sorted(metadata, key=lambda entry: entry.session):
        names.setdefault(entry.session, []).append(entry.name)
    sessions = {session: _filtered(own, f"identify {session}") for session, own in names.items()}
    return labeller.identify_sessions(sessions, used_filter)


def write_identified(identified: Mapping[str, SessionIdentification]) -> None:
    """Write what was identified, one entry a session; names carry their units, ``_interval`` is a pair."""
    content: dict[str, Any] = {session: each.to_dict() for session, each in identified.items()}
    write_json(IDENTIFIED_FILE, content or {"note": NOTHING_IDENTIFIED})


def write_labelled(
    role: str,
    names: Sequence[str],
    labeller: Labeller,
    used_filter: SignalFilter,
    identified: Mapping[str, SessionIdentification],
) -> dict[str, float]:
    """Write one role's recordings with their labels; returns how many recordings, rows and usable rows."""
    rows, usable = 0, 0
    with whole_folder(PROCESSED_FOLDERS[role]) as folder:
        for recording in _filtered(names, f"label {role}"):
            labelled = labeller.labelled(recording, used_filter, identified.get(recording.metadata.session))
            write_recording(folder, labelled)
            rows, usable = rows + len(labelled), usable + int(labelled.usable().sum())
    return {
        f"{role}.recordings": float(len(names)),
        f"{role}.rows": float(rows),
        f"{role}.usable_rows": float(usable),
    }


def audit_labels(
    names: Sequence[str],
    params: Params,
    labeller: Labeller,
    filters: Mapping[str, SignalFilter],
    identified: Mapping[str, SessionIdentification],
) -> tuple[list[AuditRow], int]:
    """Return the audit of every filter and the number of recordings whose truth is known."""
    folder = Path(params.ingest.truth)
    known = [name for name in names if params.ingest.truth and (folder / f"{name}.parquet").is_file()]
    audit = Audit(params.label.event_window_s)
    for recording in _filtered(known, "audit labels"):
        truth = read_truth(folder, recording)
        assert truth is not None
        labeller.audit(recording, truth, filters, audit, identified.get(recording.metadata.session))
    return audit.rows(), len(known)


def write_audit(rows: Sequence[AuditRow]) -> None:
    """Write ``audit.json``, nested by filter, test and stratum, and ``audit.csv``, one line a row."""
    nested: dict[str, Any] = {} if rows else {"note": NO_TRUTH}
    for row in rows:
        content = row.to_dict()
        place = nested.setdefault(content.pop("filter"), {}).setdefault(content.pop("condition"), {})
        place[content.pop("stratum")] = content
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(AuditRow)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(row.to_dict() for row in rows)
    with whole_folder(AUDIT_FOLDER) as folder:
        write_json(folder / "audit.json", nested)
        write_text(folder / "audit.csv", text.getvalue())


def _filtered(names: Sequence[str], what: str) -> Iterator[Recording]:
    """Yield the named recordings one at a time, with a progress bar."""
    for name in tqdm(names, what, unit="recording", disable=None):
        yield read_recording(SIGNALS_FOLDER / f"{name}.parquet")


def _audit_metrics(rows: Sequence[AuditRow]) -> dict[str, float]:
    return {
        f"audit.{row.filter}.condition_{row.condition}.{row.stratum}_mae_n": row.mae_n
        for row in rows
        if row.stratum in ("steady", "events")
    }
