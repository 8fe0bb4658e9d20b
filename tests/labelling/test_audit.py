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


def test_bias_is_signed_and_unusable_rows_do_not_count() -> None:
    usable = np.arange(200) < 50
    audit = Audit(0.05)
    audit.add("1", 0.005, {"low": TRUTH - np.where(usable, 3.0, 1e6)}, usable, TRUTH, VELOCITY)
    row = row_of(audit.rows(), condition="1", stratum="all")
    assert (row.rows, row.bias_n, row.max_n) == (50, -3.0, 3.0)


def test_tests_are_kept_apart_and_summed_up() -> None:
    audit = Audit(0.05)
    for condition, error in (("1", 1.0), ("2", 3.0)):
        audit.add(condition, 0.005, {"a": TRUTH + error, "b": TRUTH}, np.ones(200, dtype=bool), TRUTH, VELOCITY)
    rows = audit.rows()
    assert [row_of(rows, filter="a", condition=condition, stratum="all").mae_n for condition in ("1", "2", "all")] == [
        1.0,
        3.0,
        2.0,
    ]
    assert row_of(rows, filter="b", condition="all", stratum="all").mae_percent == 0.0
    assert Audit(0.05).rows() == []
