"""Rows that no working sensor logs, sent to a logged model by MLflow's own server code.

What is scored and flagged is the table in docs/serving.md.
"""

import io
import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import mlflow
import numpy as np
import pandas as pd
import pytest
from mlflow.exceptions import MlflowException
from mlflow.models import Model
from mlflow.pyfunc import PyFuncModel
from mlflow.pyfunc.scoring_server import invocations

from cylinder_friction.deployment.served_model import save_model_folder
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from cylinder_friction.recordings.recording import Recording

JSON, CSV, PARQUET = "application/json", "text/csv", "application/vnd.apache.parquet"
PAGE = Path(__file__).parents[2] / "docs/serving.md"
TABLE = PAGE.read_text("utf-8").partition("| sent | flag and share of rows |")[2].partition("\n\n")[0]
FLAGS = dict(re.findall(r"^\| ([^|]+?) \| (`[^|]+) \|$", TABLE, re.MULTILINE))
P1, P2, X = SAMPLE_COLUMNS
ENOUGH = 0.9
"""Share of rows that a line's flag must be set in; the page has the shares of the default hybrid."""
SAMPLE_TIME_S = 0.005
ARABIC = {ord("0") + digit: 0x0660 + digit for digit in range(10)}
Request = tuple[str | bytes, str]


def split(rows: pd.DataFrame, **columns: Any) -> Request:
    content = rows.assign(**columns).to_dict("split")
    return json.dumps({"dataframe_split": {key: content[key] for key in ("columns", "data")}}), JSON


def at_row_7(rows: pd.DataFrame, column: str, value: Any) -> Request:
    values = rows[column].astype(object) if column in rows else pd.Series(["a"] * len(rows), dtype=object)
    values[7] = value
    return split(rows, **{column: values})


def csv(rows: pd.DataFrame, change: Callable[[list[str]], list[str]] = list) -> Request:
    return "\n".join(change(rows.to_csv(index=False).splitlines())), CSV


def parquet(rows: pd.DataFrame) -> Request:
    file = io.BytesIO()
    rows.to_parquet(file)
    return file.getvalue(), PARQUET


def scaled(rows: pd.DataFrame, pressure: float, position: float = 1.0) -> Request:
    return split(rows * [pressure, pressure, position])


def stopped(rows: pd.DataFrame) -> Request:
    stands = pd.concat([rows.iloc[[500]]] * 400, ignore_index=True)
    return split(stands, **{P1: 1.03 * rows[P1].max(), P2: rows[P2].min()})


def ticks(rows: pd.DataFrame, *, step_s: float = SAMPLE_TIME_S, later_s: float = 0.0) -> Request:
    times = step_s * np.arange(len(rows))
    times[10:] += later_s
    return split(rows, time_s=times)


def joined(rows: pd.DataFrame, recording: str | None) -> Request:
    """Return the rows twice, the second time from where the position is another."""
    away = int((rows[X] - rows[X].iloc[199]).abs().argmax())
    both = pd.concat([rows[:200], rows[away:]], ignore_index=True)
    return split(both) if recording is None else split(both, recording=recording)


def halves(rows: pd.DataFrame) -> pd.DataFrame:
    return rows[:400].assign(recording=["a"] * 200 + ["b"] * 200)


