"""The process of the OPC UA server: an object per session with friction, bounds, quality and health of the sensors.

Started by ``opcua_server`` with its settings as JSON; each line of its standard input is ``[WHAT, ...]`` as JSON. It
imports little, so that it is there soon.
"""

import asyncio
import json
import logging
import math
import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import IntEnum
from pathlib import Path
from typing import Any

from asyncua import Node, Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from pydantic import TypeAdapter

from cylinder_friction.realtime.flags import Flag
from cylinder_friction.service.access import TokenFile
from cylinder_friction.service.links.opcua_cylinders import MonitoredCylinders
from cylinder_friction.service.live.settings import OpcUaServerSettings, OpcUaValues

FAILED, UNSETTLED, OFF_RANGE = Flag.of_kind("sensor"), Flag.of_kind("settling"), Flag.of_kind("range")
_STATUS = (  # The first that applies
    (Flag.NOT_READY, ua.StatusCodes.BadWaitingForInitialData),
    (FAILED, ua.StatusCodes.BadSensorFailure),
    (OFF_RANGE, ua.StatusCodes.UncertainEngineeringUnitsExceeded),
    (UNSETTLED & ~Flag.OFFSET_UNKNOWN, ua.StatusCodes.UncertainSubNormal),
    (Flag.OFFSET_UNKNOWN, ua.StatusCodes.UncertainSensorNotAccurate),
)
SILENT = ua.StatusCode(ua.StatusCodes.UncertainNoCommunicationLastUsableValue)
CLOSED = ua.StatusCode(ua.StatusCodes.BadNoCommunication)


class Health(IntEnum):
    """``DeviceHealthEnumeration`` of OPC 10000-100, after NAMUR NE 107."""

    NORMAL = 0
    FAILURE = 1
    """A sensor has failed, now."""
    CHECK_FUNCTION = 2
    """No valid friction for the time being: the estimate settles, or nothing comes."""
    OFF_SPEC = 3
    """The cylinder works outside of what the model was trained on."""
    MAINTENANCE_REQUIRED = 4
    """All is well now, but a sensor failed a while ago: a wire that comes and goes."""


def status_of(flags: int) -> ua.StatusCode:
    """Return the status code of friction and bounds."""
    return ua.StatusCode(next((code for mask, code in _STATUS if flags & mask), ua.StatusCodes.Good))


def health_of(flags: int, failed_before: bool) -> Health:
    """Return the health.

    Args:
        flags: All that were set since the last update.
        failed_before: Whether a sensor failed within the stretch that health looks back on.
    """
    if flags & FAILED:
        return Health.FAILURE
    if flags & UNSETTLED:
        return Health.CHECK_FUNCTION
    if flags & OFF_RANGE:
        return Health.OFF_SPEC
    return Health.MAINTENANCE_REQUIRED if failed_before else Health.NORMAL


NAMESPACE, APPLICATION = "urn:cylinder-friction:live:results", "urn:cylinder-friction:live"
DEVICES = "http://opcfoundation.org/UA/DI/"
HEALTH_TYPE, HEALTH_NAMES = 6244, 6450
"""Numbers of ``DeviceHealthEnumeration`` and of its names in the namespace of OPC 10000-100."""
ENCRYPTED = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]
SILENT_S = 5.0
"""A session that gives nothing for so long keeps its last values, as uncertain ones."""
GONE_S = 60.0
"""A client that is gone without a word is served for so long, at its full cost; the library's own limit is 600 s."""
LOOK_S = 0.5
"""How often the server looks for silent sessions and new tokens."""
_NEWTON, _SECOND = ("NEW", "N", "newton"), ("SEC", "s", "second [unit of time]")
_FORCES = ("Friction", "LowerBound", "UpperBound")
_log = logging.getLogger(__name__)
LINES_PER_S = 10


