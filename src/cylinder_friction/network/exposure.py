"""Who can reach a service, and what it needs before others than this machine may."""

from ipaddress import ip_address
from pathlib import Path


class AccessError(ValueError):
    """A service that would be open to anybody, or tokens that cannot be read; the message states what to do."""


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach a service that listens on ``host``."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def refuse_exposed(
    host: str, tokens: Path | None, without_tokens: bool, tls_certificate: Path | None, tls_key: Path | None
) -> None:
    """Refuse a service that others reach without tokens, and half of a TLS pair; raises ``AccessError``."""
    if (tls_certificate is None) != (tls_key is None):
        raise AccessError("TLS needs both a certificate and its key; got one of them")
    if not (is_loopback(host) or tokens or without_tokens):
        raise AccessError(
            f"host {host}: whoever reaches it could use the model; give a file of tokens, listen on "
            "127.0.0.1, or state that no tokens are wanted"
        )


def file_stamp(path: Path) -> tuple[int, int]:
    """Return what changes when a file is written anew; zeros where it is not there."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_ino
