"""Jobs beside the samples: sessions and estimates go into the journal each second, and later into the history."""

import asyncio
import logging
import os
import sqlite3
import sys
import time
from collections.abc import Callable, Coroutine, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from cylinder_friction_live.connection import Peers
from cylinder_friction_live.history import join_past_days, write_session
from cylinder_friction_live.service import LiveService, LiveSession

KEEP_S, HISTORY_S = 1.0, 60.0
KEEP_STEPS = 10
"""Steps per second in which all sessions are written. More would write pages of the journal more often."""
LEFT_S = 10
"""Time for which estimates stay in the journal, for a client that comes back [s]."""
Job = Callable[[], Coroutine[Any, Any, None]]
AGAIN_S = 1.0
"""Time after which a job that ended is started again, and after which it counts as running [s]."""
_log = logging.getLogger(__name__)


async def keep_running(service: LiveService, name: str, job: Job) -> None:
    """Run a job, and start it again if it fails; the service is not ready until the job has run for a while."""
    while True:
        running = asyncio.create_task(job())
        try:
            done, _ = await asyncio.wait({running}, timeout=AGAIN_S if name in service.ended_jobs else None)
            if not done:
                del service.ended_jobs[name]
                await asyncio.wait({running})
        except asyncio.CancelledError:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            raise
        error = running.exception()
        if error is None:
            return  # the job is done
        _log.error("the job %r of the live service ended and is started again", name, exc_info=error)
        service.ended_jobs[name] = f"{type(error).__name__}: {error}"
        await asyncio.sleep(AGAIN_S)


async def keep_each_second(service: LiveService, peers: Peers) -> None:
    """Write every session once a second, a few at a time, so that none waits long for the others."""
    while True:
        sessions, begun_s, kept = list(service.sessions.values()), time.monotonic(), 0
        count, some = max(1, len(sessions)), -(-len(sessions) // KEEP_STEPS) or 1
        while kept < count:
            due = int(count * (time.monotonic() - begun_s) / KEEP_S)  # more samples at once if it is late
            first, kept = kept, max(kept + some, due)
            await keep_some(service, peers, sessions[first:kept])
            await asyncio.sleep(max(0.0, begun_s + KEEP_S * kept / count - time.monotonic()))
        for name in service.close_idle():
            peers.events.note("session closed", session=name, why="idle")


async def keep_some(service: LiveService, peers: Peers, sessions: Sequence[LiveSession]) -> None:
    """Write the news of some sessions to the journal, and acknowledge them."""
    async with peers.keeping:
        await _keep_now(service, sessions)


async def _keep_now(service: LiveService, sessions: Sequence[LiveSession]) -> None:
    saved, chunks = service.take_pending(sessions)
    if not saved:
        return
    keeping = asyncio.create_task(asyncio.to_thread(service.journal.keep, saved, chunks))
    try:
        await asyncio.shield(keeping)
    except asyncio.CancelledError:
        await keeping  # a write that has begun ends before the last one begins
        raise
    except (sqlite3.Error, OSError) as error:
        _log.error("nothing is kept or acknowledged: %s; tried again each second", error)
        service.requeue(saved, str(error))
        return
    service.kept(saved)


async def move_each_minute(service: LiveService) -> None:
    """Move the journal into the history each minute, one session at a time, at low priority."""
    loop, behind = asyncio.get_running_loop(), ThreadPoolExecutor(1, "history", _lower_priority)
    joined = ""  # Day on which past days were joined
    while True:
        await asyncio.sleep(HISTORY_S / 2)
        begun_s, last, failed = time.monotonic(), service.journal.last_chunk(), list[str]()
        names = service.journal.with_chunks(last)
        last -= LEFT_S * len(names)
        for done, name in enumerate(names, 1):
            try:
                await loop.run_in_executor(behind, write_session, service.journal, name, last)
                service.not_in_history.pop(name, None)
            except Exception as error:  # other sessions continue after any error
                _log.error("session %s stays in the journal, not in the history: %r", name, error)
                service.not_in_history[name] = str(error)
                failed.append(name)
            await asyncio.sleep(max(0.0, begun_s + HISTORY_S / 2 * done / len(names) - time.monotonic()))
        await loop.run_in_executor(behind, service.journal.forget, last, failed)
        today = time.strftime("%F", time.gmtime())
        if today != joined:
            try:
                await loop.run_in_executor(behind, join_past_days, service.journal.history)
                joined = today
            except OSError as error:
                _log.error("past days of the history stay in parts: %s", error)


def _lower_priority() -> None:
    """Lower the priority of this thread; only Linux can do so for one thread."""
    if sys.platform == "linux":
        os.nice(10)