class Brief(logging.Filter):
    """At most ``LINES_PER_S`` records, without tracebacks: clients cannot fill the disk of the log."""

    def __init__(self) -> None:
        super().__init__()
        self._second, self._lines = 0, 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether a record is written."""
        if int(record.created) != self._second:
            self._second, self._lines = int(record.created), 0
        record.exc_info = record.exc_text = None
        self._lines += 1
        return self._lines <= LINES_PER_S


def main() -> None:
    """Serve until the service is gone."""
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s opcua server: %(message)s")
    for handler in logging.getLogger().handlers:
        handler.addFilter(Brief())
    given = json.loads(sys.argv[1])
    settings = TypeAdapter(OpcUaServerSettings).validate_json(json.dumps(given["settings"]))
    tokens = None if given["tokens"] is None else TokenFile(Path(given["tokens"]), given["roles"])
    try:
        asyncio.run(_serve(given["address"], settings, tokens))
    except (OSError, ValueError, ua.UaError) as error:
        _log.error("%s", error)
        sys.exit(1)


async def _serve(address: str, settings: OpcUaServerSettings, tokens: TokenFile | None) -> None:
    users = None if tokens is None else _Users(tokens)
    server = Server(user_manager=users)
    await server.init()
    server.iserver.max_session_timeout_ms = 1e3 * GONE_S
    await server.set_application_uri(APPLICATION)
    server.set_server_name("cylinder-friction live")
    server.set_endpoint(address)
    server.allow_remote_admin(False)
    if settings.certificate is None:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
    else:
        try:
            await server.load_certificate(settings.certificate)
            await server.load_private_key(settings.private_key)
        except ValueError as error:
            files = f"{settings.certificate} and {settings.private_key}"
            raise ValueError(f"{files}: expected a certificate and its private key, as PEM or DER ({error})") from error
        server.set_security_policy(ENCRYPTED)
    server.set_identity_tokens([ua.AnonymousIdentityToken if tokens is None else ua.UserNameIdentityToken])
    space = await _Space.of(server, settings)
    async with server, asyncio.TaskGroup() as jobs:
        jobs.create_task(_look(space, users))
        while line := await asyncio.to_thread(sys.stdin.buffer.readline):
            what, content = json.loads(line)
            await {"show": space.show, "close": space.close, "remove": space.remove}[what](content)
        os._exit(0)  # closing by the library takes a second, and nothing would be lost


async def _look(space: "_Space", users: "_Users | None") -> None:
    while True:
        await asyncio.sleep(LOOK_S)
        if users is not None:
            await users.refresh(space.server)
        if space.monitored is not None:
            await space.monitored.refresh()
        await space.mark_silent()


@dataclass
class _User(User):  # type: ignore[misc]  # the library states no types
    token: bytes = b""


class _Users:
    """Users by any name, whose password is a token of any role: all may read, nobody may write."""

    def __init__(self, tokens: TokenFile) -> None:
        self._tokens = tokens

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """Return a user, None for one that is refused."""
        del iserver, certificate
        token = (password or "").encode()
        return _User(UserRole.User, username, token) if self._tokens.role_of(token) is not None else None

    async def refresh(self, server: Server) -> None:
        """Read the tokens again if they have changed, and close the connections of those that are gone."""
        if not self._tokens.refresh():
            return
        for client in list(server.bserver.clients):
            session = client.processor.session
            if session is not None and isinstance(session.user, _User) and not self._tokens.role_of(session.user.token):
                _log.warning("%s: its token is no longer in the file; the connection is closed", client.peer_name)
                await session.close_session()
                client.transport.close()


@dataclass
class _Shown:
    """One session's object."""

    nodes: list[ua.NodeId]  # Of ``_FORCES``, then flags, index, lag and health
    values: list[tuple[Any, ua.VariantType]] = field(default_factory=list)
    status: ua.StatusCode = field(default_factory=ua.StatusCode)  # Of friction and bounds
    moment: datetime | None = None  # Of the sample, in its sender's clock
    seen_s: float = 0.0
    failed_s: float = -math.inf

    def take(self, given: OpcUaValues, health_s: float) -> None:
        """Take what is new; a failed sensor counts for ``health_s``."""
        now_s = time.monotonic()
        if given.flags_since & FAILED:
            self.failed_s = now_s
        self.seen_s, self.status, self.moment = now_s - given.age_s, status_of(given.flags), _moment(given.time_s)
        self.values = [
            *((force, ua.VariantType.Double) for force in given.newtons),
            (given.flags, ua.VariantType.UInt32),
            (given.last_index, ua.VariantType.UInt64),
            (time.time() - given.time_s, ua.VariantType.Double),
            (int(health_of(given.flags_since, now_s - self.failed_s < health_s)), ua.VariantType.Int32),
        ]


