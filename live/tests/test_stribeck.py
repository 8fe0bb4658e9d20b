"""Curves that were identified before, as the page draws them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cylinder_friction.files.whole_files import write_json
from cylinder_friction.friction_models.stribeck import StribeckCurve
from cylinder_friction_live.stribeck import StribeckError, stribeck_lines

CURVE = {
    "coulomb_n": 300.0, "static_n": 400.0, "stribeck_velocity_m_s": 0.01, "stribeck_exponent": 2.0,
    "viscous_n_s_m": 500.0, "retract_ratio": 1.2,
}  # fmt: skip


def test_curves_of_the_pipeline_and_of_identify_become_lines(tmp_path: Path) -> None:
    path = tmp_path / "curves.json"
    write_json(path, {"curve": CURVE, "points": []})
    (line,) = stribeck_lines(path).values()
    np.testing.assert_array_equal(line["friction_n"], StribeckCurve(**CURVE).friction(np.array(line["velocity_m_s"])))
    assert line["velocity_m_s"] == sorted(line["velocity_m_s"])
    assert line["everywhere"]
    found = {"cold": {"curve": CURVE}, "warm": {"curve": CURVE | {"coulomb_n": 250.0}}, "none": {"curve": None}}
    write_json(path, {"stribeck": found, "models": {}})
    lines = stribeck_lines(path)
    assert list(lines) == ["cold", "warm"]
    assert lines["cold"] == line | {"everywhere": False} != lines["warm"]


@pytest.mark.parametrize(("unknown", "viscous"), [((), 500.0), (("viscous_n_s_m",), 0.0)])
def test_where_sliding_determined_nothing_the_line_does_not_rise(
    unknown: tuple[str, ...], viscous: float, tmp_path: Path
) -> None:
    slow = dict.fromkeys(("static_n", "stribeck_velocity_m_s", "stribeck_exponent", *unknown))
    write_json(tmp_path / "curves.json", {"stribeck": {"1": {"curve": CURVE | slow}}})
    line = stribeck_lines(tmp_path / "curves.json")["1"]
    dry_n = np.abs(line["friction_n"]) - viscous * np.abs(line["velocity_m_s"])
    np.testing.assert_allclose(dry_n, np.where(np.array(line["velocity_m_s"]) < 0.0, 360.0, 300.0))


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"curve": None}, r"none of its 1 Stribeck curves was determined; expected friction_models.json of"),
        ({"stribeck": {}}, r"none of its 0 Stribeck curves"),
        ({"points": []}, r"cannot be read as Stribeck curves \(KeyError\('curve'\)\); expected friction_models.json"),
        ({"curve": {"coulomb_n": -1.0}}, r"cannot be read as Stribeck curves"),
    ],
)
def test_another_file_is_refused(content: Any, words: str, tmp_path: Path) -> None:
    write_json(tmp_path / "curves.json", content)
    with pytest.raises(StribeckError, match=words):
        stribeck_lines(tmp_path / "curves.json")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(StribeckError, match=r"gone.json: cannot be read.*FileNotFoundError"):
        stribeck_lines(tmp_path / "gone.json")
