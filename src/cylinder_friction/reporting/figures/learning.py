"""Figure 5: how the error falls during training."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.evaluation.names import title
from cylinder_friction.reporting.figures.style import panels

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from cylinder_friction.evaluation.views import LearningCurve


def learning_curves(curves: Mapping[str, LearningCurve]) -> Figure:
    """Return one panel a hybrid: training and validation error an epoch, the gap between them, the epoch kept."""
    figure, axes = panels(1, max(1, len(curves)), 4.6 * max(1, len(curves)), 3.4)
    for axis, (name, curve) in zip(axes, curves.items(), strict=False):
        epochs = np.array(curve.epoch)
        train, validation = np.array(curve.train_mae_n), np.array(curve.validation_mae_n)
        axis.fill_between(epochs, train, validation, color="#56B4E9", alpha=0.25, linewidth=0, label="gap")
        axis.plot(epochs, train, color="#0072B2", label="training")
        axis.plot(epochs, validation, color="#D55E00", label="validation")
        if curve.best_epoch in curve.epoch:
            kept = curve.epoch.index(curve.best_epoch)
            label = f"kept: epoch {curve.best_epoch}, {validation[kept]:.1f} N"
            axis.plot(epochs[kept], validation[kept], "o", color="#000000", markersize=5, label=label)
        axis.set_yscale("log")
        axis.yaxis.set_major_formatter("{x:g}")
        axis.yaxis.set_minor_formatter("{x:g}")
        axis.tick_params(axis="y", which="minor", labelsize=7)
        axis.set(title=title(name), xlabel="epoch", ylabel="mean absolute error against the label [N]")
        axis.legend()
    return figure
