"""Boosted trees out of scikit-learn, through ONNX, into plain arrays: the same way down every tree."""

from __future__ import annotations

import numpy as np
import onnxruntime
import pytest
from sklearn.ensemble import HistGradientBoostingRegressor

from cylinder_friction.estimators.onnx_files import forest_to_onnx
from friction_benchmark.models.gradient_boosting import BoostingPlan, fit_boosted_trees, trees_of


def made_rows(count: int = 3000, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    generator = np.random.default_rng(seed)
    features = generator.normal(size=(count, 4)).astype(np.float32)
    features[:, 3] = np.round(features[:, 3], 1)  # many equal values: thresholds lie half-way between neighbours
    target = np.sin(2.0 * features[:, 0]) + features[:, 1] * (features[:, 3] > 0.1) + generator.normal(0, 0.1, count)
    return features, target.astype(np.float64)


@pytest.mark.parametrize("loss", ["absolute_error", "squared_error"])
def test_plain_arrays_agree_with_scikit_learn(loss: str) -> None:
    features, target = made_rows()
    model = HistGradientBoostingRegressor(loss=loss, max_iter=30, early_stopping=False, random_state=0)
    model.fit(features, target)
    forest = trees_of(model, 4)
    unseen, _ = made_rows(20_000, seed=1)
    np.testing.assert_allclose(forest.predict(unseen), model.predict(unseen), rtol=0.0, atol=2e-6)


def test_rows_on_a_threshold_go_the_same_way_as_in_scikit_learn() -> None:
    features, target = made_rows()
    model = HistGradientBoostingRegressor(max_iter=10, early_stopping=False, random_state=0).fit(features, target)
    forest = trees_of(model, 4)
    inner = np.concatenate([stage[0].nodes[stage[0].nodes["is_leaf"] == 0] for stage in model._predictors])
    assert len(inner) > 50
    for node in inner:
        for nudge in (-np.inf, 0.0, np.inf):
            row = features[:1].copy()
            single = np.float32(node["num_threshold"])
            row[0, node["feature_idx"]] = single if nudge == 0.0 else np.nextafter(single, np.float32(nudge))
            assert forest.predict(row)[0] == pytest.approx(model.predict(row)[0], abs=2e-6)


def test_onnx_runtime_runs_the_stored_graph() -> None:
    features, target = made_rows()
    forest = fit_boosted_trees(features, target, BoostingPlan(trees=20, leaves=8), seed=0)
    session = onnxruntime.InferenceSession(
        forest_to_onnx(forest).SerializeToString(), providers=["CPUExecutionProvider"]
    )
    found = session.run(None, {"features": features})[0][:, 0]
    np.testing.assert_allclose(found, forest.predict(features), atol=1e-5)


def test_the_same_rows_and_seed_give_the_same_bytes() -> None:
    features, target = made_rows()
    plan = BoostingPlan(trees=5, rows=1000)
    first, second, other = (
        forest_to_onnx(fit_boosted_trees(features, target, plan, seed)).SerializeToString() for seed in (0, 0, 1)
    )
    assert first == second
    assert first != other


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"trees": 0}, "expected at least one tree and row, and two leaves, but got"),
        ({"leaves": 1}, "expected at least one tree and row, and two leaves, but got"),
        ({"learning_rate": 0.0}, r"expected learning_rate in \(0, 1\] and penalty >= 0, but got"),
        ({"loss": "poisson"}, "expected loss 'absolute_error' or 'squared_error', but got 'poisson'"),
    ],
)
def test_an_impossible_plan_is_refused(wrong: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        BoostingPlan(**wrong)  # type: ignore[arg-type]
