"""Stage ``label``: friction from the equation of motion, usable rows, and the audit of labels against truth."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import asdict, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tqdm import tqdm

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.labelling.audit import Audit, AuditRow
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.recordings.columns import ALL_CONDITIONS
from cylinder_friction.recordings.files import read_json, whole_folder, write_json, write_text
from cylinder_friction.recordings.recording import Recording, RecordingMetadata
from cylinder_friction.recordings.storage import read_metadata, read_recording, recording_paths, write_recording
from cylinder_friction.recordings.truth import read_truth
from cylinder_friction.run_record import RunRecord
from cylinder_friction.signals.methods import filters_by_method
from cylinder_friction.stages._datasets import datasets
from cylinder_friction.stages._stage import (
    AUDIT_FILE,
    AUDIT_FOLDER,
    FILTERS_FILE,
    IDENTIFIED_FILE,
    INGESTED_FILE,
    LABELLED_FOLDER,
    SIGNALS_FOLDER,
    artifacts,
    cylinder_from,
    flat,
)

if TYPE_CHECKING:
    from cylinder_friction.execution.workers import Workers
    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.data import LabelParams
    from cylinder_friction.recordings.checks.limits import LoadMode
    from cylinder_friction.signals.smooth_signals import SignalFilter

NOTHING_IDENTIFIED = "the load does not depend on position, and the moving mass is given, so nothing was identified"

NO_TRUTH = "true friction of no recording is known, so labels cannot be audited"


def run(params: Params) -> RunRecord:
    """Read ``data/interim/signals``, write ``data/processed/{labelled,audit}`` and ``identified.json``.

    Which filter smoothed the signals, where truth lies and what the rod worked against stand beside the signals.

    Raises:
        RecordingError: Truth does not belong to its recording, or a session does not determine the load that is asked
            of it.
    """
    settings = params.label
    ingested, filtering = read_json(INGESTED_FILE), read_json(FILTERS_FILE)
    method = filtering.pop("method")
    filters = filters_by_method(cylinder_from(params.cylinder), **filtering)
    labeller = labeller_from(params, ingested["load"])
    metadata = [read_metadata(path) for path in recording_paths(SIGNALS_FOLDER)]
    with workers_from_environment() as workers:
        identified = identify_sessions(metadata, labeller, filters[method], workers)
        write_identified(identified)
        metrics = write_labelled(metadata, labeller, filters[method], identified, workers)
        folder = Path(ingested["truth"])
        known = [each for each in metadata if ingested["truth"] and (folder / f"{each.name}.parquet").is_file()]
        audit = audit_labels(known, folder, settings.event_window_s, labeller, filters, identified, workers)
    write_audit(audit)
    return RunRecord(
        name="label",
        params=flat(settings) | {"filter": method, "load": ingested["load"]},
        metrics=metrics | {"audited_recordings": float(len(known))} | _audit_metrics(audit, method),
        artifacts=artifacts(AUDIT_FOLDER, IDENTIFIED_FILE),
        datasets=datasets({"signals": SIGNALS_FOLDER}) | datasets({"labelled": LABELLED_FOLDER}, written=True),
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


def labeller_from(params: Params, load: LoadMode) -> Labeller:
    """Return how labels are made, from the configuration and what the rod works against."""
    settings = params.label
    return Labeller(
        cylinder_from(params.cylinder),
        stiffness_from(settings),
        settings.end_stop_margin_m,
        load,
        settings.inertia,
        LoadPlan(**settings.identify.model_dump()),
    )


def identify_sessions(
    metadata: Sequence[RecordingMetadata], labeller: Labeller, used_filter: SignalFilter, workers: Workers
) -> dict[str, SessionIdentification]:
    """Return load and mass of each session; nothing where neither is to be identified.

    Sessions are split whole, so no held-out recording contributes to a training label.

    Raises:
        RecordingError: A session does not determine its load.
    """
    names: dict[str, list[str]] = {}
    for entry in sorted(metadata, key=lambda entry: entry.session):
        names.setdefault(entry.session, []).append(entry.name)
    if not labeller.needs_identification:
        return {}
    pieces = [partial(identify_session, *each, labeller, used_filter) for each in names.items()]
    return dict(zip(names, _shown(workers.all_in_order(pieces, list(names)), names, "identify"), strict=True))


def identify_session(
    session: str, names: Sequence[str], labeller: Labeller, used_filter: SignalFilter
) -> SessionIdentification:
    """Return load and mass of a session from the recordings of these names."""
    return labeller.identify_sessions({session: map(_signals, names)}, used_filter)[session]


def write_identified(identified: Mapping[str, SessionIdentification]) -> None:
    """Write what was identified, one entry per session; names carry their units, ``_interval`` is a pair."""
    content: dict[str, Any] = {session: each.to_dict() for session, each in identified.items()}
    write_json(IDENTIFIED_FILE, content or {"note": NOTHING_IDENTIFIED})


def write_labelled(
    metadata: Sequence[RecordingMetadata],
    labeller: Labeller,
    used_filter: SignalFilter,
    identified: Mapping[str, SessionIdentification],
    workers: Workers,
) -> dict[str, float]:
    """Write the recordings with their labels; return how many recordings, rows and usable rows."""
    rows, usable = 0, 0
    names = [each.name for each in metadata]
    with whole_folder(LABELLED_FOLDER) as folder:
        pieces = [
            partial(write_label, each.name, labeller, used_filter, identified.get(each.session), folder)
            for each in metadata
        ]
        for own_rows, own_usable in _shown(workers.all_in_order(pieces, names), names, "label"):
            rows, usable = rows + own_rows, usable + own_usable
    return {"recordings": float(len(names)), "rows": float(rows), "usable_rows": float(usable)}


def write_label(
    name: str, labeller: Labeller, used_filter: SignalFilter, identified: SessionIdentification | None, folder: Path
) -> tuple[int, int]:
    """Write one recording with its label into a folder; return how many rows and usable rows."""
    labelled = labeller.labelled(_signals(name), used_filter, identified)
    write_recording(folder, labelled)
    return len(labelled), int(labelled.usable().sum())


def audit_labels(
    metadata: Sequence[RecordingMetadata],
    truth_folder: Path,
    event_window_s: float,
    labeller: Labeller,
    filters: Mapping[str, SignalFilter],
    identified: Mapping[str, SessionIdentification],
    workers: Workers,
) -> list[AuditRow]:
    """Return the audit of every filter on recordings whose truth lies in a folder."""
    names = [each.name for each in metadata]
    pieces = [
        partial(audit_label, each.name, truth_folder, event_window_s, labeller, filters, identified.get(each.session))
        for each in metadata
    ]
    audit = Audit(event_window_s)
    for own in _shown(workers.all_in_order(pieces, names), names, "audit labels"):
        audit.merge(own)
    return audit.rows()


def audit_label(
    name: str,
    truth_folder: Path,
    event_window_s: float,
    labeller: Labeller,
    filters: Mapping[str, SignalFilter],
    identified: SessionIdentification | None,
) -> Audit:
    """Return the audit of every filter on one recording."""
    recording = _signals(name)
    truth = read_truth(truth_folder, recording)
    assert truth is not None
    audit = Audit(event_window_s)
    labeller.audit(recording, truth, filters, audit, identified)
    return audit


def write_audit(rows: Sequence[AuditRow]) -> None:
    """Write ``audit.json``, nested by filter, condition and stratum, and ``audit.csv``, one line per entry."""
    nested: dict[str, Any] = {} if rows else {"note": NO_TRUTH}
    for row in rows:
        content = asdict(row)
        place = nested.setdefault(content.pop("filter"), {}).setdefault(content.pop("condition"), {})
        place[content.pop("stratum")] = content
    text = io.StringIO()
    writer = csv.DictWriter(text, [field.name for field in fields(AuditRow)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(map(asdict, rows))
    with whole_folder(AUDIT_FOLDER) as folder:
        write_json(folder / AUDIT_FILE.name, nested)
        write_text(folder / "audit.csv", text.getvalue())


def _signals(name: str) -> Recording:
    return read_recording(SIGNALS_FOLDER / f"{name}.parquet")


def _shown(results: Iterator[Any], names: Collection[str], what: str) -> Iterator[Any]:
    """Yield results with a progress bar."""
    yield from tqdm(results, what, len(names), unit="piece", disable=None)


def _audit_metrics(rows: Sequence[AuditRow], method: str) -> dict[str, float]:
    """Return the label's error by stratum, of the filter in use and over all conditions; ``audit.csv`` has the rest."""
    return {
        f"label_mae_n/{row.stratum}": row.mae_n
        for row in rows
        if (row.filter, row.condition) == (method, ALL_CONDITIONS) and math.isfinite(row.mae_n)
    }
