"""The command ``params``: compose ``conf/`` by Hydra into ``params.yaml``, checked before it is written."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from cylinder_friction.files.whole_files import write_text
from cylinder_friction.params.checking import check_params
from cylinder_friction.params.composing import CONF, composed
from cylinder_friction.params.file import PARAMS_FILE

HEADER = "# Composed from conf/ by `cylinder-friction params`; change it there, or here for one run.\n"


def compose_params(conf: Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Compose the configuration from ``conf`` and Hydra overrides (``experiment=smoke``, ``search.trials=5``).

    Raises:
        ParamsError: Hydra knows no such group or key, or the result is refused.
    """
    content = composed(conf, overrides)
    check_params(content, f"{conf} with {list(overrides)}" if overrides else str(conf))
    return content


def write_params(conf: Path, overrides: Sequence[str] = (), path: Path = PARAMS_FILE) -> None:
    """Composes, checks and writes ``params.yaml``; a refused configuration leaves the file as it was."""
    content = compose_params(conf, overrides)
    write_text(path, HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True))


def run(options: argparse.Namespace) -> None:
    write_params(CONF, options.overrides)
