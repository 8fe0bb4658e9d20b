"""The command ``adapt``: make a model for another cylinder from an existing one and a few logger files."""

from __future__ import annotations

import argparse
import json
import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cylinder_friction.commands._model import model_folder
from cylinder_friction.commands.log_options import run_on_logs
from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.files.result_folder import ResultFolder, existing
from cylinder_friction.files.whole_files import write_json
from cylinder_friction.labelling.apparent_loss import loss_of_labels
from cylinder_friction.labelling.known_offset import training_models, without_offsets
from cylinder_friction.labelling.label import label, position_load
from cylinder_friction.labelling.sliding_blocks import LOADED, OffsetPlan
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.recordings.checks.limits import StatedLoad, load_of
from cylinder_friction.recordings.columns import LOAD_FORCE
from cylinder_friction.recordings.line_loss import RECTANGULAR
from cylinder_friction.recordings.reading_logs import read_recordings
from cylinder_friction.recordings.recording import Recording, RecordingError
from cylinder_friction.wording import counted

EXPECTED = (ValueError, OSError)
SUMMARY_FILE = "adaptation.json"


def run(options: argparse.Namespace) -> None:
    with tempfile.TemporaryDirectory() as scratch:
        model, name = model_folder(options.model, Path(scratch))
        result, notes = run_on_logs(partial(_adapt_to_logs, model, name), options)
    if options.json:
        print(json.dumps(result | {"notes": notes}, indent=2))
        return
    lines = [f"source   {name}", f"for      {result['trained_for']}", f"bounds   {result['bounds']}"]
    lines += [f"{name:<8} {result[name]}" for name in ("gain", "offset", "loss", "readings") if result[name]]
    print("\n".join([*(f"note     {note}" for note in notes), *lines, f"model    {options.output}"]))


def _adapt_to_logs(
    model: Path, name: str, files: list[str], cylinder: Cylinder, into: Path, *, channels: Path | None, **reading: Any
) -> dict[str, Any]:
    """Adapt a saved hybrid to a cylinder by logs that are read as ``estimate`` reads them, and write the new model.

    A load that position decides is identified and becomes part of the model.
    """
    read = existing([*files, channels, model])
    with ResultFolder(into, SUMMARY_FILE, "cylinder-friction adapt", read).written() as folder:
        source = load_estimator(model)
        if not isinstance(source, HybridEstimator):
            raise ValueError(f"{name}: is of the kind {source.kind!r}, expected a hybrid; no other can be adapted")
        recordings = read_recordings(files, channels, cylinder, **reading)
        measured = "measured" if LOAD_FORCE in recordings[0].columns else "none"
        mode, load, beside = load_of(reading["load"] or measured), None, ""
        if isinstance(mode, StatedLoad):  # part of the model, as no sensor measures it
            load = PositionLoad(
                0.0, cylinder.stroke_m, np.full(2, mode.force_n), np.full(2, RECTANGULAR * mode.within_n)
            )
            recordings = [each.without_columns(LOAD_FORCE) for each in recordings]
            beside = f"; an error of the load ({mode.in_words()}) comes on top" if mode.within_n else ""
        labelled = label(recordings, cylinder, load=load or mode)
        labelled, offset = _without_offsets(labelled, cylinder, LOADED["position"] if mode == "position" else "")
        load = position_load(recordings, cylinder) if mode == "position" else load
        adapted = source.adapt(labelled, cylinder, load)
        adapted.save(folder)
        loss = loss_of_labels(labelled, cylinder)
        assert adapted.trained_for is not None
        assert adapted.bounds is not None
        applied = adapted.step_model().applied()
        result = {
            "source": name,
            "trained_for": adapted.trained_for.in_words(),
            "bounds": adapted.bounds.in_words() + beside,
            "offset": f"of the sensors' zeros: {offset}; the model learns "
            + ("none" if adapted.offset is None else "that of a new session while it runs"),
            "loss": "" if loss is None else loss.sentence(cylinder),
            "gain": _gain_in_words(adapted),
            "readings": applied and f"in real time and in exports are the sensors' own: the step makes {applied}",
            "recordings": [each.name for each in labelled],
        }
        write_json(folder / SUMMARY_FILE, result)
    return result


def _gain_in_words(adapted: FrictionEstimator) -> str:
    """State what the adapted model gains over a tuned low-pass; empty if there is nothing to correct."""
    if not isinstance(adapted, HybridEstimator):
        return "none: a tuned low-pass is as good on sessions held out of training, and is the model that is written"
    return "" if adapted.gain is None else adapted.gain.in_words()


def _without_offsets(labelled: list[Recording], cylinder: Cylinder, why_not: str) -> tuple[list[Recording], str]:
    """Take the offset of each session off its labels, as the stage ``offset`` does, and say so in words.

    ``why_not`` states why offsets are not to be identified; empty if they are.
    """
    try:
        models, why_not = ({}, why_not) if why_not else training_models(labelled, cylinder, OffsetPlan())
    except RecordingError as error:
        models, why_not = {}, str(error)
    if why_not:
        return labelled, f"not identified: {why_not}"
    corrected = without_offsets(labelled, models)
    known = {each.metadata.session: bool(each.metadata.identified_zero) for each in corrected}
    sessions = counted(len(known), "session")
    return corrected, f"identified from strokes in {sum(known.values())} of {sessions} and subtracted from their labels"
