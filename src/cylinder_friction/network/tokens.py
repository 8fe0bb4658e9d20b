"""Bearer tokens, of which a service knows the hashes alone."""

import hmac
import logging
from collections.abc import Collection
from hashlib import sha256
from pathlib import Path

from cylinder_friction.network.exposure import AccessError, file_stamp

_OF_NOTHING = sha256(b"").hexdigest()
_log = logging.getLogger(__name__)


def read_tokens(path: Path, roles: Collection[str] = ()) -> tuple[tuple[str, str], ...]:
    """Return the SHA-256 of every token, the first word of each line, with the second word; # begins a comment.

    Args:
        path: A file as ``sha256sum`` writes it.
        roles: What the second word must be one of; empty: it is a comment.

    Raises:
        AccessError: The file cannot be read, is empty, or holds something else.
    """
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
        if roles and role not in roles:
            raise AccessError(f"{path}:{number}: got {role!r} behind the hash, expected a role: {', '.join(roles)}")
        tokens.append((word.lower(), role))
    if not tokens:
        raise AccessError(f"{path}: holds no token; expected the SHA-256 of one per line")
    return tuple(tokens)


class TokenFile:
    """The tokens of a file, read again when it changes."""

    def __init__(self, path: Path, roles: Collection[str] = ()) -> None:
        """Read the file; raises ``AccessError`` as ``read_tokens`` does."""
        self._path, self._roles, self._stamp = path, roles, file_stamp(path)
        self._tokens = read_tokens(path, roles)

    def refresh(self) -> bool:
        """Read the file again if it has changed, return whether it has; if it cannot be read, the old tokens stay."""
        stamp = file_stamp(self._path)
        if stamp == self._stamp:
            return False
        self._stamp = stamp
        try:
            self._tokens = read_tokens(self._path, self._roles)
        except AccessError as error:
            _log.error("%s; the tokens stay as they were", error)
        return True

    def role_of(self, token: bytes) -> str | None:
        """Return the second word of a token's line, None where it is not known; takes equally long for all."""
        found = sha256(token).hexdigest()
        known = [(hmac.compare_digest(found, each), role) for each, role in self._tokens]
        return next((role for same, role in known if same), None)

    def knows(self, authorization: bytes) -> bool:
        """Return whether a header ``Bearer TOKEN`` holds a known token."""
        return self.role_of(bearer_token(authorization)) is not None


def bearer_token(authorization: bytes) -> bytes:
    """Return the token of a header ``Bearer TOKEN``; empty where it is none, which no file holds."""
    scheme, _, token = authorization.partition(b" ")
    return token.strip() if scheme.lower() == b"bearer" else b""
