"""A public OPC UA client sees each session's newtons, units, quality and health."""

import asyncio
import signal
import subprocess
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from asyncua import Client, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography.x509.oid import ExtendedKeyUsageOID

from cylinder_friction.arrays import Array
from cylinder_friction.execution.ports import free_port
from cylinder_friction.realtime.flags import Flag
from cylinder_friction_live.client import Client as LiveClient
from cylinder_friction_live.connection import Peers
from cylinder_friction_live.frames import SampleBlock
from cylinder_friction_live.links import opcua
from cylinder_friction_live.links.opcua import APPLICATION, NAMESPACE, OpcUaLink
from cylinder_friction_live.links.opcua_quality import Health, health_of, status_of
from cylinder_friction_live.service import LiveService, LiveSession
from cylinder_friction_live.settings import OpcUaServerSettings
from live_process import keep
from live_service import running

pytestmark = pytest.mark.extended
BEGAN_S = 1.7e9
PATIENCE_S = 120.0
"""Time limit for what happens at once on a machine that is not busy [s]."""


@asynccontextmanager
async def serving(service: LiveService, **settings: Any) -> AsyncIterator[OpcUaLink]:
    """An OPC UA server of the service."""
    link = OpcUaLink(OpcUaServerSettings(port=free_port(), update_hz=10.0, **settings))
    service.takers = [link.note]
    async with link.running(service, Peers()):
        yield link
    service.journal.close()


@asynccontextmanager
async def shown(service: LiveService, **settings: Any) -> AsyncIterator[Client]:
    """A client of such a server."""
    async with serving(service, **settings) as link, connected(link.address) as client:
        yield client


def opened(service: LiveService, name: str) -> LiveSession:
    return service.open(name, service.engine.inputs, service.engine.sample_time_s)


@asynccontextmanager
async def connected(address: str) -> AsyncIterator[Client]:
    """A client of a server that may not be there yet."""
    client = Client(address, timeout=PATIENCE_S)

    async def is_there() -> bool:
        await client.connect()
        return True

    await until(is_there)
    try:
        yield client
    finally:
        await client.disconnect()


async def until(true: Callable[[], Awaitable[object]]) -> None:
    """Wait until it neither fails nor is false."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            with suppress(ua.UaError, OSError):
                if await true():
                    return
            await asyncio.sleep(0.05)


async def values(client: Client, session: str) -> dict[str, ua.DataValue]:
    number = await client.get_namespace_index(NAMESPACE)
    names = ("Friction", "LowerBound", "UpperBound", "Flags", "SampleIndex", "SampleLag", "DeviceHealth")
    nodes = [client.get_node(ua.NodeId(f"{session}/{name}", number)) for name in names]
    return dict(zip(names, await client.read_attributes(nodes), strict=True))


async def values_once(client: Client, session: str, **wanted: int) -> dict[str, ua.DataValue]:
    """Values once the sample has that ``index``, or friction that ``status``."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            found = await values(client, session)
            shown = {"index": found["SampleIndex"].Value.Value, "status": found["Friction"].StatusCode.value}
            if wanted.items() <= shown.items():
                return found
            await asyncio.sleep(0.02)


def test_a_client_reads_newtons_and_quality(service: LiveService, newtons: Array, flags: Array, samples: Array) -> None:
    broken = np.vstack([samples[:600], [[np.nan, *samples[600, 1:]]]])

    async def look() -> tuple[dict[str, ua.DataValue], ...]:
        async with shown(service) as client:
            session = opened(service, "press 7")
            service.receive([SampleBlock(session.handle, 0, BEGAN_S, broken[:1])])
            first = await values_once(client, "press 7", index=0)
            service.receive([SampleBlock(session.handle, 1, BEGAN_S + 0.005, broken[1:600])])
            good = await values_once(client, "press 7", index=599)
            service.receive([SampleBlock(session.handle, 600, BEGAN_S + 3.0, broken[600:])])
            bad = await values_once(client, "press 7", index=600)
            keep(service)
            service.limits = replace(service.limits, idle_s=1e-9)
            assert service.close_idle() == ["press 7"]
            closed = await values_once(client, "press 7", status=ua.StatusCodes.BadNoCommunication)
            return first, good, bad, closed

    first, good, bad, closed = asyncio.run(look())
    assert first["Friction"].StatusCode == status_of(int(flags[0]))
    assert first["DeviceHealth"].Value.Value == Health.CHECK_FUNCTION
    shown_newtons = [good[name].Value.Value for name in ("Friction", "LowerBound", "UpperBound")]
    assert shown_newtons == newtons[599].tolist()
    assert good["Flags"].Value.Value == flags[599]
    assert good["Friction"].StatusCode == status_of(int(flags[599]))
    assert good["Friction"].SourceTimestamp.timestamp() == pytest.approx(BEGAN_S + 599 * 0.005, abs=1e-5)
    assert good["SampleLag"].Value.Value > 0.0
    assert bad["Friction"].StatusCode.value == ua.StatusCodes.BadSensorFailure
    assert bad["Friction"].Value.Value is None
    assert bad["DeviceHealth"].Value.Value == Health.FAILURE
    assert closed["Friction"].StatusCode.value == ua.StatusCodes.BadNoCommunication
    assert closed["DeviceHealth"].Value.Value == Health.CHECK_FUNCTION


