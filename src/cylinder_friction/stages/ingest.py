"""Stage ``ingest``: convert any logger's files to one Parquet schema in SI units, and quarantine unusable ones."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from tqdm import tqdm

from cylinder_friction.execution.selection import workers_from_environment
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.recordings.columns import LOAD_FORCE, OIL_TEMPERATURE, OTHER_POSITIONS
from cylinder_friction.recordings.logs import NameRules, Recipe
from cylinder_friction.recordings.reading_logs import Ingested, ingest_folder
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.run_record import RunRecord
from cylinder_friction.stages._stage import INGESTED_FILE, RECORDINGS_FOLDER, artifacts, flat

if TYPE_CHECKING:
    from cylinder_friction.params.checking import Params
    from cylinder_friction.params.data import IngestParams

QUARANTINE_FILE = Path("data/interim/quarantine.json")
"""Every file or part of a file that did not become a recording, with the reason."""


def run(params: Params) -> RunRecord:
    """Read ``ingest.source``; write ``data/interim/recordings``, one file per recording, and ``quarantine.json``.

    ``data/interim/ingested.json`` gives later stages the folder of the truth and the source of the load.

    Raises:
        RecordingError: Mapping and ``ingest.load`` contradict each other, there is no file, or no file is usable.
    """
    refuse_unlike_load(params.ingest)
    source, pattern = Path(params.ingest.source), params.ingest.pattern
    with workers_from_environment() as workers:
        ingested = ingest_folder(source, pattern, recipe_from(params), RECORDINGS_FOLDER, QUARANTINE_FILE, workers)
    content = params.ingest.model_dump(include={"source", "truth", "load", "oil_temperature"})
    others = [column for column in OTHER_POSITIONS if column in params.ingest.channels]
    write_json(INGESTED_FILE, content | {"other_positions": others if params.ingest.load == "position" else []})
    tqdm.write(f"ingest: {ingested.summary()}")
    return RunRecord(
        name="ingest",
        params=flat(params.ingest, exclude_defaults=True),
        metrics=_metrics(ingested),
        artifacts=artifacts(QUARANTINE_FILE, INGESTED_FILE),
    )


def refuse_unlike_load(settings: IngestParams) -> None:
    """Refuse settings that later stages would refuse, before all files are read.

    Raises:
        RecordingError: A load cell is mapped that the label does not use, or the label needs one that is not mapped;
            or the oil temperature is an input of the estimators but is not mapped.
    """
    mapped, load = LOAD_FORCE in settings.channels, settings.load
    if mapped and load != "measured":
        raise RecordingError(
            f"ingest.load is {load}, but ingest.channels maps a load cell ({LOAD_FORCE!r}); set ingest.load to "
            "measured, or leave its channel out of the mapping"
        )
    if load == "measured" and not mapped:
        raise RecordingError(
            f"ingest.load is measured, but ingest.channels has no {LOAD_FORCE!r}; map the load cell's channel to it, "
            "or set ingest.load to none or position"
        )
    if settings.oil_temperature == "input" and OIL_TEMPERATURE not in settings.channels:
        raise RecordingError(
            f"ingest.oil_temperature is input, but ingest.channels has no {OIL_TEMPERATURE!r}; map the oil's "
            "temperature to it, or set ingest.oil_temperature to recorded"
        )


def recipe_from(params: Params) -> Recipe:
    """Make the recipe by which a file becomes recordings."""
    settings = params.ingest
    return Recipe.from_settings(settings.model_dump(), NameRules(settings.name_pattern), params.cylinder, settings.load)


def _metrics(ingested: Ingested) -> dict[str, float]:
    seconds: defaultdict[str, float] = defaultdict(float)
    for metadata, rows in ingested.recordings:
        seconds[f"seconds/condition_{metadata.condition}"] += rows * metadata.sample_time_s
    return {
        "files": float(ingested.files),
        "recordings": float(len(ingested.recordings)),
        "repaired": float(len(ingested.repaired())),
        "quarantined": float(len(ingested.quarantined)),
        "sessions": float(len({metadata.session for metadata, _ in ingested.recordings})),
        **seconds,
    }
