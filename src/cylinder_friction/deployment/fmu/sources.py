"""The FMU's C sources: the exported estimator, FMI's functions around it, and the header that joins the two."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

from cylinder_friction.realtime.flags import Flag

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.deployment.fmu.model_description import FmiVersion
    from cylinder_friction.deployment.fmu.variables import FmuVariable

INTERFACE_FILES = {
    2: ("fmi2.c", "fmi2_absent.h", "fmi2_types.h", "fmu_instance.h", "fmu_states.h"),
    3: ("fmi3.c", "fmi3_absent.h", "fmi3_types.h", "fmu_instance.h", "fmu_states.h"),
}


def interface_sources(fmi: FmiVersion) -> dict[str, bytes]:
    """Return FMI's functions in C, by file name."""
    folder = files(__package__) / "sources"
    return {name: (folder / name).read_bytes() for name in INTERFACE_FILES[fmi]}


def model_header(name: str, token: str, sample_time_s: float, variables: Sequence[FmuVariable]) -> bytes:
    """Return ``fmu_model.h``: what FMI's functions call the estimator by, and its variables' value references.

    Args:
        name: Prefix of the exported estimator.
        token: Fingerprint that a host must show.
        sample_time_s: The only step size [s].
        variables: In the order of their value references.
    """
    references = {variable.name: reference for reference, variable in enumerate(variables)}
    flags = [str(flag.name).lower() for flag in Flag]
    lines = [
        f"/* How FMI's functions find the estimator {name}. Written by cylinder-friction. */",
        "#ifndef FMU_MODEL_H",
        "#define FMU_MODEL_H",
        "",
        f'#include "{name}.h"',
        "",
        f'#define FMU_MODEL_TOKEN "{token}"',
        f"#define FMU_MODEL_SAMPLE_TIME_S {sample_time_s!r}",
        *(
            f"#define FMU_MODEL_START_{variable.name.upper()}_{str(variable.unit).upper()} {variable.start!r}"
            for variable in variables
            if variable.causality == "input"
        ),
        f"#define FMU_MODEL_FLAGS {len(flags)}U",
        f"#define FMU_MODEL_FLAG_NOT_READY {Flag.NOT_READY.value}U",
        "",
        f"typedef {name}_real fmu_model_real;",
        f"typedef {name}_state fmu_model_state;",
        f"typedef {name}_output fmu_model_output;",
        *(f"#define fmu_model_{function} {name}_{function}" for function in ("init", "warm_up", "step")),
        "",
        *(
            f"#define FMU_VR_{variable.upper()} {reference}U"
            for variable, reference in references.items()
            if variable not in flags
        ),
        f"#define FMU_VR_FIRST_FLAG {references[flags[0]]}U",
        "",
        "#endif",
        "",
    ]
    assert [references[flag] for flag in flags] == list(range(references[flags[0]], references[flags[0]] + len(flags)))
    return "\n".join(lines).encode()
