"""The OPC UA link: an object per session with friction, bounds, quality and the health of its sensors."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import reduce
from operator import or_
from pathlib import Path
from typing import Any, ClassVar

from asyncua import Node, Server, ua
from asyncua.crypto.permission_rules import User, UserRole

from cylinder_friction.realtime.flags import Flag
from cylinder_friction_live.access import TokenFile
from cylinder_friction_live.connection import Peers
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.links.link import Link, in_background
from cylinder_friction_live.links.opcua_quality import CLOSED, SILENT, Health, health_of, status_of
from cylinder_friction_live.service import LiveService, LiveSession
from cylinder_friction_live.settings import OpcUaServerSettings

NAMESPACE, APPLICATION = "urn:cylinder-friction:live:results", "urn:cylinder-friction:live"
DEVICES = "http://opcfoundation.org/UA/DI/"
HEALTH_TYPE, HEALTH_NAMES = 6244, 6450
"""Numbers of ``DeviceHealthEnumeration`` and of its names in the namespace of OPC 10000-100."""
ENCRYPTED = [
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
]
SILENT_S = 5.0
"""Time without estimates after which a session's values become uncertain [s]."""
GONE_S = 60.0
"""Time until the server drops a silent client [s]; the library's own limit is 600 s."""
LARGEST_MESSAGE = 1 << 20
_NEWTON, _SECOND = ("NEW", "N", "newton"), ("SEC", "s", "second [unit of time]")
_FORCES = ("Friction", "LowerBound", "UpperBound")
_log = logging.getLogger(__name__)


@dataclass
class _Shown:
    """The OPC UA object of one session."""

    nodes: list[Node]  # Nodes of ``_FORCES``, then flags, index, lag and health
    values: list[ua.Variant]
    status: ua.StatusCode  # Status of friction and bounds
    moment: datetime | None  # Time of the sample, in its sender's clock


