"""An event loop in a thread of its own, for links whose library would hold up the service's."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Coroutine
from concurrent.futures import Future
from contextlib import asynccontextmanager
from typing import Any

PATIENCE_S = 1.0
Run = Callable[[Callable[[], None], asyncio.Event], Coroutine[Any, Any, None]]
"""Given a function to be called when it is ready, and an event that is set when it is to end."""


@asynccontextmanager
async def in_own_loop(name: str, run: Run) -> AsyncIterator[None]:
    """Run a coroutine in a thread of that name beside what stands within; raises what it raised before it was ready."""
    ready: Future[tuple[asyncio.AbstractEventLoop, asyncio.Event]] = Future()

    async def until_stopped() -> None:
        stop = asyncio.Event()
        await run(lambda: ready.set_result((asyncio.get_running_loop(), stop)), stop)

    def main() -> None:
        try:
            asyncio.run(until_stopped())
        except Exception as error:
            if ready.done():
                raise
            ready.set_exception(error)

    thread = threading.Thread(target=main, name=name, daemon=True)
    thread.start()
    loop, stop = await asyncio.wrap_future(ready)
    try:
        yield
    finally:
        if thread.is_alive():
            loop.call_soon_threadsafe(stop.set)
            await asyncio.to_thread(thread.join, PATIENCE_S)
