"""A constant load that somebody weighed is taken off as a load cell's would be."""

from pathlib import Path

import numpy as np
import pytest
from tests.logger_files import CHANNELS, write_log
from tests.made_recordings import made_recording

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.checks.limits import StatedLoad
from cylinder_friction.recordings.reading_logs import read_recordings


@pytest.mark.parametrize(
    ("text", "load"),
    [("4218", StatedLoad(4218.0)), ("4218+-40", StatedLoad(4218.0, 40.0)), ("-900 ± 5", StatedLoad(-900.0, 5.0))],
)
def test_a_load_is_a_number_of_newtons(text: str, load: StatedLoad) -> None:
    assert StatedLoad.parsed(text) == load


def test_friction_is_without_the_weight(tmp_path: Path, cylinder: Cylinder) -> None:
    made = made_recording(cylinder)
    heavy = made.with_columns(pressure_1_pa=made.column("pressure_1_pa") + 4218.0 / cylinder.piston_area_m2)
    write_log(tmp_path / "heavy.csv", heavy)
    (read,) = read_recordings(tmp_path, CHANNELS, cylinder, load=StatedLoad(4218.0, 40.0))
    assert read.metadata.load == "4218 ± 40 N, as stated"
    (found,) = label([read], cylinder, load="measured")
    off_n = (found.column("friction_n") - made.column("friction_n"))[found.usable()]
    assert np.abs(off_n).mean() < 15.0
