"""The file: valid by FMPy, the same bytes every time, sources that compile, a name of its own."""

import shutil
import subprocess
import zipfile
from pathlib import Path

import pytest
from fmpy import read_model_description, simulate_fmu
from fmpy.build import build_platform_binary
from fmpy.validation import validate_fmu

from cylinder_friction.deployment.c_export.compiled import NoCompilerError, compile_shared, find_compiler
from cylinder_friction.deployment.fmu import export
from cylinder_friction.deployment.fmu.export import ExportedFmu, export_fmu, model_identifier
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.model import StepModel
from fmu_host import ExtractedFmu


def without_compiler() -> str:
    raise NoCompilerError("none here")


OFFSET_VARIABLES = ("start_offset", "start_offset_uncertainty", "offset", "offset_uncertainty")
STRICT = (
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Wcast-qual",
    "-Wmissing-prototypes",
    "-Werror",
)


@pytest.mark.extended
def test_fmpy_finds_no_problem(exported: ExportedFmu) -> None:
    assert validate_fmu(str(exported.path)) == []


def test_the_same_model_gives_the_same_bytes(exported: ExportedFmu, hybrid: HybridEstimator, tmp_path: Path) -> None:
    fmi = 2 if read_model_description(str(exported.path)).fmiVersion == "2.0" else 3
    again = export_fmu(hybrid, tmp_path / exported.path.name, fmi)
    first, second = zipfile.ZipFile(exported.path), zipfile.ZipFile(again.path)
    for one, other in zip(first.infolist(), second.infolist(), strict=True):
        assert one.date_time == other.date_time == (1980, 1, 1, 0, 0, 0)
        if one.filename != exported.binary:  # a compiler may note when it ran
            assert (one.filename, first.read(one)) == (other.filename, second.read(other))


def test_another_model_or_version_has_another_token(
    small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export, "find_compiler", without_compiler)
    ways = [("one", 2, "double"), ("one", 3, "double"), ("two", 2, "double"), ("one", 2, "float")]
    assert len({export_fmu(small_hybrid, tmp_path / f"{name}.fmu", *how).token for name, *how in ways * 2}) == 4


def test_what_is_declared(exported: ExportedFmu, model: StepModel) -> None:
    description = read_model_description(str(exported.path))
    interface = description.coSimulation
    assert interface.modelIdentifier == exported.name == "press"
    assert description.guid == exported.token
    assert not interface.canHandleVariableCommunicationStepSize
    assert interface.canGetAndSetFMUstate
    assert interface.canSerializeFMUstate
    assert float(description.defaultExperiment.stepSize) == model.sample_time_s
    if description.fmiVersion == "3.0":
        assert float(interface.fixedInternalStepSize) == model.sample_time_s
    units = {variable.name: variable.unit for variable in description.modelVariables if variable.unit}
    assert units == {
        "time": "s",
        "sample_time": "s",
        "pressure_1": "Pa",
        "pressure_2": "Pa",
        "position": "m",
        "friction": "N",
        "friction_lower": "N",
        "friction_upper": "N",
    } | (dict.fromkeys(OFFSET_VARIABLES, "N") if model.offset is not None else {})
    bases = {unit.name: unit.baseUnit for unit in description.unitDefinitions}
    assert (bases["Pa"].kg, bases["Pa"].m, bases["Pa"].s) == (1, -1, -2)
    assert (bases["N"].kg, bases["N"].m, bases["N"].s) == (1, 1, -2)
    assert all(variable.description for variable in description.modelVariables)
    starts = {variable.name: variable.start for variable in description.modelVariables}
    for channel, name in enumerate(("pressure_1", "pressure_2", "position")):
        assert model.guard.trained_lower[channel] < float(starts[name]) < model.guard.trained_upper[channel]


def test_a_host_simulates_it_with_nothing_set(exported: ExportedFmu, model: StepModel) -> None:
    if exported.binary is None:
        pytest.skip(exported.note)
    rows = simulate_fmu(
        str(exported.path), stop_time=0.1, output_interval=model.sample_time_s, output=["friction", "flags"]
    )
    assert len(rows) == 21
    assert (rows["friction"][0], rows["flags"][0]) == (0.0, 1)
    assert abs(rows["friction"][1:]).min() > 0.0


