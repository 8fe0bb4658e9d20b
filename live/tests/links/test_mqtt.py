"""By a real broker: the same bits as the step, also when the broker or the service goes away; nothing ends the link."""

import json
import queue
import subprocess
import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from paho.mqtt.client import Client as PahoClient

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction_live.client import Client
from cylinder_friction_live.frames import EstimateBlock, SampleBlock, pack_samples, unpack
from cylinder_friction_live.links import mqtt
from cylinder_friction_live.links.mqtt import MqttLink
from cylinder_friction_live.service import LiveService
from cylinder_friction_live.settings import BrokerSettings, MqttSettings
from live_process import PATIENT, Mosquitto, Relay, by_hand, needs_broker, served
from live_service import running

OPEN = {"session": "press", "inputs": ["pressure_1_pa", "pressure_2_pa", "position_m"], "sample_time_s": 0.005}


def link_to(broker: Mosquitto, **settings: Any) -> MqttLink:
    return MqttLink(MqttSettings(BrokerSettings(port=broker.port), **settings))


def opened(client: PahoClient, got: queue.Queue[tuple[str, bytes]], topic: str) -> int:
    """Open the session by hand; return its handle."""
    client.publish(topic, json.dumps({"open": OPEN}), qos=1)
    return int(json.loads(got.get(timeout=60.0)[1])["opened"]["handle"])


def all_estimates(client: Client) -> tuple[Array, Array]:
    parts = []
    while len((part := client.estimates(0.5))[2]):
        parts.append(part)
    return np.concatenate([each[1] for each in parts]), np.concatenate([each[2] for each in parts])


@needs_broker
def test_a_killed_broker_loses_nothing(
    service: LiveService, newtons: Array, flags: Array, samples: Array, broker: Mosquitto
) -> None:
    """The client sends again what is not acknowledged, and gets again what it has not read."""

    def use() -> tuple[Array, Array]:
        with Client(f"mqtt://127.0.0.1:{broker.port}/plant/hall 3/press7", "press", 0.005) as client:
            for begin in range(0, len(samples), 100):
                client.send(samples[begin : begin + 100])
                if begin == 300:
                    broker.kill()
                    threading.Timer(1.0, broker.start).start()
            client.wait_until_kept()
            return all_estimates(client)

    link = link_to(broker, prefix="plant/hall 3")
    got = served([link], service, use)
    np.testing.assert_array_equal(got[0], newtons)
    np.testing.assert_array_equal(got[1], flags)
    assert link.counts["connected"] == 2


@needs_broker
def test_a_cut_needs_no_second_opening(service: LiveService, newtons: Array, samples: Array, broker: Mosquitto) -> None:
    """The broker keeps what comes meanwhile: even a publisher that never sends again loses nothing."""

    def use() -> bytes:
        with by_hand(broker, "cylinder-friction/c/out", "cylinder-friction/state") as (client, got):
            assert b"true" in got.get(timeout=60.0)[1]
            handle = opened(client, got, "cylinder-friction/c/in")
            for index in range(0, 1000, 50):
                block = SampleBlock(handle, index, 0.0, samples[index : index + 50])
                client.publish("cylinder-friction/c/in", pack_samples(block), qos=1)
                if index == 400:
                    relay.cut()
            rows: dict[int, bytes] = {}
            while len(rows) < 1000:
                topic, payload = got.get(timeout=60.0)
                is_frames = topic.endswith("/out") and not payload.startswith(b"{")  # QoS 1 may bring `opened` twice
                for each in unpack(payload) if is_frames else ():
                    if isinstance(each, EstimateBlock):
                        rows |= {each.index + row: newton.tobytes() for row, newton in enumerate(each.newtons)}
            return b"".join(rows[index] for index in range(1000))

    with Relay(broker.port) as relay:
        link = MqttLink(MqttSettings(BrokerSettings(port=relay.port)))
        assert served([link], service, use) == newtons[:1000].tobytes()
    assert link.counts["connected"] == 2
    assert service.sessions["press"].order.counts.missing == 0


