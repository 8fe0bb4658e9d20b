"""What stands in a saved model's folder is what ``save`` wrote, or is refused in a sentence."""

import json
import os
import random
import shutil
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from cylinder_friction.deployment.c_export.export import generate_c
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.linear import RidgeEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.saved_folder import SavedModelError, write_description
from cylinder_friction.recordings.channel_correction import ChannelCorrection
from cylinder_friction.recordings.recording import Recording, RecordingError


@pytest.fixture
def saved(small_hybrid: HybridEstimator, tmp_path: Path) -> Path:
    small_hybrid.save(tmp_path / "model")
    return tmp_path / "model"


def with_new_hashes(folder: Path, change: Callable[[dict[str, Any]], None] = lambda _: None) -> None:
    """Change the description, and make it look as if ``save`` had written it."""
    content = json.loads((folder / "estimator.json").read_text())
    change(content)
    names = list(content.pop("files"))
    del content["sha256"]
    write_description(folder, content, names)


@pytest.mark.parametrize(
    ("name", "message"),
    [("estimator.json", "was changed after `save` wrote it"), ("forest.onnx", "is not the file that `save` wrote")],
)
def test_a_digit_that_was_changed_is_noticed(saved: Path, name: str, message: str) -> None:
    content = (saved / name).read_bytes()
    place = content.index(b"0.0") if name.endswith("json") else len(content) // 2
    (saved / name).write_bytes(content[:place] + b"1" + content[place + 1 :])
    with pytest.raises(SavedModelError, match=message):
        load_estimator(saved)


def test_a_model_that_was_saved_without_hashes_is_loaded(saved: Path, small_hybrid: HybridEstimator) -> None:
    content = json.loads((saved / "estimator.json").read_text())
    del content["files"], content["sha256"]
    (saved / "estimator.json").write_text(json.dumps(content))
    assert load_estimator(saved).guard == small_hybrid.guard


def test_a_model_of_an_earlier_version_is_refused(saved: Path) -> None:
    with_new_hashes(saved, lambda content: content.pop("corrections"))
    with pytest.raises(SavedModelError, match=r"saved by an earlier version.*; train or adapt the model anew$"):
        load_estimator(saved)


def test_recordings_of_different_offsets_do_not_train_one_model(labelled_recordings: list[Recording]) -> None:
    read = {"pressure_1_pa": ChannelCorrection(offset=1.3e5)}
    pair = [labelled_recordings[0].described(corrections=read), labelled_recordings[1]]
    with pytest.raises(RecordingError, match=r"disagree: pressure_1_pa = reading - 1\.3 bar; neither sign"):
        RidgeEstimator().fit(pair)
    assert RidgeEstimator().fit(pair[:1]).corrections == read


@pytest.mark.parametrize("name", ["estimator.json", "network.onnx", "forest.onnx"])
@pytest.mark.parametrize("kind", ["fifo", "device", "folder", "nothing"])
def test_what_is_no_plain_file_is_refused_at_once(saved: Path, name: str, kind: str) -> None:
    (saved / name).unlink()
    if kind == "fifo":
        os.mkfifo(saved / name)
    elif kind == "device":
        (saved / name).symlink_to("/dev/zero")
    elif kind == "folder":
        (saved / name).mkdir()
    with pytest.raises((SavedModelError, FileNotFoundError), match=r"no regular file|cannot be read|holds no"):
        load_estimator(saved)


def test_a_file_that_is_too_large_is_not_read(saved: Path) -> None:
    with (saved / "forest.onnx").open("r+b") as file:
        file.truncate(2**40)
    with pytest.raises(SavedModelError, match="has 1099511627776 bytes, but expected a file of at most 67108864"):
        load_estimator(saved)


def set_in(*path: str | int, value: Any) -> Callable[[dict[str, Any]], None]:
    def change(content: dict[str, Any]) -> None:
        holder: Any = content
        for key in path[:-1]:
            holder = holder[key]
        holder[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["sample_time_s"], -0.005, r"sample_time_s: holds -0.005, but expected numbers from 1e-06 to 10"),
        (["lag_s"], -1.0, "lag_s: holds -1.0"),
        (["kind"], "other", "kind is 'other', but expected one of"),
        (["guard", "accept_lower"], [0.0], r"guard.accept_lower: has shape \(1,\), but expected \(3,\)"),
        (["guard", "warm_up_samples"], -1, "guard.warm_up_samples: got -1"),
        (["bounds", "upper_n"], [1.0, 1.0, 1.0], r"bounds.upper_n: has shape \(3,\), but expected \(4,\)"),
        (["bounds", "lower_n", 0], 1e20, "bounds.lower_n: .* is above upper_n"),
        (["parameters", "front_end", "mean"], [0.0], r"feature_mean: has shape \(1,\)"),
        (["parameters", "front_end", "scale", 0], 0.0, "feature_scale: holds 0.0"),
        (["parameters", "front_end"], None, "save the model again"),
        (["guard"], {}, "save the model again"),
        (["training_range"], {}, "has no 'pressure_1_pa'"),
    ],
)
def test_numbers_that_no_runtime_would_take_are_named(saved: Path, path: list[Any], value: Any, message: str) -> None:
    with_new_hashes(saved, set_in(*path, value=value))
    with pytest.raises(SavedModelError, match=message):
        load_estimator(saved)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("nodes_featureids", 10**8, "forest.feature: holds 100000000"),
        ("nodes_truenodeids", 0, "node 0 leads to node 0, but expected a later node of its tree"),
        ("nodes_falsenodeids", 10**6, "expected a later node of its tree"),
        ("nodes_values", np.nan, "forest.threshold: holds nan"),
        ("nodes_modes", b"BRANCH_GT", "another graph than `save` writes"),
        ("target_weights", np.inf, "forest.value: holds inf"),
    ],
)
def test_trees_end_and_ask_for_features_that_are_there(saved: Path, name: str, value: Any, message: str) -> None:
    model = onnx.load(saved / "forest.onnx")
    (attribute,) = (each for each in model.graph.node[0].attribute if each.name == name)
    (attribute.floats or attribute.ints or attribute.strings)[0] = value
    (saved / "forest.onnx").write_bytes(model.SerializeToString())
    with_new_hashes(saved)
    with pytest.raises(SavedModelError, match=message):
        load_estimator(saved)


