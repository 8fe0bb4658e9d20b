"""An estimator's engine: its exported C with a loop over sessions, compiled once for this machine."""

from __future__ import annotations

import logging
import platform
from dataclasses import asdict
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import cylinder_friction
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, GoldenError
from cylinder_friction.files.whole_files import hash_of, whole_folder, write_json, write_text
from cylinder_friction_live.engine import DESCRIPTION, LIBRARY, NAME, Engine, EngineError
from cylinder_friction_live.frames import ESTIMATES, HEADER

if TYPE_CHECKING:
    from cylinder_friction.estimators.base import FrictionEstimator

_log = logging.getLogger(__name__)
_PACKAGES = Path(__file__).parent, Path(cylinder_friction.__file__).parent

_BATCH = """\
#include "{name}.h"

#include <string.h>

static void step_rows({name}_state *state, uint32_t rows, const double *samples, double *newtons, uint32_t *flags)
{{
    {name}_output output;

    for (; rows > 0u; rows--) {{
        {name}_step(state, {arguments}, &output);
        samples += {columns};
        *newtons++ = output.friction_n;
        *newtons++ = output.lower_n;
        *newtons++ = output.upper_n;
        *flags++ = output.flags;
    }}
}}

/* Jobs one after the other: a session's rows together, so that its state is what a single stream's would be. */
void {name}_batch({name}_state *states, uint32_t jobs, const uint32_t *slots, const uint32_t *resets,
                  const uint32_t *rows, const double *samples, double *newtons, uint32_t *flags)
{{
    uint32_t job;

    for (job = 0; job < jobs; job++) {{
        if (resets[job])
            {name}_reset(states + slots[job]);
        step_rows(states + slots[job], rows[job], samples, newtons, flags);
        samples += {columns} * rows[job];
        newtons += 3 * rows[job];
        flags += rows[job];
    }}
}}

/* Frames of samples, all with as many rows, into frames of estimates: a header of 24 bytes, then the numbers. */
void {name}_frames({name}_state *states, uint32_t blocks, const uint32_t *slots, uint32_t rows, const char *message,
                   char *answer)
{{
    uint32_t block;

    for (block = 0; block < blocks; block++) {{
        double *newtons = (double *)(answer + {header});
        uint32_t *flags = (uint32_t *)(newtons + 3 * rows);

        memcpy(answer, message, {header});
        answer[0] = {estimates};
        answer[1] = 3;
        if (rows % 2 != 0u)
            flags[rows] = 0u;
        step_rows(states + slots[block], rows, (const double *)(message + {header}), newtons, flags);
        message += {header} + 8 * {columns} * rows;
        answer += {header} + 24 * rows + 4 * (rows + rows % 2);
    }}
}}
"""


def build_engine(estimator: FrictionEstimator, folder: Path) -> Path:
    """Compile an estimator's engine into a folder, which appears whole or not at all; return the folder.

    Args:
        estimator: A fitted estimator with a real-time step.
        folder: Folder of the engine; one that exists is replaced.

    Raises:
        ValueError: The estimator has no real-time step.
        NoCompilerError: There is no C compiler, or it refused the source.
    """
    # Late, like the estimator below: only the first start with a model needs them, and a restart must be quick
    from cylinder_friction.deployment.c_export.compiled import OPTIMISED, compile_shared
    from cylinder_friction.deployment.c_export.export import export_c

    with whole_folder(folder) as draft:
        exported = export_c(estimator, draft, NAME)
        noise_pa = 0.0 if estimator.trained_for is None else estimator.trained_for.pressure_noise_pa
        arguments = ", ".join(f"samples[{place}]" for place in range(len(exported.inputs)))
        batch = draft / "batch.c"
        about = {"columns": len(exported.inputs), "header": HEADER.size, "estimates": ESTIMATES}
        write_text(batch, _BATCH.format(name=NAME, arguments=arguments, **about))
        compile_shared((exported.source, batch), draft / LIBRARY, ("-std=c99", *OPTIMISED))
        described = {
            "model": exported.model,
            "library": hash_of(draft / LIBRARY),
            "inputs": list(exported.inputs),
            "corrections": {name: asdict(each) for name, each in estimator.corrections.items()},
            "sample_time_s": estimator.sample_time_s,
            "state_bytes": exported.state_bytes,
            "bounds": "as wide as can be" if estimator.bounds is None else estimator.bounds.in_words(),
            "pressure_noise_pa": noise_pa,
        }
        write_json(draft / DESCRIPTION, described)
    return folder


def engine_of(estimator: Path, called: str, engines: Path) -> Engine:
    """Open a saved estimator's engine, checked against the golden trajectory that lies beside a registered model.

    A start with the same files and the same program finds the compiled engine; it neither loads the estimator nor needs
    a compiler. A damaged engine is compiled again.

    Args:
        estimator: Folder of the saved estimator.
        called: The model's folder or registered version, for people.
        engines: Folder of the engines, one per model, program and processor.

    Raises:
        GoldenError: The engine does not reproduce the trajectory, or a registered model has none.
        ValueError: The estimator has no real-time step.
        NoCompilerError: There is no C compiler, or it refused the source.
    """
    golden = estimator.resolve().with_name(GOLDEN_FILE)
    if called.startswith("models:/") and not golden.is_file():
        raise GoldenError(f"{called}: its golden trajectory, {GOLDEN_FILE}, is not there; register the model again")
    folder = engines / _key(estimator)
    try:
        engine = Engine(folder, called)
    except EngineError as error:
        from cylinder_friction.estimators.loading import load_estimator

        if folder.exists():
            _log.warning("%s; it is compiled again", error)
        engine = Engine(build_engine(load_estimator(estimator), folder), called)
    if golden.is_file():
        engine.check(golden)
    return engine


def _key(estimator: Path) -> str:
    """Hash what an engine is made from: the estimator's files, the program, the processor."""
    written_ns = max(path.stat().st_mtime_ns for package in _PACKAGES for path in package.rglob("*.py"))
    hashed = sha256(f"{version('cylinder-friction')} {written_ns} {_processor()}".encode())
    for path in sorted(path for path in estimator.rglob("*") if path.is_file()):
        hashed.update(f"{path.relative_to(estimator)} {path.stat().st_size} ".encode() + path.read_bytes())
    return hashed.hexdigest()


def _processor() -> str:
    """Describe the processor for which code is compiled: the machine's kind and its instructions."""
    known = Path("/proc/cpuinfo")
    lines = known.read_text(encoding="utf-8").splitlines() if known.is_file() else [platform.processor()]
    able = [line for line in lines if line.startswith(("flags", "Features"))] or lines
    return f"{platform.machine()} {able[0]}"