@needs_broker
@pytest.mark.extended
def test_a_kill_loses_nothing(newtons: Array, samples: Array, model: Path, tmp_path: Path, broker: Mosquitto) -> None:
    port, settings = free_port(), {"mqtt": {"broker": {"port": broker.port}}}
    with running(model, tmp_path, port, settings) as first:
        client = Client(f"mqtt://127.0.0.1:{broker.port}/cylinder-friction/press7", "press", 0.005)
        with client:
            client.send(samples[:400])
            time.sleep(1.2)
            client.send(samples[400:600])
            first.kill()
            first.wait()
            client.send(samples[600:700])  # the broker takes it; the service that comes never sees it
            with running(model, tmp_path, port, settings):
                client.send(samples[700:])
                client.wait_until_kept()
                got, _ = all_estimates(client)
    np.testing.assert_array_equal(got, newtons)


@needs_broker
def test_no_message_ends_the_link(service: LiveService, newtons: Array, samples: Array, broker: Mosquitto) -> None:
    service.limits = replace(PATIENT, message_bytes=10_000, connections_per_user=2)
    link = link_to(broker, prefix="plant")

    def use() -> None:
        with by_hand(broker, "plant/+/out", "plant/state") as (client, got):
            topic, payload = got.get(timeout=60.0)
            assert (topic, json.loads(payload)["online"]) == ("plant/state", True)
            for name, payload, retain, words in (
                ("a", b"\x01garbage", False, "got frames without an open session; open it first"),
                ("b", b"\x01garbage", False, "got frames without an open session; open it first"),
                ("a", b"{garbage", False, "expected"),
                ("a", b"\xffgarbage", False, "expected a header of 24"),
                ("a", b"{\xff", False, "expected"),
                ("a", bytes(10_001), False, "got a message of more than 10000 bytes"),
                ("b", b"{}", True, "expected"),
                ("c", b"{}", False, "got a client more than 2; try later"),
            ):
                client.publish(f"plant/{name}/in", payload, qos=1, retain=retain)
                topic, reply = got.get(timeout=60.0)
                assert topic == f"plant/{name}/out"
                assert words in reply.decode()
            client.publish("plant/a/in", bytes(50_000), qos=1)  # the broker keeps it to itself
            client.publish("plant/a/other", b"{}", qos=1)
            handle = opened(client, got, "plant/a/in")
            client.publish("plant/a/in", pack_samples(SampleBlock(handle, 0, 10.0, samples[:50])), qos=1)
            assert newtons[:50].tobytes() in got.get(timeout=60.0)[1]

    served([link], service, use)
    assert link.counts == {"connected": 1, "not open": 2, "too large": 1, "too many clients": 1}