FLAGGED: dict[str, tuple[Callable[[pd.DataFrame], Request], ...]] = {
    "pressures in bar, kPa, MPa or psi, or both zero": (
        *(partial(scaled, pressure=share) for share in (1e-5, 1e-3, 1e-6, 1.0 / 6894.757, 0.0)),
    ),
    "all zero": (lambda rows: scaled(rows, 0.0, 0.0),),
    "pressures swapped": (lambda rows: split(rows.rename(columns={P1: P2, P2: P1})),),
    "position in millimetres": (lambda rows: scaled(rows, 1.0, 1e3),),
    "the piston at an end stop": (stopped,),
    "a value that no working sensor gives": (
        lambda rows: split(rows.iloc[[0, *[1] * 99]], **{P1: [1e6] + [1e9] * 99}),
    ),
    "pressures or position of the wrong sign": (lambda rows: scaled(rows, -1.0), lambda rows: scaled(rows, 1.0, -1.0)),
    "plausible values outside the training range": (
        lambda rows: split(rows, **{X: 1.5 * rows[X].max() - 0.5 * rows[X].min()}),
    ),
    "the first 3 s of each recording": (lambda rows: split(rows[:600]),),
}
"""What is sent, by line of the table in the guide; all of it is scored."""
REFUSED: dict[str, tuple[str, Callable[[pd.DataFrame], Request]]] = {
    "a column is missing": ("Model is missing inputs ['position_m']", lambda rows: split(rows[[P1, P2]])),
    "a column twice": (
        "Failed to enforce schema",
        lambda rows: (
            json.dumps({"dataframe_split": {"columns": [P1, P2, X, X], "data": [[1e6, 1e6, 0.1, 0.1]]}}),
            JSON,
        ),
    ),
    "a load, to a model that knows none": (
        "this model was trained without one",
        lambda rows: split(rows, load_force_n=0.0),
    ),
    "text among numbers": (
        "Failed to convert column pressure_1_pa to type 'float64'",
        lambda rows: at_row_7(rows, P1, "high"),
    ),
    "a header again in the middle of a CSV": (
        "could not convert string to float: 'pressure_1_pa'",
        lambda rows: csv(rows, lambda lines: lines + lines),
    ),
    "CSV rows with one value more than the header": (
        "a CSV has more values than its header",
        lambda rows: csv(rows, lambda lines: [lines[0], *(f"{line},7" for line in lines[1:])]),
    ),
    "CSV without a header": ("Model is missing inputs", lambda rows: csv(rows, lambda lines: lines[1:])),
    "recordings as the index of a Parquet file": (
        "the index, recording, begins with ['a', 'a']",
        lambda rows: parquet(halves(rows).set_index("recording")),
    ),
    "an index that begins again": (
        "expected row numbers from 0 without gaps",
        lambda rows: parquet(pd.concat([rows[:200], rows[:200]])),
    ),
    "every second row": ("expected row numbers from 0 without gaps", lambda rows: parquet(rows[::2])),
    "`null`": ("position_m is nan at row 7", lambda rows: at_row_7(rows, X, None)),
    "an infinite value": ("position_m is inf at row 7", lambda rows: at_row_7(rows, X, np.inf)),
    "a whole number with 400 digits": ("int too large to convert to float", lambda rows: at_row_7(rows, P1, 10**399)),
    "no row": ("got no row", lambda rows: split(rows[:0])),
    "rows without names of columns": (
        "Failed to enforce schema",
        lambda rows: (json.dumps({"instances": rows.to_numpy().tolist()}), JSON),
    ),
    "columns of different lengths": (
        "Failed to enforce schema",
        lambda rows: (json.dumps({"inputs": {**rows.to_dict("list"), X: [0.1, 0.1]}}), JSON),
    ),
    "a recording without a name": (
        "at row 7; expected the name of a recording in every row",
        lambda rows: at_row_7(rows, "recording", None),
    ),
    "an empty name of a recording": ("recording is '' at row 7", lambda rows: at_row_7(rows, "recording", "")),
    "a fraction as the name of a recording": ("recording is 1.5 at row 0", lambda rows: split(rows, recording=1.5)),
    "names of recordings as text and as numbers": (
        "recording is 1 at row 7",
        lambda rows: at_row_7(rows, "recording", 1),
    ),
    "recordings that alternate": (
        "recording 'a' comes back at row 400",
        lambda rows: split(pd.concat([halves(rows), halves(rows)])),
    ),
    "two recordings without names": ("position_m jumps from", lambda rows: joined(rows, None)),
    "two recordings under one name": ("position_m jumps from", lambda rows: joined(rows, "monday")),
    "times that jump back": ("time_s goes on by -", lambda rows: ticks(rows, later_s=-0.05)),
    "times with a gap": ("time_s goes on by 0.05 s at row 10", lambda rows: ticks(rows, later_s=0.045)),
    "times of another sample time": ("time_s goes on by 0.004 s on average", lambda rows: ticks(rows, step_s=0.004)),
    "JSON that is none": ("valid JSON", lambda rows: ("{broken", JSON)),
}
"""What is sent, and what the message of the refusal holds: MLflow's where the signature decides, else the model's."""
TAKEN: dict[str, Callable[[pd.DataFrame], Request]] = {
    "numbers as text": lambda rows: split(rows, **{X: rows[X].map(repr)}),
    "an unknown column": lambda rows: split(rows, velocity_m_s=0.0),
    "a column twice in CSV": lambda rows: csv(rows, lambda lines: [f"{line},{line.split(',')[2]}" for line in lines]),
}
"""What MLflow makes of a table before the model sees it: the estimates are those of the plain rows."""
BOOLEANS: dict[str, str] = {P1: "UNMODELLED_FORCE", P2: "UNMODELLED_FORCE", X: "INVALID_POSITION"}
"""MLflow reads ``true`` as 1.0: which flag the rows of a column of booleans have."""


@pytest.fixture(scope="module")
def model(
    small_hybrid: HybridEstimator, labelled_recordings: list[Recording], tmp_path_factory: pytest.TempPathFactory
) -> PyFuncModel:
    folder = tmp_path_factory.mktemp("logged")
    small_hybrid.save(folder / "hybrid")
    example = pd.DataFrame(labelled_recordings[0].samples()[:5], columns=list(SAMPLE_COLUMNS))
    save_model_folder(folder / "model", folder / "hybrid", {}, example, Model())
    return mlflow.pyfunc.load_model(str(folder / "model"))


