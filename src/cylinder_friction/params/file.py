"""Name and place of the parameter file, and the error for a configuration that is refused."""

from pathlib import Path

from cylinder_friction.refusal import RefusalError

PARAMS_FILE = Path("params.yaml")
IN_A_PROJECT = "run this in a project's folder, which `cylinder-friction init FOLDER` makes"


class ParamsError(RefusalError, ValueError):
    """A configuration is refused; the message names the key."""
