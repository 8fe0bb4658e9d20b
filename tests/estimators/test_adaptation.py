"""A hybrid for another cylinder: an ordinary model that knows where it comes from, or a clear refusal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.estimators.adaptation import adaptation_inputs, feature_places
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.training import network_from, weights_of
from cylinder_friction.estimators.training_plan import TrainingPlan
from cylinder_friction.files.whole_files import read_json
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.trained_for import OtherCylinderError
from cylinder_friction.recordings.recording import Recording, RecordingError

PRESS = Cylinder(name="press", bore_diameter_m=0.08, rod_diameter_m=0.045, stroke_m=0.25, moving_mass_kg=6.0)
ONE_EPOCH = TrainingPlan(1, None, 200, 20, 4)


def of_the_press(recording: Recording, cylinder: Cylinder, times: float = 3.0) -> Recording:
    """Return a recording of the press whose friction is ``times`` as large."""
    areas = (("pressure_1_pa", cylinder.piston_area_m2 / PRESS.piston_area_m2),)
    areas += (("pressure_2_pa", cylinder.annulus_area_m2 / PRESS.annulus_area_m2),)
    pressures = {name: times * ratio * recording.column(name) for name, ratio in areas}
    return recording.with_columns(**pressures, friction_n=times * recording.column("friction_n"))


@pytest.fixture(scope="module")
def press(labelled_recordings: list[Recording], cylinder: Cylinder) -> list[Recording]:
    return [of_the_press(each, cylinder) for each in labelled_recordings]


def test_it_is_an_ordinary_model_of_the_new_cylinder_and_states_where_it_comes_from(
    small_hybrid: HybridEstimator, press: list[Recording], cylinder: Cylinder, tmp_path: Path
) -> None:
    adapted = small_hybrid.adapt(press, PRESS, plan=ONE_EPOCH)
    adapted.save(tmp_path / "adapted")
    read = HybridEstimator.load(tmp_path / "adapted")
    usable, label_n = press[0].usable(), press[0].column("friction_n")
    assert np.abs(adapted.estimate(press[0]) - label_n)[usable].mean() < 0.15 * np.abs(label_n).mean()
    assert read.trained_for is not None
    read.trained_for.refuse(PRESS)
    with pytest.raises(OtherCylinderError):
        read.trained_for.refuse(cylinder)
    small_hybrid.save(tmp_path / "source")
    words = read.trained_for.in_words()
    source = read_json(tmp_path / "source/estimator.json")["sha256"]
    assert f"; adapted from the model with SHA-256 {source} on 2.7 min; its bounds rest on 8 sessions, each " in words
    assert "not trained on it, with a mean absolute error against the label of " in words
    assert source in export_c(read, tmp_path / "c", "press").header.read_text(encoding="utf-8")


def test_bounds_of_one_recording_say_so(small_hybrid: HybridEstimator, press: list[Recording]) -> None:
    alone = small_hybrid.adapt(press[:1], PRESS, plan=ONE_EPOCH).trained_for
    assert alone is not None
    assert "3 stretches of the only recording of the only session, so that they do not hold how" in alone.adapted


def test_strokes_in_one_direction_or_none_at_all_are_refused(
    small_hybrid: HybridEstimator, press: list[Recording]
) -> None:
    extending = [
        each.with_columns(usable=np.gradient(each.column("position_m")) > 0.0, position_m=each.column("position_m"))
        for each in press
    ]
    words = r"slides for \d+\.\d s while extending and 0\.\d s while retracting, expected at least 3 s each, also"
    with pytest.raises(RecordingError, match=words):
        small_hybrid.adapt(extending, PRESS)
    with pytest.raises(RecordingError, match=r"recordings to train on \(none\): the piston slides for 0\.0 s"):
        small_hybrid.adapt([], PRESS)
    short = [each.rows(slice(0, 200)) for each in press[:1]]
    with pytest.raises(RecordingError, match="record more strokes in both directions"):
        small_hybrid.adapt(short, PRESS)


def test_the_new_load_takes_the_place_of_the_old_one(press: list[Recording]) -> None:
    inputs = ("pressure_1_pa", "pressure_2_pa", "position_m", "oil_temperature_c", "other_position_1_m")
    loaded = [each.with_columns(load_force_n=np.zeros(len(each))) for each in press[:2]]
    assert adaptation_inputs(inputs, loaded, None) == (*inputs[:3], "load_force_n")
    assert adaptation_inputs((*inputs[:3], "load_force_n"), press[:2], None) == inputs[:3]
    known = PositionLoad(0.05, 0.2, np.array([0.0, 1.0]), np.ones(2))
    assert adaptation_inputs(inputs, loaded, known) == inputs[:3]
    assert feature_places(["a", "b"], ["b", "load", "a"]) == [1, None, 0]


def test_a_network_begins_with_the_weights_that_exist_and_a_new_feature_without_influence(
    small_hybrid: HybridEstimator,
) -> None:
    assert small_hybrid.parts is not None
    weights = small_hybrid.parts.network
    more = weights_of(network_from(small_hybrid.architecture, weights, [None, *range(weights.inputs)]))
    np.testing.assert_array_equal(more.input[0, 0], 0.0)
    np.testing.assert_array_equal(more.input[0, 1 : weights.inputs + 1], weights.input[0, : weights.inputs])
    for name in ("recurrent", "bias", "head"):
        np.testing.assert_array_equal(getattr(more, name), getattr(weights, name))


def test_what_is_not_fitted_cannot_be_adapted(press: list[Recording]) -> None:
    with pytest.raises(RuntimeError, match="not fitted yet"):
        HybridEstimator(PRESS).adapt(press, replace(PRESS))
