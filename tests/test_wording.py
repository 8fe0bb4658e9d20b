"""Numbers as messages and pages state them."""

import math

from cylinder_friction.evaluation.inspection.sliding_friction import MeanFriction
from cylinder_friction.labelling.known_offset import KnownOffset
from cylinder_friction.recordings.reading_logs import Ingested
from cylinder_friction.recordings.recording import UNNAMED
from cylinder_friction.reporting.page import number_cell


def test_one_thing_is_no_plural() -> None:
    one = Ingested(1, recordings=[(UNNAMED, 0)])
    assert one.summary() == "1 recording (0 h) from 1 file; 0 repaired or noted, 0 quarantined"
    assert Ingested().summary() == "0 recordings (0 h) from 0 files; 0 repaired or noted, 0 quarantined"


def test_what_rounds_to_zero_has_no_sign() -> None:
    assert KnownOffset("session", "", "", 3.0, 3.0, -0.04).value == "0.0 ± 3.0 N"
    assert str(MeanFriction(-0.4, math.nan)) == "0"
    assert number_cell(-0.4).words == "0"
