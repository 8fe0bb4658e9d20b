"""The command ``switch`` on a running service: the other model takes over at the stated sample, and goes back."""

import asyncio
import json
import shutil
import urllib.error
import urllib.request
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from live_service import running

from cylinder_friction.arrays import Array
from cylinder_friction.commands.cli import main
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.service.client import Client
from cylinder_friction.service.live.app import create_app
from cylinder_friction.service.live.engine import DESCRIPTION
from cylinder_friction.service.live.service import LiveService

pytestmark = pytest.mark.extended


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
    newtons: Array, other_estimator: HybridEstimator, model: Path, other_model: Path, samples: Array, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder, port = tmp_path / "live", free_port()
    address = ["--url", f"http://127.0.0.1:{port}"]
    with running(model, folder, port) as process, Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as client:
        client.send(samples[:100])
        first = read(client, 100)
        given = [str(other_model), "--at-index", "700", "--record", "--folder", str(folder), *address]
        assert main(["switch", *given]) == 0
        words = "open sessions: 1; the second model starts in about a second and takes over at sample 700;"
        assert words in capsys.readouterr().out
        client.send(samples[100:900])
        second = read(client, 800)
        assert main(["switch", "--status", *address]) == 0
        runs = json.loads(capsys.readouterr().out)["models"].values()
        found = sorted((each["gives_newtons"], each["runs_beside"], each["called"]) for each in runs)
        assert found == [(0, 1, str(model)), (1, 0, str(other_model))]
        assert main(["switch", "--back", "--at-index", "1200", *address]) == 0
        client.send(samples[900:1400])
        third = read(client, 500)
        assert main(["switch", "--end", *address]) == 0
        client.wait_until_kept()
        process.terminate()
        process.wait(timeout=60.0)
    other = other_estimator.real_time().run(samples[300:1400])[0]
    expected = np.concatenate([newtons[:700], other[400:900], newtons[1200:1400]])
    np.testing.assert_array_equal(np.concatenate([first, second, third]), expected)
    history = pd.concat([pd.read_parquet(path) for path in (folder / "history").rglob("*.parquet")])
    beside = history.set_index("index")["shadow_friction_n"].sort_index()
    np.testing.assert_array_equal(beside.loc[700:1199], newtons[700:1200, 0])


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
        (old,) = ready().values()
        assert (old["called"], old["golden_trajectory"]) == (str(model), "none is in the model's folder")
        write_json(other_model.with_name(GOLDEN_FILE), golden)
        assert main(["switch", str(other_model), "--after-s", "0", *address]) == 0
        client.send(samples[100:700])
        read(client, 700)
        now = {"called": str(other_model), "sessions": 1, "golden_trajectory": "met", "golden_difference_n": 0.0}
        assert list(ready().values()) == [now]
        (stored,) = (folder / "engines").glob(f"*/{GOLDEN_FILE}")
        write_json(stored, golden | {"flags": (flags ^ 1).tolist()})
        body = json.dumps({"do": "beside", "engine": stored.parent.name}).encode()
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(urllib.request.Request(f"http://127.0.0.1:{port}/models", body))
        assert "not taken into service (model" in json.load(refused.value)["error"]


def engine_with(engines: Path, digit: str, **changed: Any) -> str:
    """The name of an engine like the one that is there, as another model's."""
    (known,) = (path.parent for path in engines.glob(f"*/{DESCRIPTION}") if len(set(path.parent.name)) > 1)
    folder = shutil.copytree(known, engines / (32 * digit))
    write_json(folder / DESCRIPTION, read_json(folder / DESCRIPTION) | {"model": 64 * digit} | changed)
    return folder.name


