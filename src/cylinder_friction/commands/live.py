"""The command ``live``: friction of many cylinders in real time, on this machine, with a page."""

import argparse
import logging
import tempfile
import threading
from pathlib import Path

import uvicorn

from cylinder_friction.commands.estimate import cylinder_of, model_folder
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.live.app import create_app
from cylinder_friction.live.engine import Engine
from cylinder_friction.live.journal import Journal
from cylinder_friction.live.replay import Replay
from cylinder_friction.live.service import LiveError, LiveLimits, LiveService
from cylinder_friction.live.session import SessionRules
from cylinder_friction.params.checking import load_params
from cylinder_friction.recordings.reading_logs import read_logs
from cylinder_friction.recordings.recording import Recording

EXPECTED = (ValueError, OSError)
LARGEST_MESSAGE = 1 << 20
JOURNAL_FILE, HISTORY_FOLDER = "journal.db", "history"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    rules, limits = SessionRules(), LiveLimits()
    parser.add_argument("--model", help="a saved estimator's folder, or models:/NAME@ALIAS; default: the champion")
    parser.add_argument("--port", type=int, default=5002, help="on 127.0.0.1; default: 5002; 0: a free one")
    parser.add_argument("--folder", type=Path, default=Path("live"), help="journal and history; default: live")
    parser.add_argument("--replay", nargs="+", metavar="LOGS", help="files, folders or patterns of logs to send")
    parser.add_argument("--speed", type=float, default=1.0, help="of the replay; 0: as fast as possible; default: 1")
    parser.add_argument("--cylinder", help="of the replayed logs; default: that of params.yaml")
    parser.add_argument("--channels", type=Path, help="of the replayed logs; without: guessed")
    parser.add_argument("--names", help="of the replayed logs: expression with the groups condition and session")
    parser.add_argument("--sessions", type=int, default=limits.sessions, help="most sessions that are open at a time")
    parser.add_argument("--hold-s", type=float, default=rules.hold_s, help="how long early samples wait [s]")
    parser.add_argument("--short-gap-s", type=float, default=rules.short_gap_s, help="gap without a reset [s]")


def run(options: argparse.Namespace) -> int:
    rules = SessionRules(hold_s=options.hold_s, short_gap_s=options.short_gap_s)
    with tempfile.TemporaryDirectory() as scratch:
        given = options.model or f"models:/{load_params().registered_name}@champion"
        estimator = load_estimator(model_folder(given, Path(scratch) / "model"))
        engine = Engine(estimator, Path(scratch) / "engine")
        recordings = _replayed(options, engine) if options.replay else {}
        service = LiveService(
            engine, Journal(options.folder / JOURNAL_FILE), rules=rules, limits=LiveLimits(sessions=options.sessions)
        )
        _serve(service, options, recordings)
    return 0


def _serve(service: LiveService, options: argparse.Namespace, recordings: dict[str, list[Recording]]) -> None:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    app = create_app(service, options.folder / HISTORY_FOLDER)
    config = uvicorn.Config(
        app, host="127.0.0.1", port=options.port, ws_max_size=LARGEST_MESSAGE, log_level="warning",
        ws_per_message_deflate=False, timeout_graceful_shutdown=2,
    )  # fmt: skip
    server = uvicorn.Server(config)
    stop = threading.Event()
    follower = threading.Thread(target=_follow, args=(server, service, options, recordings, stop), daemon=True)
    follower.start()
    try:
        server.run()
    finally:
        stop.set()
        service.journal.close()


def _follow(
    server: uvicorn.Server,
    service: LiveService,
    options: argparse.Namespace,
    recordings: dict[str, list[Recording]],
    stop: threading.Event,
) -> None:
    """Print where the service is once it is there, then replay."""
    while not server.started:
        if stop.wait(0.05):
            return
    port = server.servers[0].sockets[0].getsockname()[1]
    print(
        f"live at http://127.0.0.1:{port} (stop with Ctrl-C)\n  samples in, estimates out   ws://127.0.0.1:{port}/stream\n"
        f"  metrics                     http://127.0.0.1:{port}/metrics\n  history                     "
        f"{options.folder / HISTORY_FOLDER}",
        flush=True,
    )
    if recordings:
        replay = Replay(f"ws://127.0.0.1:{port}/stream", recordings, options.speed or None)
        count = replay.run(service.engine.inputs, stop)
        print(f"replayed {count} samples of {len(recordings)} sessions", flush=True)


def _replayed(options: argparse.Namespace, engine: Engine) -> dict[str, list[Recording]]:
    """Return the logs as recordings at the model's rate, by session."""
    rate_hz = 1.0 / engine.sample_time_s
    read = read_logs(options.replay, options.channels, cylinder_of(options.cylinder), names=options.names)
    by_session: dict[str, list[Recording]] = {}
    for recording in read:
        if abs(recording.sample_time_s * rate_hz - 1.0) > 1e-6:
            raise LiveError(
                f"{recording.name}: {1.0 / recording.sample_time_s:g} Hz; the model was trained at {rate_hz:g} Hz; "
                "give logs at that rate"
            )
        by_session.setdefault(recording.metadata.session, []).append(recording)
    return by_session
