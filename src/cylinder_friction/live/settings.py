"""What a live service is given: how long a session waits, what is taken, and by which links."""

from dataclasses import dataclass
from pathlib import Path

LOOPBACK = ("127.0.0.1", "localhost", "::1")


class LiveSettingsError(ValueError):
    """Settings that cannot be; the message names the key."""


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
    """

    sessions: int = 1000
    unkept_rows: int = 2_000_000
    idle_s: float = 600.0
    message_bytes: int = 1 << 20

    def __post_init__(self) -> None:
        """Refuse what is not positive; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "limits", "sessions", "unkept_rows", "idle_s", "message_bytes")


@dataclass(frozen=True)
class TcpSettings:
    """Raw TCP, for clients without WebSocket. It has neither TLS nor tokens, and therefore stays on this machine.

    Attributes:
        host: An address of this machine's loopback.
        port: 0 for a free one.
    """

    host: str = "127.0.0.1"
    port: int = 5003

    def __post_init__(self) -> None:
        """Refuse other machines' addresses and what is no port; raises ``LiveSettingsError``."""
        if self.host not in LOOPBACK:
            raise LiveSettingsError(
                f"tcp.host: got {self.host!r}, expected one of {', '.join(LOOPBACK)}: raw TCP has neither TLS nor "
                "tokens; from elsewhere use WebSocket or MQTT, or a tunnel"
            )
        refuse_unless_port("tcp.port", self.port)


def refuse_unless_port(key: str, port: int, least: int = 0) -> None:
    """Raise ``LiveSettingsError`` for what is no port."""
    if not least <= port <= 65535:
        raise LiveSettingsError(f"{key}: got {port}, expected {least} to 65535")


@dataclass(frozen=True)
class LiveAccess:
    """Who may reach a service.

    Attributes:
        tokens: File of one ``SHA256 ROLE`` per line; None: whoever reaches the service may do all. Read again when it
            changes.
        without_tokens: Listen beyond loopback although there are no tokens.
        hosts: Names and addresses under which the service may be addressed, besides its own and those of loopback.
        tls_certificate, tls_key: PEM files; both or neither.
    """

    tokens: Path | None = None
    without_tokens: bool = False
    hosts: tuple[str, ...] = ()
    tls_certificate: Path | None = None
    tls_key: Path | None = None


def refuse_unless_positive(settings: object, section: str, *names: str) -> None:
    """Raise ``LiveSettingsError`` for the first attribute that is not more than 0."""
    for name in names:
        if not getattr(settings, name) > 0:
            raise LiveSettingsError(f"{section}.{name}: got {getattr(settings, name)}, expected more than 0")