def test_a_change_that_is_taken_back_or_followed_by_a_kill_is_what_was_replied(
    newtons: Array, other_estimator: HybridEstimator, model: Path, other_model: Path, samples: Array, tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    folder, port = tmp_path / "live", free_port()
    settings = {"log": str(folder / "log")}
    address = ["--url", f"http://127.0.0.1:{port}"]
    switch = ["switch", str(other_model), "--folder", str(folder), *address]

    def of_new_sessions() -> str:
        assert main(["switch", "--status", *address]) == 0
        return str(json.loads(capsys.readouterr().out)["model_of_new_sessions"])

    with ExitStack() as services:
        process = services.enter_context(running(model, folder, port, settings))
        client = services.enter_context(Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005))
        client.send(samples[:100])
        first = read(client, 100)
        before = of_new_sessions()
        assert main([*switch, "--after-s", "60"]) == 0
        assert capsys.readouterr().out.endswith("and takes over after 60 s; --status shows which models run\n")
        assert of_new_sessions() != before
        assert main(["switch", "--end", *address]) == 0
        assert "open sessions: 1; the second model stops;" in capsys.readouterr().out
        assert of_new_sessions() == before
        assert main([*switch, "--at-index", "700"]) == 0
        capsys.readouterr()
        process.kill()
        process.wait()
        services.enter_context(running(model, folder, port, settings))
        client.send(samples[100:900])
        second = read(client, 800)
    other = other_estimator.real_time().run(samples[300:900])[0]
    np.testing.assert_array_equal(np.concatenate([first, second]), np.concatenate([newtons[:700], other[400:]]))
    events = [json.loads(line) for line in (folder / "log").read_text(encoding="utf-8").splitlines()]
    done = [(each["do"], each["sessions"]) for each in events if each["event"] == "models changed"]
    assert done == [("beside", 1), ("end", 1), ("beside", 1)]


def test_a_service_that_is_ending_changes_nothing(service: LiveService, tmp_path: Path) -> None:
    app, sent = create_app(service, tmp_path), list[Any]()

    async def run() -> None:
        async def send(message: Any) -> None:
            sent.append(message)

        async def receive() -> Any:
            return {"type": "http.request", "body": b'{"do": "end"}'}

        await app.state.drain()
        request = {"type": "http", "method": "POST", "path": "/models", "headers": [(b"host", b"127.0.0.1")]}
        await app(request | {"query_string": b""}, receive, send)

    asyncio.run(run())
    assert sent[0]["status"] == 503
    assert "the service is ending, nothing is changed" in json.loads(sent[1]["body"])["error"]


def test_what_cannot_be_switched_is_refused(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}"
    assert main(["switch", "--back", "--url", url]) == 1
    assert "is the service running? --url states its address" in capsys.readouterr().err
    with running(model, tmp_path / "live", port), Client(f"ws://127.0.0.1:{port}/stream", "press", 0.005):
        for arguments, words in (
            (["--back"], "no second model runs in it"),
            (["--end", "--session", "nobody"], "session 'nobody': not open"),
            (["--end"], "no second model runs in any session that was asked for; nothing is changed"),
            (["--back", "--after-s", "0"], "--after-s: cannot be combined with these options"),
            (["--end", "--at-index", "7"], "--at-index: cannot be combined"),
            ([str(model), "--folder", str(tmp_path / "live")], "no session that was asked for has another one"),
            ([str(model), "--folder", str(tmp_path / "live"), "--at-index", "-1"], "at_index: Input should be greater"),
        ):
            assert main(["switch", *arguments, "--url", url]) == 1
            assert words in capsys.readouterr().err
        engines = tmp_path / "live/engines"
        for body, words in (
            ({"do": "beside", "engine": "../../etc"}, "not in"),
            (
                {"do": "beside", "engine": engine_with(engines, "1", inputs=["position_m"])},
                "takes ['position_m'] every",
            ),
            ({"do": "beside", "engine": engine_with(engines, "2", sample_time_s=0.001)}, "every 0.001 s; the sessions"),
            ({"do": "beside", "engine": "0" * 32}, "switch`, called on the service's machine with its --folder, puts"),
            ({"do": "dance"}, "do: Input should be 'beside', 'take-over' or 'end', but got 'dance'"),
        ):
            request = urllib.request.Request(f"{url}/models", json.dumps(body).encode())
            with pytest.raises(urllib.error.HTTPError) as refused:
                urllib.request.urlopen(request)
            assert refused.value.code == 422
            assert words in json.load(refused.value)["error"]
