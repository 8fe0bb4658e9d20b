"""The command ``switch``: another model for the sessions of a running live service, warm before it takes over."""

import argparse
import json
import ssl
import tempfile
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from cylinder_friction.commands.estimate import model_folder
from cylinder_friction.live.app import ENGINES_FOLDER
from cylinder_friction.live.engine_building import engine_of
from cylinder_friction.live.service import LiveError
from cylinder_friction.params.live import load_live_params

EXPECTED = (ValueError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("model", nargs="?", help="a saved estimator's folder, or models:/NAME@ALIAS")
    what.add_argument("--take-over", action="store_true", help="the model that runs beside gives the newtons now")
    what.add_argument("--back", action="store_true", help="the same: after a change the former model runs beside")
    what.add_argument("--end", action="store_true", help="stop the model that runs beside")
    what.add_argument("--status", action="store_true", help="which models run in how many sessions")
    parser.add_argument(
        "--after-s", type=float, help="MODEL runs so long beside before it takes over [s]; default: warm_s"
    )
    parser.add_argument("--at-index", type=int, help="it takes over at this sample of every session")
    parser.add_argument("--beside", action="store_true", help="MODEL does not take over until --take-over")
    parser.add_argument("--record", action="store_true", help="keep both models' newtons side by side in the history")
    parser.add_argument("--session", nargs="+", metavar="NAME", help="in these alone; default: in all")
    parser.add_argument("--config", type=Path, help="settings of the service; default: as `live` has it")
    parser.add_argument("--folder", type=Path, help="of the service, instead of the configured one")
    parser.add_argument("--url", help="of the service; default: as configured, on this machine")
    parser.add_argument("--token", type=Path, help="file with a token whose role is admin")
    parser.add_argument("--ca", type=Path, help="PEM file that the service's certificate is checked with")


def run(options: argparse.Namespace) -> int:
    params = load_live_params(options.config)
    scheme = "http" if params.access.tls_certificate is None else "https"
    url = (options.url or f"{scheme}://127.0.0.1:{params.port}").rstrip("/") + "/models"
    if options.status:
        print(json.dumps(_asked(url, None, options), indent=2))
        return 0
    command: dict[str, Any] = {"sessions": options.session}
    if options.model is None:
        command |= {"do": "end" if options.end else "take-over", "at_index": options.at_index}
    else:
        engine = _built(options.model, (options.folder or params.folder) / ENGINES_FOLDER)
        command |= {"do": "beside", "engine": engine, "recorded": options.record, "at_index": options.at_index}
        if not options.beside and options.at_index is None:
            command["after_s"] = params.rules.warm_s if options.after_s is None else options.after_s
    done = _asked(url, command, options)
    print(f"asked for and kept in {done['sessions']} sessions; `cylinder-friction switch --status` shows who runs what")
    return 0


def _built(model: str, engines: Path) -> str:
    """Return the name of a model's engine, made for the service on this machine."""
    with tempfile.TemporaryDirectory() as scratch:
        return engine_of(model_folder(model, Path(scratch) / "model"), engines).name


def _asked(url: str, command: dict[str, Any] | None, options: argparse.Namespace) -> Any:
    headers = {"Content-Type": "application/json"}
    if options.token is not None:
        headers["Authorization"] = f"Bearer {options.token.read_text(encoding='ascii').strip()}"
    if not url.startswith(("http://", "https://")):
        raise LiveError(f"{url}: expected http:// or https://")
    body = None if command is None else json.dumps(command).encode()
    request = urllib.request.Request(url, body, headers)  # noqa: S310 - one of both schemes
    context = ssl.create_default_context(cafile=options.ca) if url.startswith("https") else None
    try:
        with urllib.request.urlopen(request, timeout=30.0, context=context) as reply:  # noqa: S310
            return json.load(reply)
    except urllib.error.HTTPError as refused:
        raise LiveError(f"{url}: {refused.code} {refused.read(4000).decode(errors='replace')}") from None
    except urllib.error.URLError as error:
        raise LiveError(f"{url}: {error.reason}; is the service running? --url states where") from None
