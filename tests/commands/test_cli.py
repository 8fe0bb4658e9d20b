"""The command line itself: what it lists, what it loads, and how it ends."""

import errno
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from cylinder_friction.commands import check, stage
from cylinder_friction.commands.cli import (
    COMMANDS,
    INTERRUPTED,
    UNREAD,
    machine_code_refusal,
    main,
    parser,
)
from cylinder_friction.commands.plugins import ELSEWHERE
from cylinder_friction.run_record import STAGES


def output_of(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 0
    return capsys.readouterr().out


def test_help_lists_every_command_and_its_module_has_what_it_needs(capsys: pytest.CaptureFixture[str]) -> None:
    shown = output_of(["--help"], capsys)
    assert "``" not in shown
    assert all(f"    {name}" in shown for name in COMMANDS)
    assert parser().parse_args(["check"]).work == check.__name__


def test_help_of_stage_lists_every_stage_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    shown = output_of(["stage", "--help"], capsys)
    assert "``" not in shown
    assert re.findall(r"^- (\w+): +\w", shown, re.MULTILINE) == [*STAGES]


def test_version_and_completion_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert output_of(["--version"], capsys).startswith("cylinder-friction 0.")
    script = output_of(["--print-completion", "bash"], capsys)
    assert f"_shtab_cylinder_friction_pos_0_choices=({' '.join(COMMANDS)}" in script  # and what plugins bring
    assert " ".join(STAGES) in script


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("search", "finished trials are kept in .cylinder-friction/resume; run `dvc repro` to go on from there"),
        ("ingest", "results of earlier stages are kept, and nothing is half-written; run `dvc repro` to run this"),
    ],
)
def test_ctrl_c_says_what_is_kept_and_how_to_go_on(
    what: str, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(stage, "run", Mock(side_effect=KeyboardInterrupt))
    assert main(["stage", what]) == INTERRUPTED
    printed = capsys.readouterr().err
    assert f"cylinder-friction stage {what}: interrupted; {words}" in printed
    assert "Traceback" not in printed


@pytest.mark.parametrize(("command", "unbuffered"), [("--help", ""), ("check", ""), ("check", "1")])
def test_a_reader_that_has_ended_ends_the_command_without_a_traceback(command: str, unbuffered: str) -> None:
    code = (
        "import sys; from cylinder_friction.commands import check, cli\n"
        "check.run = lambda _: [print('x' * 100) for _ in range(1000)][:0]\n"
        f"sys.exit(cli.main({command.split()}))"
    )
    reading, writing = os.pipe()
    os.close(reading)
    given = {**os.environ, "PYTHONUNBUFFERED": unbuffered}
    done = subprocess.run([sys.executable, "-c", code], stdout=writing, stderr=subprocess.PIPE, text=True, env=given)
    os.close(writing)
    assert (done.returncode, done.stderr) == (UNREAD, "")


@pytest.mark.parametrize("error", [ValueError("a defect"), BrokenPipeError("of a socket")])
def test_an_unexpected_error_is_not_hidden(error: Exception, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check, "run", Mock(side_effect=error))
    with pytest.raises(type(error), match=str(error)):
        main(["check"])


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "no space left on device; make room, then run the same"),
        (PermissionError(errno.EACCES, "Permission denied", "a/log.csv"), "a/log.csv: permission denied; choose"),
        (OSError(errno.EROFS, "Read-only file system", "/logs/.friction.draft"), "/logs: read-only file system;"),
        (NotADirectoryError(errno.ENOTDIR, "Not a directory", "log.csv/x"), "log.csv/x: not a directory; check"),
    ],
)
def test_what_the_system_refuses_is_a_sentence(
    error: OSError, words: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(check, "run", Mock(side_effect=error))
    assert main(["check"]) == 1
    assert f"cylinder-friction check: {words}" in capsys.readouterr().err


@pytest.fixture
def plugin(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An installed package that brings a command."""
    about = tmp_path / "others-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Name: others\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[cylinder_friction.commands]\ngreet = others_greet\n")
    (tmp_path / "others_greet.py").write_text(
        "HELP = 'greet somebody'\n"
        "def add_arguments(parser): parser.add_argument('name')\n"
        "def run(options): print('hello', options.name)\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "others_greet", raising=False)


def test_serve_states_at_once_that_it_starts_a_server(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["serve", str(tmp_path), "--port", "0"]) == 1
    first, problem = capsys.readouterr().err.splitlines()
    assert first == "cylinder-friction serve: starting MLflow's model server, which can take a minute"
    assert "MLmodel" in problem


def test_a_package_brings_a_command(plugin: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["greet", "Kim"]) == 0
    assert capsys.readouterr().out == "hello Kim\n"
    assert re.search("^ +greet +greet somebody$", output_of(["--help"], capsys), re.MULTILINE)
    assert "Greet somebody." in output_of(["greet", "--help"], capsys)
    assert "greet" in output_of(["--print-completion", "bash"], capsys)


def test_a_package_that_cannot_be_imported_is_named(
    plugin: None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "others_greet.py").write_text("raise ImportError('100 % gone')\n")
    words = "this command is part of others, which cannot be imported (ImportError: 100 % gone)"
    assert words in " ".join(output_of(["--help"], capsys).split())
    assert main(["greet", "Kim", "--loud"]) == 1
    assert f"cylinder-friction greet: {words}" in (printed := capsys.readouterr().err)
    assert printed.endswith("install others again, or remove it: pip uninstall others\n")


def test_a_command_of_the_project_imports_no_plugin(plugin: None) -> None:
    parser("check")
    assert "others_greet" not in sys.modules


def test_a_command_whose_package_is_not_installed_names_the_package(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(ELSEWHERE, "far", "cylinder-friction-far-away")
    assert main(["far", "logs", "--into", "there"]) == 1
    assert capsys.readouterr().err == (
        "cylinder-friction far: this command is part of cylinder-friction-far-away, which is not installed; pip "
        "install cylinder-friction-far-away, or `make far` in a checkout, which installs its folder far-away/\n"
    )


def test_machine_code_of_another_version_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = "from typing import NamedTuple\nimport numba\n{0} = NamedTuple('{0}', [('x', float)])\n"
    kept += "@numba.njit(cache=True)\ndef doubled(given):\n    return 2.0 * given.x\n"
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("Earlier", "Later"):
        (tmp_path / "kept_code.py").write_text(kept.format(name))
        monkeypatch.delitem(sys.modules, "kept_code", raising=False)
        importlib.invalidate_caches()
        module = importlib.import_module("kept_code")
        if name == "Earlier":
            assert module.doubled(module.Earlier(2.0)) == 4.0
    with pytest.raises(AttributeError, match="Earlier") as caught:
        module.doubled(module.Later(2.0))
    words = machine_code_refusal(caught.value)
    assert words.startswith("machine code that another version kept cannot be read (Can't get attribute 'Earlier'")
    assert "delete the files *.nbi in " in words
    assert machine_code_refusal(AttributeError("of our own")) == ""