def test_the_address_space_states_units_ranges_and_names(service: LiveService, samples: Array) -> None:
    async def look() -> None:
        async with shown(service, range_n=3000.0) as client:
            session = opened(service, "press 7")
            service.receive([SampleBlock(session.handle, 0, BEGAN_S, samples[:3])])
            await values_once(client, "press 7", index=2)
            number = await client.get_namespace_index(NAMESPACE)
            devices = await client.get_namespace_index("http://opcfoundation.org/UA/DI/")
            path = [f"{number}:CylinderFriction", f"{number}:press 7"]
            press = await client.nodes.objects.get_child(path)
            friction = await press.get_child(f"{number}:Friction")
            assert await friction.read_type_definition() == ua.NodeId(ua.ObjectIds.AnalogUnitRangeType)
            unit = await (await friction.get_child("0:EngineeringUnits")).read_value()
            assert (unit.UnitId, unit.DisplayName.Text) == (5129559, "N")
            extent = await (await friction.get_child("0:EURange")).read_value()
            assert (extent.Low, extent.High) == (-3000.0, 3000.0)
            names = await (await press.get_child([f"{number}:Flags", "0:OptionSetValues"])).read_value()
            assert [each.Text for each in names] == [flag.name for flag in Flag]
            health = await press.get_child(f"{devices}:DeviceHealth")
            kind = client.get_node(await health.read_data_type())
            assert (await kind.read_browse_name()).Name == "DeviceHealthEnumeration"
            texts = await (await kind.get_child("0:EnumStrings")).read_value()
            assert [text.Text for text in texts] == [each.name for each in Health]
            with pytest.raises(ua.UaStatusCodeError):
                await friction.write_value(1.0)

    asyncio.run(look())


def test_sessions_beyond_the_configured_number_are_counted_not_shown(service: LiveService, samples: Array) -> None:
    async def look() -> int:
        async with serving(service, sessions=1) as link, connected(link.address) as client:
            for name in ("one", "two"):
                service.receive([SampleBlock(opened(service, name).handle, 0, BEGAN_S, samples[:3])])
            await values_once(client, "one", index=2)
            while not link.counts["not shown"]:
                await asyncio.sleep(0.02)
            return len(await (await client.nodes.objects.get_child("2:CylinderFriction")).get_children())

    assert asyncio.run(look()) == 1


def test_a_session_that_comes_back_has_its_object_again(service: LiveService, samples: Array) -> None:
    async def look() -> None:
        async with shown(service) as client:
            service.limits = replace(service.limits, idle_s=1e-9)
            for begin in (0, 3):
                session = opened(service, "press")
                service.receive([SampleBlock(session.handle, begin, BEGAN_S, samples[begin : begin + 3])])
                found = await values_once(client, "press", index=begin + 2)
                assert found["Friction"].StatusCode.value == ua.StatusCodes.UncertainSubNormal
                keep(service)
                assert service.close_idle() == ["press"]
                await values_once(client, "press", status=ua.StatusCodes.BadNoCommunication)

    asyncio.run(look())


