"""The command ``params``: compose ``conf/`` by Hydra into ``params.yaml``, checked before it is written."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import yaml

from cylinder_friction.params.checking import IN_A_PROJECT, PARAMS_FILE, ParamsError, check_params
from cylinder_friction.recordings.files import write_text

CONF = Path("conf")
HEADER = "# Composed from conf/ by `cylinder-friction params`; change it there, or here for one run.\n"


def compose_params(conf: Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return the configuration that ``conf`` and Hydra overrides (``experiment=smoke``, ``search.trials=5``) make.

    Raises:
        ParamsError: Hydra knows no such group or key, or the result is refused.
    """
    content = composed(conf, overrides)
    check_params(content, f"{conf} with {list(overrides)}" if overrides else str(conf))
    return content


def composed(conf: Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Return what ``conf`` and Hydra overrides make, not yet checked.

    Raises:
        ParamsError: There is no such folder, or Hydra knows no such group or key.
    """
    from hydra import compose, initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException

    if not conf.is_dir():
        raise ParamsError(f"{conf.absolute()}: no such folder; {IN_A_PROJECT}")
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(config_dir=str(conf.resolve()), version_base="1.3"):
            content = OmegaConf.to_container(compose("config", list(overrides)), resolve=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise ParamsError(f"{conf}: {error}") from error
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}


def write_params(conf: Path, overrides: Sequence[str] = (), path: Path = PARAMS_FILE) -> None:
    """Composes, checks and writes ``params.yaml``; a refused configuration leaves the file as it was."""
    content = compose_params(conf, overrides)
    write_text(path, HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("overrides", nargs="*", help="for example experiment=smoke search.trials=5")


def run(options: argparse.Namespace) -> None:
    write_params(CONF, options.overrides)
