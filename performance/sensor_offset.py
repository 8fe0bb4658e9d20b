"""How well the offset of each session's pressure sensors is identified, against the true friction of the simulated rig.

    python performance/sensor_offset.py [--data FOLDER]
    python performance/sensor_offset.py --asymmetry-sd 0.01

Reads the labelled recordings, the split and the truth of a finished run; its ``data`` folder is the default. With
``--asymmetry-sd`` it records a campaign whose friction, retracting over extending, varies so much from session to
session. Prints the offset of the label before and after, less the mean of the fitted sessions, for all sessions fitted
together, for the held-out ones given the training sessions, and after the first seconds of each held-out session.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.labelling.label import label
from cylinder_friction.labelling.offset_identification import OffsetModel, SessionOffset, fit_offset_model
from cylinder_friction.labelling.sliding_blocks import OffsetPlan
from cylinder_friction.recordings.recording import Recording, SensorUncertainty
from cylinder_friction.recordings.splits import ROLES, split_sessions
from cylinder_friction.recordings.storage import read_metadata, read_stored, recording_paths
from cylinder_friction.recordings.truth import read_truth
from cylinder_friction.rig.campaign import CampaignPlan, campaign
from cylinder_friction.rig.sensors import DECIMALS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from cylinder_friction.arrays import Array

CYLINDER = Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
PRESSURE = SensorUncertainty(zero=3000.0, span=0.0029, resolution=6103.5)
FIRST_S = (5.0, 10.0, 30.0, 60.0)
SESSIONS = 8


def main() -> None:
    """Print how far each way of identifying is from the truth."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, default=Path("data"), help="data folder of a finished run")
    parser.add_argument("--asymmetry-sd", type=float, help="record a campaign whose asymmetry varies so much")
    arguments = parser.parse_args()
    if arguments.asymmetry_sd is None:
        recordings, truth_n, roles = finished_run(arguments.data)
    else:
        recordings, truth_n, roles = uneven_campaign(arguments.asymmetry_sd)
    sessions: dict[str, list[Recording]] = {}
    for recording in recordings:
        sessions.setdefault(recording.metadata.session, []).append(recording)
    true_n = {name: session_offset(each, truth_n) for name, each in sessions.items()}
    print(f"{len(sessions)} sessions, mean offset of the label {np.mean(list(true_n.values())):.2f} N")
    titles = "".join(f"{title:>8}" for title in ("before", "after", "corr.", "stated", "in 1 sd", "in 2 sd"))
    print(f"{'asymmetry_sd':46}{titles}")
    for deviation in sorted({OffsetPlan().asymmetry_sd, 0.01, 0.02}):
        score(sessions, roles, true_n, OffsetPlan(asymmetry_sd=deviation))


def score(
    sessions: Mapping[str, list[Recording]],
    roles: Mapping[str, set[str]],
    true_n: Mapping[str, float],
    plan: OffsetPlan,
) -> None:
    """Print one line for the sessions together, and lines for the held-out ones given those for training."""
    joint = fit_offset_model([each for own in sessions.values() for each in own], CYLINDER, plan)
    line(f"{plan.asymmetry_sd:<12g} all sessions together", joint, list(joint.sessions.values()), true_n)
    model = fit_offset_model([each for name in sorted(roles["train"]) for each in sessions[name]], CYLINDER, plan)
    held_out = sorted(set().union(*(roles[role] for role in roles if role != "train")))
    line(f"{'':12} held-out, all of the session", model, [model.identify(sessions[name]) for name in held_out], true_n)
    for first_s in FIRST_S:
        found = [model.identify([beginning(sessions[name][0], first_s)]) for name in held_out]
        line(f"{'':12} held-out, first {first_s:g} s", model, found, true_n)


