"""Four public measurements through the project's own door: ingest, filter, force balance and identification."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import InertiaMode, Labeller
from cylinder_friction.labelling.load import LoadPlan
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.logs import NameRules, Recipe
from cylinder_friction.recordings.mapping.channel_mapping import ChannelMapping
from cylinder_friction.recordings.reading_logs import ingest_folder
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.recordings.timeline.timestamps import TimeRules
from cylinder_friction.signals.smooth_signals import smooth_columns
from cylinder_friction.signals.zero_phase import SavitzkyGolay

if TYPE_CHECKING:
    from cylinder_friction.labelling.session import SessionIdentification
    from cylinder_friction.recordings.checks.limits import LoadMode

MAPPINGS: dict[str, dict[str, dict[str, Any]]] = {
    "emps": {
        "time_s": {"channel": "t", "unit": "s"},
        "position_m": {"channel": "qm", "unit": "m", "offset": -0.005},
        # The file's own drive gain, 35.15065188 N/V, over the amplifier's 10 V.
        "drive_force_n": {
            "channel": "vir",
            "unit": "V",
            "sensor": {"range": [-351.5065188, 351.5065188], "unit": "N", "signal": [-10.0, 10.0]},
        },
    },
    "crane": {
        "time_s": {"channel": "t_s", "unit": "s"},
        "pressure_1_pa": {"channel": "jib_pA_cyl_bar", "unit": "bar"},
        "pressure_2_pa": {"channel": "jib_pB_cyl_bar", "unit": "bar"},
        "position_m": {"channel": "jib_x_m", "unit": "m"},
    },
    "pneumatic-seals": {
        "time_s": {"channel": "column_1", "unit": "ms"},
        "position_m": {"channel": "column_5", "unit": "mm", "offset": -5.0},
        "drive_force_n": {"channel": "column_7", "unit": "N"},
    },
    "tribometer": {
        "time_s": {"channel": "Time [s]", "unit": "s"},
        "position_m": {"channel": "Position [mm]", "unit": "mm", "offset": -110.1},
        # Friction is logged as what the sample feels; the drive feels its opposite.
        "drive_force_n": {"channel": "Friction [uN]", "unit": "uN", "sign": -1},
    },
}

CYLINDERS = {
    "emps": Cylinder(name="EMPS", bore_diameter_m=0.02, rod_diameter_m=0.01, stroke_m=0.26, moving_mass_kg=1.0),
    "crane": Cylinder(
        name="HMF 2020-K jib", bore_diameter_m=0.150, rod_diameter_m=0.100, stroke_m=0.85, moving_mass_kg=100.0
    ),
    "pneumatic-seals": Cylinder(
        name="printed piston 25 mm", bore_diameter_m=0.025, rod_diameter_m=0.010, stroke_m=0.05, moving_mass_kg=0.1
    ),
    "tribometer": Cylinder(
        name="tribometer", bore_diameter_m=0.02, rod_diameter_m=0.01, stroke_m=0.001, moving_mass_kg=0.1
    ),
}
"""Bore and rod matter to the crane alone: the others measure force. The masses are of no account, but for EMPS's,
which is identified."""

FILTERS = {
    "emps": SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2),
    "crane": SavitzkyGolay(),
    "pneumatic-seals": SavitzkyGolay(),
    "tribometer": SavitzkyGolay(0.02, 2, 0.02, 2, 0.02, 2),
}
"""At 1 kHz and half a micrometre of resolution 20 ms are enough, alike for force, velocity and acceleration."""

LOADS: dict[str, LoadMode] = {"emps": "none", "crane": "position", "pneumatic-seals": "position", "tribometer": "none"}


def recipe_of(rig: str) -> Recipe:
    """Return how a rig's files become recordings: its mapping, and otherwise what is usual."""
    return Recipe(
        names=NameRules(r"(?P<session>(?P<condition>[^_/]+)_[^./]+)\."),
        channels={column: ChannelMapping.from_dict(entry) for column, entry in MAPPINGS[rig].items()},
        limits=CheckLimits(CYLINDERS[rig], LOADS[rig]),
        time=TimeRules(),
    )


def recordings_of(path: Path, rig: str) -> list[Recording]:
    """Return a file's recordings, one session, as ingest writes them.

    Raises:
        RecordingError: Ingest made nothing of the file.
    """
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "recordings"
        ingested = ingest_folder(path.parent, path.name, recipe_of(rig), folder, Path(place) / "out.json")
        if not ingested.recordings:
            raise RecordingError(f"{path.name}: {ingested.quarantined}")
        return read_stored(folder)


def labelled(
    recordings: list[Recording],
    rig: str,
    load: LoadMode = "none",
    inertia: InertiaMode = "given",
    plan: LoadPlan | None = None,
) -> tuple[list[Recording], SessionIdentification]:
    """Return one session's recordings with labels, and the load and mass identified from them."""
    cylinder, chosen = CYLINDERS[rig], FILTERS[rig]
    labeller = Labeller(cylinder, end_stop_margin_m=0.0, load=load, inertia=inertia, load_plan=plan or LoadPlan())
    filtered = [recording.with_columns(**smooth_columns(recording, chosen)) for recording in recordings]
    identified = labeller.identify(filtered, chosen)
    return [labeller.label(recording, chosen, identified) for recording in filtered], identified
