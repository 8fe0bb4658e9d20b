"""Results by OPC UA: an object per session with friction, bounds, quality and health, updated at a stated rate."""

import asyncio
import logging
import time
from collections import deque
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from functools import partial
from typing import Any

import numpy as np
from asyncua import Node, Server, ua
from asyncua.crypto.permission_rules import User, UserRole

from cylinder_friction.live.connection import Peers
from cylinder_friction.live.frames import EstimateBlock
from cylinder_friction.live.links import Link
from cylinder_friction.live.opcua_quality import CLOSED, FAILED, SILENT, Health, health_of, status_of
from cylinder_friction.live.opcua_settings import OpcUaServerSettings
from cylinder_friction.live.own_loop import in_own_loop
from cylinder_friction.live.service import LiveService, LiveSession
from cylinder_friction.network.tokens import TokenFile
from cylinder_friction.realtime.flags import Flag

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
BLOCKS = 2000
"""Most blocks of one session that an update looks at; only their flags are lost beyond it."""
_NEWTON, _SECOND = ("NEW", "N", "newton"), ("SEC", "s", "second [unit of time]")
_FORCES = ("Friction", "LowerBound", "UpperBound")
logging.getLogger("asyncua").setLevel(logging.WARNING)


class OpcUaServerLink(Link):
    """An OPC UA server beside a live service, in a thread of its own.

    Args:
        settings: Address, rate and certificate.
        tokens: One of them is the password of each user; None: whoever reaches it may read.
    """

    name = "opcua server"

    def __init__(self, settings: OpcUaServerSettings, tokens: TokenFile | None = None) -> None:
        super().__init__(f"opc.tcp://{settings.host}:{settings.port}/")
        self._tokens = tokens
        self._settings = settings
        self._blocks: dict[str, deque[EstimateBlock]] = {}
        self._shown: dict[str, _Shown] = {}

    def running(self, service: LiveService, peers: Peers) -> AbstractAsyncContextManager[None]:  # noqa: ARG002
        """Listen; raises ``OSError`` where the port is taken."""
        return in_own_loop(self.name, partial(self._run, service))

    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Take estimates for the next update; called in the service's thread."""
        blocks = self._blocks.get(session.name)
        if blocks is None:
            blocks = self._blocks[session.name] = deque(maxlen=BLOCKS)
        blocks.append(block)

    async def _run(self, service: LiveService, ready: Callable[[], None], stop: asyncio.Event) -> None:
        server = Server(user_manager=None if self._tokens is None else _Users(self._tokens))
        await server.init()
        await server.set_application_uri(APPLICATION)
        server.set_server_name("cylinder-friction live")
        server.set_endpoint(self.address)
        server.allow_remote_admin(False)
        if self._settings.certificate is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        else:
            await server.load_certificate(self._settings.certificate)
            await server.load_private_key(self._settings.private_key)
            server.set_security_policy(ENCRYPTED)
        server.set_identity_tokens([ua.AnonymousIdentityToken if self._tokens is None else ua.UserNameIdentityToken])
        space = await _Space.of(server, self._settings.range_n)
        async with server:
            ready()
            while not stop.is_set():
                began_s = time.monotonic()
                if self._tokens is not None:
                    self._tokens.refresh()
                await self._update(service, space, began_s)
                rest_s = 1.0 / self._settings.update_hz - (time.monotonic() - began_s)
                await _sleep(stop, max(0.01, rest_s))

    async def _update(self, service: LiveService, space: "_Space", now_s: float) -> None:
        for name in list(self._blocks):
            blocks = self._blocks.pop(name)
            if name not in self._shown:
                if len(self._shown) >= self._settings.sessions:
                    self.counts["not shown"] += 1
                    continue
                self._shown[name] = _Shown(await space.add(name))
            self._take(self._shown[name], list(blocks), service.engine.sample_time_s, now_s)
            await space.write(self._shown[name])
            await asyncio.sleep(0)  # clients are served in between
        for name, shown in self._shown.items():
            if name not in service.sessions:
                await space.mark(shown, CLOSED)
            elif now_s - shown.seen_s > SILENT_S:
                await space.mark(shown, SILENT)

    def _take(self, shown: "_Shown", blocks: list[EstimateBlock], sample_time_s: float, now_s: float) -> None:
        flags = int(np.bitwise_or.reduce(np.concatenate([block.flags for block in blocks])))
        last = blocks[-1]
        rows = len(last.flags)
        time_s = last.time_s + (rows - 1) * sample_time_s
        if flags & FAILED:
            shown.failed_s = now_s
        failed_before = now_s - shown.failed_s < self._settings.health_s
        own_flags = int(last.flags[-1])
        shown.seen_s, shown.status, shown.moment = now_s, status_of(own_flags), _moment(time_s)
        shown.values = [
            *((force, ua.VariantType.Double) for force in last.newtons[-1].tolist()),
            (own_flags, ua.VariantType.UInt32),
            (last.index + rows - 1, ua.VariantType.UInt64),
            (time.time() - time_s, ua.VariantType.Double),
            (int(health_of(flags, failed_before)), ua.VariantType.Int32),
        ]


