"""Labelled recordings of campaigns on the simulated rig, made in memory by the pipeline's own functions and defaults.

So recordings and labels are those of the stages ``ingest``, ``filter`` and ``label``; the truth stands beside them.
The simulated twin is a campaign on many rigs drawn at random whose *target* is true friction. Friction, hydraulics and
sensors of each come from their whole ranges, so that what is learnt holds for an unknown rig.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import yaml

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.files.whole_files import whole_folder
from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.checks.recording_checks import checked_recording
from cylinder_friction.recordings.conversion import metadata_of, pieces_from
from cylinder_friction.recordings.formats.format import LoggedTable
from cylinder_friction.recordings.logs import NameRules, Recipe
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import write_recording
from cylinder_friction.rig.campaign import RigRecording, campaign
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.rig.sensors import as_written
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.signals.zero_phase import default_filter
from friction_benchmark.cases import LabelledRecording
from friction_benchmark.datasets import TRUE_FRICTION, TRUE_LOAD, Kind, Sizes, Sources

INGEST = Path(__file__).parents[3] / "conf" / "ingest"
"""The product's mappings of the rig's files, one with and one without its load cell."""
END_STOP_MARGIN_M = 0.003
UNSEEN_SEEDS = 1000  # Seeds of unseen rigs begin here, so that none of them is a rig that models are trained on
TWIN_SEEDS = 1_000_000  # Seeds of the twin's rigs begin here, so that no rig that is estimated is one of the twin's
MOST_RIGS = 1_000

LoadKind = Literal["none", "varied"]


def simulate(sources: Sources, kind: Kind, seed: int) -> None:
    """Simulate one campaign, or the twin's, and store it, unless it is there already."""
    folder = sources.campaign_folder(kind, seed)
    if folder.is_dir():
        return
    sizes, cylinder = sources.sizes, sources.cylinder
    load: LoadKind = "varied" if kind.endswith("loaded") else "none"
    if kind.startswith("twin"):
        made = twin_campaign(seed, sizes.twin_rigs, sizes.duration_s, cylinder, load)
    else:
        made = labelled_campaign(campaign_plan(sizes, kind, seed), cylinder)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with whole_folder(folder) as draft:
        for labelled in made:
            truth = {TRUE_FRICTION: labelled.true_friction_n, TRUE_LOAD: labelled.true_load_n}
            known = {name: values for name, values in truth.items() if values is not None}
            write_recording(draft, labelled.recording.with_columns(**known))


def campaign_plan(sizes: Sizes, kind: Kind, seed: int) -> CampaignPlan:
    """Return what is simulated; an unseen rig is any rig of this size, another one for every seed."""
    unseen = kind.startswith("unseen")
    return CampaignPlan(
        seed=UNSEEN_SEEDS + seed if unseen else seed,
        sessions_per_condition=sizes.unseen_sessions if unseen else sizes.sessions_per_condition,
        recordings_per_session=sizes.recordings_per_session,
        duration_s=sizes.duration_s,
        external_load="varied" if kind.endswith("loaded") else "none",
        specimen="wide" if unseen else "default",
    )


def labelled_campaign(plan: CampaignPlan, cylinder: Cylinder) -> tuple[LabelledRecording, ...]:
    """Return a campaign's labelled recordings, in the order of their names; equal plans give equal bits.

    What ingest would set aside (too short, without motion) is left out, as it would be; it is refused only if no
    recording is left.
    """
    with_load = plan.external_load != "none"
    recipe = campaign_recipe(cylinder, load=with_load)
    labeller = Labeller(cylinder, Stiffness(), END_STOP_MARGIN_M, "measured" if with_load else "none")
    made: list[LabelledRecording] = []
    refused: list[RecordingError] = []
    for recording in campaign(cylinder, plan):
        try:
            made += _labelled(recording, recipe, labeller)
        except RecordingError as error:
            refused.append(error)
    if refused and not made:
        raise refused[0]
    return tuple(sorted(made, key=lambda labelled: labelled.recording.name))


def twin_campaign(
    seed: int,
    rigs: int,
    duration_s: float,
    cylinder: Cylinder,
    external_load: LoadKind = "none",
    sample_time_s: float = CampaignPlan.sample_time_s,
) -> tuple[LabelledRecording, ...]:
    """Return the twin's recordings, in the order of their names; ``friction_n`` is true friction, not the label.

    Each rig has one session in each of the four conditions, two recordings per session. Which rows are usable is taken
    from the label: against an end stop, pressures show nothing. Equal arguments give equal bits, other seeds draw other
    rigs, and more rigs begin with those of fewer. There are at most ``MOST_RIGS``.
    """
    if not 1 <= rigs <= MOST_RIGS:
        raise ValueError(f"rigs must be 1 to {MOST_RIGS}, but got {rigs!r}")
    made: list[LabelledRecording] = []
    for rig in range(rigs):
        plan = CampaignPlan(
            seed=TWIN_SEEDS + MOST_RIGS * seed + rig,
            sessions_per_condition=1,
            recordings_per_session=2,
            duration_s=duration_s,
            sample_time_s=sample_time_s,
            external_load=external_load,
            specimen="wide",
        )
        for labelled in labelled_campaign(plan, cylinder):
            old, truth_n = labelled.recording.metadata, labelled.true_friction_n
            assert truth_n is not None
            named = replace(old, name=f"rig{rig:03d}_{old.name}", session=f"rig{rig:03d}_{old.session}")
            target = replace(labelled.recording, metadata=named).with_columns(friction_n=truth_n)
            made.append(replace(labelled, recording=target))
    return tuple(made)


def campaign_recipe(cylinder: Cylinder, *, load: bool) -> Recipe:
    """Return how the rig's log becomes recordings, by default; ``load``: whether there is a load cell."""
    rig, loaded = (yaml.safe_load((INGEST / f"{each}.yaml").read_text("utf-8")) for each in ("rig", "rig_loaded"))
    settings = {"channels": rig["channels"] | (loaded["channels"] if load else {})}
    return Recipe.from_settings(settings, NameRules(rig["name_pattern"]), cylinder, "measured" if load else "none")


def _labelled(logged: RigRecording, recipe: Recipe, labeller: Labeller) -> Iterator[LabelledRecording]:
    """Yield a log's recordings: one, unless samples that cannot be bridged part it."""
    file = f"{logged.metadata.name}.csv"
    about = metadata_of(recipe.names.names(file), file, "", recipe)
    truth, signal_filter = logged.truth, default_filter(labeller.cylinder)
    for piece in pieces_from([LoggedTable(as_written(logged.logger))], recipe, about):
        raw = checked_recording(piece, recipe.limits)
        rows = np.rint(raw.column("time_s") / raw.sample_time_s).astype(np.int64)
        load_n = truth["load_force_n"].to_numpy() if "load_force_n" in truth.columns else np.zeros(len(truth))
        yield LabelledRecording(
            labeller.labelled(filtered(raw, signal_filter), signal_filter),
            truth["friction_n"].to_numpy()[rows],
            load_n[rows],
        )
