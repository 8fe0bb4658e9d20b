"""What the models of related work share: the side of the last motion, as the product's backlash operator sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.realtime.history import TOLERANCE_M
from cylinder_friction.signals.backlash import CENTRE, DIRECTION, new_backlash, push
from friction_benchmark.models.related_work import MotionModel
from friction_benchmark.registry import BuildConfiguration, registered_models

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording

HALF_WIDTH, STEP_S = 4e-5, 0.005


def test_the_direction_among_the_features_is_that_of_the_play(
    cylinder: Cylinder, labelled_recordings: list[Recording]
) -> None:
    machado = registered_models()["machado"]
    model = machado.build(BuildConfiguration(cylinder, ("position_m",), 0, 0.01, machado.defaults))
    assert isinstance(model, MotionModel)
    model.set_features(labelled_recordings, ("position_m",))
    features, (found, _) = model.features, model.features_of(labelled_recordings[0])
    place = features.names.index("position_m_20")
    smooth_m = found[:, place] * features.scale[place] + features.mean[place]
    play, expected = new_backlash(), []
    for at in smooth_m:
        if not abs(at - play[CENTRE]) <= HALF_WIDTH + TOLERANCE_M:
            push(at, play, HALF_WIDTH, 0.0, STEP_S)
        expected.append(play[DIRECTION])
    np.testing.assert_array_equal(model.last_motion(found), expected)
    assert set(expected) == {-1.0, 0.0, 1.0}
