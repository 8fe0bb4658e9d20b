"""The wheel alone, outside the repository: from installation to friction of a log, and to a served champion.

    python performance/outside_the_repository.py [--torch WHEEL]

Builds the wheel, makes two new environments in a temporary folder, and prints each command with its seconds: the core,
with which a log becomes a CSV of friction; and ``[pipeline]``, with which ``dvc repro`` runs the smoke recipe in a new
project and the champion is served and asked about real rows. Prints megabytes of each environment too.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

from empty_environment import megabytes

from cylinder_friction.commands.init import EXAMPLE
from cylinder_friction.network.ports import free_port

BUILD = "from hatchling.build import build_wheel; import sys; build_wheel(sys.argv[1])"
SHOWN_LINES = 3


class Shell:
    """A user's shell with one environment activated, which prints what each line typed in it costs."""

    def __init__(self, environment: Path, folder: Path) -> None:
        """Make the environment."""
        self.environment, self.folder = environment, folder
        clean = ("PATH", "HOME", "LANG", "SSL_CERT_FILE", "PIP_INDEX_URL", "PIP_CERT", "PIP_FIND_LINKS")
        self.variables = {key: os.environ[key] for key in clean if key in os.environ}
        self.variables["PATH"] = f"{environment / 'bin'}{os.pathsep}{os.environ['PATH']}"
        self.seconds = 0.0
        subprocess.run([sys.executable, "-m", "venv", environment], check=True)
        self.empty_mb = megabytes(environment)

    def run(self, *command: str) -> str:
        """Return what the line prints; shows its end, and the seconds it took."""
        began = time.monotonic()
        done = subprocess.run(command, cwd=self.folder, env=self.variables, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise SystemExit(f"{' '.join(command)}\n{done.stdout}\n{done.stderr}")
        took = time.monotonic() - began
        self.seconds += took
        print(f"{took:6.1f} s  $ {' '.join(command)}")
        print("".join(f"            {line}\n" for line in done.stdout.strip().splitlines()[-SHOWN_LINES:]), end="")
        return done.stdout

    def size(self) -> str:
        return f"{megabytes(self.environment) - self.empty_mb:.0f} MB installed, {self.seconds:.0f} s in all"


def log_to_friction(shell: Shell, wheel: str) -> None:
    """The core: from nothing to a CSV file of friction."""
    shell.run("pip", "install", "-q", wheel)
    shell.run("cylinder-friction", "init", "project")
    shell.folder /= "project"
    shell.run("cylinder-friction", "estimate", EXAMPLE, "--channels", "conf/ingest/rig.yaml", "--format", "csv")
    (written,) = (shell.folder / "friction").glob("**/*.csv")
    lines = written.read_text(encoding="utf-8").splitlines()
    print(f"            {written.name}: {len(lines) - 1} rows of {lines[0]}")


def pipeline_to_served_champion(shell: Shell, wheel: str, torch: str | None) -> None:
    """The extras: a whole pipeline in a new project, and friction over HTTP from its champion."""
    if torch is not None:
        shell.run("pip", "install", "-q", torch)
    shell.run("pip", "install", "-q", f"{wheel}[pipeline]")
    shell.run("cylinder-friction", "init", "project")
    shell.folder /= "project"
    shell.run("cylinder-friction", "params", "experiment=smoke")
    shell.run("git", "add", ".")
    shell.run("git", "-c", "user.name=me", "-c", "user.email=me@localhost", "commit", "-qm", "A project")
    shell.run("dvc", "repro", "-q")
    shell.run("cylinder-friction", "summary")
    shell.run("cylinder-friction", "lineage")
    served(shell)


def served(shell: Shell) -> None:
    """Serve the champion, ask it about its own example, and end it."""
    began, port = time.monotonic(), str(free_port())
    command = ["cylinder-friction", "serve", "--port", port]
    with subprocess.Popen(command, cwd=shell.folder, env=shell.variables, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        printed = ""
        while "-d '" not in printed:
            printed += server.stdout.readline()
        print(f"{time.monotonic() - began:6.1f} s  $ {' '.join(command)}")
        body = re.findall(r"-d '(.*)'", printed)[0].encode()
        url, kind = f"http://127.0.0.1:{port}/invocations", {"Content-Type": "application/json"}
        with urllib.request.urlopen(urllib.request.Request(url, body, kind)) as response:
            rows = json.loads(response.read())["predictions"]
        print(f"            {len(rows)} rows, the last {rows[-1]}")
        server.terminate()


def main() -> None:
    """Print the transcript."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--torch", help="what pip installs as PyTorch first, for example a CPU build")
    parser.add_argument("--only", choices=("core", "pipeline"), help="one of the two halves")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch:
        place = Path(scratch)
        subprocess.run([sys.executable, "-c", BUILD, place], cwd=Path(__file__).parents[1], check=True)
        (wheel,) = place.glob("*.whl")
        print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.2f} MB")
        for half in ("core", "pipeline"):
            if options.only not in (None, half):
                continue
            (place / half).mkdir()
            shell = Shell(place / f"{half}-environment", place / half)
            if half == "core":
                log_to_friction(shell, str(wheel))
            else:
                pipeline_to_served_champion(shell, str(wheel), options.torch)
            print(f"[{half}] {shell.size()}\n")


if __name__ == "__main__":
    main()
