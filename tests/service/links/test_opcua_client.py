"""Samples of a public OPC UA server become sessions: arrays by their index, single values by their time stamps."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from asyncua import Server, ua

from cylinder_friction.arrays import Array
from cylinder_friction.estimators.hybrid import HybridEstimator
from cylinder_friction.execution.ports import free_port
from cylinder_friction.service.links.opcua_client import OpcUaClientLink
from cylinder_friction.service.live.connection import Peers
from cylinder_friction.service.live.frames import EstimateBlock
from cylinder_friction.service.live.service import LiveService, LiveSession
from cylinder_friction.service.live.settings import OpcUaClientSettings, OpcUaSource

pytestmark = pytest.mark.extended
FIRST = 340_000_000_000
"""Index of a sample of the year 2023, by its time."""
INPUTS = {name: f"ns=2;s={name}" for name in ("pressure_1_pa", "pressure_2_pa", "position_m")}
BAD, LEFT_OUT = {80: "pressure_1_pa"}, {50: "position_m"}
ARRAY = OpcUaSource("by array", samples="ns=2;s=samples")
VALUES = OpcUaSource("by value", inputs=INPUTS)


@asynccontextmanager
async def plant(port: int) -> AsyncIterator[Server]:
    """A server with a node of arrays and a node per input."""
    server = Server()
    await server.init()
    server.set_endpoint(f"opc.tcp://127.0.0.1:{port}/")
    server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    await server.register_namespace("urn:plant")
    null = ua.VariantType.Null
    for name in ("samples", *INPUTS):
        node = ua.NodeId(name, 2)
        await server.nodes.objects.add_variable(node, ua.QualifiedName(name, 2), None, null, ua.NodeId(11))
    async with server:
        yield server


Rows = dict[int, tuple[float, ...]]


@asynccontextmanager
async def followed(service: LiveService, port: int, source: OpcUaSource) -> AsyncIterator[tuple[OpcUaClientLink, Rows]]:
    """A link that follows them, with what the service estimates by index."""
    rows: Rows = {}

    def keep(_: LiveSession, block: EstimateBlock) -> None:
        for row, newtons in enumerate(block.newtons.tolist()):
            rows[block.index + row] = tuple(newtons)

    service.takers = [keep]
    link = OpcUaClientLink(OpcUaClientSettings(f"opc.tcp://127.0.0.1:{port}/", (source,), publishing_ms=10.0))
    async with link.running(service, Peers()):
        try:
            yield link, rows
        except AssertionError as error:
            error.add_note(f"{len(rows)} rows, {link.counts}, {[each.order for each in service.sessions.values()]}")
            raise
    service.journal.close()


async def until(true: Any, service: LiveService | None = None) -> None:
    for _ in range(2000):
        if service is not None:
            service.overdue()
        if true():
            return
        await asyncio.sleep(0.01)
    raise AssertionError("it did not happen")


async def write_array(server: Server, index: int, rows: Array) -> None:
    value = ua.Variant([float(index), *rows.ravel().tolist()], ua.VariantType.Double)
    await server.write_attribute_value(ua.NodeId("samples", 2), ua.DataValue(value))


async def write_row(server: Server, index: int, row: Array, bad: str = "", left_out: str = "") -> None:
    moment = datetime.fromtimestamp(0.005 * index + 0.001, UTC)
    for name, value in zip(INPUTS, row.tolist(), strict=True):
        status = ua.StatusCode(ua.StatusCodes.BadSensorFailure if name == bad else ua.StatusCodes.Good)
        if name != left_out:
            written = ua.DataValue(ua.Variant(value, ua.VariantType.Double), status, moment)
            await server.write_attribute_value(ua.NodeId(name, 2), written)


async def subscribed(link: OpcUaClientLink) -> None:
    await until(lambda: link.counts["connected"] == 1)


def test_arrays_are_stepped_by_index_over_a_break(service: LiveService, newtons: Array, samples: Array) -> None:
    """Arrays that overlap make up for those that a break lost; what is no array of samples is counted."""
    port = free_port()

    async def run() -> tuple[Rows, dict[str, int], dict[str, int]]:
        async with followed(service, port, ARRAY) as (link, rows):
            async with plant(port) as server:
                await subscribed(link)
                for begin in range(0, 300, 10):
                    await write_array(server, begin, samples[begin : begin + 20])
                await write_array(server, 0, samples[:1, :2])
                await until(lambda: len(rows) == 310)
            async with plant(port) as server:
                await write_array(server, 250, samples[250:350])
                await until(lambda: len(rows) == 350)
            return rows, dict(link.counts), vars(service.sessions["by array"].order.counts)

    rows, events, counts = asyncio.run(run())
    assert [rows[index] for index in range(350)] == [tuple(row) for row in newtons[:350].tolist()]
    assert events["no samples"] == 1
    assert events["connected"] == 2
    assert (counts["missing"], counts["skipped"], counts["resets"]) == (0, 0, 0)
    assert counts["duplicate"] == 29 * 10 + 60


def test_values_make_rows_by_their_time(service: LiveService, small_hybrid: HybridEstimator, samples: Array) -> None:
    """A value that does not come, or comes as bad, is no number; a row of which nothing comes is a gap."""
    expected = samples[:200].copy()
    expected[50, 2] = expected[80, 0] = np.nan
    expected[120:123] = np.nan

    async def run() -> tuple[Rows, dict[str, int], dict[str, int]]:
        port = free_port()
        async with plant(port) as server, followed(service, port, VALUES) as (link, rows):
            await subscribed(link)
            for place, row in enumerate(samples[:200]):
                if not 120 <= place < 123:
                    await write_row(server, FIRST + place, row, BAD.get(place, ""), LEFT_OUT.get(place, ""))
                if place % 20 == 0:
                    await asyncio.sleep(0.01)
            await until(lambda: len(rows) == 200, service)
            return rows, dict(link.counts), vars(service.sessions["by value"].order.counts)

    rows, events, counts = asyncio.run(run())
    assert min(rows) == FIRST
    stepped = small_hybrid.real_time().run(expected)[0]
    assert [rows[FIRST + place] for place in range(200)] == [tuple(row) for row in stepped.tolist()]
    assert events["incomplete"] == 1
    assert "doubled" not in events
    assert (counts["missing"], counts["resets"]) == (3, 0)


def test_a_session_that_was_closed_while_it_rested_goes_on(service: LiveService, samples: Array) -> None:
    async def run() -> int:
        port = free_port()
        async with plant(port) as server, followed(service, port, ARRAY) as (link, rows):
            await subscribed(link)
            await write_array(server, 0, samples[:20])
            await until(lambda: len(rows) == 20)
            service.keep()
            service.limits = replace(service.limits, idle_s=1e-9)
            assert service.close_idle() == ["by array"]
            await write_array(server, 20, samples[20:40])
            await until(lambda: len(rows) == 40)
            return service.sessions["by array"].order.counts.stepped

    assert asyncio.run(run()) == 40


def test_nodes_for_other_inputs_than_the_models_are_refused(service: LiveService) -> None:
    async def run() -> None:
        async with followed(service, 1, OpcUaSource("press", inputs={"position_m": "i=1"})):
            pass

    with pytest.raises(ValueError, match=r"session 'press' has nodes for \['position_m'\]; the model takes"):
        asyncio.run(run())


@pytest.mark.parametrize(
    ("source", "words"),
    [({}, "expected either samples, one node, or inputs"), ({"samples": "i=1", "inputs": INPUTS}, "expected either")],
)
def test_a_source_has_one_kind_of_nodes(source: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        OpcUaSource("press", **source)
    with pytest.raises(ValueError, match="expected both user and password_file, or neither"):
        OpcUaClientSettings("opc.tcp://plc", (ARRAY,), user="me")
