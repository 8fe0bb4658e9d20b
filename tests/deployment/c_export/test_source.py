"""The written files: constants, warnings, symbols, sanitizers, determinism, refusals."""

import platform
import re
import shutil
import subprocess
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.deployment.c_export.compiled import NoCompilerError, compile_library, find_compiler
from cylinder_friction.deployment.c_export.export import SOURCE, ExportedC, export_c, export_model, part_of
from cylinder_friction.deployment.rendering import model_hash
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from deployment.c_export.conftest import COMPILERS
from model_shapes import SHAPES

STRICT = "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wundef"
STRICTER = "-Wstrict-prototypes -Wmissing-prototypes -Wold-style-definition -Wcast-qual -Wcast-align -Wvla -Werror"
SANITIZED = "-std=c99 -g -O1 -fsanitize=address,undefined -fno-sanitize-recover=all"

HOST = """\
#include <stdio.h>
#include "friction.h"

int main(int argc, char **argv)
{
    static friction_state state;
    friction_output output;
    double row[3];
    FILE *file = argc > 1 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        return 1;
    }
    friction_init(&state);
    while (fread(row, sizeof row[0], 3, file) == 3) {
        friction_step(&state, (friction_real)row[0], (friction_real)row[1], (friction_real)row[2], &output);
        printf("%.17g %lu\\n", (double)output.friction_n, (unsigned long)output.flags);
    }
    fclose(file);
    return 0;
}
"""


def compiler(name: str) -> str:
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed")
    return found


@cache
def sanitizing_compiler(name: str) -> str:
    """Return the compiler; skip where its sanitizers' run-time library, a package of its own, is not installed."""
    command = [compiler(name), *SANITIZED.split(), "-x", "c", "-", "-o", "/dev/null"]
    if subprocess.run(command, input=b"int main(void) { return 0; }\n", capture_output=True, check=False).returncode:
        pytest.skip(f"the sanitizers' run-time library of {name} is not installed")
    return command[0]


