"""Write the file of a first mapping, ``conf/ingest/<name>.yaml``."""

import glob
import re
from pathlib import Path

from cylinder_friction.recordings.mapping.guessing import GuessedMapping, channel_lines, quoted
from cylinder_friction.wording import printable

TEMPLATE = """\
# First mapping of {file}, made from its names, units and values.
# Look at every line marked guess, CHECK, AMBIGUOUS or NOT FOUND; then take the remark away.
defaults:
  - rules@_here_: default  # usual rules of time, spikes, zeros, limits; in a project conf/ingest/rules/default.yaml
  - _self_
source: {source}
pattern: {pattern}
# guess: the name of the file is the session, what comes before its first _ the condition.
name_pattern: {name_pattern}
{database}channels:
{channels}
"""
"""Text of the mapping file. The lines in place of ``{channels}`` are indented by two blanks."""


def mapping_yaml(guess: GuessedMapping, database: Path | None = None) -> str:
    """Write the text of ``conf/ingest/<name>.yaml``, with the file's folder as the source, and a bus's DBC file."""
    ending = re.search(r"(?<=.)(\.[A-Za-z0-9]+)?\.gz$|(?<=.)\.[A-Za-z0-9]+$", guess.path.name)
    suffix = ending[0] if ending else ""
    filled = {
        "file": printable(guess.path.name),
        "source": quoted(guess.path.parent.as_posix()),
        "pattern": quoted(f"**/*{glob.escape(suffix)}"),
        "name_pattern": quoted(rf"(?P<session>(?P<condition>[^/]+?)(?:_[^/]*)?){re.escape(suffix)}$"),
        "database": "" if database is None else f"database: {quoted(database.as_posix())}\n",
        "channels": "\n".join(f"  {line}" for line in channel_lines(guess)),
    }
    return re.sub(r"\{(\w+)\}", lambda match: filled[match[1]], TEMPLATE)
