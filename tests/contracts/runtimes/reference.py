"""The reference itself: what was recorded must still come out."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.realtime.reference import ReferenceStream

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.realtime.model import StepModel


class Reference:
    """Plain Python."""

    name = "reference"

    def open(self, model: StepModel, folder: Path) -> ReferenceStream:
        return ReferenceStream(model)


RUNTIME = Reference()
