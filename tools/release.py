"""Build a release into ``dist/``: sdist and wheel, checked, their hashes, and the bill of materials (CycloneDX).

``python tools/release.py`` refuses a tree with changes, and a changelog that does not fit the version: a final version
has the first section, a ``.dev`` one has entries under *Unreleased*.
"""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

PROJECT = Path(__file__).parents[1]
DIST = PROJECT / "dist"
BUILD = "from hatchling.build import build_{kind}; import sys; build_{kind}(sys.argv[1])"


def changelog_refusal(version: str, changelog: str) -> str:
    """Return why the changelog does not fit a version; empty where it does."""
    heading, text = re.split(r"^## (.*)\n", changelog, flags=re.MULTILINE)[1:3]
    expected = "Unreleased" if ".dev" in version else version
    if heading != expected:
        return f"CHANGELOG.md: its first section is {heading!r}, but version {version} needs {expected!r}"
    return "" if "- " in text else f"CHANGELOG.md: section {heading!r} has no entry"


def run(*command: str | Path) -> str:
    done = subprocess.run(list(map(str, command)), cwd=PROJECT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}\n{done.stdout}{done.stderr}")
    return done.stdout


def main() -> None:
    """Build and check."""
    version = tomllib.loads((PROJECT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    if changed := run("git", "status", "--porcelain"):
        sys.exit(f"changes that are in no commit; commit or remove them first:\n{changed}")
    if refusal := changelog_refusal(version, (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")):
        sys.exit(refusal)
    shutil.rmtree(DIST, ignore_errors=True)
    for kind in ("sdist", "wheel"):
        run(sys.executable, "-c", BUILD.format(kind=kind), DIST)
    files = sorted(DIST.iterdir())
    print(run(sys.executable, "-m", "twine", "check", "--strict", *files).strip())
    (wheel,) = DIST.glob(f"cylinder_friction-{version}-*.whl")
    with zipfile.ZipFile(wheel) as archive:
        held = set(archive.namelist())
    for path in run("git", "ls-files", "src", "conf").split():
        place = path.removeprefix("src/") if path.startswith("src/") else f"cylinder_friction/project/{path}"
        if place not in held:
            sys.exit(f"{wheel.name}: {path} is not inside")
    bill = DIST / f"cylinder_friction-{version}.cdx.json"
    options = ["--pyproject", "pyproject.toml", "--output-reproducible", "--mc-type", "library"]
    run(sys.executable, "-m", "cyclonedx_py", "requirements", "requirements.lock", "-o", bill, *options)
    sums = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in [*files, bill])
    (DIST / "SHA256SUMS").write_text(sums, encoding="utf-8")
    print(sums.rstrip())


if __name__ == "__main__":
    main()
