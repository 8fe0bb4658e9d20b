"""Bearer tokens, of which the server knows the hashes alone."""

import hmac
import logging
from hashlib import sha256
from pathlib import Path

from cylinder_friction.serving.settings import ServingError, file_stamp

_log = logging.getLogger(__name__)


def read_tokens(path: Path) -> tuple[str, ...]:
    """Return the SHA-256 of every token: the first word of each line; lines that begin with # are comments.

    Raises:
        ServingError: The file cannot be read, is empty, or holds something else.
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise ServingError(f"{path}: its tokens cannot be read ({error})") from error
    hashes = []
    for number, line in enumerate(lines, 1):
        if not line.strip() or line.startswith("#"):
            continue
        word = line.split()[0].lower()
        if len(word) != 64 or set(word) - set("0123456789abcdef"):
            raise ServingError(f"{path}:{number}: expected the SHA-256 of a token, as `sha256sum` writes it")
        hashes.append(word)
    if not hashes:
        raise ServingError(f"{path}: holds no token; expected the SHA-256 of one per line")
    return tuple(hashes)


class TokenFile:
    """The tokens of a file, read again when it changes."""

    def __init__(self, path: Path) -> None:
        """Read the file; raises ``ServingError`` as ``read_tokens`` does."""
        self._path, self._stamp = path, file_stamp(path)
        self._hashes = read_tokens(path)

    def refresh(self) -> None:
        """Read the file again if it has changed; if it cannot be read, the old tokens stay."""
        stamp = file_stamp(self._path)
        if stamp != self._stamp:
            self._stamp = stamp
            try:
                self._hashes = read_tokens(self._path)
            except ServingError as error:
                _log.error("%s; the tokens stay as they were", error)

    def knows(self, authorization: bytes) -> bool:
        """Return whether a header ``Bearer TOKEN`` holds a known token; takes equally long for all."""
        scheme, _, token = authorization.partition(b" ")
        found = sha256(token.strip()).hexdigest()
        known = [hmac.compare_digest(found, each) for each in self._hashes]
        return scheme.lower() == b"bearer" and any(known)
