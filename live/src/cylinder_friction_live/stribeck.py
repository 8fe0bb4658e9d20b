"""Identified Stribeck curves, which the page draws beside the estimates."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.files.whole_files import read_json

_SPEEDS_M_S = np.geomspace(1e-4, 2.0, 150)
_UNKNOWN = {"stribeck_velocity_m_s": 0.01, "stribeck_exponent": 2.0, "viscous_n_s_m": 0.0}
_EXPECTED = "expected friction_models.json of `cylinder-friction identify`, or stribeck_points.json of the stage lugre"

Lines = dict[str, dict[str, Any]]
"""Velocity [m/s], ascending, friction [N], and whether it applies ``everywhere``, by the condition of the curve."""


class StribeckError(ValueError):
    """A file holds no Stribeck curve; the message states what is expected."""


def stribeck_lines(path: Path) -> Lines:
    """Compute the curves of a file, one of each condition; positive friction opposes extension.

    A curve applies everywhere if it is the only one of ``identify``, else to the sessions whose names state its
    condition: the stage ``lugre`` identifies one of several.

    If strokes did not determine the rise of friction towards standstill, or viscous friction, the line has none.

    Raises:
        StribeckError: The file cannot be read, has another content, or none of its curves was determined.
    """
    try:
        content = read_json(path)
        by_condition = content.get("stribeck", {content.get("condition", "training"): content})
        everywhere = len(by_condition) == 1 and content.get("condition") is None
        lines = {
            name: _line(each["curve"]) | {"everywhere": everywhere}
            for name, each in by_condition.items()
            if each["curve"] is not None
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise StribeckError(f"{path}: cannot be read as Stribeck curves ({error!r}); {_EXPECTED}") from error
    if not lines:
        raise StribeckError(f"{path}: none of its {len(by_condition)} Stribeck curves was determined; {_EXPECTED}")
    return lines


def _line(parameters: Mapping[str, Any]) -> dict[str, list[float]]:
    # Late: a service without curves need not wait for SciPy
    from cylinder_friction.friction_models.stribeck import StribeckCurve

    known = {name: value for name, value in parameters.items() if value is not None}
    curve = StribeckCurve(**({"static_n": known["coulomb_n"]} | _UNKNOWN | known))
    velocity_m_s = np.concatenate([-_SPEEDS_M_S[::-1], _SPEEDS_M_S])
    return {"velocity_m_s": velocity_m_s.tolist(), "friction_n": curve.friction(velocity_m_s).tolist()}
