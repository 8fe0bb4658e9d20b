"""An engine that does not give what its model gave when it was registered is not taken into service."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, GoldenError
from cylinder_friction.live.golden import golden_difference_n
from cylinder_friction.recordings.files import write_json

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.live.engine import Engine


def test_the_trajectory_beside_the_estimator_must_be_met(
    engine: Engine, small_hybrid: HybridEstimator, samples: Array, tmp_path: Path
) -> None:
    assert golden_difference_n(engine, tmp_path / "estimator") is None
    newtons, flags = small_hybrid.real_time().run(samples[:300])
    golden = {"samples": samples[:300].tolist(), "newtons": newtons.tolist(), "flags": flags.tolist()}
    write_json(tmp_path / GOLDEN_FILE, golden)
    assert golden_difference_n(engine, tmp_path / "estimator") == 0.0
    golden["newtons"][200][0] += 1.0
    write_json(tmp_path / GOLDEN_FILE, golden)
    with pytest.raises(GoldenError, match="on its golden trajectory it is 1 N from what was recorded with it"):
        golden_difference_n(engine, tmp_path / "estimator")
