"""The registry: a candidate once, the champion only through the gate, the same end whenever a kill comes."""

import getpass
import math
import shutil
from dataclasses import replace
from pathlib import Path
from threading import Event, Thread

import pytest
from mlflow import MlflowClient

from candidates import NAME, candidate_in, champion, measured, other_model, versions
from cylinder_friction.files.whole_files import read_json, write_json
from cylinder_friction.tracking import registry
from cylinder_friction.tracking.gate import Candidate
from cylinder_friction.tracking.registry import ensure_version, move_champion, register
from cylinder_friction.tracking.repository import TrackingError
from cylinder_friction.tracking.store import open_store, tracking_uri


def test_the_first_candidate_is_promoted_and_tagged_with_the_way_back(pipeline: Path) -> None:
    candidate = candidate_in(pipeline)
    registered = register(candidate, pipeline, measured)
    assert registered.promote
    (version,) = versions(pipeline)
    assert champion(pipeline) == str(version.version)
    tags = version.tags
    assert list(tags)[:5] == ["decision", "error_percent", "recipe", "commit", "reason"], "what people read comes first"
    assert (tags["decision"], tags["error_percent"], tags["recipe"]) == ("promoted", "2.000 against label", "default")
    assert len(tags["commit"]) == 40
    assert tags["hash_model"] == candidate.model_md5
    assert tags["promoted"].startswith(f"from none by {getpass.getuser()} at 20")
    assert len(tags) == 10, "a page that one reads"
    run = MlflowClient(tracking_uri(pipeline)).get_run(version.run_id or "")
    assert run.info.run_name == "default", "the pipeline's, which has the errors that the gate went by"
    assert run.data.metrics["label_error_percent/mean"] == 2.0
    assert f"models:/{run.outputs.model_outputs[0].model_id}" == version.source
    assert register(candidate_in(pipeline), pipeline, measured) == registered
    assert len(versions(pipeline)) == 1, "it is registered once and decided once"


def test_a_refused_candidate_is_a_version_that_says_why_and_a_better_one_takes_the_place(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, measured)
    other_model(pipeline)
    refused = register(candidate_in(pipeline, {"1": 1.0, "2": 2.5}), pipeline, measured)
    assert not refused.promote
    first, second = versions(pipeline)
    assert champion(pipeline) == str(first.version)
    assert second.tags["decision"] == "refused"
    assert "worse in condition 2: 2.500 % against 2.000 %" in second.tags["reason"]
    assert (second.description or "").startswith("**Refused: worse in condition 2: 2.500 % against 2.000 %")
    assert "promoted" not in second.tags
    other_model(pipeline)
    better = register(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), pipeline, measured)
    assert better.incumbent == {"1": 2.0, "2": 2.0}, "measured, not read from the registry"
    assert champion(pipeline) == "3"
    assert versions(pipeline)[2].tags["promoted"].split(" by ")[0] == "from version 1"


@pytest.mark.parametrize("incumbent", [False, True])
def test_a_candidate_without_a_figure_is_refused_and_its_file_is_written(pipeline: Path, incumbent: bool) -> None:
    if incumbent:
        register(candidate_in(pipeline), pipeline, measured)
        other_model(pipeline)
    refused = register(candidate_in(pipeline, {"1": 1.0, "2": math.nan}), pipeline, measured)
    assert not refused.promote
    assert refused.reason.startswith("refused: the candidate's error in condition 2 is nan")
    write_json(pipeline / "registered.json", refused.to_dict())
    again = Candidate.from_dict(read_json(pipeline / "registered.json"))
    assert again.to_dict() == refused.to_dict()
    assert math.isnan(again.errors_percent["2"])


def test_a_rollback_is_recorded_and_lasts_until_a_better_candidate(pipeline: Path) -> None:
    register(candidate_in(pipeline), pipeline, measured)
    other_model(pipeline)
    second = candidate_in(pipeline, {"1": 1.0, "2": 1.0})
    register(second, pipeline, measured)
    assert move_champion(pipeline, NAME) == "friction-estimator: champion was version 2, is version 1"
    withdrawn = versions(pipeline)[1].tags["rolled_back"]
    assert withdrawn.startswith(f"to version 1 by {getpass.getuser()} at 20")
    assert register(second, pipeline, measured).reason == registry.REFUSED_ROLLED_BACK
    assert champion(pipeline) == "1", "it is decided already"
    again = register(replace(second, tolerance_percent=0.2), pipeline, measured)
    assert (again.promote, champion(pipeline)) == (False, "1")
    assert "was rolled back; `cylinder-friction promote` promotes it" in again.reason
    other_model(pipeline)
    assert not register(candidate_in(pipeline, {"1": 3.0, "2": 3.0}), pipeline, measured).promote
    assert champion(pipeline) == "1"
    other_model(pipeline)
    assert register(candidate_in(pipeline, {"1": 1.5, "2": 1.5}), pipeline, measured).promote
    assert champion(pipeline) == "4"
    assert move_champion(pipeline, NAME).endswith("champion was version 4, is version 1")


