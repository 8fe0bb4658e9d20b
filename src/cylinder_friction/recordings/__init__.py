"""Recordings: what one is, how files become one, how it is checked and stored."""

from cylinder_friction.recordings.checks import CheckLimits, check_recording
from cylinder_friction.recordings.files import read_json, whole_folder, write_json, write_text
from cylinder_friction.recordings.ingesting import QUARANTINE_FILE, Ingested, Quarantined, Source, ingest_folder
from cylinder_friction.recordings.logged import LoggedTable
from cylinder_friction.recordings.mapping import ChannelMapping
from cylinder_friction.recordings.readers import READERS, Reader, reader_for
from cylinder_friction.recordings.recording import (
    DRIVE_FORCE,
    REQUIRED_COLUMNS,
    SAMPLE_COLUMNS,
    Recording,
    RecordingError,
    RecordingMetadata,
    SensorUncertainty,
    missing_columns,
    refuse_not_finite,
)
from cylinder_friction.recordings.signal import Piece, Signal
from cylinder_friction.recordings.storage import (
    iterate_recordings,
    read_metadata,
    read_recording,
    read_recordings,
    recording_paths,
    write_recording,
)
from cylinder_friction.recordings.truth import read_truth

__all__ = [
    "DRIVE_FORCE",
    "QUARANTINE_FILE",
    "READERS",
    "REQUIRED_COLUMNS",
    "SAMPLE_COLUMNS",
    "ChannelMapping",
    "CheckLimits",
    "Ingested",
    "LoggedTable",
    "Piece",
    "Quarantined",
    "Reader",
    "Recording",
    "RecordingError",
    "RecordingMetadata",
    "SensorUncertainty",
    "Signal",
    "Source",
    "check_recording",
    "ingest_folder",
    "iterate_recordings",
    "missing_columns",
    "read_json",
    "read_metadata",
    "read_recording",
    "read_recordings",
    "read_truth",
    "reader_for",
    "recording_paths",
    "refuse_not_finite",
    "whole_folder",
    "write_json",
    "write_recording",
    "write_text",
]
