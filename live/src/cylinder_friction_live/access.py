"""Access to the service: it needs tokens before it listens beyond loopback, and knows each bearer token by its hash."""

import hmac
import logging
from dataclasses import dataclass
from hashlib import sha256
from ipaddress import ip_address
from pathlib import Path

ROLES = ("read", "write")
"""``read`` may see page, results and metrics; ``write`` may also open sessions and send samples."""
LOOPBACK = frozenset({"127.0.0.1", "localhost", "::1"})
"""Names under which a browser on this machine reaches a service."""
_OF_NOTHING = sha256(b"").hexdigest()
_log = logging.getLogger(__name__)


class AccessError(ValueError):
    """The service would be open to everybody, or its tokens cannot be read; the message states what to do."""


def is_loopback(host: str) -> bool:
    """Check whether only this machine can reach a service that listens on ``host``."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


@dataclass(frozen=True)
class Access:
    """Settings of access to the service.

    Attributes:
        tokens: File with the SHA-256 of a token and its role per line; None: every client may do everything. The
            service reads the file again when it changes.
        without_tokens: Listen beyond loopback without tokens.
        tls_certificate, tls_key: PEM files; both or neither.
        hosts: Names and addresses under which the service may be addressed, besides its own and those of loopback.
    """

    tokens: Path | None = None
    without_tokens: bool = False
    tls_certificate: Path | None = None
    tls_key: Path | None = None
    hosts: tuple[str, ...] = ()

    def refuse_exposed(self, host: str) -> None:
        """Refuse a service beyond loopback without tokens, and half of a TLS pair; raises ``AccessError``."""
        if (self.tls_certificate is None) != (self.tls_key is None):
            raise AccessError("TLS needs both a certificate and its key; got one of them")
        if not (is_loopback(host) or self.tokens or self.without_tokens):
            raise AccessError(
                f"host {host}: whoever reaches it could use the model; give a file of tokens, listen on "
                "127.0.0.1, or state that no tokens are wanted"
            )


@dataclass(frozen=True)
class Refusal:
    """Refusal of a connection: kind for the counter, HTTP status, reason."""

    kind: str
    status: int
    reason: str


def _stamp(path: Path) -> tuple[int, int]:
    """Read what changes when a file is written anew; zeros if there is no file."""
    try:
        found = path.stat()
    except OSError:
        return 0, 0
    return found.st_mtime_ns, found.st_ino


def read_tokens(path: Path, *, may_be_empty: bool = False) -> tuple[tuple[str, str], ...]:
    """Read the SHA-256 and the role of every token: the first two words of each line; # begins a comment.

    Args:
        path: The file.
        may_be_empty: Whether a missing file, or one without a token, means no tokens; otherwise it is refused.

    Raises:
        AccessError: The file cannot be read, is empty, or is no list of hashes and roles.
    """
    if may_be_empty and not path.exists():
        return ()
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise AccessError(f"{path}: its tokens cannot be read ({error})") from error
    tokens = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        word, role = [*line.split(), ""][:2]
        if len(word) != 64 or set(word.lower()) - set("0123456789abcdef"):
            raise AccessError(f"{path}:{number}: expected the SHA-256 of a token, as `sha256sum` writes it")
        if word.lower() == _OF_NOTHING:
            raise AccessError(
                f"{path}:{number}: the hash of an empty token; expected that of one which is hard to guess"
            )
        if role not in ROLES:
            raise AccessError(f"{path}:{number}: got {role!r} behind the hash, expected a role: {', '.join(ROLES)}")
        tokens.append((word.lower(), role))
    if not (tokens or may_be_empty):
        raise AccessError(f"{path}: holds no token; expected the SHA-256 of one per line")
    return tuple(tokens)


class TokenFile:
    """The tokens of a file, read again when it changes; an emptied or deleted file admits nobody.

    Attributes:
        problem: Why the file's present tokens do not count; empty if they do.
    """

    def __init__(self, path: Path) -> None:
        """Read the file; raises ``AccessError`` as ``read_tokens`` does."""
        self._path, self._read = path, _stamp(path)
        self._tokens, self.problem = read_tokens(path), ""

    def refresh(self) -> bool:
        """Read the file again if it has changed; return whether it has. If it cannot be read, the old tokens stay."""
        stamp = _stamp(self._path)
        if stamp == self._read:
            return False
        self._read = stamp
        try:
            self._tokens, self.problem = read_tokens(self._path, may_be_empty=True), ""
        except AccessError as error:
            self.problem = f"{error}; the tokens stay as they were"
            _log.error(self.problem)
        else:
            if not self._tokens:
                _log.error("%s: holds no token any more; nobody is let in until it does", self._path)
        return True

    def role_of(self, token: bytes) -> str | None:
        """Look up the role of a token, None if the token is unknown; the time does not depend on the token."""
        found = sha256(token).hexdigest()
        known = [(hmac.compare_digest(found, each), role) for each, role in self._tokens]
        return next((role for same, role in known if same), None)

    def refusal(self, token: bytes, role: str) -> Refusal | None:
        """State why a token is refused for a role, None if it is not; each role may do what the roles before it may."""
        has = self.role_of(token)
        if has is None:
            return Refusal("token", 401, "expected a known token as Authorization: Bearer TOKEN")
        if ROLES.index(has) < ROLES.index(role):
            expected = " or ".join(ROLES[ROLES.index(role) :])
            return Refusal("role", 403, f"the role of this token is {has}; expected {expected}")
        return None


def bearer_token(authorization: bytes) -> bytes:
    """Read the token of a header ``Bearer TOKEN``; empty, which no file holds, for any other header."""
    scheme, _, token = authorization.partition(b" ")
    return token.strip() if scheme.lower() == b"bearer" else b""
