"""Draw the pictures of docs/ from the simulated rig and from ``dvc.yaml``: ``python docs/pictures.py``.

Equal code gives equal bytes, so a picture changes only when the rig or the pipeline does.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import yaml
from matplotlib.patches import Rectangle

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.reporting.print_figure import draw, panels, png_bytes
from cylinder_friction.rig.campaign import CampaignPlan, RigRecording, campaign

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

IMAGES = Path(__file__).parent / "images"
DVC = Path(__file__).parents[1] / "dvc.yaml"
CYLINDER = Cylinder(
    name="Bosch H160CA 63x28", bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0
)
PLAN = CampaignPlan(seed=0, sessions_per_condition=1, recordings_per_session=2)
BEGIN_S, END_S = 18.0, 42.0
STAGES = {  # column, row and what the stage does
    "record": (0, 1, "simulated rig"),
    "ingest": (1, 1, "any format to SI"),
    "filter": (2, 1, "smooth signals"),
    "label": (3, 1, "force balance"),
    "split": (4, 1, "by session"),
    "offset": (5, 1, "sensor zeros"),
    "search": (6, 0, "Optuna"),
    "train": (7, 0, "LSTM + forest"),
    "baselines": (6.5, 1, "simpler ones"),
    "lugre": (6.5, 2, "identified"),
    "compare": (8, 1, "held-out errors"),
    "register": (9, 1, "gate, champion"),
}
"""Where a stage stands in the picture. The stage ``code``, which every other one depends on, is not drawn."""
FLOWS = (
    "record ingest", "ingest filter", "filter label", "label split", "split offset", "offset search", "search train",
    "offset baselines", "offset lugre", "train compare", "baselines compare", "lugre compare", "compare register",
)  # fmt: skip
BLUE, ORANGE, GREEN, BLACK = "#0072B2", "#D55E00", "#009E73", "#000000"
MOVING_M_S = 2e-4
"""Slower than this a row is not drawn against velocity: at rest friction is whatever holds."""


def main() -> None:
    """Write every picture."""
    recordings = list(campaign(CYLINDER, PLAN))
    pictures = {
        "one_recording": draw(one_recording, _of(recordings, "condition4_session01_recording01")),
        "friction_against_velocity": draw(friction_against_velocity, recordings),
        "pipeline": draw(pipeline, sorted(yaml.safe_load(DVC.read_text(encoding="utf-8"))["stages"])),
    }
    IMAGES.mkdir(exist_ok=True)
    for name, figure in pictures.items():
        (IMAGES / f"{name}.png").write_bytes(png_bytes(figure))


def pipeline(stages: list[str]) -> Figure:
    """Draw the pipeline's stages from logs to the registry.

    Raises:
        ValueError: ``dvc.yaml`` has other stages than the picture.
    """
    if set(stages) - {"code"} != set(STAGES):
        raise ValueError(f"the picture has the stages {sorted(STAGES)}, dvc.yaml has {stages}; correct STAGES")
    figure, (axis,) = panels(1, 1, 13.0, 3.4)
    axis.set_axis_off()
    for flow in FLOWS:
        (x0, y0, _), (x1, y1, _) = (STAGES[name] for name in flow.split())
        arrow = {"arrowstyle": "-|>", "color": "#555555", "linewidth": 1.2}
        axis.annotate("", (x1 - 0.44, -y1), (x0 + 0.44, -y0), arrowprops=arrow)
    for name, (x, y, words) in STAGES.items():
        color = {"record": GREEN, "register": ORANGE}.get(name, BLUE)
        axis.add_patch(Rectangle((x - 0.44, -y - 0.3), 0.88, 0.6, facecolor="white", edgecolor=color, linewidth=1.6))
        axis.text(x, -y + 0.09, name, ha="center", va="center", fontsize=13, fontweight="bold", color=BLACK)
        axis.text(x, -y - 0.14, words, ha="center", va="center", fontsize=9.5, color="#444444")
    for x, words in ((0, "or your own logs"), (9, "mlflow models serve\nC, FMU, Python")):
        axis.text(x, -1.6, words, ha="center", va="center", fontsize=10, color="#444444")
    axis.set(xlim=(-0.6, 9.6), ylim=(-2.4, 0.4))
    return figure


def one_recording(recording: RigRecording) -> Figure:
    """Return what the logger saw of one recording and, below it, what it did not see."""
    logger, truth = (_between(table) for table in (recording.logger, recording.truth))
    figure, axes = panels(4, 1, 9.5, 7.6)
    pressures, position, velocity, friction = axes
    pressures.plot(logger["Time [s]"], logger["P1 [bar]"], color=BLUE, label="P1, piston side")
    pressures.plot(logger["Time [s]"], logger["P2 [bar]"], color=ORANGE, label="P2, rod side")
    pressures.set(title="What the logger writes", ylabel="pressure [bar]")
    pressures.legend(ncols=2)
    position.plot(logger["Time [s]"], logger["Position [mm]"], color=GREEN)
    position.set(ylabel="position [mm]")
    velocity.plot(truth["time_s"], 1e3 * truth["velocity_m_s"], color=BLACK)
    velocity.set(title="What only the simulation knows", ylabel="velocity [mm/s]")
    friction.plot(truth["time_s"], truth["friction_n"], color=BLACK)
    friction.set(ylabel="friction [N]", xlabel="time [s]")
    for axis in axes:
        axis.set_xlim(BEGIN_S, END_S)
    return figure


def friction_against_velocity(recordings: list[RigRecording]) -> Figure:
    """Return true friction against true velocity in conditions 1 and 4, every row in motion one point."""
    figure, axes = panels(1, 2, 9.5, 4.0)
    for axis, condition, words in zip(axes, ("1", "4"), ("no load", "heaviest load"), strict=True):
        _points(axis, [recording.truth for recording in recordings if recording.metadata.condition == condition])
        axis.set(
            title=f"condition {condition}, {words}",
            xlabel="velocity [mm/s]",
            ylabel="true friction [N]",
            ylim=(-850, 850),
        )
    return figure


def _points(axis: Axes, truths: list[pd.DataFrame]) -> None:
    velocity_m_s = np.concatenate([truth["velocity_m_s"] for truth in truths])
    friction_n = np.concatenate([truth["friction_n"] for truth in truths])
    moving = np.abs(velocity_m_s) > MOVING_M_S
    axis.axhline(0.0, color="#555555", linewidth=0.8)
    axis.axvline(0.0, color="#555555", linewidth=0.8)
    axis.plot(1e3 * velocity_m_s[moving], friction_n[moving], ".", color=BLUE, markersize=1.5, alpha=0.35)


def _between(table: pd.DataFrame) -> pd.DataFrame:
    time_s = table.iloc[:, 0]
    return table[(time_s >= BEGIN_S) & (time_s <= END_S)]


def _of(recordings: list[RigRecording], name: str) -> RigRecording:
    return next(recording for recording in recordings if recording.metadata.name == name)


if __name__ == "__main__":
    main()
