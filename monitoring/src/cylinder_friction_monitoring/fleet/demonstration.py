"""Simulate a fleet to try monitoring with: one cylinder per fate, its logs, and the files that name them."""

import sys
from functools import partial
from pathlib import Path
from typing import cast

import yaml

from cylinder_friction import Cylinder
from cylinder_friction.files.whole_files import read_yaml, whole_file, whole_folder, write_text
from cylinder_friction.rig.bench import DECIMALS
from cylinder_friction_monitoring.fleet.processes import cores, outcomes
from cylinder_friction_monitoring.lives import FATES, Fate, LifePlan, life

DIMENSIONS = {"bore_diameter_m": 0.063, "rod_diameter_m": 0.028, "stroke_m": 0.25, "moving_mass_kg": 6.0}
PLAN = LifePlan(sessions=70, begins=40, takes=20)
BASELINE_SESSIONS, FALSE_ALARMS_PER_YEAR = 36, 0.2
"""Settings of a short demonstration. A plant records more sessions and allows fewer false alarms."""
SIMULATED = ".simulated.txt"  # Hidden, so that no run takes it for a log
CHANNELS = {
    "defaults": ["rig", "_self_"],
    "name_pattern": None,
    "start": {"zone": "UTC", "pattern": r"(?P<year>\d{4})-(?P<month>\d\d)-(?P<day>\d\d)T(?P<hour>\d\d)"},
}


def write_demonstration(folder: Path, plan: LifePlan = PLAN, processes: int = 1) -> Path:
    """Simulate a fleet's logs into ``logs``, unless they exist, and write ``channels.yaml`` and ``fleet.yaml``."""
    jobs = [partial(write_life, folder / "logs" / fate, number, fate, plan) for number, fate in enumerate(FATES)]
    for outcome in outcomes(jobs, processes):
        if outcome is not None:
            raise outcome
    fleet = {
        "defaults": {
            "dimensions": DIMENSIONS,
            "channels": "channels.yaml",
            "baseline_sessions": BASELINE_SESSIONS,
            "false_alarms_per_year": FALSE_ALARMS_PER_YEAR,
        },
        "cylinders": {fate: {"about": (folder / "logs" / fate / SIMULATED).read_text("utf-8")} for fate in FATES},
    }
    write_text(folder / "channels.yaml", yaml.safe_dump(CHANNELS, sort_keys=False))
    write_text(folder / "fleet.yaml", yaml.safe_dump(fleet, sort_keys=False))
    return folder / "fleet.yaml"


def write_life(folder: Path, number: int, fate: str, plan: LifePlan) -> None:
    """Write the log of each session of one cylinder, named by its start, and a note on what was simulated."""
    if len(list(folder.glob("*.csv"))) == plan.sessions and (folder / SIMULATED).is_file():
        return
    begins = ""
    for day, recording in enumerate(life(Cylinder(name=fate, **DIMENSIONS), plan, number, cast("Fate", fate))):
        if day == plan.begins and fate != "healthy":
            begins = f"; from {recording.metadata.start[:10]} on"
        with whole_file(folder / f"{recording.metadata.start[:13]}.csv") as draft:
            recording.logger.to_csv(draft, index=False, float_format=f"%.{DECIMALS}f", lineterminator="\n")
    write_text(folder / SIMULATED, f"Simulated: {FATES[cast('Fate', fate)]}{begins}.")


def main() -> None:
    """Run the pipeline's stage ``fleet``: simulate the fleet that ``params.yaml`` describes into a folder."""
    plan = LifePlan(**read_yaml(Path("params.yaml"))["fleet"])
    with whole_folder(Path(sys.argv[1])) as folder:
        write_demonstration(folder, plan, cores())


if __name__ == "__main__":
    main()
