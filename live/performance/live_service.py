"""A live service as a process of its own, for measurements and tests."""

import argparse
import subprocess
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import yaml

from service_process import CLI, ready


def arguments(description: str | None, sessions: int) -> argparse.ArgumentParser:
    """Make a parser for what every measurement of the live service asks for."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--model", type=Path, default=Path("models/hybrid"))
    parser.add_argument("--recordings", type=Path, default=Path("data/processed/test"))
    parser.add_argument("--sessions", type=int, default=sessions)
    return parser


def running(
    model: Path,
    folder: Path,
    port: int,
    settings: dict[str, Any] | None = None,
    cores: Sequence[int] = (),
    poll_s: float = 0.05,
) -> AbstractContextManager[subprocess.Popen[bytes]]:
    """Start a live service with its journal, its history and ``settings`` as a file in a folder; enter when ready."""
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "live.yaml"
    config.write_text(yaml.safe_dump(settings or {}), encoding="utf-8")
    command = [*CLI, "live", "--model", str(model), "--config", str(config), "--port", str(port)]
    return ready([*command, "--folder", str(folder)], port, "/readyz", cores, poll_s)
