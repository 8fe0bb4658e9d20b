"""Recordings: what one is, how files become one, how it is checked and stored."""

from cylinder_friction.recordings.calibration import NoZero, ZeroReading, ZeroRules
from cylinder_friction.recordings.check_limits import CheckLimits
from cylinder_friction.recordings.checks import check_recording, inspect_recording
from cylinder_friction.recordings.files import read_json, whole_folder, write_json, write_text
from cylinder_friction.recordings.findings import Finding
from cylinder_friction.recordings.formats import FORMATS, CsvOptions, read_logged_file
from cylinder_friction.recordings.ingesting import Ingested, Quarantined, Source, ingest_folder
from cylinder_friction.recordings.logged import LoggedTable
from cylinder_friction.recordings.mapping import ChannelMapping, check_mapping
from cylinder_friction.recordings.names import NameRules, PathNames, compile_name_pattern, name_of
from cylinder_friction.recordings.one_file import judged, metadata_of, pieces_of, zeroed
from cylinder_friction.recordings.plausibility import LoadMode
from cylinder_friction.recordings.recipe import Recipe
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
from cylinder_friction.recordings.screening import ScreenRules
from cylinder_friction.recordings.sensor import SensorScale
from cylinder_friction.recordings.signal import Piece, Signal
from cylinder_friction.recordings.storage import (
    iterate_recordings,
    read_metadata,
    read_recording,
    read_recordings,
    recording_paths,
    write_recording,
)
from cylinder_friction.recordings.time_rules import TimeRules
from cylinder_friction.recordings.truth import read_truth

__all__ = [
    "DRIVE_FORCE",
    "FORMATS",
    "REQUIRED_COLUMNS",
    "SAMPLE_COLUMNS",
    "ChannelMapping",
    "CheckLimits",
    "CsvOptions",
    "Finding",
    "Ingested",
    "LoadMode",
    "LoggedTable",
    "NameRules",
    "NoZero",
    "PathNames",
    "Piece",
    "Quarantined",
    "Recipe",
    "Recording",
    "RecordingError",
    "RecordingMetadata",
    "ScreenRules",
    "SensorScale",
    "SensorUncertainty",
    "Signal",
    "Source",
    "TimeRules",
    "ZeroReading",
    "ZeroRules",
    "check_mapping",
    "check_recording",
    "compile_name_pattern",
    "ingest_folder",
    "inspect_recording",
    "iterate_recordings",
    "judged",
    "metadata_of",
    "missing_columns",
    "name_of",
    "pieces_of",
    "read_json",
    "read_logged_file",
    "read_metadata",
    "read_recording",
    "read_recordings",
    "read_truth",
    "recording_paths",
    "refuse_not_finite",
    "whole_folder",
    "write_json",
    "write_recording",
    "write_text",
    "zeroed",
]
