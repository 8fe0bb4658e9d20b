"""The file of parameters: its name and place, and the error that refuses what it holds."""

from pathlib import Path

from cylinder_friction.refusal import RefusalError

PARAMS_FILE = Path("params.yaml")
IN_A_PROJECT = "run this in a project's folder, which `cylinder-friction init FOLDER` makes"


class ParamsError(RefusalError, ValueError):
    """A configuration that is refused; the message names the key."""
