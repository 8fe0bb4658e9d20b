"""Readers of loggers' files, one a format, chosen by what a file holds and not by its ending."""

from cylinder_friction.recordings.formats.detect import FORMATS, detect_format
from cylinder_friction.recordings.formats.options import CsvOptions
from cylinder_friction.recordings.formats.reading import read_logged_file

__all__ = ["FORMATS", "CsvOptions", "detect_format", "read_logged_file"]
