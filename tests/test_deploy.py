"""The files of ``deploy/`` fit each other, the guides and the programs: containers, compose, units of systemd."""

from __future__ import annotations

import configparser
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import mlflow.environment_variables
import pytest
import yaml
from mlflow.cli import server

import team_servers as servers
from cylinder_friction.commands.cli import parser

ROOT = Path(__file__).parents[1]
DEPLOY = ROOT / "deploy"
TEAM = (ROOT / "docs/team.md").read_text(encoding="utf-8")
CONTAINERFILE = (DEPLOY / "Containerfile").read_text(encoding="utf-8")
UNITS = sorted((DEPLOY / "systemd").glob("*.service"))
SERVICES: dict[str, dict[str, Any]] = yaml.safe_load((DEPLOY / "compose.yaml").read_text("utf-8"))["services"]
OWN = [name for name, service in SERVICES.items() if "build" in service]


def stages() -> dict[str, tuple[str, list[tuple[str, str]]]]:
    """Return the stages of the Containerfile by name: what each begins from, and its instructions with their words."""
    text = re.sub(r"\\\n\s*", "", re.sub(r"^#.*\n", "", CONTAINERFILE, flags=re.MULTILINE))
    found: dict[str, tuple[str, list[tuple[str, str]]]] = {}
    name = ""
    for line in filter(None, text.splitlines()):
        instruction, _, words = line.partition(" ")
        if instruction == "FROM":
            base, name = words.split(" AS ")
            found[name] = (base, list(found[base][1]) if base in found else [])
        elif name:
            found[name][1].append((instruction, words))
    return found


def last(target: str, instruction: str) -> str:
    return [words for name, words in stages()[target][1] if name == instruction][-1]


def accepted(command: list[str]) -> None:
    """Fail unless the program's own parser takes the command."""
    program, *words = command
    if program == "cylinder-friction":
        parser().parse_args(words)
    else:
        assert (program, words[0]) == ("mlflow", "server")
        server.make_context("server", words[1:])


def test_images_begin_from_one_named_base_and_end_without_rights() -> None:
    assert re.findall(r"^ARG BASE=(\S+)", CONTAINERFILE, re.MULTILINE) == [
        "docker.io/library/python:3.11-slim-bookworm"
    ]
    assert {base for base, _ in stages().values()} <= {"${BASE}", *stages()}
    for target in ("serve", "tracking", "pipeline"):
        assert last(target, "USER") == "10001"
        assert not [words for name, words in stages()[target][1] if name == "ADD" or "PASSWORD" in words.upper()]
        assert [words for name, words in stages()[target][1] if name == "LABEL"]
        last(target, "HEALTHCHECK")


def test_images_install_extras_that_exist() -> None:
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["optional-dependencies"]
    named = re.findall(r'"\$\(echo \./\*\.whl\)\[([\w,]+)\]"', CONTAINERFILE)
    assert len(named) == 3
    assert {extra for each in named for extra in each.split(",")} <= extras.keys()


@pytest.mark.parametrize("name", OWN)
def test_images_and_compose_start_with_words_that_the_program_takes(name: str) -> None:
    for image in ("serve", "tracking"):
        accepted(json.loads(last(image, "ENTRYPOINT")) + json.loads(last(image, "CMD")))
    service = SERVICES[name]
    target = service["build"]["target"]
    accepted(json.loads(last(target, "ENTRYPOINT")) + service["command"])
    assert (DEPLOY / service["build"]["context"] / service["build"]["dockerfile"]).samefile(DEPLOY / "Containerfile")
    assert f"CMD {json.dumps(service['healthcheck']['test'][1:])}" in last(target, "HEALTHCHECK")
    assert service["read_only"]
    assert service["cap_drop"] == ["ALL"]


@pytest.mark.parametrize("name", SERVICES)
def test_every_service_is_watched_restarted_and_open_to_this_machine_alone(name: str) -> None:
    service = SERVICES[name]
    assert service["healthcheck"]["test"][0] == "CMD"
    assert service["restart"] == "unless-stopped"
    assert service["ports"]
    assert all(re.fullmatch(r"127\.0\.0\.1:(\d+):\1", port) for port in service["ports"])
    assert not {"network_mode", "privileged", "env_file"} & service.keys()
    assert set(service.get("depends_on", {})) <= SERVICES.keys()


