"""The command ``switch`` on a running service: the other model takes over at the stated sample, and goes back."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import pytest

from cylinder_friction.commands.cli import main
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE
from cylinder_friction.live.client import Client
from cylinder_friction.network.ports import free_port
from cylinder_friction.recordings.files import write_json
from live_process import running

if TYPE_CHECKING:
    from pathlib import Path

    from cylinder_friction.arrays import Array
    from cylinder_friction.estimators.hybrid import HybridEstimator

pytestmark = pytest.mark.slow


@pytest.fixture
def other_model(other_estimator: HybridEstimator, tmp_path: Path) -> Path:
    other_estimator.save(tmp_path / "other")
    return tmp_path / "other"


def read(client: Client, rows: int) -> Array:
    parts: list[Array] = []
    while sum(map(len, parts)) < rows:
        parts.append(client.estimates(5.0)[1])
    return np.concatenate(parts)


def test_a_model_takes_over_at_its_sample_and_goes_back(
    small_hybrid: HybridEstimator, other_estimator: HybridEstimator, model: Path, other_model: Path, samples: Array,
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder, port = tmp_path / "live", free_port()
    address = ["--url", f"http://127.0.0.1:{port}"]
    with running(model, folder, port) as process, Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
        client.send(samples[:100])
        first = read(client, 100)
        assert (
            main(["switch", str(other_model), "--at-index", "700", "--record", "--folder", str(folder), *address]) == 0
        )
        assert "kept in 1 sessions" in capsys.readouterr().out
        client.send(samples[100:900])
        second = read(client, 800)
        assert main(["switch", "--status", *address]) == 0
        runs = json.loads(capsys.readouterr().out)["models"].values()
        assert sorted((each["gives_newtons"], each["runs_beside"]) for each in runs) == [(0, 1), (1, 0)]
        assert main(["switch", "--back", "--at-index", "1200", *address]) == 0
        client.send(samples[900:1400])
        third = read(client, 500)
        assert main(["switch", "--end", *address]) == 0
        client.wait_until_kept()
        process.terminate()
        process.wait(timeout=10.0)
    one, other = small_hybrid.real_time().run(samples[:1400])[0], other_estimator.real_time().run(samples[300:1400])[0]
    expected = np.concatenate([one[:700], other[400:900], one[1200:]])
    np.testing.assert_array_equal(np.concatenate([first, second, third]), expected)
    history = pd.concat([pd.read_parquet(path) for path in (folder / "history").rglob("*.parquet")])
    beside = history.set_index("index")["shadow_friction_n"].sort_index()
    np.testing.assert_array_equal(beside.loc[700:1199], one[700:1200, 0])


def test_a_model_that_is_not_what_was_registered_is_not_brought_in(
    model: Path, other_model: Path, other_estimator: HybridEstimator, samples: Array, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder, port = tmp_path / "live", free_port()
    address = ["--folder", str(folder), "--url", f"http://127.0.0.1:{port}"]
    newtons, flags = other_estimator.real_time().run(samples[:300])
    golden = {"samples": samples[:300].tolist(), "newtons": newtons.tolist(), "flags": flags.tolist()}

    def ready() -> Any:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/readyz") as reply:
            return json.load(reply)["gives_newtons"]

    with running(model, folder, port), Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
        client.send(samples[:100])
        write_json(other_model.with_name(GOLDEN_FILE), golden | {"newtons": (newtons + 1.0).tolist()})
        assert main(["switch", str(other_model), *address]) == 1
        assert "on its golden trajectory it is 1 N from what was recorded with it" in capsys.readouterr().err
        assert list(ready().values()) == [
            {"sessions": 1, "golden_trajectory": "none is in the model's folder", "golden_difference_n": None}
        ]
        write_json(other_model.with_name(GOLDEN_FILE), golden)
        assert main(["switch", str(other_model), "--after-s", "0", *address]) == 0
        client.send(samples[100:700])
        read(client, 700)
        assert list(ready().values()) == [{"sessions": 1, "golden_trajectory": "met", "golden_difference_n": 0.0}]
        (stored,) = (folder / "engines").glob(f"*/{GOLDEN_FILE}")
        write_json(stored, golden | {"flags": (flags ^ 1).tolist()})
        body = json.dumps({"do": "beside", "engine": stored.parent.name}).encode()
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(f"http://127.0.0.1:{port}/models", body))
        assert "not taken into service (model" in json.load(refused.value)["error"]


def test_what_cannot_be_switched_is_refused(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    assert main(["switch", "--back", "--url", url]) == 1
    assert "is the service running? --url states where" in capsys.readouterr().err
    with running(model, tmp_path / "live", port), Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005):
        for arguments, words in (
            (["--back"], "no second model runs in it"),
            (["--end", "--session", "nobody"], "session 'nobody': not open"),
        ):
            assert main(["switch", *arguments, "--url", url]) == 1
            assert words in capsys.readouterr().err
        for body, words in (
            ({"do": "beside", "engine": "../../etc"}, "not in"),
            ({"do": "beside", "engine": "0" * 32}, "`cylinder-friction switch` puts it there"),
            ({"do": "dance"}, "beside"),
        ):
            request = urllib.request.Request(f"{url}/models", json.dumps(body).encode())
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request)
            assert refused.value.code == 422
            assert words in json.load(refused.value)["error"]
