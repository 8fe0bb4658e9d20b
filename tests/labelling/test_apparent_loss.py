"""A force that grows with speed far more than friction does is named; what grows of friction itself is not."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import nnls
from tests.labelling.test_line_loss import lossy, stated

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.apparent_loss import ApparentLoss, loss_of_labels, missing_loss, not_negative
from cylinder_friction.labelling.known_offset import offset_evidence
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.realtime.trained_for import TrainedFor
from cylinder_friction.recordings.line_loss import LineLoss
from cylinder_friction.recordings.recording import Recording


def test_a_loss_is_named_with_its_size(labelled_recordings: list[Recording], cylinder: Cylinder) -> None:
    assert loss_of_labels(label(labelled_recordings, cylinder), cylinder) is None
    loss = loss_of_labels(label([lossy(each) for each in labelled_recordings], cylinder), cylinder)
    assert loss is not None
    true_n = 2e5 * (loss.speed_m_s / 0.05) ** 2 * (cylinder.piston_area_m2 + cylinder.annulus_area_m2)
    assert loss.square_n == pytest.approx(true_n, rel=0.3)
    assert loss.most_n(np.array([loss.speed_m_s]))[0] > 0.95 * true_n


def test_sensors_stated_at_the_ports_leave_viscous_friction(
    labelled_recordings: list[Recording], cylinder: Cylinder
) -> None:
    raw = [stated(lossy(each), LineLoss(bar=0.0)) for each in labelled_recordings]
    labelled = label(raw, cylinder)
    assert loss_of_labels(labelled, cylinder) is None
    assert "lose" not in TrainedFor.of(labelled, cylinder).in_words()
    one_side = [replace(each.metadata, line_loss={"pressure_1_pa": LineLoss(bar=0.0)}) for each in raw]
    raw = [replace(each, metadata=metadata) for each, metadata in zip(raw, one_side, strict=True)]
    assert loss_of_labels(label(raw, cylinder), cylinder) is not None


def test_the_sentence_leaves_open_which_it_is_and_asks(cylinder: Cylinder) -> None:
    words = ApparentLoss(1500.0, 100.0, 400.0, 0.05).sentence(cylinder)
    assert words == (
        "1600 N of the force against motion at 0.05 m/s grow with speed: viscous friction of the cylinder, or what "
        "lines between sensors and cylinder lose, such as 3.4 bar (piston side) and 2.2 bar (rod side); strokes cannot "
        "tell which. State sensor.line_loss in the mapping, {bar: 0} if the sensors are at the cylinder's ports; until "
        "then any bounds are wider by what lines may lose, and Coulomb and viscous friction are not known"
    )


@pytest.mark.parametrize("seed", range(20))
def test_coefficients_that_may_not_be_negative_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    free, others = np.eye(3)[np.arange(60) % 3] * rng.choice([-1.0, 1.0], (60, 1)), rng.uniform(0.0, 1.0, (60, 5))
    design, target = np.hstack([free, others]), rng.normal(0.0, 1.0, 60)
    expected = nnls(np.hstack([design, -free]), target)[0]
    expected[:3] -= expected[-3:]
    np.testing.assert_allclose(not_negative(design, target, 3), expected[:-3], atol=1e-9)


@pytest.mark.parametrize(("share", "named"), [(1.0, False), (0.7, True)])
def test_a_stated_loss_that_is_too_small_is_named_with_what_is_missing(
    share: float, named: bool, labelled_recordings: list[Recording], cylinder: Cylinder
) -> None:
    line = LineLoss(share * 2.0, 0.05)
    labelled = label([stated(lossy(each), line) for each in labelled_recordings], cylinder)
    words = missing_loss([offset_evidence(each, cylinder, OffsetPlan(), np.nan, np.nan, "") for each in labelled])
    found = re.search(r"explains ([\d.]+) of about ([\d.]+) bar \(piston side\) at ([\d.]+) m/s", words)
    assert (found is not None) == named
    if found is not None:
        explained_bar, about_bar, speed_m_s = map(float, found.groups())
        assert explained_bar == pytest.approx(share * 2.0 * (speed_m_s / 0.05) ** 2, rel=0.1)
        assert about_bar == pytest.approx(2.0 * (speed_m_s / 0.05) ** 2, rel=0.3)