def line(title: str, model: OffsetModel, found: Sequence[SessionOffset], true_n: Mapping[str, float]) -> None:
    """Print one line: offsets before and after, less the mean of the fitted sessions, and how what is stated holds."""
    fitted = model.sessions
    mean_n, true_mean_n = (float(np.mean([of[name] for name in fitted])) for of in (offsets(fitted), true_n))
    truth = np.array([true_n[each.session] for each in found]) - true_mean_n
    offset = np.array([each.offset_n for each in found]) - mean_n
    stated = np.array([each.relative_uncertainty_n for each in found])
    shares = [100.0 * np.mean(np.abs(offset - truth) <= multiple * stated) for multiple in (1.0, 2.0)]
    correlation = np.corrcoef(offset, truth)[0, 1]
    newtons = f"{rms(truth):6.2f} N{rms(offset - truth):6.2f} N{correlation:8.3f}{rms(stated):6.2f} N"
    print(f"{title:46}{newtons}{shares[0]:6.0f} %{shares[1]:6.0f} %", flush=True)


def offsets(sessions: Mapping[str, SessionOffset]) -> dict[str, float]:
    """Return the offset of each session [N]."""
    return {name: each.offset_n for name, each in sessions.items()}


def rms(values: Array) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def beginning(recording: Recording, first_s: float) -> Recording:
    """Return the first seconds of a recording."""
    return replace(recording, table=recording.table[: round(first_s / recording.sample_time_s)])


def session_offset(recordings: Sequence[Recording], truth_n: Mapping[str, Array]) -> float:
    """Return the mean of label less truth over the usable rows of a session [N]."""
    errors = [(each.column("friction_n") - truth_n[each.name])[each.usable()] for each in recordings]
    return float(np.concatenate(errors).mean())


def finished_run(data: Path) -> tuple[list[Recording], dict[str, Array], dict[str, set[str]]]:
    """Return labelled recordings, true friction of each, and the sessions of each role."""
    recordings = read_stored(data / "processed/labelled")
    truth_n = {}
    for recording in recordings:
        truth = read_truth(data / "raw/rig_truth", recording)
        if truth is None:
            raise SystemExit(f"{data}: true friction of {recording.name} is not there; give a run of the simulated rig")
        truth_n[recording.name] = truth["friction_n"].to_numpy(dtype=np.float64)
    paths = {role: recording_paths(data / "processed" / role) for role in ROLES}
    return recordings, truth_n, {role: {read_metadata(path).session for path in own} for role, own in paths.items()}


def uneven_campaign(ratio_sd: float) -> tuple[list[Recording], dict[str, Array], dict[str, set[str]]]:
    """Return the same of a campaign whose ratio of friction, retracting over extending, varies with the session."""

    plan = CampaignPlan(sessions_per_condition=SESSIONS, asymmetry_sd=ratio_sd)
    recorded = list(campaign(CYLINDER, plan))
    labelled = label([logged(each.logger, each.metadata) for each in recorded], CYLINDER)
    truth_n = {each.metadata.name: each.truth["friction_n"].to_numpy(dtype=np.float64) for each in recorded}
    names = split_sessions([each.metadata for each in labelled], 2, 1, seed=1)
    of = {each.name: each.metadata.session for each in labelled}
    return labelled, truth_n, {role: {of[name] for name in own} for role, own in names.items()}


def logged(table: pd.DataFrame, metadata: Any) -> Recording:
    """Return a recording in SI units, with the uncertainty that ``conf/ingest/rig.yaml`` states."""
    time_s, pressure_1, pressure_2, position, warm = (table.iloc[:, place].round(DECIMALS) for place in range(5))
    columns = {"time_s": time_s, "pressure_1_pa": 1e5 * pressure_1, "pressure_2_pa": 1e5 * pressure_2}
    columns |= {"position_m": 1e-3 * position, "oil_temperature_c": warm}
    stated = {"pressure_1_pa": PRESSURE, "pressure_2_pa": PRESSURE}
    return Recording(replace(metadata, uncertainty=stated), table.iloc[:, :0].assign(**columns))


if __name__ == "__main__":
    main()
