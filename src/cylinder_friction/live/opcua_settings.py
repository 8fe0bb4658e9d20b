"""What the links by OPC UA are given."""

from dataclasses import dataclass

from cylinder_friction.live.settings import LOOPBACK, LiveSettingsError, refuse_unless_port, refuse_unless_positive


@dataclass(frozen=True)
class OpcUaServerSettings:
    """The OPC UA server of results.

    Attributes:
        host: Address that it listens on: one of this machine's loopback, whoever reaches it may read.
        port: Its port.
        update_hz: How often values are updated, 1 to 10 [Hz].
        range_n: Friction is expected within ± this: ``EURange`` of the three forces [N].
        health_s: For how long a failed sensor counts for ``DeviceHealth`` after it has recovered [s].
        sessions: Most sessions that have an object; those that were closed keep theirs.
    """

    host: str = "127.0.0.1"
    port: int = 4840
    update_hz: float = 2.0
    range_n: float = 10_000.0
    health_s: float = 60.0
    sessions: int = 2000

    def __post_init__(self) -> None:
        """Refuse what cannot be; raises ``LiveSettingsError``."""
        refuse_unless_positive(self, "opcua_server", "range_n", "health_s", "sessions")
        refuse_unless_port("opcua_server.port", self.port, 1)
        if not 1.0 <= self.update_hz <= 10.0:
            raise LiveSettingsError(f"opcua_server.update_hz: got {self.update_hz}, expected 1 to 10")
        if self.host not in LOOPBACK:
            raise LiveSettingsError(f"opcua_server.host: got {self.host!r}, expected one of {', '.join(LOOPBACK)}")
