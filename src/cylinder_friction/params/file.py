"""The file of parameters: its name, where it lies, and the error that refuses what it holds."""

from pathlib import Path

PARAMS_FILE = Path("params.yaml")
IN_A_PROJECT = "run this in a project's folder, which `cylinder-friction init FOLDER` makes"


class ParamsError(ValueError):
    """A configuration that is refused; the message names the key."""
