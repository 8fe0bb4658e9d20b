"""Settings of a live service: waiting times of sessions, limits, and links."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field
from pydantic.dataclasses import dataclass

from cylinder_friction_live.access import is_loopback

HELD_BACK_S = 120.0
"""Time for which neither side drops the other [s], as a service that holds a sender back reads no pings."""
_CONFIG = ConfigDict(extra="forbid", strict=True)
_Positive = Annotated[float, Field(gt=0.0)]
_Count = Annotated[int, Field(gt=0)]
_Port = Annotated[int, Field(ge=1, le=65535)]


def _checked_topic(topic: str) -> str:
    if not re.fullmatch(r"[^+#/\0]+(/[^+#/\0]+){0,19}", topic):
        raise ValueError("expected up to 20 levels of a topic, without + and #")
    return topic


_Topic = Annotated[str, AfterValidator(_checked_topic)]


@dataclass(frozen=True, config=_CONFIG)
class SessionRules:
    """Waiting time of a session, and the length of a short gap.

    Attributes:
        hold_s: Time for which early samples wait for those before them [s].
        hold_rows: Most samples that wait; above it the gap before them counts as lost.
        short_gap_s: Longest gap that is stepped through as NaN, which the step holds and flags [s]; after a longer one
            the session begins anew, as after a reset.
    """

    hold_s: _Positive = 0.5
    hold_rows: _Count = 2000
    short_gap_s: _Positive = 0.5


@dataclass(frozen=True, config=_CONFIG)
class LiveLimits:
    """Limits of one service.

    Attributes:
        sessions: Most open sessions. Beyond it, sessions that no client has any more give way to new ones.
        sessions_per_connection: Most sessions of one connection.
        sessions_per_user: Most sessions of one user: a token, an address if there are no tokens, or all of MQTT.
        unkept_rows: Most rows of all sessions that wait for the journal; above it writers are slowed down.
        idle_s: Time after which an idle session is closed, with its state in the journal [s].
        message_bytes: Largest message of a client.
        text_bytes: Largest message of JSON, which takes a hundred times as long to read as frames.
        connections: Most connected clients, and most connected pages.
        connections_per_user: Most connected clients of one user.
        rows_per_s: Most samples per second of a connection, up to ten seconds' worth at once; above it the client is
            slowed down.
        loop_lag_s: Delay of the event loop above which new sessions are refused, and known ones are not [s].
    """

    sessions: _Count = 1000
    sessions_per_connection: _Count = 250
    sessions_per_user: _Count = 500
    unkept_rows: _Count = 2_000_000
    idle_s: _Positive = 600.0
    message_bytes: _Count = 1 << 20
    text_bytes: _Count = 1 << 16
    connections: _Count = 1000
    connections_per_user: _Count = 500
    rows_per_s: _Positive = 100_000.0
    loop_lag_s: _Positive = 0.25


@dataclass(frozen=True, config=_CONFIG)
class BrokerSettings:
    """An MQTT 5 broker.

    Attributes:
        host: Address of the broker.
        port: Port of the broker; 8883 is usual with TLS.
        tls: Whether to use TLS; a password needs it, except on loopback.
        ca_file: Certificates of the authority that signed the broker's; None: the system's.
        user: Name for the login; None: no login.
        password_file: File with the password on one line.
    """

    host: str = "127.0.0.1"
    port: _Port = 1883
    tls: bool = False
    ca_file: str | None = None
    user: str | None = None
    password_file: str | None = None

    def __post_init__(self) -> None:
        """Refuse to send a password in plain text beyond loopback; raises ``ValueError``."""
        if self.password_file and not self.tls and not is_loopback(self.host):
            raise ValueError(
                f"tls: got false with a password for {self.host}, expected true: anyone between would read it"
            )

    def password(self) -> str | None:
        """Read the password, None without one; raises ``OSError`` if its file cannot be read."""
        return Path(self.password_file).read_text(encoding="utf-8").strip() if self.password_file else None


@dataclass(frozen=True, config=_CONFIG)
class MqttSettings:
    """Frames and JSON over MQTT, ``PREFIX/CLIENT/in`` and ``PREFIX/CLIENT/out``.

    Attributes:
        broker: The broker.
        prefix: First levels of all topics.
        client_id: Name of the service at the broker, unique there.
        results_hz: Rate at which the latest newtons of a session are published as JSON on ``PREFIX/results/SESSION``.
        waiting_messages: Most waiting messages of one client; above it the client must open its session again.
        session_s: Time for which the broker keeps messages for the service after a break [s].
    """

    broker: BrokerSettings = BrokerSettings()
    prefix: _Topic = "cylinder-friction"
    client_id: str = "cylinder-friction-live"
    results_hz: _Positive = 2.0
    waiting_messages: _Count = 500
    session_s: _Count = 60


@dataclass(frozen=True, config=_CONFIG)
class OpcUaServerSettings:
    """The OPC UA server of results.

    Attributes:
        host: Address to listen on; beyond loopback it needs certificate, key and the service's tokens.
        port: Port to listen on.
        update_hz: Rate at which values are updated, 1 to 10 [Hz].
        range_n: Expected range of friction, ± this: ``EURange`` of the three forces [N].
        sessions: Most sessions with an object; objects stay after their sessions are closed.
        certificate, private_key: Files of the server; with them all connections are signed and encrypted.
    """

    host: str = "127.0.0.1"
    port: _Port = 4840
    update_hz: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    range_n: _Positive = 10_000.0
    sessions: _Count = 1000
    certificate: Path | None = None
    private_key: Path | None = None

    def __post_init__(self) -> None:
        """Refuse a certificate without key, or the reverse; raises ``ValueError``."""
        if (self.certificate is None) != (self.private_key is None):
            raise ValueError("expected both certificate and private_key, or neither")

    def refuse_exposed(self, tokens: Path | None) -> None:
        """Refuse a server beyond loopback without encryption or tokens; raises ``ValueError``."""
        if not is_loopback(self.host) and (tokens is None or self.certificate is None):
            raise ValueError(
                f"opcua_server.host: got {self.host!r}, which others reach; give opcua_server.certificate and "
                "private_key, and access.tokens, or listen on 127.0.0.1"
            )
