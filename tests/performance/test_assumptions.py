"""The register of assumptions in ``docs/trust.md``: each is broken by an option of the bench, and measured."""

import re
import sys
from dataclasses import fields
from pathlib import Path
from types import ModuleType

import pytest

from cylinder_friction.estimation.from_logs import LABEL_BOUNDS
from cylinder_friction.rig.campaign_plan import CampaignPlan

PROJECT = Path(__file__).parents[2]
REGISTER = PROJECT / "docs/trust.md"
OUTCOMES = ("named", "wider", "refused", "wrong", "held")


def rows() -> list[list[str]]:
    table = (
        REGISTER.read_text(encoding="utf-8").split("<!-- assumptions: begin -->")[1].split("<!-- assumptions: end")[0]
    )
    lines = [line for line in table.splitlines() if line.startswith("|")][2:]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


@pytest.fixture(scope="module")
def measured() -> ModuleType:
    sys.path.insert(0, str(PROJECT / "performance"))
    import assumptions

    return assumptions


def test_every_assumption_of_the_register_is_broken_on_the_bench(measured: ModuleType) -> None:
    broken = {name: world for name, world in measured.ASSUMPTIONS.items() if name != measured.UNBROKEN}
    assert [row[0] for row in rows()] == list(broken)
    assert all(world != measured.ASSUMPTIONS[measured.UNBROKEN] for world in broken.values())


@pytest.mark.parametrize("row", rows(), ids=lambda row: row[0])
def test_an_assumption_names_code_option_and_what_happens(row: list[str], measured: ModuleType) -> None:
    name, code, stated, bench, outcome = row
    (module,) = re.findall(r"`([\w/]+\.py)`", code)
    assert (PROJECT / "src/cylinder_friction" / module).is_file()
    assert stated
    world = measured.ASSUMPTIONS[name]
    known = {f"record.{each.name}" for each in fields(CampaignPlan)}
    options = re.findall(r"`([\w.]+)", bench)
    assert options, "the option that breaks it"
    assert {each for each in options if each.startswith("record.")} <= known
    assert {f"record.{each}" for each in world.options} <= {*options}
    assert re.search(r"held [\d.]+ %", outcome)
    assert any(word in outcome for word in OUTCOMES)


def test_the_sentence_on_bounds_refers_to_the_register() -> None:
    (path,) = re.findall(r"docs/[\w-]+\.md", LABEL_BOUNDS)
    assert PROJECT / path == REGISTER
