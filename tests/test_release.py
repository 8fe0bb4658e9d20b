"""A release's changelog must fit its version, and what cites the project must be well formed."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
import release

PROJECT = Path(__file__).parents[1]


@pytest.mark.parametrize(
    ("version", "changelog", "refusal"),
    [
        ("1.0", "# Changelog\n\n## 1.0\n\n- New.\n\n## 0.9\n", ""),
        ("1.0.dev0", "# Changelog\n\n## Unreleased\n\n- New.\n", ""),
        ("1.0", "# C\n\n## Unreleased\n\n- New.\n", "its first section is 'Unreleased', but version 1.0 needs '1.0'"),
        ("1.0.dev0", "# C\n\n## 1.0\n\n- New.\n", "first section is '1.0', but version 1.0.dev0 needs 'Unreleased'"),
        ("1.0", "# C\n\n## 1.0\n\n## 0.9\n\n- Old.\n", "section '1.0' has no entry"),
    ],
)
def test_the_changelog_must_fit_the_version(version: str, changelog: str, refusal: str) -> None:
    found = release.changelog_refusal(version, changelog)
    assert refusal in found
    assert bool(refusal) == bool(found)


def test_that_of_this_version_does() -> None:
    version = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    assert release.changelog_refusal(version, (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")) == ""
