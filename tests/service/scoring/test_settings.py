"""Settings of a server: what is refused before anything starts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from cylinder_friction.service.access import AccessError
from cylinder_friction.service.scoring.settings import ServeSettings


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"host": "0.0.0.0"}, "host 0.0.0.0: whoever reaches it could use the model; give a file of tokens"),
        ({"host": "example.org"}, "host example.org: whoever"),
        ({"port": 65536}, "port: got 65536, expected 0 to 65535"),
        ({"max_rows": 0}, "max_rows: got 0, expected more than 0"),
        ({"timeout_s": float("nan")}, "timeout_s: got nan"),
        ({"tls_key": Path("key.pem")}, "TLS needs both a certificate and its key"),
    ],
)
def test_what_cannot_be_served_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(AccessError, match=message):
        ServeSettings(**given)


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost", "127.9.9.9"])
def test_loopback_needs_no_tokens(host: str) -> None:
    assert ServeSettings(host=host).host == host


@pytest.mark.parametrize("open_to_all", [{"tokens": Path("tokens")}, {"without_tokens": True}])
def test_other_hosts_need_tokens_or_a_statement(open_to_all: dict[str, Any]) -> None:
    assert ServeSettings(host="0.0.0.0", **open_to_all).host == "0.0.0.0"


def test_settings_travel_to_a_worker_as_json() -> None:
    settings = ServeSettings(port=7, tokens=Path("some/tokens"), timeout_s=2.5, without_tokens=True)
    assert ServeSettings.from_json(settings.to_json()) == settings
