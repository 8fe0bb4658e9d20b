"""The file of tokens: what it may hold, and what is refused."""

from hashlib import sha256
from pathlib import Path

import pytest

from cylinder_friction_live.access import AccessError, TokenFile, read_tokens

HASH = sha256(b"abc").hexdigest()


def test_a_hash_and_its_role_are_read(tmp_path: Path) -> None:
    (tmp_path / "tokens").write_text(f"# two\n\n{HASH}  read\n{HASH.upper()} write of a press\n")
    assert read_tokens(tmp_path / "tokens") == ((HASH, "read"), (HASH, "write"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "tokens: holds no token; expected the SHA-256"),
        ("# nobody\n", "tokens: holds no token"),
        (f"{HASH} read\nabc\n", "tokens:2: expected the SHA-256 of a token, as `sha256sum` writes it"),
        ("g" * 64, "tokens:1: expected"),
        (f"{HASH}  -", "tokens:1: got '-' behind the hash, expected a role: read, write"),
        (HASH, "tokens:1: got '' behind the hash, expected a role"),
        (sha256(b"").hexdigest(), "tokens:1: the hash of an empty token; expected that of one which is hard to guess"),
        ("\u00e9", "tokens: its tokens cannot be read"),
    ],
)
def test_another_file_is_refused(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "tokens").write_text(text)
    with pytest.raises(AccessError, match=message):
        TokenFile(tmp_path / "tokens")


def test_a_file_that_breaks_leaves_the_old_tokens_and_says_so(tmp_path: Path) -> None:
    path = tmp_path / "tokens"
    path.write_text(f"{HASH} read")
    tokens = TokenFile(path)
    path.write_text("no hash")
    assert tokens.refresh()
    assert not tokens.refresh()
    assert tokens.refusal(b"abc", "read") is None
    assert "tokens:1: expected the SHA-256 of a token" in tokens.problem
    assert tokens.problem.endswith("the tokens stay as they were")
    path.write_text(f"{HASH} read\n")
    assert tokens.refresh()
    assert tokens.problem == ""


@pytest.mark.parametrize("left", [None, "", "# nobody\n"])
def test_a_file_that_is_emptied_or_deleted_lets_nobody_in(tmp_path: Path, left: str | None) -> None:
    path = tmp_path / "tokens"
    path.write_text(f"{HASH} read")
    tokens = TokenFile(path)
    path.unlink()
    if left is not None:
        path.write_text(left)
    assert tokens.refresh()
    refusal = tokens.refusal(b"abc", "read")
    assert refusal is not None
    assert refusal.status == 401
    path.write_text(f"{HASH} read\n")
    assert tokens.refresh()
    assert tokens.refusal(b"abc", "read") is None
