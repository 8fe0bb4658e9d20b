"""The files: same bytes each time, checked, described, opened as they ask, and run without this project."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.deployment.onnx_graphs.export import ExportedOnnx, export_model
from cylinder_friction.deployment.onnx_graphs.stream import open_sequence, open_step
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.testing.golden import MODEL_FOLDER
from learned_offset import learning

ROOT = Path(__file__).parents[3]
FILES = ("step", "sequence")
PROGRAM = "run_graphs.py"


@pytest.fixture(scope="module")
def exported(golden_model: StepModel, tmp_path_factory: pytest.TempPathFactory) -> ExportedOnnx:
    return export_model(golden_model, tmp_path_factory.mktemp("onnx") / "made" / "here")


@pytest.fixture(scope="module")
def learner(golden_model: StepModel, tmp_path_factory: pytest.TempPathFactory) -> ExportedOnnx:
    return export_model(learning(golden_model), tmp_path_factory.mktemp("learner"))


def metadata(path: Path) -> dict[str, str]:
    return {entry.key: entry.value for entry in onnx.load(path).metadata_props}


@pytest.mark.parametrize("file", FILES)
def test_equal_models_make_equal_bytes(
    file: str, exported: ExportedOnnx, golden_model: StepModel, tmp_path: Path
) -> None:
    again = export_model(golden_model, tmp_path)
    assert getattr(again, file).read_bytes() == getattr(exported, file).read_bytes()
    assert export_model(replace(golden_model, target_mean_n=1.0), tmp_path).model != exported.model


@pytest.mark.parametrize("file", FILES)
def test_the_checker_passes_it_at_versions_that_old_runtimes_read_and_every_port_has_its_meaning(
    file: str, exported: ExportedOnnx, learner: ExportedOnnx
) -> None:
    for path in (getattr(exported, file), getattr(learner, file)):
        onnx.checker.check_model(str(path), full_check=True)
        model = onnx.load(path)
        assert model.ir_version == 8
        assert {entry.domain: entry.version for entry in model.opset_import} == {"": 17, "ai.onnx.ml": 3}
        assert [port.name for port in (*model.graph.input, *model.graph.output) if not port.doc_string] == []


@pytest.mark.parametrize("file", FILES)
def test_it_states_what_it_is(file: str, exported: ExportedOnnx, golden_model: StepModel) -> None:
    described = metadata(getattr(exported, file))
    assert float(described["sample_time_s"]) == golden_model.sample_time_s
    assert "gauge pressure on the rod side [Pa], piston position" in described["input"]
    assert "[N]" in json.loads(described["output"])["friction_n"]
    assert described["model_sha256"] == exported.model
    lower, upper = json.loads(described["training_range_with_margin"])["position_m"]
    assert (lower, upper) == (golden_model.guard.trained_lower[2], golden_model.guard.trained_upper[2])


@pytest.mark.parametrize("file", FILES)
def test_a_learned_offset_has_ports_of_its_own_and_no_other_model_has_them(
    file: str, exported: ExportedOnnx, learner: ExportedOnnx
) -> None:
    plain, learns = (onnx.load(getattr(each, file)).graph for each in (exported, learner))
    inputs, outputs = (
        {port.name for port in getattr(learns, what)} - {port.name for port in getattr(plain, what)}
        for what in ("input", "output")
    )
    assert inputs == {"offset"}
    assert outputs == {"offset_n", "offset_uncertainty_n"} | ({"offset_out"} if file == "step" else set())
    described = json.loads(metadata(getattr(learner, file))["output"])
    assert described["offset_n"] == "offset of the sensors' zeros in friction that the next step takes off [N]"
    assert "offset_n" not in json.loads(metadata(getattr(exported, file))["output"])


def test_a_stream_is_opened_with_the_options_stored(exported: ExportedOnnx) -> None:
    options = open_step(exported.step).session.get_session_options()
    assert (options.intra_op_num_threads, options.inter_op_num_threads) == (1, 1)
    assert options.get_session_config_entry("session.intra_op.allow_spinning") == "0"
    assert options.get_session_config_entry("session.inter_op.allow_spinning") == "0"


def test_a_graph_of_another_kind_is_refused(exported: ExportedOnnx) -> None:
    with pytest.raises(
        ValueError, match=r"sequence\.onnx: is not a step graph, its inputs are \['samples'\]; expected"
    ):
        open_step(exported.sequence)
    with pytest.raises(ValueError, match=r"network\.onnx: is not a sequence graph"):
        open_sequence(ROOT / "tests/golden" / MODEL_FOLDER / "network.onnx")
    with pytest.raises(FileNotFoundError):
        open_step(exported.step.with_name("none.onnx"))


def test_the_command_writes_both_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model = ROOT / "tests/golden" / MODEL_FOLDER
    assert main(["export", "onnx", str(model), "--output", str(tmp_path / "onnx")]) == 0
    printed = capsys.readouterr().out
    for file in FILES:
        assert str(tmp_path / "onnx" / f"{file}.onnx") in printed
    assert metadata(tmp_path / "onnx/step.onnx")["model_sha256"] in printed


@pytest.mark.parametrize("learns", [False, True])
def test_the_guide_s_program_runs_where_this_project_is_not(
    learns: bool, golden_model: StepModel, tmp_path: Path
) -> None:
    page = (ROOT / "docs/onnx.md").read_text(encoding="utf-8")
    program = page.partition(f"complete file={PROGRAM}\n")[2].partition("```")[0]
    export_model(learning(golden_model) if learns else golden_model, tmp_path / "onnx/hybrid")
    absent = "import sys; sys.modules['cylinder_friction'] = sys.modules['onnx'] = None\n"
    (tmp_path / PROGRAM).write_text(absent + program, encoding="utf-8")
    ran = subprocess.run([sys.executable, PROGRAM], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    lines = ran.stdout.splitlines()
    assert [line.partition("flags ")[2].partition(";")[0] for line in lines[:3]] == (
        ["514", "514", "522"] if learns else ["2", "2", "10"]
    )
    stepped, whole = (float(line.split()[0]) for line in lines[2:])
    np.testing.assert_allclose(stepped, whole, atol=0.1)
