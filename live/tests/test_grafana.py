"""Every panel of the dashboard and every alert gets data from a real Prometheus that scrapes a real service."""

import json
import re
import shutil
import subprocess
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from websockets.sync.client import connect

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live.client import Client
from live_process import Mosquitto, needs_broker
from live_service import running

pytestmark = [
    pytest.mark.extended,
    pytest.mark.skipif(shutil.which("prometheus") is None, reason="prometheus is not installed"),
]
DEPLOY = Path(__file__).parents[1] / "deploy"
PANELS = json.loads((DEPLOY / "grafana/live.json").read_text("utf-8"))["panels"]
EXPRESSIONS = [target["expr"] for panel in PANELS for target in panel["targets"]]


@contextmanager
def prometheus(folder: Path, target: int) -> Iterator[str]:
    """Yield the address of a Prometheus with the shipped configuration, scraping each second."""
    config = yaml.safe_load((DEPLOY / "prometheus.yml").read_text("utf-8"))
    config["global"] = {"scrape_interval": "1s", "evaluation_interval": "1s"}
    config["scrape_configs"][0]["static_configs"][0]["targets"] = [f"127.0.0.1:{target}"]
    (folder / "prometheus.yml").write_text(yaml.safe_dump(config), "utf-8")
    shutil.copy(DEPLOY / "prometheus-alerts.yml", folder)
    address = f"127.0.0.1:{free_port()}"
    process = subprocess.Popen(
        [
            "prometheus", f"--config.file={folder / 'prometheus.yml'}", f"--storage.tsdb.path={folder / 'data'}",
            f"--web.listen-address={address}", "--log.level=error",
        ]
    )  # fmt: skip
    try:
        yield f"http://{address}"
    finally:
        process.kill()
        process.wait()


def values(address: str, expression: str) -> list[float]:
    query = urllib.parse.urlencode({"query": expression})
    with urllib.request.urlopen(f"{address}/api/v1/query?{query}", timeout=60.0) as reply:
        found: list[dict[str, Any]] = json.load(reply)["data"]["result"]
    return [float(each["value"][1]) for each in found]


@needs_broker
def test_every_panel_has_data(samples: Array, model: Path, tmp_path: Path, broker: Mosquitto) -> None:
    port, settings = free_port(), {"mqtt": {"broker": {"port": broker.port}}}  # a link whose connections are counted
    url = f"ws://127.0.0.1:{port}/stream"
    broken = samples.copy()
    broken[::50, 0] = np.nan
    missing = set(EXPRESSIONS)
    with (
        running(model, tmp_path / "service", port, settings),
        prometheus(tmp_path, port) as address,
        Client(url, "press", 0.005) as client,
    ):
        for turn in range(240):
            client.send(broken[turn * 10 % 900 :][:10])
            while len(client.estimates(0.0)[2]):
                pass
            with connect(url) as other:
                other.send(b"garbage")
                other.recv()
            time.sleep(0.25)
            try:
                missing = {each for each in missing if not (got := values(address, each)) or not np.isfinite(got).all()}
            except urllib.error.URLError:
                continue  # not there yet
            if not missing:
                break
        rules = json.load(urllib.request.urlopen(f"{address}/api/v1/rules", timeout=60.0))["data"]["groups"][0]["rules"]
        estimates = values(address, "sum(cylinder_friction_live_estimates_total)")
    assert missing == set()
    assert [rule for rule in rules if rule["health"] == "err"] == []
    assert estimates[0] > 10.0


def test_what_the_alerts_ask_for_is_what_the_service_gives(samples: Array, model: Path, tmp_path: Path) -> None:
    """Each name in the alerts and panels is one of the service's."""
    port = free_port()
    with running(model, tmp_path, port), urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics") as reply:
        names = {line.split()[2] for line in reply.read().decode().splitlines() if line.startswith("# TYPE")}
    text = (DEPLOY / "prometheus-alerts.yml").read_text("utf-8") + json.dumps(PANELS)
    asked = {word.removesuffix("_bucket") for word in re.findall(r"cylinder_friction_live_\w+", text)}
    assert {word.removesuffix("_total") for word in asked} <= {name.removesuffix("_total") for name in names}
