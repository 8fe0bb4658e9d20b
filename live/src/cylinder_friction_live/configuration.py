"""Configuration of the live service: a file whose keys are those of ``live.yaml`` beside this module."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from cylinder_friction.files.whole_files import read_yaml
from cylinder_friction_live.access import Access
from cylinder_friction_live.settings import LiveLimits, MqttSettings, OpcUaServerSettings, SessionRules

SHIPPED_FILE = Path(__file__).with_name("live.yaml")
"""File of all settings with their defaults."""


class ConfigurationError(ValueError):
    """A configuration that is refused; the message names the key."""


class LiveParams(BaseModel):
    """Settings of the service.

    Attributes:
        model: A saved estimator's folder, or ``models:/NAME@ALIAS``; None: the champion of the project's registry.
        host: Address that page, WebSocket and metrics listen on.
        port: Port to listen on; 0 for a free one.
        folder: Folder of the journal and the history.
        stribeck: File of identified curves, which the page draws beside the estimates; None: no curves.
        log: File for one JSON object per event; None: no such file.
        access: Tokens, TLS and names of the service.
        rules: Treatment of samples that come early, late or not at all.
        limits: Limits on clients, sessions and messages.
        mqtt: Frames and JSON through an MQTT 5 broker; None: off.
        opcua_server: Results through OPC UA; None: off.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)

    model: str | None = None
    host: str = "127.0.0.1"
    port: int = Field(default=5002, ge=0, le=65535)
    folder: Path = Field(default=Path("live-data"), strict=False)
    stribeck: Path | None = Field(default=None, strict=False)
    log: Path | None = Field(default=None, strict=False)
    access: Access = Access()
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


def load_live_params(path: Path) -> LiveParams:
    """Read a file of settings; keys that it does not state keep their defaults.

    Raises:
        ConfigurationError: The file is not there, is no YAML, or is refused; the message names the key.
    """
    try:
        content = read_yaml(path)
    except (OSError, ValueError) as error:
        raise ConfigurationError(f"{path}: cannot be read as YAML ({error})") from error
    try:
        # As JSON, so that in strict mode a mapping may be a dataclass
        return LiveParams.model_validate_json(json.dumps(content, default=str))
    except ValidationError as error:
        lines = [_explained(dict(problem)) for problem in error.errors()]
        raise ConfigurationError(f"{path}: refused, nothing was started\n  " + "\n  ".join(lines)) from None


def _explained(problem: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in problem["loc"]) or "(whole file)"
    if problem["type"] in ("extra_forbidden", "unexpected_keyword_argument"):
        return f"{key}: unknown key; check its spelling against {SHIPPED_FILE}"
    got = "" if isinstance(problem["input"], dict) else f", but got {problem['input']!r}"
    return f"{key}: {problem['msg'].removeprefix('Value error, ')}{got}"