def test_a_rollback_goes_to_any_version_and_back_and_to_nothing_else(pipeline: Path) -> None:
    for errors in (3.0, 2.0, 1.0):
        register(candidate_in(pipeline, {"1": errors, "2": errors}), pipeline, measured)
        other_model(pipeline)
    move_champion(pipeline, NAME)
    assert move_champion(pipeline, NAME).endswith("is version 1")
    versions_of = "name one of its versions, `cylinder-friction promote VERSION`: 1, 2, 3"
    for name, to, message in (
        (NAME, None, f"no previous champion is known; {versions_of}"),
        (NAME, 7, f"friction-estimator: there is no version 7; {versions_of}"),
        ("other", None, "other: the registry at .* has no version of it; run `dvc repro` or, if it has "),
    ):
        with pytest.raises(TrackingError, match=message):
            move_champion(pipeline, name, to)
    assert move_champion(pipeline, NAME, 3).endswith("champion was version 1, is version 3")
    assert move_champion(pipeline, NAME, 3) == "friction-estimator version 3 is the champion already"
    assert "rolled_back" not in versions(pipeline)[2].tags
    assert move_champion(pipeline, NAME).endswith("champion was version 3, is version 1")


@pytest.mark.parametrize("to", [None, 1])
def test_a_version_whose_files_are_gone_does_not_become_champion(pipeline: Path, to: int | None) -> None:
    register(candidate_in(pipeline), pipeline, measured)
    other_model(pipeline)
    register(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), pipeline, measured)
    shutil.rmtree(pipeline / "mlartifacts" / "models" / str(versions(pipeline)[0].source).removeprefix("models:/"))
    with pytest.raises(TrackingError, match=r"version 1: its files are not at file:.*; restore them from a backup"):
        move_champion(pipeline, NAME, to)
    assert (champion(pipeline), "rolled_back" in versions(pipeline)[1].tags) == ("2", False)


def test_a_version_waits_for_an_earlier_one_and_then_goes_by_its_outcome(
    pipeline: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    register(candidate_in(pipeline, {"1": 9.0, "2": 9.0}), pipeline, measured)
    other_model(pipeline)
    slower = tmp_path / "slower"
    shutil.copytree(pipeline, slower)
    better = candidate_in(pipeline, {"1": 1.0, "2": 1.0})
    monkeypatch.setenv("MLFLOW_TRACKING_URI", tracking_uri(pipeline))
    other_model(slower)
    worse = candidate_in(slower, {"1": 2.0, "2": 2.0})
    reached, waiting = Event(), Event()
    results: list[Candidate] = []
    warnings: list[str] = []
    monkeypatch.setattr(registry._log, "warning", lambda text, *values: (warnings.append(text % values), waiting.set()))

    def measured_late(folder: Path) -> dict[str, float]:
        reached.set()
        assert waiting.wait(60.0), "the other one did not wait"
        return measured(folder)

    first = Thread(target=lambda: results.append(register(better, pipeline, measured_late)))
    first.start()
    assert reached.wait(60.0)
    refused = register(worse, slower, measured)
    first.join()
    assert results[0].promote
    assert not refused.promote
    assert "not better overall, mean error 2.000 % against the incumbent's 1.000 %" in refused.reason
    assert warnings == ["friction-estimator version 3 waits for version 2: it is being decided"]
    assert champion(pipeline) == "2"


def test_a_version_whose_machine_stopped_is_named_until_it_is_decided_or_deleted(
    pipeline: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with open_store(pipeline) as store:
        ensure_version(store, candidate_in(pipeline, {"1": 2.0, "2": 2.0}), pipeline)
    other_model(pipeline)
    monkeypatch.setattr(registry, "_PATIENCE_S", 0.0)
    with pytest.raises(TrackingError, match=r"version 2 waits for version 1: it is being decided; .* delete version 1"):
        register(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), pipeline, measured)
    MlflowClient(tracking_uri(pipeline)).delete_model_version(NAME, "1")
    assert register(candidate_in(pipeline, {"1": 1.0, "2": 1.0}), pipeline, measured).promote
    assert champion(pipeline) == "2"


@pytest.mark.extended
@pytest.mark.parametrize(
    "at",
    [
        "save_model_folder",
        "_write_grounds",
        "set_registered_model_alias",
        "create_model_version",
        "finalize_logged_model",
    ],
)
def test_a_kill_at_any_moment_changes_nothing_in_the_end(
    pipeline: Path, at: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def killed(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    place = next(one for one in (registry, MlflowClient) if hasattr(one, at))
    with monkeypatch.context() as patch:
        patch.setattr(place, at, killed)
        with pytest.raises(KeyboardInterrupt):
            register(candidate_in(pipeline), pipeline, measured)
    registered = register(candidate_in(pipeline), pipeline, measured)
    assert registered.reason.startswith("promoted: there is no incumbent")
    (version,) = versions(pipeline)
    assert champion(pipeline) == str(version.version)
    client = MlflowClient(tracking_uri(pipeline))
    experiment = client.get_experiment_by_name("cylinder-friction")
    assert experiment is not None
    assert len(client.search_logged_models([experiment.experiment_id])) == 1
    assert len(client.search_runs([experiment.experiment_id], "tags.stage = 'pipeline'")) == 1