def test_without_a_compiler_it_holds_the_sources_and_says_so(
    small_hybrid: HybridEstimator, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(export, "find_compiler", without_compiler)
    exported = export_fmu(small_hybrid, tmp_path / "press.fmu", 3)
    assert exported.binary is None
    assert exported.note == "sources only: no C compiler (gcc, clang, cc) was found here; install one and export again"
    names = zipfile.ZipFile(exported.path).namelist()
    assert not any(name.startswith("binaries/") for name in names)
    assert {"sources/press.c", "sources/fmi3.c", "sources/buildDescription.xml"} <= set(names)
    assert validate_fmu(str(exported.path)) == []


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_the_sources_compile_without_a_warning(exported: ExportedFmu, tmp_path: Path) -> None:
    zipfile.ZipFile(exported.path).extractall(tmp_path)
    sources = sorted((tmp_path / "sources").glob("*.c"))
    for prefix in ((), ("-DFMI2_FUNCTION_PREFIX=press_", "-DFMI3_FUNCTION_PREFIX=press_")):
        command = [find_compiler(), "-std=c99", *STRICT, *prefix, "-c", *sources]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.stderr == ""
        assert done.returncode == 0


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_the_binary_exports_fmi_alone(exported: ExportedFmu, opened: ExtractedFmu) -> None:
    library = opened.folder / str(exported.binary)
    listed = subprocess.run(["nm", "-D", "--defined-only", library], capture_output=True, text=True, check=True).stdout
    names = [line.split()[-1] for line in listed.splitlines()]
    assert len(names) > 30
    assert [name for name in names if not name.startswith(f"fmi{opened.version}")] == []


@pytest.mark.extended
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_sanitizers_find_nothing(exported: ExportedFmu, opened: ExtractedFmu, tmp_path: Path) -> None:
    host = Path(__file__).parent / f"host{opened.version}.c"
    sources = [opened.folder / "sources" / name for name in (f"{exported.name}.c", f"fmi{opened.version}.c")]
    flags = ("-std=c99", "-g", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    command = [find_compiler(), *flags, "-I", opened.folder / "sources", host, *sources, "-o", tmp_path / "host", "-lm"]
    built = subprocess.run(command, capture_output=True, text=True)
    if "cannot find" in built.stderr:
        pytest.skip("the compiler has no sanitizers")
    assert built.returncode == 0, built.stderr
    done = subprocess.run([tmp_path / "host"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.extended
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_fmpy_builds_the_binary_from_the_sources(
    exported: ExportedFmu, opened: ExtractedFmu, tmp_path: Path, samples: list[tuple[float, float, float]]
) -> None:
    built = ExtractedFmu(exported.path, tmp_path / "fmu")
    (built.folder / str(exported.binary)).unlink()
    (tmp_path / "build").mkdir()
    build_platform_binary(built.folder, tmp_path / "build")
    own, theirs = opened.instance(), built.instance()
    for instance in (own, theirs):
        instance.initialize()
    for sample in samples[:50]:
        assert own.step(sample) == pytest.approx(theirs.step(sample), abs=1e-3)
    for instance in (own, theirs):
        instance.close()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no C compiler")
def test_refused_sources_are_an_error_with_the_compilers_words(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("#error wrong\n")
    with pytest.raises(NoCompilerError, match="wrong"):
        compile_shared([tmp_path / "a.c"], tmp_path / "a.so", ["-O1"])


@pytest.mark.parametrize(
    ("stem", "name"),
    [
        ("press", "press"),
        ("Press 4, hybrid", "press_4_hybrid"),
        ("4-bar", "friction_4_bar"),
        ("fmu", "friction_fmu"),
        ("---", "model"),
    ],
)
def test_the_files_name_becomes_an_identifier(stem: str, name: str) -> None:
    assert model_identifier(stem) == name


def test_another_version_is_refused(small_hybrid: HybridEstimator, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected FMI version 2 or 3, but got 1"):
        export_fmu(small_hybrid, tmp_path / "press.fmu", 1)  # type: ignore[arg-type]
