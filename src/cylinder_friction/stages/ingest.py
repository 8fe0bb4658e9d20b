"""Stage ``ingest``: any logger's files into one Parquet schema in SI units; what is unusable is quarantined."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.recordings import (
    QUARANTINE_FILE,
    ChannelMapping,
    CheckLimits,
    Ingested,
    Source,
    ingest_folder,
    reader_for,
)
from cylinder_friction.stages._stage import RECORDINGS_FOLDER, artifacts, flat, hash_of
from cylinder_friction.tracking.run_record import RunRecord

if TYPE_CHECKING:
    from cylinder_friction.params import IngestParams, Params


def run(params: Params) -> RunRecord:
    """Reads ``ingest.source``, writes ``data/interim/recordings``: one file a recording, and ``quarantine.json``.

    Raises:
        RecordingError: There is no file, or not one is usable.
    """
    settings = params.ingest
    limits = CheckLimits(params.cylinder.stroke_m, minimum_duration_s=settings.minimum_duration_s)
    ingested = ingest_folder(source_from(settings, params.cylinder.name), limits, RECORDINGS_FOLDER)
    return RunRecord(
        name="ingest",
        params=flat(settings),
        metrics=_metrics(ingested),
        artifacts=artifacts(RECORDINGS_FOLDER / QUARANTINE_FILE),
        datasets={"recordings": hash_of(RECORDINGS_FOLDER)},
    )


def source_from(settings: IngestParams, cylinder: str) -> Source:
    """Returns what ``ingest_folder`` reads, from the configuration."""
    options = getattr(settings, settings.format).model_dump()  # each format's options stand under its name
    return Source(
        folder=Path(settings.source),
        pattern=settings.pattern,
        name_pattern=settings.name_pattern,
        reader=reader_for(settings.format, **options),
        channels={column: ChannelMapping(**channel.model_dump()) for column, channel in settings.channels.items()},
        cylinder=cylinder,
    )


def _metrics(ingested: Ingested) -> dict[str, float]:
    seconds: defaultdict[str, float] = defaultdict(float)
    for metadata, rows in ingested.recordings:
        seconds[f"test_{metadata.test}.seconds"] += rows * metadata.sample_time_s
    return {
        "recordings": float(len(ingested.recordings)),
        "quarantined": float(len(ingested.quarantined)),
        "sessions": float(len({metadata.session for metadata, _ in ingested.recordings})),
        **seconds,
    }
