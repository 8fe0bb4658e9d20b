"""The page inside the FMU that a host shows as its documentation."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from cylinder_friction.deployment.fmu.model_description import FmuFacts

PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{name}</title></head>
<body>
<h1>{name}</h1>
<p>{description}</p>
<p>Each step takes the inputs as one sample of the sensors, and its outputs are the estimate at that sample: set the
inputs at t, step from t to t + {step} s, read the outputs. The estimator was trained at one sample time, so the only
communication step size is {step} s; any other is refused. Friction is positive when it opposes positive velocity.</p>
<p>A stored state fits the binary that stored it, and no other.</p>
<table>
<tr><th>Variable</th><th>Causality</th><th>Unit</th><th>Meaning</th></tr>
{rows}
</table>
</body>
</html>
"""


def documentation(facts: FmuFacts) -> bytes:
    """Return ``documentation/index.html``."""
    rows = "\n".join(
        "<tr>"
        + "".join(f"<td>{escape(cell)}</td>" for cell in (v.name, v.causality, v.unit or "", v.description))
        + "</tr>"
        for v in facts.variables
    )
    page = PAGE.format(
        name=escape(facts.name), description=escape(facts.description), step=f"{facts.sample_time_s:g}", rows=rows
    )
    return page.encode()