class _Users:
    """Users by any name, whose password is a token of any role: all may read, nobody may write."""

    def __init__(self, tokens: TokenFile) -> None:
        self._tokens = tokens

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """Return a user, None for one that is refused."""
        del iserver, certificate
        known = password is not None and self._tokens.role_of(password.encode()) is not None
        return User(role=UserRole.User, name=username) if known else None


@dataclass
class _Shown:
    """One session's object."""

    nodes: list[ua.NodeId]  # Of ``_FORCES``, then flags, index, lag and health
    values: list[tuple[Any, ua.VariantType]] = field(default_factory=list)
    status: ua.StatusCode = field(default_factory=ua.StatusCode)  # Of friction and bounds
    moment: datetime | None = None  # Of the sample, in its sender's clock
    seen_s: float = 0.0
    failed_s: float = -np.inf


@dataclass(frozen=True)
class _Space:
    """The server's own part of the address space."""

    server: Server
    number: int  # Of its namespace
    devices: int  # Of that of OPC 10000-100
    folder: Node
    range_n: float

    @classmethod
    async def of(cls, server: Server, range_n: float) -> "_Space":
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
        return cls(server, number, devices, folder, range_n)

    async def add(self, name: str) -> list[ua.NodeId]:
        """Add a session's object; return its variables."""
        node = await self.folder.add_object(ua.NodeId(name, self.number), ua.QualifiedName(name, self.number))
        forces = [(each, ua.VariantType.Double, ua.ObjectIds.AnalogUnitRangeType) for each in _FORCES]
        others = [
            ("Flags", ua.VariantType.UInt32, ua.ObjectIds.OptionSetType),
            ("SampleIndex", ua.VariantType.UInt64, ua.ObjectIds.BaseDataVariableType),
            ("SampleLag", ua.VariantType.Double, ua.ObjectIds.AnalogUnitType),
        ]
        variables = [await self._variable(node, name, *each) for each in (*forces, *others)]
        for variable in variables[: len(_FORCES)]:
            await self._property(variable, "EngineeringUnits", _unit(*_NEWTON))
            await self._property(variable, "EURange", ua.Range(-self.range_n, self.range_n))
        flags, _, lag = variables[len(_FORCES) :]
        await self._property(flags, "OptionSetValues", [ua.LocalizedText(flag.name) for flag in Flag])
        await self._property(lag, "EngineeringUnits", _unit(*_SECOND))
        health = await node.add_variable(
            ua.NodeId(f"{name}/DeviceHealth", self.number), ua.QualifiedName("DeviceHealth", self.devices),
            int(Health.CHECK_FUNCTION), ua.VariantType.Int32, ua.NodeId(HEALTH_TYPE, self.devices),
        )  # fmt: skip
        return [each.nodeid for each in (*variables, health)]

    async def write(self, shown: _Shown) -> None:
        """Write a session's values."""
        good, now = ua.StatusCode(), datetime.now(UTC)
        for place, (node, (value, kind)) in enumerate(zip(shown.nodes, shown.values, strict=True)):
            status = shown.status if place < len(_FORCES) else good
            written = ua.DataValue(ua.Variant(value, kind), status, shown.moment, now)
            await self.server.write_attribute_value(node, written)

    async def mark(self, shown: _Shown, status: ua.StatusCode) -> None:
        """Write, once, that nothing comes any more."""
        if shown.status != status:
            shown.status, shown.moment = status, datetime.now(UTC)
            shown.values[-1] = (int(Health.CHECK_FUNCTION), ua.VariantType.Int32)
            await self.write(shown)

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


async def _sleep(stop: asyncio.Event, seconds: float) -> None:
    try:
        await asyncio.wait_for(stop.wait(), seconds)
    except TimeoutError:
        return


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
