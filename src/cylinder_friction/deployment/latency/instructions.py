"""Instructions of one step of the exported C, counted by Valgrind: the same on a quiet machine and on a busy one."""

from __future__ import annotations

import platform
import re
import shutil
import subprocess
from typing import TYPE_CHECKING

from cylinder_friction.deployment.c_export.compiled import find_compiler
from cylinder_friction.deployment.c_export.literals import number

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from cylinder_friction.deployment.c_export.export import ExportedC

FEW, MORE = 100, 300
X86_OPTIONS = ("-march=x86-64-v3",)
"""The widest instructions that Valgrind knows."""

MAIN = """\
#include "@name@.h"

#include <stdlib.h>

static const double SAMPLES[][3] = {
@samples@
};

int main(int count, char **words)
{
    static @name@_state state;
    @name@_output output = {0};
    const int steps = count > 1 ? atoi(words[1]) : 0;
    int row;
    @name@_init(&state);
    for (row = 0; row < steps; ++row) {
        const double *sample = SAMPLES[row];
        @name@_step(&state, (@name@_real)sample[0], (@name@_real)sample[1], (@name@_real)sample[2], &output);
    }
    return output.flags > 255u;
}
"""


def instructions_per_step(exported: ExportedC, samples: NDArray[np.float64]) -> float | None:
    """Return the mean number of instructions of a step under ``-O3``; None where Valgrind is not there.

    Args:
        exported: What ``export_c`` wrote.
        samples: Raw, shape ``(n, 3)``, at least ``MORE`` rows; fewer give None.

    Raises:
        NoCompilerError: There is no compiler.
    """
    valgrind = shutil.which("valgrind")
    if valgrind is None or len(samples) < MORE:
        return None
    rows = ",\n".join("    {" + ", ".join(number(value, "double") for value in row) + "}" for row in samples[:MORE])
    main = exported.source.with_name("counted.c")
    main.write_text(MAIN.replace("@samples@", rows).replace("@name@", exported.name), encoding="utf-8")
    program = main.with_suffix("")
    wide = X86_OPTIONS if platform.machine() in ("x86_64", "AMD64") else ()
    sources = (str(exported.source), str(main))
    command = [find_compiler(), "-std=c99", "-O3", *wide, "-ffp-contract=off", *sources, "-o", str(program), "-lm"]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:  # noqa: S603 - the user's compiler
        return None
    counts = []
    for steps in (FEW, MORE):
        counting = [valgrind, "--tool=callgrind", f"--callgrind-out-file={main.with_suffix('.out')}"]
        done = subprocess.run(  # noqa: S603 - a program that was just compiled
            [*counting, str(program), str(steps)], capture_output=True, text=True, check=False
        )
        found = re.search(r"Collected : (\d+)", done.stderr)
        if found is None:
            return None
        counts.append(int(found[1]))
    return (counts[1] - counts[0]) / (MORE - FEW)
