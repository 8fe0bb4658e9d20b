"""What the registry advises when something is gone, typed as it is advised, leads to a champion again."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from mlflow import MlflowClient

from cylinder_friction.params.checking import load_params
from pipeline_workspace import copy_of, run, run_here

pytestmark = pytest.mark.extended

REGISTER = "cylinder-friction stage register"


@pytest.fixture
def project(finished_pipeline: Path, tmp_path: Path) -> Path:
    return copy_of(finished_pipeline, tmp_path)


def model_of(project: Path) -> str:
    return load_params(project / "params.yaml").registered_name


def client_of(project: Path) -> MlflowClient:
    return MlflowClient(f"sqlite:///{project / 'mlflow.db'}")


def advises(project: Path, asked: str, command: str) -> bool:
    """Check whether the answer to ``asked``, a command that fails, advises a command; show the answer otherwise."""
    done = run_here(project, "cylinder-friction", *asked.split(), check=False)
    answer = done.stdout + done.stderr
    if command not in re.findall(r"`((?:cylinder-friction|dvc) [^`]*)`", answer):
        pytest.fail(f"{asked}: {answer}")
    return True


def champion(project: Path) -> str:
    """Check the lineage of the champion; return its version."""
    shown = run_here(project, "cylinder-friction", "lineage", check=False).stdout
    assert re.search("(all [0-9]+ links hold for the files at .*|broken: git commit)$", shown.strip()), shown
    return str(client_of(project).get_model_version_by_alias(model_of(project), "champion").version)


def test_a_version_that_was_deleted_is_registered_again(project: Path) -> None:
    client_of(project).delete_model_version(model_of(project), "1")
    for asked in ("serve --port 0", "lineage", "rollback", "track"):
        assert advises(project, asked, REGISTER)
    for words in ("dvc repro", REGISTER):
        assert advises(project, "lineage", words)
        run(project, *words.split())
    assert champion(project) == "2"


def test_a_version_whose_files_are_lost_is_deleted_and_registered_again(project: Path) -> None:
    shutil.rmtree(project / "mlartifacts/models")
    for asked in ("serve --port 0", "lineage", "stage register"):
        assert advises(project, asked, REGISTER)
    client_of(project).delete_model_version(model_of(project), "1")
    run(project, *REGISTER.split())
    assert champion(project) == "2"
