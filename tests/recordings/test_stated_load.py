"""A constant load that somebody weighed is taken off as a load cell's would be."""

from pathlib import Path

import numpy as np
import pytest
from tests.logger_files import CHANNELS, write_log
from tests.made_recordings import made_recording

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.recordings.checks.limits import GivenLoad, Load, StatedLoad, load_of
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import RecordingError


@pytest.mark.parametrize(
    ("given", "load"),
    [
        ("4218", StatedLoad(4218.0)),
        ("4218+-40", StatedLoad(4218.0, 40.0)),
        ("-900 ± 5", StatedLoad(-900.0, 5.0)),
        (-7848, StatedLoad(-7848.0)),
        (StatedLoad(1.0), StatedLoad(1.0)),
        ("position", "position"),
    ],
)
def test_a_load_is_a_number_of_newtons_or_how_it_is_known(given: GivenLoad, load: Load) -> None:
    assert load_of(given) == load


@pytest.mark.parametrize("again", ["measured", "4218+-40"])
def test_friction_is_without_the_weight(tmp_path: Path, cylinder: Cylinder, again: str) -> None:
    made = made_recording(cylinder)
    heavy = made.with_columns(pressure_1_pa=made.column("pressure_1_pa") + 4218.0 / cylinder.piston_area_m2)
    write_log(tmp_path / "heavy.csv", heavy)
    (read,) = read_recordings(tmp_path, CHANNELS, cylinder, load="4218+-40")
    assert read.metadata.load == "4218 ± 40 N, as stated"
    (found,) = label([read], cylinder, load=again)
    off_n = (found.column("friction_n") - made.column("friction_n"))[found.usable()]
    assert np.abs(off_n).mean() < 15.0
    (later,) = label(read_recordings(tmp_path, CHANNELS, cylinder), cylinder, load="4218+-40")
    assert later.metadata.uncertainty == found.metadata.uncertainty
    assert np.array_equal(later.column("friction_n"), found.column("friction_n"))


def test_two_loads_contradict_each_other(cylinder: Cylinder) -> None:
    made = made_recording(cylinder)
    loaded = made.with_columns(load_force_n=np.full(len(made), 900.0))
    with pytest.raises(RecordingError, match="a load of 4218 N is stated, but load_force_n is another; leave one out"):
        label([loaded], cylinder, load="4218+-40")
