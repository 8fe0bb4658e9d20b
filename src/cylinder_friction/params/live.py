"""Configuration of the live service: a file of its own, for it shapes no stage of the pipeline."""

from __future__ import annotations

from pathlib import Path

from pydantic import Field, model_validator

from cylinder_friction.params.file import ParamsError
from cylinder_friction.params.section import Section, checked
from cylinder_friction.recordings.files import read_yaml
from cylinder_friction.service.access import LiveAccess
from cylinder_friction.service.live.settings import (
    LiveLimits,
    MqttSettings,
    OpcUaServerSettings,
    SessionRules,
)

LIVE_FILE = Path("conf/live/default.yaml")


class LiveParams(Section):
    """``conf/live/*.yaml``.

    Attributes:
        model: A saved estimator's folder, or ``models:/NAME@ALIAS``; None: the champion of the project's registry.
        host: Address that page, WebSocket and metrics listen on.
        port: 0 for a free one.
        folder: Of the journal and the history.
        stribeck: File of curves identified before, which the page draws beside the estimates; None: none.
        log: File that gets one JSON object per event; None: none does.
        access: Who may reach it.
        rules: What becomes of samples that come early, late or not.
        limits: What the service takes.
        mqtt: Frames and JSON by an MQTT 5 broker; None: off.
        opcua_server: Results by OPC UA; None: off.
    """

    model: str | None = None
    host: str = "127.0.0.1"
    port: int = Field(default=5002, ge=0, le=65535)
    folder: Path = Field(default=Path("live"), strict=False)
    stribeck: Path | None = Field(default=None, strict=False)
    log: Path | None = Field(default=None, strict=False)
    access: LiveAccess = LiveAccess()
    rules: SessionRules = SessionRules()
    limits: LiveLimits = LiveLimits()
    mqtt: MqttSettings | None = None
    opcua_server: OpcUaServerSettings | None = None

    @model_validator(mode="after")
    def _not_exposed(self) -> LiveParams:
        self.access.refuse_exposed(self.host)
        if self.opcua_server is not None:
            self.opcua_server.refuse_exposed(self.access.tokens)
        return self


def load_live_params(path: Path | None = None) -> LiveParams:
    """Read a file; without one ``conf/live/default.yaml`` where there is one, else what it holds as shipped.

    Raises:
        ParamsError: The file is not there, is no YAML, or is refused; the message names the key.
    """
    if path is None and not LIVE_FILE.is_file():
        return LiveParams()
    path = path or LIVE_FILE
    try:
        content = read_yaml(path)
    except (OSError, ValueError) as error:
        raise ParamsError(f"{path}: cannot be read as YAML ({error})") from error
    return checked(LiveParams, content, str(path))
