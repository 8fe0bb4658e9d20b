"""What ``dvc.yaml`` says about each stage: the code that it uses, its own parameters, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from cylinder_friction.import_graph import SOURCE, used_files
from cylinder_friction.run_record import STAGES

PROJECT = Path(__file__).parents[2]
TEXT = (PROJECT / "dvc.yaml").read_text(encoding="utf-8")
PIPELINE = {name: each.get("do", each) for name, each in yaml.safe_load(TEXT)["stages"].items()}


def code_of(stage: str) -> list[str]:
    """Return the files whose hash is a stage's entry in ``code.yaml``, relative to the package."""
    return [
        path.relative_to(SOURCE / "cylinder_friction").as_posix()
        for path in used_files(f"cylinder_friction.stages.{stage}")
    ]


@pytest.mark.parametrize(
    ("stage", "used", "not_used"),
    [
        ("train", "estimators/hybrid.py", "reporting/search_figures.py"),
        ("ingest", "recordings/formats/delimited.py", "signals/zero_phase.py"),
        ("label", "signals/methods.py", "recordings/splits.py"),
        ("split", "recordings/splits.py", "labelling/label.py"),
        ("record", "rig/simulate.py", "tracking/log_run.py"),
    ],
)
def test_the_derivation_is_neither_blind_nor_greedy(stage: str, used: str, not_used: str) -> None:
    assert used in code_of(stage)
    assert not_used not in code_of(stage)


@pytest.mark.parametrize("stage", STAGES)
def test_no_stage_depends_on_the_commands_or_what_only_logs(stage: str) -> None:
    code = " ".join(code_of(stage))
    unwanted = ["commands/", "deployment/fmu", "stages/_run"]
    if stage != "register":
        unwanted.append("tracking")
    assert not [name for name in unwanted if name in code]


ALSO = {"split": {"lugre.condition"}, "register": {"recipe"}}
"""``split`` refuses a condition that no training session has, before hours; ``register`` names the recipe."""


@pytest.mark.parametrize("stage", STAGES)
def test_a_stage_takes_its_own_parameters_and_the_cylinder_alone(stage: str) -> None:
    *own, code = PIPELINE[stage]["params"]
    assert set(own) - {stage, "cylinder"} == ALSO.get(stage, set())
    assert code == {"code.yaml": [stage]}


def test_one_name_four_times() -> None:
    assert tuple(PIPELINE) == ("code", *STAGES)
    for stage in STAGES:
        assert PIPELINE[stage]["cmd"] == f"cylinder-friction stage {stage}"
        assert (PROJECT / "src/cylinder_friction/stages" / f"{stage}.py").is_file()
        assert (PROJECT / "conf" / stage).is_dir()
        assert stage in yaml.safe_load((PROJECT / "params.yaml").read_text(encoding="utf-8"))


def test_no_stage_that_makes_an_estimator_reads_truth_or_test_recordings() -> None:
    for stage in ("ingest", "filter", "search", "train", "lugre"):
        read = " ".join(PIPELINE[stage]["deps"])
        assert "truth" not in read
        assert "processed/test" not in read