def test_a_session_that_gives_nothing_becomes_uncertain(
    service: LiveService, samples: Array, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(opcua, "SILENT_S", 0.2)

    async def look() -> None:
        async with shown(service) as client:
            session = opened(service, "press")
            service.receive([SampleBlock(session.handle, 0, BEGAN_S, samples[:600])])
            found = await values_once(client, "press", status=ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
            assert found["SampleIndex"].Value.Value == 599
            assert found["DeviceHealth"].Value.Value == Health.CHECK_FUNCTION

    asyncio.run(look())


def test_a_service_shows_its_sessions_and_ends_while_a_client_is_connected(
    model: Path, samples: Array, tmp_path: Path
) -> None:
    port, shown_at = free_port(), free_port()

    async def look(service: subprocess.Popen[bytes]) -> float:
        async with connected(f"opc.tcp://127.0.0.1:{shown_at}/") as client:
            await values_once(client, "press", index=8)
            service.send_signal(signal.SIGTERM)
            begun_s = time.monotonic()
            while service.poll() is None:
                await asyncio.sleep(0.02)
            return time.monotonic() - begun_s

    with (
        running(model, tmp_path, port, {"opcua_server": {"port": shown_at}}) as service,
        LiveClient(f"ws://127.0.0.1:{port}/stream", "press", 0.005) as sender,
    ):
        sender.send(samples[:9])
        assert asyncio.run(look(service)) < 10.0


def test_with_tokens_and_a_certificate_only_known_users_get_in(service: LiveService, tmp_path: Path) -> None:
    (tmp_path / "tokens").write_text(f"{sha256(b'a token').hexdigest()} read\n", "ascii")
    files = {name: tmp_path / name for name in ("key.pem", "certificate.der")}
    settings = OpcUaServerSettings(port=free_port(), certificate=files["certificate.der"], private_key=files["key.pem"])
    link = OpcUaLink(settings, tmp_path / "tokens")

    async def made() -> None:
        usage = [ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]
        await setup_self_signed_certificate(files["key.pem"], files["certificate.der"], APPLICATION, "x", usage, {})

    async def comes(user: str | None, password: str, encrypted: bool = True) -> Client:
        client = Client(link.address, timeout=PATIENCE_S)
        if encrypted:
            await client.set_security(SecurityPolicyBasic256Sha256, files["certificate.der"], files["key.pem"])
        if user is not None:
            client.set_user(user)
            client.set_password(password)
        return client

    async def enter(user: str | None, password: str, encrypted: bool = True) -> int:
        async with await comes(user, password, encrypted) as client:
            return await client.get_namespace_index(NAMESPACE)

    async def is_gone(client: Client) -> bool:
        try:
            await client.get_namespace_index(NAMESPACE)
        except (ua.UaError, ConnectionError):
            return True
        return False

    async def run() -> None:
        await made()
        async with link.running(service, Peers()):
            await until(lambda: enter("anybody", "a token"))
            for wrong in (("anybody", "another"), (None, ""), ("anybody", "a token", False)):
                with pytest.raises((ua.UaError, ConnectionError)):
                    await enter(*wrong)
            inside = await comes("anybody", "a token")
            await inside.connect()
            (tmp_path / "tokens").write_text(f"{sha256(b'a new token').hexdigest()} read\n", "ascii")
            await until(lambda: enter("anybody", "a new token"))
            assert await is_gone(inside)
            with suppress(ua.UaError, ConnectionError):
                await inside.disconnect()
            with pytest.raises((ua.UaError, ConnectionError)):
                await enter("anybody", "a token")

    asyncio.run(run())


def test_wrong_certificates_and_a_taken_port_are_named(service: LiveService, tmp_path: Path) -> None:
    missing, junk = tmp_path / "missing.der", tmp_path / "junk.der"
    junk.write_text("junk", "ascii")

    async def start() -> None:
        async with serving(service) as link:
            taken = {"port": int(link.address.rpartition(":")[2].strip("/"))}
            absent, wrong = {"certificate": missing, "private_key": junk}, {"certificate": junk, "private_key": junk}
            for settings, kind, words in (
                (absent, OSError, r"missing\.der"),
                (wrong, ValueError, r"junk\.der and .*junk\.der: expected a certificate and its key, as PEM or DE"),
                (taken, OSError, "address already in use"),
            ):
                given = OpcUaServerSettings(**({"port": free_port()} | settings))
                with pytest.raises(kind, match=words):
                    async with OpcUaLink(given).running(service, Peers()):
                        pass

    asyncio.run(start())


@pytest.mark.parametrize(
    ("flags", "code", "health"),
    [
        (0, ua.StatusCodes.Good, Health.NORMAL),
        (Flag.NOT_READY | Flag.INVALID_POSITION, ua.StatusCodes.BadWaitingForInitialData, Health.FAILURE),
        (Flag.INVALID_PRESSURE_2 | Flag.WARMING, ua.StatusCodes.BadSensorFailure, Health.FAILURE),
        (Flag.FROZEN | Flag.WARMING, ua.StatusCodes.BadSensorFailure, Health.FAILURE),
        (Flag.OUTSIDE, ua.StatusCodes.UncertainEngineeringUnitsExceeded, Health.OFF_SPEC),
        (Flag.UNMODELLED_FORCE, ua.StatusCodes.UncertainEngineeringUnitsExceeded, Health.OFF_SPEC),
        (Flag.WARMING, ua.StatusCodes.UncertainSubNormal, Health.CHECK_FUNCTION),
        (Flag.WARMING | Flag.OUTSIDE, None, Health.CHECK_FUNCTION),
        (Flag.RECOVERING, ua.StatusCodes.UncertainSubNormal, None),
        (Flag.OFFSET_UNKNOWN, ua.StatusCodes.UncertainSensorNotAccurate, None),
    ],
)
def test_the_worst_flag_decides_status_and_health(flags: int, code: int | None, health: Health | None) -> None:
    assert code in (None, status_of(flags).value)
    assert health in (None, health_of(flags))


@pytest.mark.parametrize("flag", Flag)
def test_no_flag_is_good(flag: Flag) -> None:
    assert not status_of(flag).is_good()
    assert health_of(flag) is not Health.NORMAL
