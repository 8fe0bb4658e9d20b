"""``conf/`` and ``params.yaml`` agree, every recipe composes, and what is wrong is refused by name."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from cylinder_friction.commands.init import make_project
from cylinder_friction.commands.params import compose_params, write_params
from cylinder_friction.params.checking import check_params
from cylinder_friction.params.composing import as_run_params
from cylinder_friction.params.file import ParamsError

PROJECT = Path(__file__).parents[1]
CONF = PROJECT / "conf"
RECIPES = sorted(path.stem for path in (CONF / "experiment").glob("*.yaml"))
CHOICES = sorted(
    f"{group.name}={choice.stem}"
    for group in CONF.iterdir()
    if group.is_dir() and group.name != "experiment"
    for choice in group.glob("*.yaml")
)


@pytest.fixture(scope="module")
def composed() -> dict[str, Any]:
    """What ``conf/`` composes by itself; read only."""
    return compose_params(CONF)


@pytest.fixture
def content(composed: dict[str, Any]) -> dict[str, Any]:
    return copy.deepcopy(composed)


def test_params_yaml_is_what_conf_composes(composed: dict[str, Any]) -> None:
    written = yaml.safe_load((PROJECT / "params.yaml").read_text(encoding="utf-8"))
    assert written == composed, "run `make params` and commit params.yaml"


def test_recipes_and_cylinders_register_under_names_of_their_own(content: dict[str, Any]) -> None:
    recipes = [compose_params(CONF, [f"experiment={recipe}"]) for recipe in RECIPES]
    assert content not in recipes
    content["cylinder"]["name"] = "Parker 80x45 / left"
    names = [check_params(each, "conf").registered_name for each in (compose_params(CONF), *recipes, content)]
    of_cylinder = {"crane": "-hmf_2020_k_jib"}  # A recipe of another cylinder needs no name of its own
    suffixes = ["", *(of_cylinder.get(recipe, f"-{recipe}") for recipe in RECIPES), "-parker_80x45_left"]
    assert names == [f"friction-estimator{suffix}" for suffix in suffixes]


def test_a_run_states_its_recipe_and_what_differs_with_both_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(PROJECT)
    stated = as_run_params(compose_params(CONF, ["experiment=smoke", "train.lag_s=0.05"]))
    assert (stated["recipe"], stated["changes"]) == ("smoke", "train.lag_s=0.05 instead of 0.0")
    assert stated["train.lag_s"] == "0.05"


@pytest.mark.extended
def test_every_choice_of_every_group_is_accepted() -> None:
    for choice in CHOICES:
        compose_params(CONF, [choice])


def test_the_paper_recipe_is_about_the_published_hybrid_whose_final_values_are_trained_by_default(
    composed: dict[str, Any],
) -> None:
    content = compose_params(CONF, ["experiment=paper"])
    assert content["search"]["space"] == {
        "layers": [3, 4, 5],
        "nodes": [16, 32, 64],
        "dropout": [0.1, 0.2, 0.3, 0.4, 0.5],
        "learning_rate": [1e-5, 1e-3],
        "forest_trees": [32, 100],
        "forest_depth": [10, 50],
    }
    assert content["compare"]["main"] == content["register"]["candidate"] == "paper_hybrid"
    assert content["filter"]["method"] == "moving_average"
    assert content["offset"]["identify"] == "never"
    assert content["train"]["design"] == "force_balance"  # the row beside it
    final = {"layers": 4, "nodes": 64, "dropout": 0.3, "learning_rate": 1e-3, "forest_trees": 64, "forest_depth": 10}
    assert composed["baselines"]["hybrid"] == final


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ("search.trails", 5, "search.trails: unknown key; check its spelling against conf/"),
        ("cylinder.stroke_m", -0.25, "'Bosch H160CA 63x28': stroke_m must be a positive number, but got -0.25"),
        ("train.training.epochs", "many", "train.training.epochs: Input should be a valid integer, but got 'many'"),
        ("filter.method", "kalman", "filter.method: Input should be"),
        ("train.hybrid.dropout", 1.0, "train.hybrid.dropout: Input should be less than 1, but got 1.0"),
        ("record.seed", True, "record.seed: Input should be a valid integer, but got True"),
        ("search.space.learning_rate", [1e-2, 1e-3], "learning_rate: lowest 0.01 is above highest 0.001; swap them"),
        ("label.end_stop_margin_m", 0.2, "leaves nothing of the stroke of 0.25 m; make it smaller"),
    ],
)
def test_what_is_wrong_is_refused_by_its_key(content: dict[str, Any], path: str, value: object, message: str) -> None:
    *outer, key = path.split(".")
    section = content
    for name in outer:
        section = section[name]
    section[key] = value
    with pytest.raises(ParamsError) as refused:
        check_params(content, "params.yaml")
    assert "params.yaml: refused, nothing was run" in str(refused.value)
    assert message in str(refused.value)


@pytest.mark.parametrize(("section", "key"), [("lugre", "generations"), ("cylinder", "stroke_m")])
def test_a_missing_key_is_named(content: dict[str, Any], section: str, key: str) -> None:
    del content[section][key]
    with pytest.raises(
        ParamsError, match=rf"{section}\.{key}: missing; run the command `params` to compose it from conf/"
    ):
        check_params(content, "params.yaml")
    del content["cylinder"]["name"]
    with pytest.raises(ParamsError, match="cylinder: name is missing; models of this cylinder are reg"):
        check_params(content, "params.yaml")


def test_a_folder_of_an_older_version_lacks_a_key_and_the_message_is_what_helps(tmp_path: Path) -> None:
    for folder in ("old", "new"):
        make_project(tmp_path / folder)
    old, new = (tmp_path / folder / "conf/search/default.yaml" for folder in ("old", "new"))
    old.write_text(re.sub("^batch:.*\n", "", old.read_text("utf-8"), flags=re.MULTILINE), "utf-8")
    with pytest.raises(ParamsError) as refused:
        compose_params(tmp_path / "old/conf")
    assert str(refused.value).endswith(
        "search.batch: missing, conf/ was made for another version; copy it from conf/search/ of a new folder, which "
        "`cylinder-friction init FOLDER` makes"
    )
    (key,) = re.findall("^batch:.*\n", new.read_text("utf-8"), flags=re.MULTILINE)
    old.write_text(old.read_text("utf-8") + key, "utf-8")
    assert compose_params(tmp_path / "old/conf") == compose_params(tmp_path / "new/conf")


def test_all_that_is_wrong_is_told_at_once(content: dict[str, Any]) -> None:
    content["record"]["seed"] = -1
    content["compare"]["colour"] = "blue"
    with pytest.raises(ParamsError) as refused:
        check_params(content, "params.yaml")
    assert "record.seed" in str(refused.value)
    assert "compare.colour" in str(refused.value)


def test_an_unknown_recipe_or_override_is_refused_and_params_yaml_stays(tmp_path: Path) -> None:
    target = tmp_path / "params.yaml"
    write_params(CONF, path=target)
    before = target.read_bytes()
    for wrong, message in (
        ("experiment=nope", r"conf: there is no 'experiment/nope'; expected one of crane, own, .*thorough$"),
        ("serach.trials=3", "serach"),
        ("search.trials=none", r"search\.trials"),
    ):
        with pytest.raises(ParamsError, match=message):
            write_params(CONF, [wrong], target)
    assert target.read_bytes() == before
