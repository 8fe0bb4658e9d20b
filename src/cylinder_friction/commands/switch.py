"""The command ``switch``: another model for the sessions of a running live service, warm before it takes over."""

import argparse
import json
import ssl
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

from cylinder_friction.commands.live import engine_folder
from cylinder_friction.params.live import load_live_params
from cylinder_friction.service.live.app import ENGINES_FOLDER
from cylinder_friction.service.live.service import LiveError

EXPECTED = (ValueError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("model", nargs="?", help="folder of a saved estimator, or models:/NAME@ALIAS")
    what.add_argument("--take-over", action="store_true", help="the second model gives the newtons from now on")
    what.add_argument("--back", action="store_true", help="return to the former model, which still runs beside")
    what.add_argument("--end", action="store_true", help="stop the second model")
    what.add_argument("--status", action="store_true", help="show which models run in how many sessions")
    when = parser.add_mutually_exclusive_group()
    when.add_argument(
        "--after-s", type=float, help="time that MODEL runs beside before it takes over [s]; default: rules.warm_s"
    )
    when.add_argument("--at-index", type=int, help="sample index at which MODEL takes over, in every session")
    when.add_argument("--beside", action="store_true", help="MODEL does not take over until --take-over")
    parser.add_argument("--record", action="store_true", help="keep both models' newtons side by side in the history")
    parser.add_argument("--session", nargs="+", metavar="NAME", help="sessions to change; default: all")
    parser.add_argument("--config", type=Path, help="file of the service's settings; default: that of `live`")
    parser.add_argument("--folder", type=Path, help="folder of the service; overrides the settings")
    parser.add_argument("--url", help="address of the service; default: this machine, port as in the settings")
    parser.add_argument("--token", type=Path, help="file with a token whose role is admin")
    parser.add_argument("--ca", type=Path, help="PEM file to check the service's certificate with")


def run(options: argparse.Namespace) -> int:
    _refuse_what_does_not_apply(options)
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
        engine = engine_folder(options.model, (options.folder or params.folder) / ENGINES_FOLDER).name
        command |= {"do": "beside", "engine": engine, "recorded": options.record, "at_index": options.at_index}
        if not options.beside and options.at_index is None:
            command["after_s"] = params.rules.warm_s if options.after_s is None else options.after_s
    done = _asked(url, command, options)
    print(f"open sessions: {done['sessions']}; {_meaning(command)}; --status shows which models run")
    return 0


def _refuse_what_does_not_apply(options: argparse.Namespace) -> None:
    of_model = {"--after-s": options.after_s is not None, "--beside": options.beside, "--record": options.record}
    of_change = {"--at-index": options.at_index is not None} if options.end or options.status else {}
    of_sessions = {"--session": options.session is not None} if options.status else {}
    for name, is_given in ({} if options.model else of_model | of_change | of_sessions).items():
        if is_given:
            raise LiveError(f"{name}: cannot be combined with these options; see `cylinder-friction switch --help`")


def _meaning(command: dict[str, Any]) -> str:
    """Return what the service does after this command."""
    if command["do"] == "end":
        return "the second model stops"
    at = "" if command["at_index"] is None else f" at sample {command['at_index']}"
    if command["do"] == "take-over":
        return f"the second model takes over{at or ' in about a second'}"
    if command.get("after_s") is not None:
        at = f" after {command['after_s']:g} s"
    return f"the second model starts in about a second{at and ' and takes over'}{at}"


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
        more = "; --token names its file" if refused.code in (401, 403) else ""
        raise LiveError(f"{url}: {_reason(refused)}{more}") from None
    except OSError as error:  # also one that is killed while it replies
        reason = getattr(error, "reason", error)
        raise LiveError(f"{url}: {reason}; is the service running? --url states its address") from None


def _reason(refused: urllib.error.HTTPError) -> str:
    content = refused.read(4000).decode(errors="replace")
    try:
        return str(json.loads(content)["error"])
    except (ValueError, TypeError, KeyError):  # not from the service
        return f"{refused.code} {content}"
