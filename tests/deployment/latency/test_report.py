"""A run as text, JSON and metrics."""

import json
from dataclasses import replace

import numpy as np
import pytest

from cylinder_friction.deployment.latency.machine import Quiet
from cylinder_friction.deployment.latency.measuring import Measured
from cylinder_friction.deployment.latency.report import as_dict, metrics_of, table
from deployment.latency.conftest import STEPS


def test_json_states_what_was_measured_where_and_how(measured: Measured) -> None:
    content = json.loads(json.dumps(as_dict(measured), allow_nan=False))
    assert content["models"]["small"]["runtimes"]["c"]["ratio_to_c"] in (0.0, 1.0)
    assert set(content["models"]["small"]["runtimes"]) == set(measured.models["small"].runtimes)
    assert "-march=native" in content["options"]["c"]
    assert content["options"]["c_o2"][0] == "-O2"
    assert content["machine"]["processor"]
    assert content["effort"]["steps"] == STEPS
    assert {"core_share", "is_quiet"} <= set(content["quiet"])


def test_metrics_are_finite_numbers_by_model_and_runtime(measured: Measured) -> None:
    metrics = metrics_of(measured)
    assert {"small.c.p999_us", "small.onnx_step.ratio_to_c", "lugre.python.p50_us"} <= set(metrics)
    assert np.isfinite(list(metrics.values())).all()


def test_the_table_names_every_runtime(measured: Measured) -> None:
    text = table(measured)
    for model in measured.models.values():
        assert all(figures.title in text for figures in model.runtimes.values())


@pytest.mark.parametrize(("share", "word"), [(0.3, "a BUSY machine"), (0.0, "others had 0.0 % of that core")])
def test_a_busy_machine_is_called_busy(measured: Measured, share: float, word: str) -> None:
    text = table(replace(measured, quiet=Quiet(share, 0.5, 1.0)))
    assert word in text
    assert ("BUSY" in text) == (share > 0.02)
