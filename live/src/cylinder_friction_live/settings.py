"""What a live service is given: how long a session waits, what is taken, and by which links."""

import re
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field
from pydantic.dataclasses import dataclass

from cylinder_friction_live.access import is_loopback

HELD_BACK_S = 120.0
"""Who holds a fast sender back does not read its pings either; for so long neither side takes the other for gone."""
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
    """How long a session waits, and what counts as a short gap.

    Attributes:
        hold_s: How long samples that came too early wait for the ones before them [s].
        hold_rows: How many may wait; beyond it the gap before them is taken for lost.
        short_gap_s: A gap up to this long is stepped through as samples that are no numbers, which the step holds and
            flags; after a longer one the session begins anew, as after a reset [s].
    """

    hold_s: _Positive = 0.5
    hold_rows: _Count = 2000
    short_gap_s: _Positive = 0.5


@dataclass(frozen=True, config=_CONFIG)
class LiveLimits:
    """What one service takes.

    Attributes:
        sessions: Most sessions that are open at a time.
        unkept_rows: Most rows that wait to be kept, all sessions together; beyond it writers are slowed down.
        idle_s: How long a session may rest before it is closed, its state kept [s].
        message_bytes: Largest message of a client.
        text_bytes: Largest message of JSON, which takes a hundred times as long to read as frames.
        connections: Most clients, and as many pages, that are connected at a time.
        rows_per_s: Most samples per second of a connection, ten seconds' worth at once; beyond it the client is slowed.
        loop_lag_s: How late the event loop may be before new sessions are refused; known ones are not [s].
    """

    sessions: _Count = 1000
    unkept_rows: _Count = 2_000_000
    idle_s: _Positive = 600.0
    message_bytes: _Count = 1 << 20
    text_bytes: _Count = 1 << 16
    connections: _Count = 1000
    rows_per_s: _Positive = 100_000.0
    loop_lag_s: _Positive = 0.25


@dataclass(frozen=True, config=_CONFIG)
class BrokerSettings:
    """An MQTT 5 broker.

    Attributes:
        host: Its address.
        port: Its port; 8883 is usual with TLS.
        tls: Whether it is spoken to by TLS; a password needs it, except on loopback.
        ca_file: Certificates that sign the broker's; None: the system's.
        user: Name that the service logs in by; None: without.
        password_file: File of the password, a line.
    """

    host: str = "127.0.0.1"
    port: _Port = 1883
    tls: bool = False
    ca_file: str | None = None
    user: str | None = None
    password_file: str | None = None

    def __post_init__(self) -> None:
        """Refuse a password in plain text to elsewhere; raises ``ValueError``."""
        if self.password_file and not self.tls and not is_loopback(self.host):
            raise ValueError(
                f"tls: got false with a password for {self.host}, expected true: anyone between would read it"
            )

    def password(self) -> str | None:
        """Return the password, None without one; raises ``OSError`` if its file cannot be read."""
        return Path(self.password_file).read_text(encoding="utf-8").strip() if self.password_file else None


@dataclass(frozen=True, config=_CONFIG)
class MqttSettings:
    """Frames and JSON over MQTT, ``PREFIX/CLIENT/in`` and ``PREFIX/CLIENT/out``.

    Attributes:
        broker: Where messages go through.
        prefix: First levels of all topics.
        client_id: Of the service; one per service and broker.
        results_hz: How often the latest newtons of a session are published as JSON on ``PREFIX/results/SESSION``.
        waiting_messages: Most messages of one client that wait to be taken; beyond it the client has to open anew.
        session_s: How long the broker keeps messages for the service when their connection breaks [s].
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
        host: Address that it listens on; other than loopback only with certificate, key and the service's tokens.
        port: Its port.
        update_hz: How often values are updated, 1 to 10 [Hz].
        range_n: Friction is expected within ± this: ``EURange`` of the three forces [N].
        sessions: Most sessions that have an object; it stays after they are closed.
        certificate, private_key: Files of the server's; with them connections are signed and encrypted, all of them.
    """

    host: str = "127.0.0.1"
    port: _Port = 4840
    update_hz: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    range_n: _Positive = 10_000.0
    sessions: _Count = 1000
    certificate: Path | None = None
    private_key: Path | None = None

    def __post_init__(self) -> None:
        """Refuse half of a pair; raises ``ValueError``."""
        if (self.certificate is None) != (self.private_key is None):
            raise ValueError("expected both certificate and private_key, or neither")

    def refuse_exposed(self, tokens: Path | None) -> None:
        """Refuse what others could read or listen to; raises ``ValueError``."""
        if not is_loopback(self.host) and (tokens is None or self.certificate is None):
            raise ValueError(
                f"opcua_server.host: got {self.host!r}, which others reach; give opcua_server.certificate and "
                "private_key, and access.tokens, or listen on 127.0.0.1"
            )
