"""Looking at recordings: the checks as text, the signals and friction as a page, and a first mapping of a new file."""

from cylinder_friction.inspection.files import inspect_file, inspect_files
from cylinder_friction.inspection.first_mapping import GuessedColumn, GuessedMapping, guess_mapping
from cylinder_friction.inspection.mapping_text import TEMPLATE, mapping_yaml
from cylinder_friction.inspection.page import PLOTTED, write_page
from cylinder_friction.inspection.subject import OUTCOMES, Inspected
from cylinder_friction.inspection.text import text_report

__all__ = [
    "OUTCOMES",
    "PLOTTED",
    "TEMPLATE",
    "GuessedColumn",
    "GuessedMapping",
    "Inspected",
    "guess_mapping",
    "inspect_file",
    "inspect_files",
    "mapping_yaml",
    "text_report",
    "write_page",
]
