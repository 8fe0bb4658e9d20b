"""What the served model does with rows: its own sequences, its flag, and everything it refuses."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cylinder_friction.deployment.onnx_estimator import load_onnx
from cylinder_friction.deployment.scoring import ScoringError, score
from cylinder_friction.estimators.linear import ForceBalanceEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.recordings.recording import Recording

AGREEMENT_N = 0.5


@pytest.fixture(scope="module")
def folder(small_hybrid: HybridEstimator, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("model") / "hybrid"
    small_hybrid.save(path)
    return path


@pytest.fixture(scope="module")
def onnx(folder: Path) -> FrictionEstimator:
    return load_onnx(folder)


def rows_of(recording: Recording, count: int | None = None) -> pd.DataFrame:
    return recording.table[list(SAMPLE_COLUMNS)].iloc[:count].reset_index(drop=True)


def test_onnx_runtime_agrees_with_the_estimator_that_was_trained(
    onnx: FrictionEstimator, small_hybrid: HybridEstimator, labelled_recordings: list[Recording]
) -> None:
    for recording in labelled_recordings:
        difference = onnx.estimate(recording) - small_hybrid.estimate(recording)
        assert np.abs(difference).max() < AGREEMENT_N


def test_onnx_runtime_carries_its_state_from_piece_to_piece(
    onnx: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    samples = labelled_recordings[0].samples()[:300]
    whole = onnx.advance(onnx.new_state(), samples)
    state = onnx.new_state()
    pieces = [onnx.advance(state, samples[start:stop]) for start, stop in ((0, 1), (1, 1), (1, 50), (50, 300))]
    assert np.abs(np.concatenate(pieces) - whole).max() < 1e-3
    stream = onnx.stream()
    assert np.abs([stream.step(*sample) for sample in samples] - whole).max() < 1e-3


def test_what_is_no_hybrid_runs_as_it_is(
    cylinder: Cylinder, labelled_recordings: list[Recording], tmp_path: Path
) -> None:
    balance = ForceBalanceEstimator(cylinder, "none")
    balance.fit(labelled_recordings)
    balance.save(tmp_path / "balance")
    loaded = load_onnx(tmp_path / "balance")
    assert np.array_equal(loaded.estimate(labelled_recordings[0]), balance.estimate(labelled_recordings[0]))


def test_one_recording_is_scored_as_it_is_estimated(
    onnx: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    recording = labelled_recordings[0]
    scored = score(onnx, rows_of(recording))
    assert list(scored.columns) == ["friction_n", "in_training_range"]
    assert np.array_equal(scored["friction_n"], onnx.estimate(recording))
    assert scored["in_training_range"].all()


def test_interleaved_recordings_are_scored_apart_and_answered_in_the_order_of_the_rows(
    onnx: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    one, other = rows_of(labelled_recordings[0], 200), rows_of(labelled_recordings[4], 200)
    mixed = pd.concat([one.assign(recording="one"), other.assign(recording="other")])
    order = np.random.default_rng(1).permutation([0] * 200 + [1] * 200)
    nth = [np.cumsum(order == which)[at] - 1 + 200 * which for at, which in enumerate(order)]
    scored = score(onnx, mixed.iloc[nth])
    alone = np.concatenate([score(onnx, one)["friction_n"], score(onnx, other)["friction_n"]])
    assert np.abs(scored["friction_n"].to_numpy() - alone[nth]).max() < 1e-3


def test_one_row_is_a_first_sample(onnx: FrictionEstimator, labelled_recordings: list[Recording]) -> None:
    rows = rows_of(labelled_recordings[0], 50)
    scored = score(onnx, rows.iloc[:1])
    assert len(scored) == 1
    assert abs(scored["friction_n"].iloc[0] - score(onnx, rows)["friction_n"].iloc[0]) < 1e-3


def test_whole_numbers_are_numbers(onnx: FrictionEstimator) -> None:
    rows = pd.DataFrame({"pressure_1_pa": [1_000_000], "pressure_2_pa": [900_000], "position_m": [0.1]})
    assert np.isfinite(score(onnx, rows)["friction_n"]).all()


def test_a_sample_out_of_range_casts_doubt_on_the_second_after_it(
    onnx: FrictionEstimator, labelled_recordings: list[Recording]
) -> None:
    rows = rows_of(labelled_recordings[0], 500)
    rows.loc[100, "pressure_1_pa"] = 3e8
    flags = score(onnx, rows.assign(recording="spiked"))["in_training_range"].to_numpy()
    assert flags[:100].all()
    assert not flags[100:300].any()
    assert flags[300:].all()
    both = pd.concat([rows.assign(recording="spiked"), rows_of(labelled_recordings[0], 50).assign(recording="calm")])
    assert score(onnx, both)["in_training_range"].to_numpy()[500:].all(), "another recording is not doubted"


def spoilt(rows: pd.DataFrame, **columns: object) -> pd.DataFrame:
    return rows.assign(**columns)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda rows: rows.iloc[:0], "got no row; expected at least one sample"),
        (lambda rows: rows.drop(columns="position_m"), "column 'position_m' is missing; got"),
        (lambda rows: rows.rename(columns={"position_m": "position_mm"}), "'position_mm'.*, expected .*'position_m'"),
        (lambda rows: pd.concat([rows, rows[["position_m"]]], axis=1), "column 'position_m' is there more than once"),
        (lambda rows: spoilt(rows, pressure_1_pa="high"), "column 'pressure_1_pa' holds .*, expected numbers"),
        (lambda rows: spoilt(rows, pressure_1_pa=True), "column 'pressure_1_pa' holds bool, expected numbers"),
        (lambda rows: spoilt(rows, position_m=np.nan), "position_m is nan at row 0 .5 such values in all."),
        (lambda rows: spoilt(rows, pressure_2_pa=[1.0, 1.0, np.inf, 1.0, 1.0]), "pressure_2_pa is inf at row 2"),
        (
            lambda rows: spoilt(rows, recording=["a", "a", None, "b", "b"]),
            "recording is (None|nan) at row 2; expected the",
        ),
        (lambda rows: spoilt(rows, recording=["", "a", "b", "b", "b"]), "recording is '' at row 0"),
        (lambda rows: spoilt(rows, recording=[["x"]] * 5), r"recording is \['x'\] at row 0"),
        (lambda rows: spoilt(rows, recording=[1.5] * 5), "recording is 1.5 at row 0"),
    ],
)
def test_what_cannot_be_scored_is_refused_by_name(
    onnx: FrictionEstimator, labelled_recordings: list[Recording], spoil: object, message: str
) -> None:
    assert callable(spoil)
    with pytest.raises(ScoringError, match=message):
        score(onnx, spoil(rows_of(labelled_recordings[0], 5)))


def test_an_estimate_that_is_no_number_is_refused_with_the_row_it_followed_from(
    onnx: FrictionEstimator, labelled_recordings: list[Recording], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(onnx, "advance", lambda state, samples: np.array([1.0, np.nan, np.nan]))
    with pytest.raises(ScoringError, match=r"no finite friction follows from row 1: .*trained between .* check units"):
        score(onnx, rows_of(labelled_recordings[0], 3))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(*itertools.repeat(st.floats(), 3)), min_size=1, max_size=6))
def test_whatever_comes_the_answer_is_finite_or_a_refusal(
    onnx: FrictionEstimator, samples: list[tuple[float, float, float]]
) -> None:
    rows = pd.DataFrame(samples, columns=list(SAMPLE_COLUMNS))
    try:
        scored = score(onnx, rows)
    except ScoringError:
        return
    assert len(scored) == len(rows)
    assert np.isfinite(scored["friction_n"]).all()