@pytest.mark.parametrize("change", ["operator", "direction", "node", "base"])
def test_a_graph_that_computes_something_else_is_refused(saved: Path, change: str) -> None:
    path = saved / ("forest.onnx" if change == "base" else "network.onnx")
    model = onnx.load(path)
    lstm = next((node for node in model.graph.node if node.op_type == "LSTM"), model.graph.node[0])
    if change == "operator":
        model.graph.node[-3].op_type = "Sub"
    elif change == "node":
        model.graph.node.append(onnx.helper.make_node("Tanh", ["head"], ["more"]))
    elif change == "direction":
        lstm.attribute.append(onnx.helper.make_attribute("direction", "reverse"))
    else:
        lstm.attribute.append(onnx.helper.make_attribute("base_values", [100.0]))
    path.write_bytes(model.SerializeToString())
    with_new_hashes(saved)
    with pytest.raises(SavedModelError, match="another graph than `save` writes of its numbers"):
        load_estimator(saved)


HOSTILE: tuple[Any, ...] = (None, True, "", "../x", "/dev/zero", -1, 0, 0.5, 10**8, 2**63, 1e308, float("nan"))
HOSTILE += ([], {}, [[]], [1.0], {"a": 1})


def damage(path: Path, chance: random.Random) -> None:
    """Replace a value anywhere in a description, change an attribute of a graph, flip a bit, or cut the end off."""
    how, content = chance.random(), bytearray(path.read_bytes())
    if how < 0.6 and path.suffix == ".json":
        holder, key = (whole := json.loads(content)), chance.choice(sorted(whole))
        while isinstance(holder[key], dict | list) and holder[key] and chance.random() < 0.8:
            holder = holder[key]
            key = chance.choice(sorted(holder)) if isinstance(holder, dict) else chance.randrange(len(holder))
        holder[key] = chance.choice(HOSTILE)
        content = bytearray(json.dumps(whole).encode())
    elif how < 0.6 and path.name == "forest.onnx":
        model = onnx.load(path)
        attributes = [each for node in model.graph.node for each in node.attribute if each.ints or each.floats]
        values = (attribute := chance.choice(attributes)).ints or attribute.floats
        values[chance.randrange(len(values))] = chance.choice((-1, 0, 1, 10**8))
        content = bytearray(model.SerializeToString())
    elif how < 0.8:
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    else:
        del content[chance.randrange(len(content)) :]
    path.write_bytes(content)


@pytest.mark.parametrize("count", [300, pytest.param(3_000, marks=pytest.mark.extended)])
def test_damaged_models_are_refused_or_give_the_same_bits(
    saved: Path, labelled_recordings: list[Recording], tmp_path: Path, count: int
) -> None:
    """Half of them have new hashes, as if ``save`` had written them: these are refused, or can be exported."""
    chance, samples, refused = random.Random(1), labelled_recordings[0].samples()[:300], list[str]()
    expected = load_estimator(saved).real_time().run(samples)[0]
    for _ in range(count):
        folder = Path(shutil.copytree(saved, tmp_path / "damaged"))
        damage(chance.choice(sorted(folder.iterdir())), chance)
        keeps_hashes = chance.random() < 0.5
        if not keeps_hashes:
            with suppress(ValueError, AttributeError, TypeError, KeyError):  # what cannot be read keeps them
                with_new_hashes(folder)
        try:
            found = load_estimator(folder)
        except (SavedModelError, FileNotFoundError) as error:
            refused.append(str(error))
        else:
            if keeps_hashes:
                np.testing.assert_array_equal(found.real_time().run(samples)[0], expected)
            else:
                generate_c(found.step_model(), folder, "damaged", "double", found.kind)
        shutil.rmtree(folder)
    assert len(refused) > 0.6 * count
    assert all(str(folder) in each for each in refused)
