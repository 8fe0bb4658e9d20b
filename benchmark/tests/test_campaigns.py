"""Recordings made in memory are the pipeline's: the same rows, labels and masks as its stages write; and the twin."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.commands.params import compose_params
from cylinder_friction.evaluation.truth import read_truth
from cylinder_friction.params.checking import Params, check_params
from cylinder_friction.recordings.recording import RecordingError
from cylinder_friction.recordings.storage import read_stored
from cylinder_friction.rig.campaign_plan import CampaignPlan
from cylinder_friction.stages import filter as filter_stage
from cylinder_friction.stages import ingest, label, record
from cylinder_friction.stages._stage import LABELLED_FOLDER, RIG_TRUTH_FOLDER
from friction_benchmark.campaigns import campaign_recipe, labelled_campaign, twin_campaign

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.recordings.recording import Recording
    from friction_benchmark.cases import LabelledRecording

CONF = Path(__file__).parents[2] / "conf"
LOADED = ("record=loaded", "ingest=rig_loaded")


def smoke(*overrides: str) -> Params:
    small = ("experiment=smoke", "record.duration_s=6.0", "record.seed=11")
    return check_params(compose_params(CONF, [*small, *overrides]), "test")


def through_the_stages(params: Params) -> list[Recording]:
    for stage in (record, ingest, filter_stage, label):
        stage.run(params)
    made = read_stored(LABELLED_FOLDER)
    return sorted(made, key=lambda recording: recording.name)


@pytest.mark.parametrize("overrides", [(), LOADED, ("record=wide",)], ids=["default", "loaded", "wide"])
def test_recordings_and_labels_are_those_of_the_stages(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cylinder: Cylinder, overrides: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    params = smoke(*overrides)
    written = through_the_stages(params)
    made = labelled_campaign(params.record, cylinder)
    assert len(written) == 12
    assert [entry.recording.name for entry in made] == [recording.name for recording in written]
    for entry, recording in zip(made, written, strict=True):
        pd.testing.assert_frame_equal(entry.recording.table, recording.table, check_exact=True)
        assert entry.recording.metadata == replace(recording.metadata, source_sha256="")
        truth = read_truth(RIG_TRUTH_FOLDER, recording)
        assert truth is not None
        assert np.array_equal(entry.true_friction_n, truth["friction_n"])
        load_n = truth["load_force_n"] if overrides == LOADED else np.zeros(len(truth))
        assert np.array_equal(entry.true_load_n, load_n)
        assert ("load_force_n" in recording.columns) == (overrides == LOADED)
        assert "oil_temperature_c" in recording.columns


@pytest.mark.parametrize("load", [False, True])
def test_the_recipe_is_the_shipped_configuration(cylinder: Cylinder, load: bool) -> None:
    params = smoke(*(LOADED if load else ()))
    assert campaign_recipe(cylinder, load=load) == ingest.recipe_from(params)


def test_equal_plans_give_equal_bits_and_another_seed_does_not(cylinder: Cylinder) -> None:
    plan = CampaignPlan(
        seed=2, sessions_per_condition=1, recordings_per_session=1, duration_s=6.0, external_load="varied"
    )
    one, two = labelled_campaign(plan, cylinder), labelled_campaign(plan, cylinder)
    for first, second in zip(one, two, strict=True):
        pd.testing.assert_frame_equal(first.recording.table, second.recording.table, check_exact=True)
        assert np.array_equal(first.true_friction_n, second.true_friction_n)
    other = labelled_campaign(replace(plan, seed=3), cylinder)
    assert not np.array_equal(other[0].true_friction_n, one[0].true_friction_n)


def test_the_label_takes_the_measured_load_off(cylinder: Cylinder) -> None:
    plan = CampaignPlan(
        seed=4, sessions_per_condition=1, recordings_per_session=1, duration_s=20.0, external_load="varied"
    )
    for entry in labelled_campaign(plan, cylinder):
        usable = entry.recording.usable()
        error_n = np.abs(entry.recording.column("friction_n") - entry.true_friction_n)[usable].mean()
        assert error_n < 0.08 * np.abs(entry.true_friction_n[usable]).mean()
        assert np.abs(entry.true_load_n[usable]).mean() > 2.0 * error_n


def test_what_ingest_would_set_aside_is_left_out(cylinder: Cylinder) -> None:
    plan: dict[str, Any] = asdict(CampaignPlan(sessions_per_condition=1, recordings_per_session=1, duration_s=2.0))
    with pytest.raises(RecordingError, match=r"lasts 2 s \(400 rows\), expected at least 5 s"):
        labelled_campaign(CampaignPlan(**plan), cylinder)


@pytest.fixture(scope="module")
def twin(cylinder: Cylinder) -> tuple[LabelledRecording, ...]:
    return twin_campaign(3, 2, 10.0, cylinder)


def test_the_target_of_the_twin_is_true_friction(twin: tuple[LabelledRecording, ...]) -> None:
    for labelled in twin:
        np.testing.assert_array_equal(labelled.recording.column("friction_n"), labelled.true_friction_n)
        assert labelled.recording.usable().any()


def test_every_rig_has_its_own_names_and_sessions(twin: tuple[LabelledRecording, ...]) -> None:
    names = [labelled.recording.name for labelled in twin]
    assert names == sorted(set(names))
    assert len(names) == 2 * 4 * 2
    assert {labelled.recording.metadata.session.split("_")[0] for labelled in twin} == {"rig000", "rig001"}


def test_rigs_differ(twin: tuple[LabelledRecording, ...]) -> None:
    first, second = (
        np.mean([np.abs(one.true_friction_n).mean() for one in twin if one.recording.name.startswith(rig)])
        for rig in ("rig000", "rig001")
    )
    assert abs(first - second) > 20.0


def test_fewer_rigs_are_the_first_of_more_and_the_same_bits(
    twin: tuple[LabelledRecording, ...], cylinder: Cylinder
) -> None:
    again = twin_campaign(3, 1, 10.0, cylinder)
    for one, other in zip(again, twin, strict=False):
        assert one.recording.name == other.recording.name
        np.testing.assert_array_equal(one.recording.samples(), other.recording.samples())


@pytest.mark.parametrize("rigs", [0, 1001])
def test_a_twin_out_of_range_is_refused(rigs: int, cylinder: Cylinder) -> None:
    with pytest.raises(ValueError, match=f"rigs must be 1 to 1000, but got {rigs}"):
        twin_campaign(0, rigs, 10.0, cylinder)
