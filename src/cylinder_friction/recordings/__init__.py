"""Recordings: what one is, how files become one, how it is checked and stored."""

from cylinder_friction.recordings.files import read_json, whole_folder, write_json, write_text
from cylinder_friction.recordings.recording import (
    REQUIRED_COLUMNS,
    SAMPLE_COLUMNS,
    Recording,
    RecordingError,
    RecordingMetadata,
    refuse_not_finite,
)
from cylinder_friction.recordings.storage import (
    iterate_recordings,
    read_metadata,
    read_recording,
    read_recordings,
    recording_paths,
    write_recording,
)

__all__ = [
    "REQUIRED_COLUMNS",
    "SAMPLE_COLUMNS",
    "Recording",
    "RecordingError",
    "RecordingMetadata",
    "iterate_recordings",
    "read_json",
    "read_metadata",
    "read_recording",
    "read_recordings",
    "recording_paths",
    "refuse_not_finite",
    "whole_folder",
    "write_json",
    "write_recording",
    "write_text",
]
