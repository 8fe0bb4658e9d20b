"""Looking at recordings: the checks as text, the signals and friction as a page, and a first mapping of a new file."""

from cylinder_friction.inspection.choice import PLOTTED, held
from cylinder_friction.inspection.files import inspect_file, inspect_files
from cylinder_friction.inspection.first_mapping import GuessedColumn, GuessedMapping, guess_mapping
from cylinder_friction.inspection.mapping_text import TEMPLATE, mapping_yaml
from cylinder_friction.inspection.page import write_page
from cylinder_friction.inspection.subject import OUTCOMES, Extent, Inspected
from cylinder_friction.inspection.text import text_report

__all__ = [
    "OUTCOMES",
    "PLOTTED",
    "TEMPLATE",
    "Extent",
    "GuessedColumn",
    "GuessedMapping",
    "Inspected",
    "guess_mapping",
    "held",
    "inspect_file",
    "inspect_files",
    "mapping_yaml",
    "text_report",
    "write_page",
]