@pytest.fixture(scope="module")
def rows(labelled_recordings: list[Recording]) -> pd.DataFrame:
    return pd.DataFrame(labelled_recordings[0].samples(), columns=list(SAMPLE_COLUMNS))


def served(model: PyFuncModel, body: str | bytes, content_type: str) -> tuple[int, str]:
    """Return status and body as ``mlflow models serve`` gives them."""
    try:
        done = invocations(body, content_type, model, model.metadata.get_input_schema())
    except MlflowException as error:
        return error.get_http_status_code(), error.serialize_as_json()
    return done.status, done.response


def test_every_line_of_the_table_is_tried() -> None:
    assert list(FLAGS) == list(FLAGGED)


def test_what_is_scored_has_the_flags_of_the_table(model: PyFuncModel, rows: pd.DataFrame) -> None:
    for sent, requests in FLAGGED.items():
        words = re.findall(r"`([^`]+)`", FLAGS[sent])
        for request in requests:
            body, content_type = request(rows)
            status, response = served(model, body, content_type)
            assert status == 200, (sent, response[:500])
            assert_flagged(sent, response, words)


def test_what_cannot_be_meant_is_refused_by_name(model: PyFuncModel, rows: pd.DataFrame) -> None:
    for sent, (message, request) in REFUSED.items():
        status, response = served(model, *request(rows))
        assert status == 400, (sent, response[:500])
        assert message in json.loads(response)["message"], sent
    status, response = served(model, "rows", "text/plain")
    assert (status, "only supports the following content types" in response) == (415, True)


def test_mlflow_changes_no_estimate(model: PyFuncModel, rows: pd.DataFrame) -> None:
    expected = served(model, *split(rows))
    assert {sent: served(model, *request(rows)) == expected for sent, request in TAKEN.items()} == dict.fromkeys(
        TAKEN, True
    )


@pytest.mark.parametrize("column", BOOLEANS)
def test_booleans_are_numbers_to_mlflow_and_flagged(column: str, model: PyFuncModel, rows: pd.DataFrame) -> None:
    status, response = served(model, *split(rows, **{column: True}))
    assert status == 200
    assert_flagged(column, response, [BOOLEANS[column]])
    status, response = served(model, *at_row_7(rows, X, True))
    assert "INVALID_POSITION" in json.loads(response)["predictions"][7]["flag_names"]


@pytest.mark.parametrize("text", [str, "{:_}".format, lambda number: str(number).translate(ARABIC)])
def test_text_that_python_reads_as_a_number_is_one_to_mlflow(
    text: Callable[[int], str], model: PyFuncModel, rows: pd.DataFrame
) -> None:
    whole = rows.assign(**{P1: rows[P1].round().astype(int)})
    assert served(model, *split(whole, **{P1: whole[P1].map(text)})) == served(model, *split(whole))


def test_rows_without_an_estimate_are_null(model: PyFuncModel, rows: pd.DataFrame) -> None:
    later = rows.assign(**{P1: np.where(np.arange(len(rows)) < 3, 1e12, rows[P1])})
    status, response = served(model, *split(later))
    predictions = json.loads(response)["predictions"]
    assert status == 200
    for row, found in enumerate(predictions[:6]):
        assert ("NOT_READY" in found["flag_names"]) == (row < 3)
        assert [found[name] is None for name in ("friction_n", "lower_n", "upper_n")] == [row < 3] * 3


def assert_flagged(sent: str, response: str | bytes, words: list[str]) -> None:
    predictions = json.loads(response)["predictions"]
    assert np.mean([bool({*words} & {*row["flag_names"].split()}) for row in predictions]) >= ENOUGH, sent
    assert "in_training_range" not in words or not any(row["in_training_range"] for row in predictions), sent


def test_good_rows_in_every_form_get_the_same(model: PyFuncModel, rows: pd.DataFrame) -> None:
    few = halves(rows).assign(time_s=np.tile(SAMPLE_TIME_S * np.arange(200), 2))
    forms = {
        "dataframe_split with its index": (json.dumps({"dataframe_split": few.to_dict("split")}), JSON),
        "dataframe_records": (json.dumps({"dataframe_records": few.to_dict("records")}), JSON),
        "inputs": (json.dumps({"inputs": few.to_dict("list")}), JSON),
        "instances": (json.dumps({"instances": few.to_dict("records")}), JSON),
        "CSV": csv(few),
        "Parquet": parquet(few),
    }
    expected = served(model, *split(few))
    assert expected[0] == 200
    assert {name: served(model, *request) == expected for name, request in forms.items()} == dict.fromkeys(forms, True)
