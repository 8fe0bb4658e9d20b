"""The live service's configuration: what is shipped are the defaults, and what is wrong is refused by its key."""

from __future__ import annotations

from pathlib import Path

import pytest

from cylinder_friction_live.access import ROLES
from cylinder_friction_live.configuration import SHIPPED_FILE, ConfigurationError, LiveParams, load_live_params


def test_the_shipped_file_states_every_default() -> None:
    assert load_live_params(SHIPPED_FILE) == LiveParams()
    text = SHIPPED_FILE.read_text(encoding="utf-8")
    assert [name for name in LiveParams.model_fields if f"\n{name}:" not in text] == []
    assert f"`SHA256 {'|'.join(ROLES)}` per line" in text


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("prot: 5002", f"prot: unknown key; check its spelling against {SHIPPED_FILE}"),
        ("port: 70000", "port: Input should be less than or equal to 65535, but got 70000"),
        ("rules: {hold_s: -1.0}", "rules.hold_s: Input should be greater than 0, but got -1.0"),
        ("limits: {sesions: 5}", "limits.sesions: unknown key"),
        ("limits: {sessions: 0}", "limits.sessions: Input should be greater than 0, but got 0"),
        ("host: 0.0.0.0", "host 0.0.0.0: whoever reaches it could use the model; give a file of tokens"),
        ("access: {tls_key: a.pem}", "TLS needs both a certificate and its key; got one of them"),
        ("port: [", "cannot be read as YAML"),
        ("mqtt: {prefix: 'a/#'}", "mqtt.prefix: expected up to 20 levels of a topic"),
        ("mqtt: {results_hz: 0.0}", "mqtt.results_hz: Input should be greater than 0"),
        ("mqtt: {broker: {port: 0}}", "mqtt.broker.port: Input should be greater than or equal to 1"),
        ("mqtt: {broker: {host: a.b, password_file: word}}", "mqtt.broker: tls: got false with a password for a.b"),
        ("opcua_server: {host: 0.0.0.0}", "which others reach; give opcua_server.certificate and private_key, and ac"),
        ("opcua_server: {host: 0.0.0.0, certificate: a, private_key: b}", "which others reach"),
        ("opcua_server: {certificate: a}", "expected both certificate and private_key, or neither"),
        ("opcua_server: {update_hz: 100.0}", "opcua_server.update_hz: Input should be less than or equal to 10, but"),
    ],
)
def test_what_is_wrong_is_refused_by_its_key(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "plant.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigurationError) as refused:
        load_live_params(path)
    assert message in str(refused.value)
    assert str(path) in str(refused.value)
    with pytest.raises(ConfigurationError, match=r"none\.yaml: cannot be read"):
        load_live_params(tmp_path / "none.yaml")
