"""Sessions are kept a few at a time, and all that are due where that takes longer than it should."""

from __future__ import annotations

import asyncio
import time
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import pytest

from cylinder_friction.service.live import keeping
from cylinder_friction.service.live.connection import Peers

if TYPE_CHECKING:
    from collections.abc import Sequence


@pytest.mark.parametrize(("takes_s", "expected"), [(0.0, [2] * 25), (0.5, [2, 23, 25])])
def test_a_service_that_is_late_keeps_more_sessions_at_a_time(
    monkeypatch: pytest.MonkeyPatch, takes_s: float, expected: list[int]
) -> None:
    clock, kept = [0.0], list[int]()

    async def keep_some(_service: Any, _peers: Peers, sessions: Sequence[int]) -> None:
        kept.append(len(sessions))
        clock[0] += takes_s

    async def sleep(seconds: float) -> None:
        clock[0] += seconds

    def close_idle() -> list[str]:
        raise KeyboardInterrupt  # after one round

    monkeypatch.setattr(keeping, "keep_some", keep_some)
    monkeypatch.setattr(asyncio, "sleep", sleep)
    monkeypatch.setattr(time, "monotonic", lambda: clock[0])
    service: Any = SimpleNamespace(sessions={str(each): each for each in range(50)}, close_idle=close_idle)
    with pytest.raises(KeyboardInterrupt):
        keeping.keep_each_second(service, Peers()).send(None)
    assert kept == expected
