"""Sparkplug B by a real broker, read with Google's protobuf and the specification's field numbers."""

import queue
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given
from hypothesis import strategies as st
from paho.mqtt.client import Client as PahoClient

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction.service.client import Client
from cylinder_friction.service.links.sparkplug import SparkplugLink
from cylinder_friction.service.links.sparkplug_payload import REBIRTH, SparkplugError, asks_for_rebirth
from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.journal import Journal
from cylinder_friction.service.live.service import LiveService
from cylinder_friction.service.live.settings import BrokerSettings, SparkplugSettings
from live_process import PATIENT, Mosquitto, by_hand, needs_broker, served

KINDS = {"u32": 13, "u64": 4, "f64": 1, "bool": 8, "text": 9, "metric": 11}
METRIC = [
    ("name", 1, "text"), ("alias", 2, "u64"), ("timestamp", 3, "u64"), ("datatype", 4, "u32"), ("int_value", 10, "u32"),
    ("long_value", 11, "u64"), ("double_value", 13, "f64"), ("boolean_value", 14, "bool"),
]  # fmt: skip
PAYLOAD = [("timestamp", 1, "u64"), ("metrics", 2, "metric"), ("seq", 3, "u64")]


def payload_class() -> Any:
    """The specification's Payload, as far as it is used here."""
    file = descriptor_pb2.FileDescriptorProto(name="sparkplug_b.proto", package="b", syntax="proto2")
    for name, fields in (("Metric", METRIC), ("Payload", PAYLOAD)):
        described = file.message_type.add(name=name)
        for field, number, kind in fields:
            added = described.field.add(name=field, number=number, type=KINDS[kind], label=3 if kind == "metric" else 1)
            if kind == "metric":
                added.type_name = ".b.Metric"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("b.Payload"))


Payload = payload_class()


def rebirth(value: bool = True, name: str = REBIRTH) -> bytes:
    command = Payload(timestamp=1)
    command.metrics.add(name=name, timestamp=1, datatype=11, boolean_value=value)
    return bytes(command.SerializeToString())


@needs_broker
def test_births_data_and_deaths(
    service: LiveService, newtons: Array, flags: Array, samples: Array, tmp_path: Path, broker: Mosquitto
) -> None:
    service.limits = replace(PATIENT, idle_s=2.0)
    link = SparkplugLink(SparkplugSettings(BrokerSettings(port=broker.port), "plant", "live", rate_hz=20.0))
    port = free_port()
    seen: list[tuple[str, Any]] = []

    def use(host: PahoClient, got: queue.Queue[tuple[str, bytes]]) -> None:
        with Client(f"ws://127.0.0.1:{port}/stream", "hall 3/press", 0.005, start_time_s=100.0) as client:

            def take(kind: str) -> None:
                while not seen or kind not in seen[-1][0]:
                    topic, payload = got.get(timeout=60.0)
                    if "NCMD" not in topic:
                        seen.append((topic, Payload.FromString(payload)))

            take("NBIRTH")
            client.send(samples[:100])
            take("DBIRTH")
            client.send(samples[100:400])
            take("DDATA")
            for other in (rebirth(value=False), rebirth(name="Node Control/Reboot"), b"\xff\xff no payload"):
                host.publish("spBv1.0/plant/NCMD/live", other)
            host.publish("spBv1.0/plant/NCMD/live", rebirth())
            take("NBIRTH")
            take("DBIRTH")
            client.send(samples[400:500])
            take("DDATA")
            take("DDEATH")

    with by_hand(broker, "spBv1.0/plant/#") as (host, got):  # before the node, so that its first birth is seen
        served([link], service, tmp_path, lambda: use(host, got), port)
    kinds = [topic.split("/")[2] for topic, _ in seen]
    last_birth = len(kinds) - 1 - kinds[::-1].index("NBIRTH")
    assert kinds[last_birth:] == ["NBIRTH", "DBIRTH", "DDATA", "DDEATH"]
    assert [payload.seq for _, payload in seen[last_birth:]] == [0, 1, 2, 3]
    node = {metric.name: metric for metric in seen[last_birth][1].metrics}
    assert (node["bdSeq"].datatype, node["bdSeq"].long_value) == (4, 0)
    assert (node[REBIRTH].datatype, node[REBIRTH].boolean_value) == (11, False)
    topic, data = seen[-2]
    assert topic == "spBv1.0/plant/DDATA/live/hall 3%2Fpress"
    values = {metric.name: metric for metric in data.metrics}
    assert [values[name].double_value for name in ("friction_n", "lower_n", "upper_n")] == newtons[499].tolist()
    assert (values["flags"].int_value, values["index"].long_value) == (int(flags[499]), 499)
    assert {metric.timestamp for metric in data.metrics} == {int(1e3 * (100.0 + 0.005 * 499))}
    assert link.counts == {"connected": 1, "rebirth": 1, "other command": 2, "no payload": 1}


@needs_broker
def test_death_has_the_number_of_its_birth(engine: Engine, tmp_path: Path, broker: Mosquitto) -> None:
    link = SparkplugLink(SparkplugSettings(BrokerSettings(port=broker.port), "plant"))

    def numbers(payload: Any) -> tuple[int, bool]:
        return payload.metrics[0].long_value, payload.HasField("seq")

    def connects(times: int) -> None:
        deadline = time.monotonic() + 60.0
        while link.counts["connected"] < times and time.monotonic() < deadline:
            time.sleep(0.05)
        assert link.counts["connected"] == times

    def use() -> None:
        connects(1)
        broker.kill()
        broker.start()
        connects(2)

    served([link], LiveService(engine, Journal(tmp_path / "journal.db")), tmp_path, use)
    connected = link._connects
    with by_hand(broker, "spBv1.0/plant/#") as (_, got):
        served([link], LiveService(engine, Journal(tmp_path / "journal.db")), tmp_path, lambda: connects(3))
        birth, death = (Payload.FromString(got.get(timeout=60.0)[1]) for _ in range(2))
    assert numbers(birth) == (connected + 1, True)
    assert numbers(death) == (connected + 1, False)


@needs_broker
def test_a_flood_of_commands_makes_few_births(service: LiveService, tmp_path: Path, broker: Mosquitto) -> None:
    link = SparkplugLink(SparkplugSettings(BrokerSettings(port=broker.port), "plant", "live"))

    def use(host: PahoClient, got: queue.Queue[tuple[str, bytes]]) -> None:
        while "NBIRTH" not in got.get(timeout=60.0)[0]:
            pass
        for _ in range(100):
            host.publish("spBv1.0/plant/NCMD/live", rebirth())
        deadline = time.monotonic() + 60.0
        while link.counts["rebirth"] < 100 and time.monotonic() < deadline:
            time.sleep(0.05)

    with by_hand(broker, "spBv1.0/plant/#") as (host, got):
        served([link], service, tmp_path, lambda: use(host, got))
        topics = list(iter(lambda: got.get(timeout=60.0)[0], "spBv1.0/plant/NDEATH/live"))
    assert link.counts["rebirth"] == 100
    assert topics.count("spBv1.0/plant/NBIRTH/live") < 50


@given(st.binary(max_size=80))
def test_garbage_is_no_command(payload: bytes) -> None:
    try:
        assert not asks_for_rebirth(payload)
    except SparkplugError as error:
        assert "expected a Sparkplug B payload" in str(error)  # noqa: PT017 - either outcome is right


def test_a_node_is_one_level() -> None:
    with pytest.raises(ValueError, match=r"node\n.*expected up to 1 levels"):
        SparkplugSettings(node="a/b")
