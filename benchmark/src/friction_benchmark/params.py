"""The benchmark's configuration: ``benchmark/conf`` composed into ``benchmark/params.yaml``, and its types."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, Self

import yaml
from pydantic import AfterValidator, Field, model_validator

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.params.composing import composed
from cylinder_friction.params.file import PARAMS_FILE, ParamsError
from cylinder_friction.params.section import Count, Section, Seed, checked
from friction_benchmark.datasets import Sizes
from friction_benchmark.scoring import ScoreSettings
from friction_benchmark.tasks import task_named

FOLDER = Path("benchmark")
CONF = Path("conf")
HEADER = "# Composed from conf/ by `friction-benchmark params`; change it there, or here for one run.\n"
RIG = "rig"


TaskName = Annotated[str, AfterValidator(lambda name: task_named(name).name)]
SplitName = Literal["unseen_rig", "leave_one_load_out", "leave_one_temperature_out"]


class PlanParams(Section):
    """Which models are evaluated on which tasks and splits."""

    seeds: Annotated[list[Seed], Field(min_length=1)]
    tasks: Annotated[list[TaskName], Field(min_length=1)]
    splits: dict[SplitName, list[TaskName]]
    models: list[str]

    @model_validator(mode="after")
    def _splits_have_known_tasks(self) -> Self:
        for split, names in self.splits.items():
            for name in names:
                if name not in self.tasks:
                    raise ValueError(f"splits.{split}: task {name!r} is not among tasks; add it there or leave it out")
        return self


class BudgetParams(Section):
    """What every model may spend."""

    effort: Annotated[float, Field(gt=0.0, le=1.0)]
    trials: Count


class BenchmarkParams(Section):
    """The whole configuration of the benchmark."""

    cylinder: Cylinder
    source: str
    campaign: Sizes
    plan: PlanParams
    budget: BudgetParams
    scoring: ScoreSettings
    workers: Count


def compose_benchmark(overrides: Sequence[str] = (), conf: Path = CONF) -> BenchmarkParams:
    """Return what ``conf`` and Hydra overrides (``experiment=full``, ``budget.trials=5``) make.

    Cylinders are those of the product's ``conf/cylinder``, two folders above. Raises ``ParamsError``, as ``checked``.
    """
    product = conf.resolve().parents[1] / "conf"
    found_in = f"hydra.searchpath=['file://{product}']"
    where = f"{conf} with {list(overrides)}" if overrides else str(conf)
    return checked(BenchmarkParams, composed(conf, [found_in, *overrides]), where)


def write_benchmark_params(overrides: Sequence[str] = ()) -> None:
    """Compose, check and write ``params.yaml``; a refused configuration leaves the file as it was."""
    params = compose_benchmark(overrides)
    content = params.model_dump() | {"cylinder": params.cylinder.to_dict()}
    write_text(PARAMS_FILE, HEADER + yaml.safe_dump(content, sort_keys=False, allow_unicode=True))


def load_benchmark_params() -> BenchmarkParams:
    """Read and check ``params.yaml``; raises ``ParamsError`` if it is not there, or refused."""
    if not PARAMS_FILE.is_file():
        raise ParamsError(f"{PARAMS_FILE.resolve()}: not there; run `friction-benchmark params`")
    return checked(BenchmarkParams, yaml.safe_load(PARAMS_FILE.read_text(encoding="utf-8")), str(PARAMS_FILE))