@needs_broker
def test_a_flood_of_names_locks_nobody_out(
    service: LiveService, newtons: Array, samples: Array, broker: Mosquitto, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Not even a client of the same broker that comes after it: clients that are silent give way."""
    monkeypatch.setattr(mqtt, "SILENT_S", 0.1)
    service.limits = replace(PATIENT, connections=10, connections_per_user=5)
    link, port = link_to(broker), free_port()

    def use() -> None:
        with by_hand(broker, "cylinder-friction/state") as (client, got):
            assert b"true" in got.get(timeout=60.0)[1]
            for place in range(50):
                text = json.dumps({"open": OPEN | {"session": f"flood {place}"}})
                client.publish(f"cylinder-friction/flood{place}/in", text, qos=1)
            while link.counts["too many clients"] + link.counts["silent"] < 45:
                time.sleep(0.01)
            time.sleep(0.2)
            for url in (f"ws://127.0.0.1:{port}/stream", f"mqtt://127.0.0.1:{broker.port}/cylinder-friction/late"):
                with Client(url, f"press by {url[:4]}", 0.005) as late:
                    late.send(samples[:50])
                    np.testing.assert_array_equal(late.estimates(60.0)[1], newtons[:50])

    served([link], service, use, port)
    assert link.counts["silent"] > 0


@needs_broker
def test_a_client_that_is_too_fast_opens_anew(service: LiveService, samples: Array, broker: Mosquitto) -> None:
    """While the service takes no more, messages wait up to their limit; the one beyond ends the client's turn."""
    service.limits = replace(PATIENT, unkept_rows=100)
    link = link_to(broker, waiting_messages=5)

    def use() -> tuple[list[str], int]:
        with by_hand(broker, "cylinder-friction/fast/out", "cylinder-friction/state") as (client, got):
            assert b"true" in got.get(timeout=60.0)[1]
            told, handle = list[str](), opened(client, got, "cylinder-friction/fast/in")
            for index in range(0, 1000, 50):
                block = SampleBlock(handle, index, 0.0, samples[index : index + 50])
                client.publish("cylinder-friction/fast/in", pack_samples(block), qos=1)
            while "closed" not in (told[-1] if told else ""):
                payload = got.get(timeout=60.0)[1]
                told += [payload.decode()] if payload.startswith(b"{") else []
            client.publish("cylinder-friction/fast/in", json.dumps({"open": OPEN}), qos=1)
            reply = ""
            while "opened" not in reply:
                payload = got.get(timeout=60.0)[1]
                reply = payload.decode() if payload.startswith(b"{") else ""
            return told, int(json.loads(reply)["opened"]["next_index"])

    told, next_index = served([link], service, use)
    assert "got more than 5 messages that wait; open the session again" in told[-1]
    assert link.counts["overflow"] == 1
    assert next_index == service.sessions["press"].next_index < 1000  # no later sample came before a refused one
    assert service.sessions["press"].order.counts.missing == 0


@needs_broker
def test_results_are_retained_json(service: LiveService, newtons: Array, samples: Array, broker: Mosquitto) -> None:
    def use() -> dict[str, Any]:
        with Client(f"mqtt://127.0.0.1:{broker.port}/cylinder-friction/c", "hall 3/press", 0.005) as client:
            client.send(samples[:300])
            client.wait_until_kept()
            time.sleep(0.3)
        with by_hand(broker, "cylinder-friction/results/hall 3/#") as (_, got):
            topic, payload = got.get(timeout=60.0)
            assert topic == "cylinder-friction/results/hall 3/press"
        with Client(f"mqtt://127.0.0.1:{broker.port}/cylinder-friction/d", "in", 0.005) as client:
            client.send(samples[:300])  # its results have a topic like one of a client
            client.wait_until_kept()
        with by_hand(broker, "cylinder-friction/results/+") as (_, got):
            assert got.get(timeout=60.0)[0] == "cylinder-friction/results/in"
            time.sleep(0.5)
            assert got.empty(), "nothing is answered to results"
        return dict(json.loads(payload))

    link = link_to(broker, results_hz=10.0)
    result = served([link], service, use)
    assert result["index"] == 299
    assert result["time_s"] == pytest.approx(time.time(), abs=60.0)
    assert [result[name] for name in ("friction_n", "lower_n", "upper_n")] == newtons[299].tolist()
    with by_hand(broker, "cylinder-friction/state") as (_, got):
        assert json.loads(got.get(timeout=60.0)[1])["online"] is False


@needs_broker
def test_tls_and_password(service: LiveService, samples: Array, tmp_path: Path, certificate: tuple[Path, Path]) -> None:
    (public, key), passwords = certificate, tmp_path / "passwords"
    subprocess.run(["mosquitto_passwd", "-b", "-c", passwords, "live", "a word"], check=True, capture_output=True)
    given = tmp_path / "password"
    given.write_text("a word\n", encoding="utf-8")
    secured = [f"certfile {public}", f"keyfile {key}", "allow_anonymous false", f"password_file {passwords}"]
    with Mosquitto(tmp_path, *secured) as broker:
        place = BrokerSettings("localhost", broker.port, True, str(public), "live", str(given))
        url = f"mqtts://live:a%20word@localhost:{broker.port}/cylinder-friction/press"

        def use() -> int:
            with Client(url, "press", 0.005, ca=public) as client:
                client.send(samples[:50])
                return len(client.estimates(10.0)[2])

        assert served([MqttLink(MqttSettings(place))], service, use) == 50
        link = MqttLink(MqttSettings(replace(place, user=None, password_file=None)))
        served([link], service, lambda: time.sleep(1.0))
        assert link.counts["connected"] == 0


@needs_broker
def test_a_broker_that_refuses_is_tried_again(service: LiveService, tmp_path: Path) -> None:
    with Mosquitto(tmp_path, "allow_anonymous false") as refusing:
        link = link_to(refusing)

        def use() -> None:
            time.sleep(0.5)
            assert link.counts["connected"] == 0
            refusing.kill()
            refusing.configure("allow_anonymous true")
            refusing.start()
            deadline = time.monotonic() + 60.0
            while not link.counts["connected"] and time.monotonic() < deadline:
                time.sleep(0.05)

        served([link], service, use)
    assert link.counts["connected"] == 1
