"""Labelled recordings of a campaign on the simulated rig, made in memory: no file is written, none is read.

The same functions make them that the stages ``ingest``, ``filter`` and ``label`` call, with the default settings, so
that recordings and labels are those of the pipeline; the truth stands beside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from cylinder_friction.labelling.equation_of_motion import Stiffness
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.recordings.checks.limits import CheckLimits
from cylinder_friction.recordings.checks.screening import ScreenRules, screen_signals
from cylinder_friction.recordings.conversion import Recipe, checked, metadata_of
from cylinder_friction.recordings.formats.logged_table import LoggedTable
from cylinder_friction.recordings.mapping.channel_mapping import sensor_limits
from cylinder_friction.recordings.mapping.mapped_file import map_signals
from cylinder_friction.recordings.path_names import NameRules
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.timeline.aligning import align
from cylinder_friction.rig.campaign import CampaignPlan, campaign
from cylinder_friction.rig.sensors import as_written
from cylinder_friction.signals.smooth_signals import filtered
from cylinder_friction.signals.zero_phase import SavitzkyGolay
from friction_benchmark.rig_channels import NAME_PATTERN, logger_channels

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd
    from numpy.typing import NDArray

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.recordings.signal import Piece
    from cylinder_friction.rig.campaign import RigRecording

    Array = NDArray[np.float64]

END_STOP_MARGIN_M = 0.003
FILTER = SavitzkyGolay()


@dataclass(frozen=True)
class LabelledRecording:
    """A recording as the pipeline labels it, and what the rig knows of it.

    Attributes:
        recording: With ``friction_n`` and ``usable``; ``load_force_n``, the load cell's reading, only where an external
            load works on the rod.
        true_friction_n: Shape ``(n,)``, at the recording's rows; positive when it opposes positive velocity [N].
        true_load_n: External force that resists extension, shape ``(n,)``; zero where there is none [N].
    """

    recording: Recording
    true_friction_n: Array
    true_load_n: Array


def labelled_campaign(plan: CampaignPlan, cylinder: Cylinder) -> tuple[LabelledRecording, ...]:
    """Return a campaign's labelled recordings, in the order of their names; equal plans give equal bits.

    What ingest would set aside (too short, without motion) is left out, as it would be.

    Raises:
        RecordingError: Not one recording is usable; the message is the first one's.
        ValueError: See ``rig.campaign.campaign``.
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
    return tuple(sorted(made, key=lambda entry: entry.recording.name))


def campaign_recipe(cylinder: Cylinder, *, load: bool) -> Recipe:
    """Return how the rig's log becomes recordings, by default; ``load`` tells whether there is a load cell."""
    return Recipe(
        names=NameRules(NAME_PATTERN),
        channels=logger_channels(load=load),
        cylinder=cylinder.name,
        limits=CheckLimits(
            cylinder.stroke_m, cylinder.piston_area_m2, cylinder.annulus_area_m2, "measured" if load else "none"
        ),
        screen=ScreenRules(stroke_m=cylinder.stroke_m),
    )


def _labelled(logged: RigRecording, recipe: Recipe, labeller: Labeller) -> Iterator[LabelledRecording]:
    """Yield a log's recordings: one, unless samples that cannot be bridged part it."""
    file = f"{logged.metadata.name}.csv"
    pieces = _pieces(as_written(logged.logger), recipe)
    for number, piece in enumerate(pieces, start=1):
        metadata = metadata_of(piece, recipe.names.names(file), number, len(pieces), file, "", recipe.cylinder)
        raw = checked(piece, metadata, recipe)
        rows = np.rint(raw.column("time_s") / raw.sample_time_s).astype(np.int64)
        yield LabelledRecording(
            labeller.labelled(filtered(raw, FILTER), FILTER),
            logged.truth["friction_n"].to_numpy()[rows],
            _load(logged.truth)[rows],
        )


def _pieces(table: pd.DataFrame, recipe: Recipe) -> list[Piece]:
    mapped = map_signals([LoggedTable(table)], recipe.channels)
    signals, _ = screen_signals(mapped.signals, sensor_limits(recipe.channels), recipe.screen)
    return align(signals, recipe.time)


def _load(truth: pd.DataFrame) -> Array:
    return truth["load_force_n"].to_numpy() if "load_force_n" in truth.columns else np.zeros(len(truth))