def run(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("name", [pytest.param("clang", marks=pytest.mark.extended), "gcc"])
@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_it_compiles_without_a_warning(
    shape: str, name: str, precision: str, golden_model: StepModel, tmp_path: Path
) -> None:
    exported = export_model(SHAPES[shape](golden_model), tmp_path, precision=precision)
    for level in ("-O0", "-O3"):
        said = run(compiler(name), *STRICT.split(), *STRICTER.split(), level, "-c", exported.source, "-o", "/dev/null")
        assert said == ""


def test_the_source_is_the_same_for_every_model_and_reads_as_it_stands(golden_model: StepModel, tmp_path: Path) -> None:
    for shape in ("whole", "base", "learning"):
        exported = export_model(SHAPES[shape](golden_model), tmp_path / shape)
        assert exported.source.read_bytes() == SOURCE.read_bytes()
    said = run(find_compiler_or_skip(), *STRICT.split(), "-c", SOURCE, "-I", exported.header.parent, "-o", "/dev/null")
    assert said == ""


@pytest.mark.parametrize("shape", ["whole", "learning"])
def test_constants_are_what_was_returned(shape: str, golden_model: StepModel, tmp_path: Path) -> None:
    exported = export_model(SHAPES[shape](golden_model), tmp_path, "press_4")
    names = {
        "PRESS_4_SAMPLE_TIME_S": golden_model.sample_time_s,
        "PRESS_4_STATE_BYTES": exported.state_bytes,
        "sizeof(press_4_state)": exported.state_bytes,
        "PRESS_4_OPERATIONS": exported.operations,
        "PRESS_4_WARM_UP_SAMPLES": golden_model.guard.warm_up_samples,
        "PRESS_4_RECOVERY_SAMPLES": golden_model.guard.recovery_samples,
        "PRESS_4_PROBABILITY": golden_model.bounds.probability,
        "PRESS_4_TRAINED_LOWER_POSITION_M": golden_model.guard.trained_lower[2],
        "PRESS_4_TRAINED_UPPER_PRESSURE_1_PA": golden_model.guard.trained_upper[0],
    } | {
        f"PRESS_4_FLAG_{flag.name}": flag.value
        for flag in Flag
        if exported.learns_offset or flag not in (Flag.OFFSET_UNKNOWN, Flag.UNMODELLED_FORCE)
    }
    prints = "\n".join(f'    printf("%.17g\\n", (double)({name}));' for name in names)
    program = f'#include <stdio.h>\n#include "press_4.h"\nint main(void)\n{{\n{prints}\n    return 0;\n}}\n'
    (tmp_path / "main.c").write_text(program + f"/* {exported.model} */\n", encoding="utf-8")
    run(find_compiler_or_skip(), "-std=c99", tmp_path / "main.c", exported.source, "-o", tmp_path / "main", "-lm")
    assert [float(line) for line in run(tmp_path / "main").split()] == list(names.values())
    assert f'"{exported.model}"' in exported.header.read_text(encoding="utf-8")


def find_compiler_or_skip() -> str:
    try:
        return find_compiler()
    except NoCompilerError as missing:
        pytest.skip(str(missing))


@pytest.mark.parametrize(
    ("shape", "mathematics", "functions"),
    [
        ("whole", set(), set()),
        ("learning", {"log", "sqrt"}, {"friction_reset_from", "friction_offset_n", "friction_offset_uncertainty_n"}),
    ],
)
def test_nothing_is_kept_outside_the_state_and_nothing_is_needed_but_libm(
    shape: str, mathematics: set[str], functions: set[str], golden_model: StepModel, tmp_path: Path
) -> None:
    exported = export_model(SHAPES[shape](golden_model), tmp_path)
    run(find_compiler_or_skip(), "-std=c99", "-O2", "-c", exported.source, "-o", tmp_path / "friction.o")
    symbols = [line.split()[-2:] for line in run("nm", tmp_path / "friction.o").splitlines()]
    kinds = {name: kind for kind, name in symbols}
    assert [name for name, kind in kinds.items() if kind in "DdBbCGgSs"] == []
    needed = {name for name, kind in kinds.items() if kind == "U"}
    assert needed <= {"memcpy", "memset", "_GLOBAL_OFFSET_TABLE_"} | mathematics
    assert {name for name, kind in kinds.items() if kind == "T"} == {
        "friction_init",
        "friction_reset",
        "friction_warm_up",
        "friction_step",
    } | functions


@pytest.mark.extended
@pytest.mark.parametrize("name", COMPILERS)
@pytest.mark.parametrize("precision", ["double", "float"])
@pytest.mark.parametrize("shape", ["whole", "hidden_only", "forest_alone", "learning"])
def test_it_is_clean_under_sanitizers(
    shape: str, precision: str, name: str, golden_model: StepModel, trajectories: dict[str, np.ndarray], tmp_path: Path
) -> None:
    exported = export_model(SHAPES[shape](golden_model), tmp_path, precision=precision)
    (tmp_path / "main.c").write_text(HOST, encoding="utf-8")
    np.concatenate([trajectories["bad_samples"], trajectories["frozen"]]).tofile(tmp_path / "samples")
    program = tmp_path / "main"
    run(sanitizing_compiler(name), *SANITIZED.split(), tmp_path / "main.c", exported.source, "-o", program, "-lm")
    printed = run(program, tmp_path / "samples")
    assert len(printed.splitlines()) == len(trajectories["bad_samples"]) + len(trajectories["frozen"])
    assert "nan" not in printed


Printed = Callable[[str, str, str], str]


@pytest.fixture(scope="module")
def printed_by(
    golden_model: StepModel, trajectories: dict[str, np.ndarray], tmp_path_factory: pytest.TempPathFactory
) -> Printed:
    """Return what a compiler's program prints for a shape; each is compiled and run once."""

    @cache
    def printed(name: str, options: str, shape: str) -> str:
        folder = tmp_path_factory.mktemp("printed")
        exported = export_model(SHAPES[shape](golden_model), folder)
        (folder / "main.c").write_text(HOST, encoding="utf-8")
        trajectories["bad_samples" if shape == "learning" else "stick_slip_reversals"][:300].tofile(folder / "samples")
        sources = (folder / "main.c", exported.source)
        run(compiler(name), "-std=c99", *options.split(), *sources, "-o", folder / "main", "-lm")
        return run(folder / "main", folder / "samples")

    return printed


@pytest.mark.extended
@pytest.mark.parametrize("shape", ["whole", "learning"])
@pytest.mark.parametrize("options", ["-O0", "-O2", "-O3 -march=native -ffp-contract=off"])
@pytest.mark.parametrize("name", COMPILERS)
def test_every_compiler_and_level_gives_the_same_numbers(
    name: str, options: str, shape: str, printed_by: Printed
) -> None:
    assert printed_by(name, options, shape) == printed_by("gcc", "-O1", shape)


def test_fast_math_is_refused(golden_model: StepModel, tmp_path: Path) -> None:
    find_compiler_or_skip()
    exported = export_model(golden_model, tmp_path)
    with pytest.raises(NoCompilerError, match="takes the checks for NaN and infinity away"):
        compile_library(exported, options=["-O2", "-ffast-math"])


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="only x86 has an x87")
def test_numbers_with_digits_beyond_their_type_are_refused(golden_model: StepModel, tmp_path: Path) -> None:
    compiler("gcc")
    exported = export_model(golden_model, tmp_path)
    with pytest.raises(NoCompilerError, match=r"digits beyond their type; add -msse2 -mfpmath=sse on x86"):
        compile_library(exported, options=["-O2", "-mfpmath=387"])


def test_a_missing_compiler_is_named() -> None:
    with pytest.raises(NoCompilerError, match="no C compiler found; expected one of no-such-cc on the PATH"):
        find_compiler(["no-such-cc"])


def test_the_same_model_gives_the_same_bytes(golden_model: StepModel, tmp_path: Path) -> None:
    one, other = (export_model(golden_model, tmp_path / name) for name in ("one", "other"))
    assert one.source.read_bytes() == other.source.read_bytes()
    assert one.header.read_bytes() == other.header.read_bytes()
    assert model_hash(golden_model) == one.model != model_hash(part_of(golden_model, "lstm"))


def test_another_name_changes_every_public_name(golden_model: StepModel, tmp_path: Path) -> None:
    exported: ExportedC = export_model(golden_model, tmp_path, "press")
    header = re.sub(r"/\*.*?\*/", "", exported.header.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert exported.header.name == "press.h"
    assert "friction_step" not in header
    assert "FRICTION_" not in header


def test_what_cannot_be_exported_says_why(
    golden_model: StepModel, tmp_path: Path, small_hybrid: HybridEstimator
) -> None:
    with pytest.raises(ValueError, match="precision must be 'double' or 'float', but got 'half'"):
        export_model(golden_model, tmp_path, precision="half")
    with pytest.raises(ValueError, match="part must be one of whole, lstm, base, but got 'forest'"):
        export_c(small_hybrid, tmp_path, part="forest")
    with pytest.raises(ValueError, match="the model has no LSTM; expected a hybrid"):
        part_of(part_of(golden_model, "base"), "lstm")
    with pytest.raises(ValueError, match=r"name must be lower-case letters.*but got 'Friction'"):
        export_model(golden_model, tmp_path, "Friction")
