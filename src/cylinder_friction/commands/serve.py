"""The command ``serve``: serve a registered model over HTTP and print a curl to try."""

import argparse
import logging
import shlex
import sys
from pathlib import Path

from cylinder_friction.recordings.files import read_json, write_json
from cylinder_friction.service.access import AccessError
from cylinder_friction.service.scoring.locating import LOCATED_FILE, locate
from cylinder_friction.service.scoring.settings import ServeSettings, ServingError

EXPECTED = (AccessError,)
EXAMPLE_FILE, SHOWN = "example.json", 300  # The last bytes of what comes back
_OPTIONS = {
    "host": "name or address to listen on; beyond this machine only with tokens",
    "port": "port to listen on, 0 for a free one",
    "workers": "number of processes that score",
    "max_body_bytes": "largest request body",
    "max_rows": "most rows of a request",
    "timeout_s": "longest time for a body to arrive, and for its rows to be scored, each",
    "max_concurrent": "most requests that a worker has at a time",
    "max_memory_bytes": "most memory of a worker",
    "tokens": "file with the SHA-256 of a token in each line; requests need one of them",
    "without_tokens": "listen beyond this machine without tokens",
    "tls_certificate": "PEM file of the certificate",
    "tls_key": "PEM file of its key",
    "access_log": "file that gets one JSON object per request",
    "access_log_bytes": "size at which the access log is rotated",
    "access_log_files": "number of old access logs that are kept",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "model",
        nargs="?",
        help="models:/NAME@champion, models:/NAME/VERSION or a model's folder; default: the champion",
    )
    defaults = ServeSettings()
    for name, words in _OPTIONS.items():
        default, option = getattr(defaults, name), f"--{name.replace('_', '-')}"
        if isinstance(default, bool):
            parser.add_argument(option, action="store_true", help=words)
        elif default is None:
            parser.add_argument(option, type=Path, help=words)
        else:
            parser.add_argument(option, type=type(default), default=default, help=f"{words}; default: {default}")
    parser.add_argument("--locate", type=Path, help=argparse.SUPPRESS)  # what the server runs in a process that ends


def run(options: argparse.Namespace) -> int:
    if sys.platform == "win32":
        raise ServingError(
            "this server's processes share a socket, which Windows lacks; serve under WSL or in a container, or with "
            "`mlflow models serve`, which has the same model without limits, tokens and metrics"
        )
    if options.locate is not None:
        return _locate(options.model, options.locate)
    import starlette  # noqa: F401 - its workers need it: better missed here than by each of them

    from cylinder_friction.service.processes import LOG_FORMAT, Supervisor

    settings = ServeSettings(**{name: getattr(options, name) for name in _OPTIONS})
    logging.basicConfig(format=LOG_FORMAT, level=logging.INFO)
    command = [sys.executable, "-m", "cylinder_friction.commands.cli", "serve"]
    command += [*([options.model] if options.model else []), "--locate"]
    return Supervisor(settings, command).run(lambda url, folder: _announce(url, folder, settings))


def _locate(model: str | None, folder: Path) -> int:
    from cylinder_friction.params.checking import load_params

    locate(model or load_params().champion, Path.cwd(), folder)
    return 0


def _announce(url: str, folder: Path, settings: ServeSettings) -> None:
    located = read_json(folder / LOCATED_FILE)
    rows = len(located["example"]["data"])
    write_json(folder / EXAMPLE_FILE, {"dataframe_split": located["example"]})
    print(
        f"serving {located['name']} version {located['version']} at {url} (stop with Ctrl-C)\n\n"
        f"try it in another terminal:\n\n{curl(url, folder / EXAMPLE_FILE, settings)}\n\n"
        f"It sends {rows} rows of a recording and shows the last one; rows of the first 3 s are flagged WARMING.\n"
        "friction_n is in newtons, positive when it opposes extension. Send the rows of a recording in order, at the\n"
        f"trained sample time. Bounds: {located['bounds']}.\nAll routes: {url}/docs",
        flush=True,
    )


def curl(url: str, rows: Path, settings: ServeSettings) -> str:
    """Return a command that asks the served model about the rows of a file and can be pasted into a shell."""
    options = "" if settings.tls_certificate is None else f" --cacert {settings.tls_certificate}"
    options += ' -H "Authorization: Bearer $TOKEN"' if settings.tokens else ""
    place = shlex.quote(f"@{rows}")
    return f"curl -s{options} {url}/invocations -H 'Content-Type: application/json' \\\n  -d {place} | tail -c {SHOWN}"
