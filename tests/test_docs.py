"""The guides tell the truth: links, names and complete programs are tried."""

from __future__ import annotations

import re
import runpy
import shutil
import sys
from pathlib import Path

import pytest

from cylinder_friction.commands.cli import parser
from cylinder_friction.commands.plugins import ELSEWHERE
from cylinder_friction.estimators.base import FrictionEstimator

ROOT = Path(__file__).parent.parent
PAGES = sorted((ROOT / "docs").glob("*.md"))
BLOCK = re.compile(r"^```(?P<kind>\w*)(?P<rest>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"!?\[[^\]]*\]\((?P<target>[^)\s]+)\)")
PRINTED = {"adding-an-estimator.md": r"learned: weight 0\.\d"}
"""What the complete programs of a guide show, if a guide says so."""
PROGRAM = re.compile(r"complete file=(?P<file>\w+\.py)")


def named(pattern: str) -> list[tuple[str, str]]:
    """Return page and name of every match of the pattern's one group."""
    texts = [(page.name, page.read_text(encoding="utf-8")) for page in PAGES]
    return [(page, name) for page, text in texts for name in re.findall(pattern, text, re.MULTILINE)]


def programs(page: Path) -> dict[str, str]:
    """Return the complete programs of a page by their file's name."""
    blocks = BLOCK.finditer(page.read_text(encoding="utf-8"))
    return {found["file"]: block["text"] for block in blocks if (found := PROGRAM.search(block["rest"]))}


def test_links_and_pictures_are_there() -> None:
    missing = []
    for page in PAGES:
        targets = [match["target"] for match in LINK.finditer(BLOCK.sub("", page.read_text(encoding="utf-8")))]
        local = [target.partition("#")[0] for target in targets if not target.startswith(("https://", "#"))]
        missing += [(page.name, target) for target in local if not (page.parent / target).exists()]
    assert missing == []


def test_the_index_names_every_page() -> None:
    index = (ROOT / "docs/index.md").read_text(encoding="utf-8")
    assert [page.name for page in PAGES if page.name != "index.md" and f"({page.name})" not in index] == []


def test_every_module_that_a_guide_imports_is_in_the_reference() -> None:
    reference = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "docs/api").glob("*.md"))
    tutorials = "".join(path.read_text(encoding="utf-8") for path in (ROOT / "examples").glob("*.py"))
    pattern = r"^from (cylinder_friction\.[\w.]+) import"
    imported = {name for _, name in named(pattern)} | set(re.findall(pattern, tutorials, re.MULTILINE))
    assert imported
    assert [name for name in sorted(imported) if f"automodule:: {name}\n" not in reference] == []


def test_every_make_target_exists() -> None:
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    mentioned = named(r"(?:^|`)make ([a-z-]+)(?=[ `\n])")
    assert mentioned
    assert [entry for entry in mentioned if entry[1] not in targets] == []


def test_every_subcommand_exists() -> None:
    commands = next(action.choices for action in parser()._actions if action.dest == "command")
    assert commands is not None
    mentioned = named(r"cylinder-friction ([a-z]+)")
    assert mentioned
    assert [entry for entry in mentioned if entry[1] not in {*commands, *ELSEWHERE}] == []


def test_every_configuration_file_and_recipe_exists() -> None:
    paths = [entry for entry in named(r"(conf/[\w/]+(?:\.yaml)?)") if not (ROOT / entry[1]).exists()]
    written_by_the_reader = {"conf/cylinder/press.yaml", "conf/ingest/press.yaml"}
    assert [entry for entry in paths if entry[1] not in written_by_the_reader] == []
    for group in ("experiment", "record", "ingest", "filter", "search"):
        chosen = [(page, name) for page, name in named(rf"(?<![\w/]){group}=([a-z_]+)")]
        known = {"press"} if group == "ingest" else set()  # which the reader writes
        assert [e for e in chosen if e[1] not in known and not (ROOT / f"conf/{group}/{e[1]}.yaml").is_file()] == []


def test_python_is_python() -> None:
    for page in PAGES:
        for block in BLOCK.finditer(page.read_text(encoding="utf-8")):
            if block["kind"] == "python":
                compile(block["text"], page.name, "exec")


@pytest.mark.parametrize("page", [page for page in PAGES if programs(page)], ids=lambda page: page.name)
def test_complete_programs_run(
    page: Path,
    written_pipeline: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    for folder in ("data", "models"):
        shutil.copytree(written_pipeline / folder, tmp_path / folder)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(FrictionEstimator, "_kinds", dict(FrictionEstimator._kinds))
    written = programs(page)
    for name, text in written.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    for name in written:
        runpy.run_path(name, run_name="__main__")
    assert re.search(PRINTED.get(page.name, "."), capsys.readouterr().out)
    for name in written:
        sys.modules.pop(name.removesuffix(".py"), None)