@dataclass(frozen=True)
class _Space:
    """The server's own part of the address space."""

    server: Server
    number: int  # Of its namespace
    devices: int  # Of that of OPC 10000-100
    folder: Node
    settings: OpcUaServerSettings
    monitored: MonitoredCylinders | None
    shown: dict[str, _Shown] = field(default_factory=dict)

    @classmethod
    async def of(cls, server: Server, settings: OpcUaServerSettings) -> "_Space":
        """Return it, with the one type that it takes from OPC 10000-100."""
        number, devices = await server.register_namespace(NAMESPACE), await server.register_namespace(DEVICES)
        enumeration = server.get_node(ua.ObjectIds.Enumeration)
        health = await enumeration.add_data_type(
            ua.NodeId(HEALTH_TYPE, devices), ua.QualifiedName("DeviceHealthEnumeration", devices)
        )
        names = [ua.LocalizedText(each.name) for each in Health]
        await health.add_property(ua.NodeId(HEALTH_NAMES, devices), ua.QualifiedName("EnumStrings", 0), names)
        folder = await server.nodes.objects.add_folder(
            ua.NodeId("CylinderFriction", number), f"{number}:CylinderFriction"
        )
        monitored = None
        if settings.health is not None:
            numbers = {each.name: int(each) for each in Health}
            monitored = await MonitoredCylinders.of(server, folder, settings.health, health.nodeid, numbers)
        return cls(server, number, devices, folder, settings, monitored)

    async def show(self, content: Sequence[Sequence[Any]]) -> None:
        """Write values of sessions; one that is new gets an object."""
        for given in (OpcUaValues(*each) for each in content):
            if given.session not in self.shown:
                self.shown[given.session] = _Shown(await self._add(given.session))
            self.shown[given.session].take(given, self.settings.health_s)
            await self._write(self.shown[given.session])
            await asyncio.sleep(0)  # clients are served in between

    async def close(self, names: Sequence[str]) -> None:
        """Write that sessions were closed."""
        for name in self.shown.keys() & set(names):
            await self._mark(self.shown[name], CLOSED)

    async def remove(self, names: Sequence[str]) -> None:
        """Remove sessions' objects."""
        for name in self.shown.keys() & set(names):
            del self.shown[name]
            await self.server.delete_nodes([self.server.get_node(ua.NodeId(name, self.number))], recursive=True)

    async def mark_silent(self) -> None:
        """Write of sessions that have given nothing for a while that it is so."""
        for shown in list(self.shown.values()):
            if time.monotonic() - shown.seen_s > SILENT_S and shown.status != CLOSED:
                await self._mark(shown, SILENT)

    async def _add(self, name: str) -> list[ua.NodeId]:
        """Add a session's object; return its variables."""
        node = await self.folder.add_object(ua.NodeId(name, self.number), ua.QualifiedName(name, self.number))
        forces = [(each, ua.VariantType.Double, ua.ObjectIds.AnalogUnitRangeType) for each in _FORCES]
        others = [
            ("Flags", ua.VariantType.UInt32, ua.ObjectIds.OptionSetType),
            ("SampleIndex", ua.VariantType.UInt64, ua.ObjectIds.BaseDataVariableType),
            ("SampleLag", ua.VariantType.Double, ua.ObjectIds.AnalogUnitType),
        ]
        variables = [await self._variable(node, name, *each) for each in (*forces, *others)]
        range_n = self.settings.range_n
        for variable in variables[: len(_FORCES)]:
            await self._property(variable, "EngineeringUnits", _unit(*_NEWTON))
            await self._property(variable, "EURange", ua.Range(-range_n, range_n))
        flags, _, lag = variables[len(_FORCES) :]
        await self._property(flags, "OptionSetValues", [ua.LocalizedText(flag.name) for flag in Flag])
        await self._property(lag, "EngineeringUnits", _unit(*_SECOND))
        health = await node.add_variable(
            ua.NodeId(f"{name}/DeviceHealth", self.number), ua.QualifiedName("DeviceHealth", self.devices),
            int(Health.CHECK_FUNCTION), ua.VariantType.Int32, ua.NodeId(HEALTH_TYPE, self.devices),
        )  # fmt: skip
        return [each.nodeid for each in (*variables, health)]

    async def _write(self, shown: _Shown) -> None:
        """Write a session's values."""
        good, now = ua.StatusCode(), datetime.now(UTC)
        for place, (node, (value, kind)) in enumerate(zip(shown.nodes, shown.values, strict=True)):
            status = shown.status if place < len(_FORCES) else good
            written = ua.DataValue(ua.Variant(value, kind), status, shown.moment, now)
            await self.server.write_attribute_value(node, written)

    async def _mark(self, shown: _Shown, status: ua.StatusCode) -> None:
        """Write, once, that nothing comes any more."""
        if shown.status != status:
            shown.status, shown.moment = status, datetime.now(UTC)
            shown.values[-1] = (int(Health.CHECK_FUNCTION), ua.VariantType.Int32)
            await self._write(shown)

    async def _variable(self, parent: Node, session: str, name: str, kind: ua.VariantType, type_number: int) -> Node:
        identifier = ua.NodeId(f"{session}/{name}", self.number)
        node = await parent.add_variable(
            identifier, ua.QualifiedName(name, self.number), None, ua.VariantType.Null, ua.NodeId(kind.value)
        )
        before, after = ua.NodeId(ua.ObjectIds.BaseDataVariableType), ua.NodeId(type_number)
        if after != before:
            await node.delete_reference(before, ua.ObjectIds.HasTypeDefinition, True, False)
            await node.add_reference(after, ua.ObjectIds.HasTypeDefinition, True, False)
        return node

    async def _property(self, node: Node, name: str, value: Any) -> None:
        identifier = ua.NodeId(f"{node.nodeid.Identifier}/{name}", self.number)
        await node.add_property(identifier, ua.QualifiedName(name, 0), value)


def _unit(code: str, symbol: str, name: str) -> ua.EUInformation:
    """Return a unit of UNECE recommendation 20; OPC 10000-8 reads its code as a number."""
    number = int.from_bytes(code.encode(), "big")
    return ua.EUInformation(
        "http://www.opcfoundation.org/UA/units/un/cefact", number, ua.LocalizedText(symbol), ua.LocalizedText(name)
    )


def _moment(time_s: float) -> datetime | None:
    """Return a sender's time; None where no calendar has it."""
    try:
        return datetime.fromtimestamp(time_s, UTC)
    except (OverflowError, ValueError, OSError):
        return None


if __name__ == "__main__":
    main()
