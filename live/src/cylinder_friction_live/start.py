"""Run the command ``live``: build the engine, open journal and links, serve, and replay logs if asked to.

Libraries that only some starts need are imported late: after a kill, samples wait for the service to start.
"""

from __future__ import annotations

import argparse
import gc
import logging
import signal
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from cylinder_friction.files.whole_files import locked
from cylinder_friction_live.app import create_app
from cylinder_friction_live.configuration import LiveParams, load_live_params
from cylinder_friction_live.engine_building import engine_of
from cylinder_friction_live.events import Events
from cylinder_friction_live.journal import Journal
from cylinder_friction_live.links.link import Link
from cylinder_friction_live.server import LiveServer, live_server
from cylinder_friction_live.service import LiveError, LiveService
from cylinder_friction_live.stribeck import stribeck_lines

if TYPE_CHECKING:
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction_live.engine import Engine

EXPECTED = (ValueError, OSError)
FEW_COLLECTIONS = 200_000
"""Objects between two garbage collections, more than wait for the journal; with fewer, collections took 7 % of the core
and found nothing."""
SHORT_TURN_S = 5e-4
"""Longest turn of another thread, such as the journal's or a link's [s]; Python's 5 ms would be the 99th percentile."""
JOURNAL_FILE, ENGINES_FOLDER, LOCK_FILE = "journal.db", "engines", ".lock"


def run(options: argparse.Namespace) -> int:
    configured = LiveParams() if options.config is None else load_live_params(options.config)
    given = {name: getattr(options, name) for name in ("model", "port", "folder", "stribeck")}
    params = configured.model_copy(update={name: value for name, value in given.items() if value is not None})
    if options.replay and (params.access.tokens or params.access.tls_key):
        raise LiveError("--replay needs a service without tokens and TLS; use settings without `access`")
    with locked(params.folder / LOCK_FILE, wait=False) as held:
        if not held:
            raise LiveError(
                f"{params.folder}: another live service uses this folder; give this one another --folder, or "
                "end the other"
            )
        _run(options, params)
    return 0


def _run(options: argparse.Namespace, params: LiveParams) -> None:
    engine = _engine(params.model, params.folder / ENGINES_FOLDER)
    recordings = _replayed(options, engine) if options.replay else {}
    service = LiveService(engine, Journal(params.folder / JOURNAL_FILE), rules=params.rules, limits=params.limits)
    _serve(service, params, options.speed, recordings)


def _engine(model: str | None, engines: Path) -> Engine:
    """Open a model's engine, and compile it if necessary; None: the champion's."""
    if model is None:
        from cylinder_friction.params.checking import load_params

        model = load_params().champion
    if not model.startswith("models:/"):
        return engine_of(Path(model), str(Path(model).resolve()), engines)
    from cylinder_friction.tracking.lineage import estimator_folder  # MLflow

    with tempfile.TemporaryDirectory() as scratch:
        return engine_of(*estimator_folder(model, Path(), Path(scratch) / "model"), engines)


def _serve(service: LiveService, params: LiveParams, speed: float, recordings: dict[str, list[Recording]]) -> None:
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(message)s")
    links, access = links_of(params), params.access
    stribeck = None if params.stribeck is None else stribeck_lines(params.stribeck)
    app = create_app(service, links, access, params.host, Events(params.log), stribeck)
    server = live_server(app, params.host, params.port, access, params.limits.message_bytes)
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup's handler stays
        signal.signal(signal.SIGHUP, server.handle_exit)
    stop = threading.Event()
    follower = threading.Thread(
        target=_follow, args=(server, service, params, links, speed, recordings, stop), daemon=True
    )
    follower.start()
    gc.collect()
    gc.freeze()  # loaded modules stay; each look through them took a fifth of a second
    gc.set_threshold(FEW_COLLECTIONS)
    sys.setswitchinterval(SHORT_TURN_S)
    try:
        server.run()
    finally:
        stop.set()
        service.journal.close()
    if not server.started:
        raise LiveError("the service did not start; the lines above state why")


def links_of(params: LiveParams) -> list[Link]:
    """Make the configured links."""
    links: list[Link] = []
    if params.opcua_server is not None:
        try:
            from cylinder_friction_live.links.opcua import OpcUaLink
        except ModuleNotFoundError as error:
            raise LiveError(
                f'opcua_server: needs {error.name}, which is not installed; pip install "cylinder-friction-live[opcua]"'
            ) from error

        links.append(OpcUaLink(params.opcua_server, params.access.tokens))
    if params.mqtt is not None:
        from cylinder_friction_live.links.mqtt import MqttLink

        links.append(MqttLink(params.mqtt))
    return links


def _follow(
    server: LiveServer,
    service: LiveService,
    params: LiveParams,
    links: Sequence[Link],
    speed: float,
    recordings: dict[str, list[Recording]],
    stop: threading.Event,
) -> None:
    """Print the service's address once it listens, then replay."""
    while not server.started:
        if stop.wait(0.05):
            return
    host, port = server.servers[0].sockets[0].getsockname()[:2]
    address = f"{'s' if params.access.tls_key else ''}://{f'[{host}]' if ':' in host else host}:{port}"
    more = "".join(f"  {link.name:<27} {link.address}\n" for link in links)
    print(
        f"live at http{address} (stop with Ctrl-C)\n  samples in, estimates out   ws{address}/stream\n"
        f"  metrics                     http{address}/metrics\n{more}  history                     "
        f"{service.journal.history}",
        flush=True,
    )
    if recordings:
        from cylinder_friction_live.replay import Replay

        replay = Replay(f"ws{address}/stream", recordings, speed or None)
        count = replay.run(service.engine.inputs, stop)
        print(f"replayed {count} samples of {len(recordings)} sessions", flush=True)


def _replayed(options: argparse.Namespace, engine: Engine) -> dict[str, list[Recording]]:
    """Read the logs as recordings at the model's rate, by session."""
    from cylinder_friction.commands.log_options import cylinder_of, units_of
    from cylinder_friction.recordings.reading_logs import read_recordings

    rate_hz = 1.0 / engine.sample_time_s
    units = units_of(options.unit)
    cylinder = cylinder_of(options.cylinder)
    read = read_recordings(options.replay, options.channels, cylinder, names=options.names, units=units)
    by_session: dict[str, list[Recording]] = {}
    for recording in read:
        if abs(recording.sample_time_s * rate_hz - 1.0) > 1e-6:
            raise LiveError(
                f"{recording.name}: {1.0 / recording.sample_time_s:g} Hz; the model was trained at {rate_hz:g} Hz; "
                "give logs at that rate"
            )
        by_session.setdefault(recording.metadata.session, []).append(recording)
    return by_session
