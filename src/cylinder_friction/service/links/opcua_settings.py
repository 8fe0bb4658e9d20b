"""What the links by OPC UA are given."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from cylinder_friction.service.access import is_loopback
from cylinder_friction.service.live.settings import LiveSettingsError, refuse_unless_port, refuse_unless_positive


@dataclass(frozen=True)
class OpcUaServerSettings:
    """The OPC UA server of results.

    Attributes:
        host: Address that it listens on; other than loopback only with certificate, key and the service's tokens.
        port: Its port.
        update_hz: How often values are updated, 1 to 10 [Hz].
        range_n: Friction is expected within ± this: ``EURange`` of the three forces [N].
        health_s: For how long a failed sensor counts for ``DeviceHealth`` after it has recovered [s].
        sessions: Most sessions that have an object, an hour longer than they are open.
        certificate, private_key: Files of the server's; with them connections are signed and encrypted, all of them.
    """

    host: str = "127.0.0.1"
    port: int = 4840
    update_hz: float = 2.0
    range_n: float = 10_000.0
    health_s: float = 60.0
    sessions: int = 2000
    certificate: Path | None = None
    private_key: Path | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "opcua_server", "range_n", "health_s", "sessions")
        refuse_unless_port("opcua_server.port", self.port, 1)
        if not 1.0 <= self.update_hz <= 10.0:
            raise LiveSettingsError(f"opcua_server.update_hz: got {self.update_hz}, expected 1 to 10")
        _refuse_half(self, "opcua_server", "certificate", "private_key")

    def refuse_exposed(self, tokens: Path | None) -> None:
        """Refuse what others could read or listen to; raises ``LiveSettingsError``."""
        if not is_loopback(self.host) and (tokens is None or self.certificate is None):
            raise LiveSettingsError(
                f"opcua_server.host: got {self.host!r}, which others reach; give opcua_server.certificate and "
                "private_key, and access.tokens, or listen on 127.0.0.1"
            )


class OpcUaValues(NamedTuple):
    """What the server shows of a session next."""

    session: str
    last_index: int  # Of its latest sample
    time_s: float  # When that was sampled, in the sender's clock
    newtons: list[float]  # Friction, lower and upper bound [N]
    flags: int  # Of the latest sample
    flags_since: int  # Of all samples since the last update
    age_s: float  # How long ago the session's last samples came


@dataclass(frozen=True)
class OpcUaSource:
    """Nodes of one cylinder: ``samples`` or ``inputs``.

    Attributes:
        session: Name of its session.
        samples: A node whose value is an array of doubles: index of the first sample, then the samples, row by row.
        inputs: A node per input of the model, each with one value in SI units.
        sampling_ms: How often the server is asked to look at the nodes [ms]; 0: as often as it can.
    """

    session: str
    samples: str | None = None
    inputs: dict[str, str] = field(default_factory=dict)
    sampling_ms: float = 0.0

    def __post_init__(self) -> None:
        """Refuse both or neither; raises ``LiveSettingsError``."""
        if (self.samples is None) == (not self.inputs):
            raise LiveSettingsError(
                f"opcua_client.sources: session {self.session!r}: expected either samples, one node, or inputs, a node "
                "per input of the model"
            )


@dataclass(frozen=True)
class OpcUaClientSettings:
    """Samples from an OPC UA server.

    Attributes:
        url: Of the server, such as ``opc.tcp://plc:4840``.
        sources: Its nodes.
        publishing_ms: How often the server sends what is new [ms].
        queue: How many values of a node the server is asked to keep between two sends.
        user, password_file: Name, and file of the password; without: anonymous.
        certificate, private_key: Files of this client's, for a signed and encrypted connection; without: neither.
    """

    url: str
    sources: tuple[OpcUaSource, ...]
    publishing_ms: float = 50.0
    queue: int = 1000
    user: str | None = None
    password_file: Path | None = None
    certificate: Path | None = None
    private_key: Path | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "opcua_client", "publishing_ms", "queue")
        _refuse_half(self, "opcua_client", "user", "password_file")
        _refuse_half(self, "opcua_client", "certificate", "private_key")


def _refuse_half(settings: object, section: str, one: str, other: str) -> None:
    if (getattr(settings, one) is None) != (getattr(settings, other) is None):
        raise LiveSettingsError(f"{section}: expected both {one} and {other}, or neither")