def test_secrets_are_in_the_environment_file_alone() -> None:
    text = (DEPLOY / "compose.yaml").read_text(encoding="utf-8")
    wanted = re.findall(r"^(\w+)=$", (DEPLOY / ".env.example").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(wanted) == set(re.findall(r"\$\{(\w+):\?not in \.env\}", text))
    for service in SERVICES.values():
        for name, value in service["environment"].items():
            assert ("$" in value) == bool(re.search("PASSWORD|SECRET|_KEY$", name)), name
    assert (DEPLOY / ".gitignore").read_text(encoding="utf-8").split() == [".env"]


def test_the_mlflow_server_is_that_of_the_guide() -> None:
    (block,) = re.findall(r"```bash\n(export MLFLOW_AUTH_CONFIG_PATH.*?)```", TEAM, re.DOTALL)
    given = SERVICES["mlflow"]["environment"]
    assert set(re.findall(r"\b([A-Z][A-Z_]+)=", block)) <= given.keys()
    known = {*vars(mlflow.environment_variables), *(each.envvar for each in server.params)}
    assert {name for name in given if name.startswith("MLFLOW_")} <= known
    assert "mlflow server --app-name basic-auth" in block
    (example,) = re.findall(r"```ini file=/etc/mlflow/logins.ini\n(.*?)```", TEAM, re.DOTALL)
    guide, ours = configparser.ConfigParser(), configparser.ConfigParser()
    guide.read_string(example)
    ours.read(DEPLOY / "logins.ini")
    del guide["mlflow"]["database_uri"], ours["mlflow"]["database_uri"]
    assert guide == ours


def test_postgresql_makes_the_databases_with_their_passwords() -> None:
    sqlalchemy = pytest.importorskip("sqlalchemy")
    pytest.importorskip("psycopg2")
    psql = shutil.which("psql")
    if servers.postgresql_programs() is None or psql is None:
        pytest.skip("PostgreSQL is not installed")
    given = {name: f"it's {name}" for name in SERVICES["postgres"]["environment"]}
    with servers.postgresql("scratch") as urls:
        url = sqlalchemy.make_url(urls["scratch"])
        plain = url.set(drivername="postgresql").render_as_string(hide_password=False)
        subprocess.run(
            [psql, "-v", "ON_ERROR_STOP=1", "-f", str(DEPLOY / "databases.sql"), plain],
            check=True, capture_output=True, env={**os.environ, **given},
        )  # fmt: skip
        for role, database in (("mlflow", "mlflow"), ("mlflow", "logins"), ("studies", "studies")):
            password = given[f"{role.upper()}_DATABASE_PASSWORD"]
            engine = sqlalchemy.create_engine(url.set(username=role, password=password, database=database))
            with engine.begin() as connection:
                connection.execute(sqlalchemy.text("CREATE TABLE made (number int)"))
            engine.dispose()


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_a_unit_starts_with_words_that_its_program_takes(unit: Path) -> None:
    (line,) = re.findall(r"^ExecStart=/opt/cylinder-friction/bin/(.*)$", unit.read_text("utf-8"), re.MULTILINE)
    accepted(shlex.split(line.replace(" $OPTIONS", "").replace("${MODEL}", "models/hybrid").replace("%i", "5002")))


def test_systemd_takes_the_units_and_finds_them_hardened(tmp_path: Path) -> None:
    analyze = shutil.which("systemd-analyze")
    if analyze is None:
        pytest.skip("systemd-analyze is not installed")
    shutil.copytree(DEPLOY / "systemd", tmp_path, dirs_exist_ok=True)
    paths = [str(tmp_path / unit.name) for unit in UNITS]
    for path in map(Path, paths):  # it looks whether the program is there
        path.write_text(path.read_text("utf-8").replace("/opt/cylinder-friction/bin", str(Path(sys.executable).parent)))
    verified = subprocess.run([analyze, "verify", "--man=no", *paths], capture_output=True, text=True)
    assert (verified.returncode, verified.stderr) == (0, "")
    for path in paths:
        rated = subprocess.run([analyze, "security", "--offline=true", "--threshold=20", path], capture_output=True)
        assert rated.returncode == 0, rated.stdout.decode()
