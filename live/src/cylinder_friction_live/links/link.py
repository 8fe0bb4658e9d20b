"""Links: further ways into and out of the service, which start and end with it and get every estimate."""

import asyncio
import logging
from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import AsyncIterator, Coroutine
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from typing import Any, ClassVar

from cylinder_friction_live.connection import Peers
from cylinder_friction_live.frames import EstimateBlock
from cylinder_friction_live.service import LiveService, LiveSession

_log = logging.getLogger(__name__)


class Link(ABC):
    """A way into the service, out of it, or both.

    Attributes:
        name: Name in ``/metrics``.
        address: Address for people; final once the link runs.
        counts: Counts of refused, dropped and repeated messages, by name.
    """

    name: ClassVar[str]

    def __init__(self, address: str = "") -> None:
        self.address = address
        self.counts: Counter[str] = Counter()

    @abstractmethod
    def running(self, service: LiveService, peers: Peers) -> AbstractAsyncContextManager[None]:
        """Open the context in which the link works; entering it raises what keeps the link from starting."""

    @abstractmethod
    def note(self, session: LiveSession, block: EstimateBlock) -> None:
        """Take successive estimates of a session; it runs on the service's event loop and must return at once."""


@asynccontextmanager
async def in_background(*jobs: Coroutine[Any, Any, None]) -> AsyncIterator[None]:
    """Run jobs during the block, and cancel them after it; a failing job is logged."""
    tasks = [asyncio.create_task(job) for job in jobs]
    for task in tasks:
        task.add_done_callback(_log_failure)
    try:
        yield
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


def _log_failure(task: asyncio.Task[None]) -> None:
    if not task.cancelled() and task.exception() is not None:
        _log.error("a job of the live service ended", exc_info=task.exception())
