"""Logs become friction models: known parameters are found, and what the motion does not determine has no number."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.cylinder import Cylinder
from cylinder_friction.estimation.identification import identify_logs, too_coarse
from cylinder_friction.estimation.identified_model import FrictionModels, IdentifiedModel
from cylinder_friction.recordings.recording import RecordingError
from friction_samples import lugre_to_find
from logger_files import CHANNELS, SENSOR, write_lugre_log

TRUTH = lugre_to_find(6.0, 4e-5)
SPEEDS_M_S = [*np.geomspace(1e-3, 0.1, 9), *np.geomspace(1.5e-3, 0.06, 6)]
ZEROED = SENSOR | {"zero_uncertainty": 0.001}
STATED = CHANNELS | {name: CHANNELS[name] | {"sensor": ZEROED} for name in ("pressure_1_pa", "pressure_2_pa")}
SLOW = ("static_n", "stribeck_velocity_m_s", "stribeck_exponent")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("identified") / "out"


@pytest.fixture(scope="module")
def result(folder: Path, cylinder: Cylinder) -> FrictionModels:
    """Two logs with slow and fast strokes at two loads, and one broken file beside them."""
    logs = folder.parent / "logs"
    for number, pressure_pa in enumerate((8e5, 16e5), start=1):
        pressures = (pressure_pa, 4e5)
        write_lugre_log(logs / f"r{number}.csv", TRUTH, cylinder, SPEEDS_M_S, pressure_2_pa=pressures, seed=number)
    (logs / "broken.csv").write_text("t,p1\n0,1\n", encoding="utf-8")
    return identify_logs(logs, cylinder, folder, channels=STATED, generations=1)


def model_of(result: FrictionModels, name: str) -> IdentifiedModel:
    return next(model for model in result.models if model.name == name)


@pytest.mark.parametrize("name", ["coulomb_n", *SLOW, "viscous_n_s_m", "retract_ratio", "pressure_slope_n_pa"])
@pytest.mark.extended
def test_a_known_parameter_lies_in_its_interval(result: FrictionModels, name: str) -> None:
    parameter = next(each for each in model_of(result, "pressure_lugre").parameters if each.name == name)
    assert parameter.interval is not None
    assert parameter.interval[0] <= TRUTH.value(name) <= parameter.interval[1]
    assert parameter.interval[1] < 1.5 * parameter.interval[0]


@pytest.mark.extended
def test_the_model_follows_the_label(result: FrictionModels) -> None:
    found = model_of(result, "pressure_lugre").found
    assert found is not None
    assert found.error_percent < 3.0
    assert found.parameters.value("bristle_stiffness_n_m") == pytest.approx(2e6, rel=0.2)


@pytest.mark.extended
def test_file_and_page_hold_every_point_and_what_was_refused(result: FrictionModels, folder: Path) -> None:
    content = json.loads((folder / "friction_models.json").read_text())
    points = content["stribeck"]["1"]["points"]
    assert len(points) == len(result.curves[0].points) > 12
    assert all((point["half_width_n"] is None) == (point["strokes"] == 1) for point in points)
    assert content["recordings"] == ["r1", "r2"]
    assert content["simpler"] == content["zeros"] == ""
    assert [each["file"] for each in content["refused"]] == ["broken.csv"]
    assert content["models"]["pressure_lugre"]["parameters"]["coulomb_n"]["unit"] == "N"
    damping = content["models"]["pressure_lugre"]["parameters"]["bristle_damping_n_s_m"]
    assert damping["interval"] is None
    assert "damping ratio of 0.5, which is assumed" in damping["note"]
    page = (folder / "friction_models.html").read_text(encoding="utf-8")
    for words in ("Stribeck curve", "LuGre, pressure-scaled", "viscous coefficient", 'id="recording-2"', "broken.csv"):
        assert words in page


@pytest.mark.extended
def test_the_plain_model_is_named_where_pressure_changes_nothing(tmp_path: Path, cylinder: Cylinder) -> None:
    for number, pressure_pa in enumerate((8e5, 16e5), start=1):
        pressures, truth = (pressure_pa, 4e5), lugre_to_find(300.0, 0.0)
        write_lugre_log(tmp_path / f"r{number}.csv", truth, cylinder, SPEEDS_M_S, pressure_2_pa=pressures, seed=number)
    result = identify_logs(tmp_path / "r*.csv", cylinder, tmp_path / "out", channels=CHANNELS, generations=1)
    assert model_of(result, "pressure_lugre").found is not None
    assert "LuGre describes all recordings as well" in result.simpler
    assert "with one parameter fewer" in result.simpler


@pytest.mark.extended
def test_of_a_single_log_all_speeds_are_searched(tmp_path: Path, cylinder: Cylinder) -> None:
    write_lugre_log(tmp_path / "r.csv", lugre_to_find(300.0, 0.0), cylinder, SPEEDS_M_S, pressure_2_pa=(8e5, 4e5))
    result = identify_logs(tmp_path / "r.csv", cylinder, tmp_path / "out", channels=CHANNELS, generations=1)
    found = model_of(result, "lugre").found
    assert found is not None
    assert found.error_percent < 1.0, "a piece of ten seconds shows only some of them"


def test_strokes_in_one_direction_give_no_model_but_the_reason(tmp_path: Path, cylinder: Cylinder) -> None:
    longer, said = replace(cylinder, stroke_m=2.0), "while extending alone; record strokes in both directions"
    write_lugre_log(tmp_path / "r.csv", TRUTH, longer, [*np.geomspace(2e-3, 0.1, 20)], (1.0,))
    result = identify_logs(tmp_path / "r.csv", longer, tmp_path / "out", channels=CHANNELS, generations=1)
    for model in result.models:
        assert model.found is None
        assert said in model.why_not
    assert result.curves[0].curve is None
    written = {path.name for path in (tmp_path / "out").iterdir()}
    assert written == {"friction_models.html", "friction_models.json"}
    assert said in (tmp_path / "out/friction_models.html").read_text(encoding="utf-8")


def test_a_load_in_friction_is_no_parameter(tmp_path: Path, cylinder: Cylinder) -> None:
    write_lugre_log(tmp_path / "r.csv", TRUTH, cylinder, [0.01, 0.05, 0.08] * 5, load_n=900.0)
    words = r"r\.csv: friction_n holds a load, a sensor's zero or the loss of a line, of about \d{3} N"
    with pytest.raises(RecordingError, match=words):
        identify_logs(tmp_path / "r.csv", cylinder, tmp_path / "out", channels=CHANNELS)


@pytest.mark.extended
def test_viscous_and_static_friction_are_held_over_the_oils_temperatures(tmp_path: Path, cylinder: Cylinder) -> None:
    truth, oils_c = lugre_to_find(600.0, 0.0), np.linspace(27.0, 48.0, 4)
    thin = np.exp(-0.035 * (oils_c - 40.0))
    for number, (oil_c, ratio) in enumerate(zip(oils_c, thin, strict=True)):
        own = replace(truth, viscous_n_s_m=float(ratio) * truth.viscous_n_s_m)
        log = write_lugre_log(tmp_path / f"r{number}.csv", own, cylinder, SPEEDS_M_S, seed=number)
        pd.read_csv(log).assign(T=oil_c).to_csv(log, index=False)
    channels = STATED | {"oil_temperature_c": {"channel": "T", "unit": "degC"}}
    result = identify_logs(tmp_path / "r*.csv", cylinder, tmp_path / "out", channels=channels, generations=1)
    held = {each.name: each.interval for each in model_of(result, "lugre").parameters}
    assert model_of(result, "lugre").oil.range_c == pytest.approx((27.0, 48.0))
    for name, low, high in (
        ("viscous_n_s_m", thin.min() * truth.viscous_n_s_m, thin.max() * truth.viscous_n_s_m),
        ("static_n", truth.static_n, truth.static_n),
        ("coulomb_n", truth.coulomb_n, truth.coulomb_n),
    ):
        lower, upper = held[name] or (math.nan, math.nan)
        assert lower <= low <= high <= upper, name
        assert upper < 2.0 * lower * high / low, name


@pytest.mark.parametrize(
    ("coulomb_n", "found_n_m", "stiffest_n_m"), [(1250.0, 1.2e7, 2.4e7), (400.0, 2.5e6, 5e6), (300.0, 2e6, 2.5e6)]
)
def test_stiffness_has_no_number_if_bristles_may_bend_less_than_a_step(
    coulomb_n: float, found_n_m: float, stiffest_n_m: float
) -> None:
    """A step of 0.1 mm makes bristles of 60 N/um and 14 N/um look like 12 and 2.5."""
    assert coulomb_n / found_n_m > 1e-4
    words = too_coarse(coulomb_n, stiffest_n_m, 1e-4)
    assert bool(words) == (coulomb_n / stiffest_n_m < 1e-4)
    assert words == "" or "the position's step of 0.0001 m; record a finer position" in words
