from __future__ import annotations

import numpy as np
import pytest

from cylinder_friction.labelling.audit import Audit, AuditRow

VELOCITY = np.repeat([0.0, 0.1], 100)
TRUTH = np.repeat([-100.0, 300.0], 100)


def row_of(rows: list[AuditRow], **wanted: str) -> AuditRow:
    (row,) = [row for row in rows if all(getattr(row, key) == value for key, value in wanted.items())]
    return row


def test_errors_are_split_into_steady_and_events() -> None:
    label = TRUTH + 2.0
    label[100] += 50.0
    audit = Audit(0.05)
    audit.add("1", 0.005, {"made": label}, np.ones(200, dtype=bool), TRUTH, VELOCITY)
    rows = audit.rows()
    steady, events = row_of(rows, condition="1", stratum="steady"), row_of(rows, condition="1", stratum="events")
    assert (events.rows, steady.rows) == (21, 179)
    assert (steady.mae_n, steady.max_n, steady.bias_n) == pytest.approx((2.0, 2.0, 2.0))
    assert (events.mae_n, events.max_n) == pytest.approx(((20 * 2.0 + 52.0) / 21, 52.0))
    assert events.mean_friction_n == pytest.approx((10 * 100.0 + 11 * 300.0) / 21)
    assert events.mae_percent == pytest.approx(100.0 * events.mae_n / events.mean_friction_n)
    assert row_of(rows, condition="1", stratum="start").rows == 21
    assert not [row for row in rows if row.stratum in ("stop", "reversal")]


def test_bias_is_signed_and_tests_are_kept_apart_and_summed_up() -> None:
    usable = np.arange(200) < 50
    audit = Audit(0.05)
    assert audit.rows() == []
    for condition, low_n in (("1", 1.0), ("2", 3.0)):
        labels = {"low": TRUTH - np.where(usable, low_n, 1e6), "exact": TRUTH}
        audit.add(condition, 0.005, labels, usable, TRUTH, VELOCITY)
    rows = audit.rows()
    found = [row_of(rows, filter="low", condition=condition, stratum="all") for condition in ("1", "2", "all")]
    assert [(row.rows, row.bias_n, row.mae_n) for row in found] == [(50, -1.0, 1.0), (50, -3.0, 3.0), (100, -2.0, 2.0)]
    assert row_of(rows, filter="exact", condition="all", stratum="all").mae_percent == 0.0
