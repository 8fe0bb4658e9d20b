"""Composition of ``conf/`` by Hydra, and the differences of a configuration from the default recipe."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, MissingConfigException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from cylinder_friction.params.file import IN_A_PROJECT, ParamsError
from cylinder_friction.wording import in_brief

CONF = Path("conf")
DEFAULT = "default"
"""The recipe that ``conf/config.yaml`` composes without an experiment."""


def composed(conf: Path, overrides: Sequence[str] = ()) -> dict[str, Any]:
    """Compose the configuration from ``conf`` and Hydra overrides, without checking it.

    Raises:
        ParamsError: The folder does not exist, or Hydra knows no such group or key.
    """
    if not conf.is_dir():
        raise ParamsError(f"{conf.absolute()}: no such folder; {IN_A_PROJECT}")
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(config_dir=str(conf.resolve()), version_base="1.3"):
            content = OmegaConf.to_container(compose("config", list(overrides)), resolve=True)
    except MissingConfigException as error:
        expected = f"; expected one of {', '.join(error.options)}" if error.options else ""
        raise ParamsError(f"{conf}: there is no {error.missing_cfg_file!r}{expected}") from error
    except (HydraException, OmegaConfBaseException) as error:
        raise ParamsError(f"{conf}: {in_brief(error, 500)}") from error
    assert isinstance(content, dict)
    return {str(key): value for key, value in content.items()}


def as_run_params(content: dict[str, Any]) -> dict[str, str]:
    """List the parameters that a pipeline's run states: recipe, seeds, and differences from the default recipe.

    ``changes`` lists the differences from the recipe itself, with both values. Without ``conf/``, differences are
    unknown and left out.
    """
    recipe, now = str(content.get("recipe", DEFAULT)), _flat(content)
    seeds = {name.removesuffix(".seed"): value for name, value in now.items() if name.endswith(".seed")}
    same = len({*seeds.values()}) == 1
    seed = next(iter(seeds.values())) if same else ", ".join(f"{name} {value}" for name, value in seeds.items())
    named = (CONF / "experiment" / f"{recipe}.yaml").is_file()
    default = _flat(composed(CONF)) if CONF.is_dir() else now
    own = _flat(composed(CONF, [f"experiment={recipe}"])) if named else default
    changes = ", ".join(f"{name}={value} instead of {own.get(name)}" for name, value in _differing(now, own).items())
    return {"recipe": recipe, "seed": seed, "changes": changes or "none", **_differing(now, default)}


def _differing(now: dict[str, str], then: dict[str, str]) -> dict[str, str]:
    names = [name for name in {**then, **now} if now.get(name) != then.get(name) and name != "recipe"]
    return {name: now.get(name, "not set") for name in names}


def _flat(content: dict[str, Any], prefix: str = "") -> dict[str, str]:
    result: dict[str, str] = {}
    for key, value in content.items():
        result |= _flat(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + str(key): str(value)}
    return result