class OpcUaLink(Link):
    """An OPC UA server on the service's event loop, read-only for clients.

    Args:
        settings: Address, rate and certificate.
        tokens: File of the tokens, which are the users' passwords; None: everybody may read.

    Raises:
        AccessError: The tokens cannot be read.
    """

    name: ClassVar[str] = "opcua server"

    def __init__(self, settings: OpcUaServerSettings, tokens: Path | None = None) -> None:
        super().__init__(f"opc.tcp://{settings.host}:{settings.port}/")
        self._settings = settings
        self._users = None if tokens is None else _Users(TokenFile(tokens))
        self._flags: dict[str, int] = {}  # Flags of all samples of a session since its last update
        self._shown: dict[str, _Shown] = {}

    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Collect flags for the next update."""
        self._flags[session.name] = reduce(or_, block.flags.tolist(), self._flags.get(session.name, 0))

    @asynccontextmanager
    async def running(self, service: LiveService, peers: Peers) -> AsyncIterator[None]:  # noqa: ARG002 - nobody comes in
        """Serve; raises ``OSError`` if the port is taken, and ``ValueError`` for an invalid certificate."""
        logging.getLogger("asyncua").setLevel(logging.CRITICAL)  # otherwise clients could fill the disk with log lines
        self._shown.clear()
        self._flags = dict.fromkeys(service.sessions, 0)
        self._server = await self._configured()
        await self._add_types()
        async with self._server, in_background(self._update(service)):
            yield

    async def _configured(self) -> Server:
        server, settings = Server(user_manager=self._users), self._settings
        await server.init()
        server.iserver.max_session_timeout_ms = 1e3 * GONE_S
        server.limits.max_message_size = LARGEST_MESSAGE
        await server.set_application_uri(APPLICATION)
        server.set_server_name("cylinder-friction live")
        server.set_endpoint(self.address)
        server.allow_remote_admin(False)
        if settings.certificate is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        else:
            try:
                await server.load_certificate(settings.certificate)
                await server.load_private_key(settings.private_key)
            except ValueError as error:
                files = f"{settings.certificate} and {settings.private_key}"
                raise ValueError(f"{files}: expected a certificate and its key, as PEM or DER ({error})") from error
            server.set_security_policy(ENCRYPTED)
        server.set_identity_tokens([ua.AnonymousIdentityToken if self._users is None else ua.UserNameIdentityToken])
        return server

    async def _add_types(self) -> None:
        """Add the folder of the sessions, and the one type from OPC 10000-100."""
        self._number = await self._server.register_namespace(NAMESPACE)
        self._devices = await self._server.register_namespace(DEVICES)
        kind = ua.NodeId(HEALTH_TYPE, self._devices)
        enumeration = self._server.get_node(ua.ObjectIds.Enumeration)
        health = await enumeration.add_data_type(kind, ua.QualifiedName("DeviceHealthEnumeration", self._devices))
        names = [ua.LocalizedText(each.name) for each in Health]
        await health.add_property(ua.NodeId(HEALTH_NAMES, self._devices), ua.QualifiedName("EnumStrings", 0), names)
        place = ua.NodeId("CylinderFriction", self._number)
        self._folder = await self._server.nodes.objects.add_folder(place, f"{self._number}:CylinderFriction")

    async def _update(self, service: LiveService) -> None:
        """Update the values a few times a second; after each session, samples have their turn."""
        while True:
            begun_s = time.monotonic()
            if self._users is not None:
                await self._users.refresh(self._server)
            flags, self._flags = self._flags, {}
            for name, since in flags.items():
                if name in service.sessions and service.sessions[name].latest is not None:
                    await self._show(service.sessions[name], since)
                    await asyncio.sleep(0)
            for name, shown in self._shown.items():
                session = service.sessions.get(name)
                if session is None:
                    await self._mark(shown, CLOSED)
                elif begun_s - session.order.last_seen_s > SILENT_S:
                    await self._mark(shown, SILENT)
            await asyncio.sleep(max(0.01, 1.0 / self._settings.update_hz - (time.monotonic() - begun_s)))

    async def _show(self, session: LiveSession, flags_since: int) -> None:
        """Write the newest values of a session; a new session gets an object if the limit allows."""
        last, shown = session.latest, self._shown.get(session.name)
        if shown is None:
            if len(self._shown) >= self._settings.sessions:
                self.counts["not shown"] += 1
                return
            shown = self._shown[session.name] = _Shown(await self._add(session.name), [], CLOSED, None)
        assert last is not None
        shown.status, shown.moment = status_of(last.flags), datetime.fromtimestamp(last.time_s, UTC)
        shown.values = [
            *(ua.Variant(force, ua.VariantType.Double) for force in last.newtons),
            ua.Variant(last.flags, ua.VariantType.UInt32),
            ua.Variant(last.index, ua.VariantType.UInt64),
            ua.Variant(time.time() - last.time_s, ua.VariantType.Double),
            ua.Variant(int(health_of(flags_since | last.flags)), ua.VariantType.Int32),
        ]
        await self._write(shown)

    async def _mark(self, shown: _Shown, status: ua.StatusCode) -> None:
        """Mark the values once as no longer updated."""
        if shown.status != status:
            shown.status, shown.moment = status, datetime.now(UTC)
            shown.values[-1] = ua.Variant(int(Health.CHECK_FUNCTION), ua.VariantType.Int32)
            await self._write(shown)

    async def _write(self, shown: _Shown) -> None:
        good, now = ua.StatusCode(), datetime.now(UTC)
        for place, (node, value) in enumerate(zip(shown.nodes, shown.values, strict=True)):
            status = shown.status if place < len(_FORCES) else good
            await self._server.write_attribute_value(node.nodeid, ua.DataValue(value, status, shown.moment, now))

    async def _add(self, name: str) -> list[Node]:
        """Add a session's object; return its variables."""
        node = await self._folder.add_object(ua.NodeId(name, self._number), ua.QualifiedName(name, self._number))
        forces = [(each, ua.VariantType.Double, ua.ObjectIds.AnalogUnitRangeType) for each in _FORCES]
        others = [
            ("Flags", ua.VariantType.UInt32, ua.ObjectIds.OptionSetType),
            ("SampleIndex", ua.VariantType.UInt64, ua.ObjectIds.BaseDataVariableType),
            ("SampleLag", ua.VariantType.Double, ua.ObjectIds.AnalogUnitType),
        ]
        variables = [await self._variable(node, name, *each) for each in (*forces, *others)]
        for variable in variables[: len(_FORCES)]:
            await self._property(variable, "EngineeringUnits", _unit(*_NEWTON))
            await self._property(variable, "EURange", ua.Range(-self._settings.range_n, self._settings.range_n))
        flags, _, lag = variables[len(_FORCES) :]
        await self._property(flags, "OptionSetValues", [ua.LocalizedText(flag.name) for flag in Flag])
        await self._property(lag, "EngineeringUnits", _unit(*_SECOND))
        health = await node.add_variable(
            ua.NodeId(f"{name}/DeviceHealth", self._number), ua.QualifiedName("DeviceHealth", self._devices),
            int(Health.CHECK_FUNCTION), ua.VariantType.Int32, ua.NodeId(HEALTH_TYPE, self._devices),
        )  # fmt: skip
        return [*variables, health]

    async def _variable(self, parent: Node, session: str, name: str, kind: ua.VariantType, type_number: int) -> Node:
        identifier, browsed = ua.NodeId(f"{session}/{name}", self._number), ua.QualifiedName(name, self._number)
        node = await parent.add_variable(identifier, browsed, None, ua.VariantType.Null, ua.NodeId(kind.value))
        before, after = ua.NodeId(ua.ObjectIds.BaseDataVariableType), ua.NodeId(type_number)
        if after != before:
            await node.delete_reference(before, ua.ObjectIds.HasTypeDefinition, True, False)
            await node.add_reference(after, ua.ObjectIds.HasTypeDefinition, True, False)
        return node

    async def _property(self, node: Node, name: str, value: Any) -> None:
        identifier = ua.NodeId(f"{node.nodeid.Identifier}/{name}", self._number)
        await node.add_property(identifier, ua.QualifiedName(name, 0), value)


@dataclass
class _User(User):  # type: ignore[misc]  # the library states no types
    token: bytes = b""


class _Users:
    """Users with any name and a token of any role as password."""

    def __init__(self, tokens: TokenFile) -> None:
        self._tokens = tokens

    def get_user(
        self, iserver: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """Admit a user; None if the user is refused."""
        del iserver, certificate
        token = (password or "").encode()
        return _User(UserRole.User, username, token) if self._tokens.role_of(token) is not None else None

    async def refresh(self, server: Server) -> None:
        """Read the tokens again if they have changed, and close the connections of removed tokens."""
        if not self._tokens.refresh():
            return
        for client in list(server.bserver.clients):
            session = client.processor.session
            if session is not None and isinstance(session.user, _User) and not self._tokens.role_of(session.user.token):
                _log.warning("%s: its token is no longer in the file; the connection is closed", client.peer_name)
                await session.close_session()
                client.transport.close()


def _unit(code: str, symbol: str, name: str) -> ua.EUInformation:
    """Make a unit of UNECE recommendation 20; OPC 10000-8 reads its code as a number."""
    number = int.from_bytes(code.encode(), "big")
    return ua.EUInformation(
        "http://www.opcfoundation.org/UA/units/un/cefact", number, ua.LocalizedText(symbol), ua.LocalizedText(name)
    )
