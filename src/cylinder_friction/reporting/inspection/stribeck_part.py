"""The Stribeck curve in numbers, or what was seen where no curve can be stated."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.reporting.inspection.drawing import MM_PER_M
from cylinder_friction.reporting.inspection.html_page import four_digits
from cylinder_friction.reporting.inspection.known_curve import is_breakaway_known

if TYPE_CHECKING:
    from cylinder_friction.reporting.inspection.friction_view import FrictionView
    from cylinder_friction.reporting.inspection.html_page import Pane


def add_stribeck(pane: Pane, view: FrictionView) -> None:
    """Add the curve's parameters, or why none are stated and the points of steady sliding."""
    pane.heading("Stribeck curve")
    if view.curve is None:
        pane.text(f"No curve is stated: {view.no_curve}.", "warning")
        _steady_points(pane, view)
        return
    curve, known = view.curve, is_breakaway_known(view.curve, view.points)
    rows = [
        ("Coulomb friction, extending", "Fc", four_digits(curve.coulomb_n), "N"),
        ("Coulomb friction, retracting", "ratio · Fc", four_digits(curve.retract_ratio * curve.coulomb_n), "N"),
        ("static friction, extending", "Fs", four_digits(curve.static_n) if known else "not seen", "N"),
        (
            "Stribeck velocity",
            "vs",
            four_digits(MM_PER_M * curve.stribeck_velocity_m_s) if known else "not seen",
            "mm/s",
        ),
        ("Stribeck exponent", "a", four_digits(curve.stribeck_exponent) if known else "not seen", "–"),
        ("viscous coefficient", "s2", four_digits(curve.viscous_n_s_m), "N·s/m"),
        ("retracting over extending", "ratio", four_digits(curve.retract_ratio), "–"),
    ]
    pane.table(("parameter", "symbol", "value", "unit"), rows, words=(0, 1, 3))
    unseen = "" if known else " Not seen: friction that rises towards standstill, for which slower sliding is needed."
    pane.text(
        f"F = sgn(v)·[Fc + (Fs - Fc)·exp(-|v/vs|^a)] + s2·v, the bracket times the ratio while retracting; fitted to "
        f"{len(view.points)} points of steady sliding, {_speed_range(view)}, and drawn no further.{unseen}",
        "quiet",
    )


def _steady_points(pane: Pane, view: FrictionView) -> None:
    """Add what was seen where no curve is stated: the range of friction each way, and the points themselves."""
    for way, words in ((1.0, "Extending"), (-1.0, "Retracting")):
        seen = [point for point in view.points if way * point.velocity_m_s > 0.0]
        if seen:
            against_n = [way * point.friction_n for point in seen]
            speeds = [MM_PER_M * way * point.velocity_m_s for point in seen]
            pane.text(
                f"{words}: {four_digits(min(against_n))} to {four_digits(max(against_n))} N against the motion, at "
                f"{min(speeds):.2g} to {max(speeds):.2g} mm/s."
            )
    if view.points:
        head = ("velocity [mm/s]", f"{view.friction_name} [N]", "lower quartile [N]", "upper quartile [N]", "rows")
        rows = [
            (
                f"{MM_PER_M * point.velocity_m_s:.3g}",
                *(four_digits(value) for value in (point.friction_n, point.lower_quartile_n, point.upper_quartile_n)),
                str(point.rows),
            )
            for point in view.points
        ]
        pane.table(head, rows, words=())


def _speed_range(view: FrictionView) -> str:
    speeds = [MM_PER_M * abs(point.velocity_m_s) for point in view.points]
    return f"{min(speeds):.2g} to {max(speeds):.3g} mm/s"
