"""The smoke pipeline on a team's stores, by docs/team.md's commands: PostgreSQL, S3 protocol, MLflow with logins."""

import os
import re
import shutil
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import CompletedProcess

import pytest
import yaml
from sqlalchemy import make_url

import team_servers as servers
from cylinder_friction.files.whole_files import hash_of
from cylinder_friction.run_record import STAGES
from pipeline_workspace import PROJECT, copy_of, run

pytestmark = [pytest.mark.extended]

AGAIN = ("search", "register")
"""The stages that work with the stores themselves; what the others make does not depend on them."""
PAGE = (PROJECT / "docs/team.md").read_text(encoding="utf-8")
BLOCK = re.compile(r"^```\w+ (?:step|file)=(?P<name>\S+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Team:
    """The running servers, and a member's home folder that knows them."""

    url: str  # Of the MLflow server
    home: Path
    environment: dict[str, str]
    blocks: dict[str, str]  # Of the page, with the real addresses and passwords
    passwords: tuple[str, ...] = field(repr=False)

    def does(self, step: str, folder: Path) -> CompletedProcess[str]:
        """Run a step of the page as a member of the team."""
        return self.runs(folder, "bash", "-euo", "pipefail", "-c", self.blocks[step])

    def runs(self, folder: Path, *command: str, check: bool = True, **more: str) -> CompletedProcess[str]:
        return run(folder, *command, check=check, given={**self.environment, **more})


@pytest.fixture(scope="module")
def team(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Team]:
    for package in ("psycopg2", "dvc_s3", "boto3", "flask_wtf"):
        pytest.importorskip(package)
    for name, program in (("PostgreSQL", servers.postgresql_programs()), ("SeaweedFS", servers.object_store_program())):
        if program is None:
            pytest.skip(f"{name} is not installed")
    folder, home = tmp_path_factory.mktemp("servers"), tmp_path_factory.mktemp("home")
    with ExitStack() as stack:
        databases = stack.enter_context(servers.postgresql("mlflow", "logins", "studies"))
        objects = stack.enter_context(servers.object_store(folder / "s3"))
        objects.make_bucket("dvc")
        secrets = {name: os.urandom(12).hex() for name in ("admin", "ada", "key")}
        logins = folder / "logins.ini"
        logins.write_text(block("/etc/mlflow/logins.ini", {r"postgresql\S+": databases["logins"]}))
        given = {
            **objects.environment(),
            "MLFLOW_AUTH_CONFIG_PATH": str(logins),
            "MLFLOW_AUTH_ADMIN_USERNAME": "admin",
            "MLFLOW_AUTH_ADMIN_PASSWORD": secrets["admin"],
            "MLFLOW_FLASK_SERVER_SECRET_KEY": secrets["key"],
        }
        artifacts, options = objects.make_bucket("mlflow"), ("--app-name", "basic-auth")
        url = stack.enter_context(
            servers.tracking_server(folder, databases["mlflow"], artifacts, given, workers=1, options=options)
        )
        admin = {"MLFLOW_TRACKING_USERNAME": "admin", "MLFLOW_TRACKING_PASSWORD": secrets["admin"]}
        new = {"MLFLOW_TRACKING_URI": url, "NEW_PASSWORD": secrets["ada"]}
        run(folder, sys.executable, "-c", block("login", {}), given={**admin, **new})
        studies = make_url(databases["studies"])
        real = {
            "https://mlflow.example.org": url,
            "https://s3.example.org": objects.endpoint,
            r"studies@db.example.org:\d+": f"{studies.username}@{studies.host}:{studies.port}",
            r"db.example.org:\d+:studies:studies:PASSWORD": f"*:*:*:*:{studies.password}",
            r"(?<=tracking_password = )PASSWORD": secrets["ada"],
            "(?<=key_id = )ada": objects.access_key,
            "(?<=secret_access_key = )PASSWORD": objects.secret_key,
            r"git@\S+": str(folder / "press.git"),
        }
        blocks = {found["name"]: block(found["name"], real) for found in BLOCK.finditer(PAGE)}
        for name in (".mlflow/credentials", ".aws/credentials", ".pgpass"):
            (home / name).parent.mkdir(exist_ok=True)
            (home / name).write_text(blocks[name], encoding="utf-8")
            (home / name).chmod(0o600)
        who = {f"GIT_{role}_{what}": "ada@localhost" for role in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}
        exported = dict(re.findall(r"^export (\w+)=(\S+)$", blocks["environment"], re.MULTILINE))
        yield Team(
            url,
            home,
            {"HOME": str(home), **who, **exported},
            blocks,
            (*secrets.values(), objects.secret_key, str(studies.password)),
        )


def block(name: str, real: dict[str, str]) -> str:
    """Return a block of the page with what is real in place of the examples."""
    (text,) = (found["text"] for found in BLOCK.finditer(PAGE) if found["name"] == name)
    for example, meant in real.items():
        text = re.sub(example, meant, text)
    return str(text)


def new_for_the_stores(folder: Path) -> None:
    """Let the stages run again that work with the stores."""
    lock = folder / "dvc.lock"
    content = yaml.safe_load(lock.read_text(encoding="utf-8"))
    for stage in AGAIN:
        del content["stages"][stage]
    lock.write_text(yaml.safe_dump(content), encoding="utf-8")
    for gone in (".dvc/cache/runs", ".cylinder-friction/resume", "mlartifacts"):
        shutil.rmtree(folder / gone)
    (folder / "mlflow.db").unlink()


def test_a_team_shares_runs_models_data_and_trials(finished_pipeline: Path, team: Team, tmp_path: Path) -> None:
    first = copy_of(finished_pipeline, tmp_path)
    new_for_the_stores(first)
    run(tmp_path, "git", "clone", "--quiet", "--bare", str(finished_pipeline), team.blocks["join"].split()[2])
    run(first, "git", "remote", "add", "origin", team.blocks["join"].split()[2])
    shared = team.does("share", first)
    team.runs(first, "git", "push", "--quiet", "origin", "HEAD")
    assert re.findall(r"Running stage '(\w+)'", shared.stdout) == ["code", *AGAIN]
    assert not (first / "mlflow.db").exists()
    assert not (first / ".cylinder-friction/resume").exists(), "the trials are in the database"
    for result in ("models/search", "models/hybrid", "models/registered.json"):
        assert hash_of(first / result) == hash_of(finished_pipeline / result), result

    other = tmp_path / "other"
    other.mkdir()
    joined = team.does("join", other)
    clone = other / "press"
    assert re.findall(r"Running stage '(\w+)'", joined.stdout) == ["code"]
    logged = re.search(r"^(\d+) runs logged, (\d+) already there$", joined.stdout, re.MULTILINE)
    assert logged is not None, joined.stdout
    assert int(logged[1]) + int(logged[2]) == len(STAGES)
    assert int(logged[2]) >= len(AGAIN), "the stages that ran with the server were logged as they ran"
    assert "registered model: friction-estimator-smoke version 1 (champion)" in joined.stdout
    assert "links hold" in joined.stdout

    stranger = team.runs(clone, "cylinder-friction", "lineage", check=False, MLFLOW_TRACKING_PASSWORD="guessed")
    assert stranger.returncode == 1
    assert re.search(r"no MLflow store that can be opened \(.*401.*login", stranger.stderr), stranger.stderr
    assert stranger.stderr.count("\n") == 1
    assert "is the champion already" in team.does("back", clone).stdout
    tracked = team.runs(clone, "git", "grep", "-lE", "|".join(team.passwords), check=False)
    assert (tracked.returncode, tracked.stdout) == (1, ""), "a password in a file of the repository"
