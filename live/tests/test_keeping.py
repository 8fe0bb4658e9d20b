"""What runs in the background of the live service is started again when it fails, and said to have failed."""

import asyncio

from cylinder_friction_live.keeping import keep_running
from cylinder_friction_live.service import LiveService


def test_a_job_that_ends_makes_the_service_not_ready_until_it_runs_again(service: LiveService) -> None:
    runs: list[str | None] = []

    async def job() -> None:
        runs.append(service.ended_jobs.get("history"))
        if len(runs) < 3:
            raise OverflowError("a time that is none")
        await asyncio.Event().wait()

    async def until_ready() -> None:
        running = asyncio.create_task(keep_running(service, "history", job))
        while len(runs) < 3 or service.ended_jobs:
            await asyncio.sleep(0.01)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)

    asyncio.run(until_ready())
    assert runs == [None, *["OverflowError: a time that is none"] * 2]
