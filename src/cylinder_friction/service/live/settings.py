"""What a live service is given: how long a session waits, what is taken, and by which links."""

import re
from dataclasses import dataclass, fields
from pathlib import Path

from cylinder_friction.service.access import is_loopback

HELD_BACK_S = 120.0
"""Who holds a fast sender back does not read its pings either; for so long neither side takes the other for gone."""


class LiveSettingsError(ValueError):
    """Settings that cannot be; the message names the key."""


def token_of(path: str | None) -> str | None:
    """Return what a file holds, without the space around it; None without a file."""
    return Path(path).read_text(encoding="utf-8").strip() if path else None


def refuse_unless_topic(key: str, topic: str, levels: int = 20) -> None:
    """Raise ``LiveSettingsError`` for what cannot be a part of a topic, of at most so many ``levels``."""
    if not re.fullmatch(r"[^+#/\0]+(/[^+#/\0]+)*", topic) or topic.count("/") >= levels:
        raise LiveSettingsError(f"{key}: got {topic!r}, expected up to {levels} levels of a topic, without + and #")


def refuse_unless_port(key: str, port: int, least: int = 0) -> None:
    """Raise ``LiveSettingsError`` for what is no port."""
    if not least <= port <= 65535:
        raise LiveSettingsError(f"{key}: got {port}, expected {least} to 65535")


def refuse_unless_positive(settings: object, section: str, *names: str) -> None:
    """Raise ``LiveSettingsError`` for the first attribute that is not more than 0."""
    for name in names:
        if not getattr(settings, name) > 0:
            raise LiveSettingsError(f"{section}.{name}: got {getattr(settings, name)}, expected more than 0")


@dataclass(frozen=True)
class SessionRules:
    """How long a session waits, and what counts as a short gap.

    Attributes:
        hold_s: How long samples that came too early wait for the ones before them [s].
        hold_rows: How many may wait; beyond it the gap before them is taken for lost.
        short_gap_s: A gap up to this long is stepped through as samples that are no numbers, which the step holds and
            flags; after a longer one the session begins anew, as after a reset [s].
        warm_s: How long a model that a session changes to runs beside the old one before it takes over [s].
    """

    hold_s: float = 0.5
    hold_rows: int = 2000
    short_gap_s: float = 0.5
    warm_s: float = 10.0

    def __post_init__(self) -> None:
        """Refuse what is not positive; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "rules", "hold_s", "hold_rows", "short_gap_s", "warm_s")


@dataclass(frozen=True)
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

    sessions: int = 1000
    unkept_rows: int = 2_000_000
    idle_s: float = 600.0
    message_bytes: int = 1 << 20
    text_bytes: int = 1 << 16
    connections: int = 1000
    rows_per_s: float = 100_000.0
    loop_lag_s: float = 0.25

    def __post_init__(self) -> None:
        """Refuse what is not positive; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "limits", *(each.name for each in fields(self)))


@dataclass(frozen=True)
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
    port: int = 1883
    tls: bool = False
    ca_file: str | None = None
    user: str | None = None
    password_file: str | None = None

    def __post_init__(self) -> None:
        """Refuse what is no port, and a password in plain text to elsewhere; raises ``LiveSettingsError``."""
        refuse_unless_port("broker.port", self.port, 1)
        if self.password_file and not self.tls and not is_loopback(self.host):
            raise LiveSettingsError(
                f"broker.tls: got false with a password for {self.host}, expected true: anyone between would read it"
            )

    def password(self) -> str | None:
        """Return the password; raises ``OSError`` where its file cannot be read."""
        return token_of(self.password_file)


@dataclass(frozen=True)
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
    prefix: str = "cylinder-friction"
    client_id: str = "cylinder-friction-live"
    results_hz: float = 2.0
    waiting_messages: int = 500
    session_s: int = 60

    def __post_init__(self) -> None:
        """Refuse what is not positive, and wildcards; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "mqtt", "results_hz", "waiting_messages", "session_s")
        refuse_unless_topic("mqtt.prefix", self.prefix)


@dataclass(frozen=True)
class SparkplugSettings:
    """Births and data of Sparkplug B, ``spBv1.0/GROUP/.../NODE/SESSION``.

    Attributes:
        broker: Where messages go through.
        group: Group of edge nodes.
        node: This service among them.
        rate_hz: How often the latest newtons of a session are published.
    """

    broker: BrokerSettings = BrokerSettings()
    group: str = "cylinder-friction"
    node: str = "live"
    rate_hz: float = 1.0

    def __post_init__(self) -> None:
        """Refuse what is not positive, and names that are no level of a topic; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "sparkplug", "rate_hz")
        for key in ("group", "node"):
            refuse_unless_topic(f"sparkplug.{key}", getattr(self, key), levels=1)


@dataclass(frozen=True)
class LineProtocolSettings:
    """Estimates for a time-series database; either ``url`` or ``folder``.

    Attributes:
        url: Where lines are posted, as ``http://127.0.0.1:8086/write?db=friction``.
        folder: Where a file per UTC day is written.
        token_file: File of the token that ``url`` wants, a line.
        measurement: Name of the lines.
        rows_hz: Rows per second of a session, by sample index; 0: all.
        flush_s: Time between two sends [s].
        batch_rows: Rows of one post; a block more at most.
        queue_rows: Most rows that wait; beyond it the oldest are dropped.
    """

    url: str | None = None
    folder: str | None = None
    token_file: str | None = None
    measurement: str = "friction"
    rows_hz: float = 10.0
    flush_s: float = 1.0
    batch_rows: int = 5000
    queue_rows: int = 200_000

    def __post_init__(self) -> None:
        """Refuse both or neither place, and what is not positive; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "line_protocol", "flush_s", "batch_rows", "queue_rows")
        if self.rows_hz < 0.0:
            raise LiveSettingsError(f"line_protocol.rows_hz: got {self.rows_hz}, expected 0 (all) or more")
        if (self.url is None) == (self.folder is None):
            raise LiveSettingsError(
                f"line_protocol: got url {self.url!r}, folder {self.folder!r}; expected one of them"
            )
        if self.url is not None and not re.match(r"https?://", self.url):
            raise LiveSettingsError(f"line_protocol.url: got {self.url!r}, expected http://... or https://...")
