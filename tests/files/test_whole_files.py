import hashlib
import os
from pathlib import Path

import pytest

from cylinder_friction.files.whole_files import hash_of, read_yaml


@pytest.mark.parametrize("size", [0, 1, 2**18, 2**20 + 7])
def test_hash_of_a_file_is_sha_256_of_its_bytes(tmp_path: Path, size: int) -> None:
    content = bytes(index % 251 for index in range(size))
    (tmp_path / "file").write_bytes(content)
    assert hash_of(tmp_path / "file") == hashlib.sha256(content).hexdigest()


def test_hash_of_a_folder_tells_names_and_contents(tmp_path: Path) -> None:
    for name, content in (("b.txt", b"two"), ("a/c.txt", b"one"), ("__pycache__/x.pyc", b"code")):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(content)
    lines = [f"{name}\0{hashlib.sha256(text).hexdigest()}\n" for name, text in (("a/c.txt", b"one"), ("b.txt", b"two"))]
    first = hash_of(tmp_path)
    assert first == hashlib.sha256("".join(lines).encode()).hexdigest()
    (tmp_path / "__pycache__/x.pyc").write_bytes(b"other code")
    assert hash_of(tmp_path) == first
    (tmp_path / "b.txt").rename(tmp_path / "d.txt")
    assert hash_of(tmp_path) != first


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("5", "expected keys and values, but got '5'"),
        ("[1, 2]", "expected keys and values"),
        ("a: !!python/object/apply:os.system [ls]", "is no YAML of plain keys and values .could not determine a cons"),
        ("a: &a {b: *a}", "is no YAML of plain keys and values .Circular reference"),
        ("a: [", "is no YAML of plain keys and values"),
        ("#" * (1 << 20) + "\n", "expected a regular file of at most 1048576 bytes"),
    ],
)
def test_yaml_that_is_no_configuration_is_refused_in_a_sentence(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "mapping.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=f"mapping.yaml: {message}") as refused:
        read_yaml(path)
    assert "\n" not in str(refused.value)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(ValueError, match="expected a regular file"):
        read_yaml(path)
