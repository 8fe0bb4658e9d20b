"""What was promised of the exported C, and what a run says of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cylinder_friction.deployment.latency.measuring import Measured, ModelFigures

LEAST_RATIOS = (("torch_window", 100.0), ("torch_window", 600.0), ("onnx_step", 4.0))
TAIL_RATIO = 5.0
FLOOR_RATIO = 4.0
LUGRE_RATIO = 10.0


@dataclass(frozen=True)
class Verdict:
    """One promise: in words, its limit, what was measured, and whether that keeps it."""

    what: str
    limit: float
    measured: float
    met: bool

    def line(self) -> str:
        return f"{'met   ' if self.met else 'MISSED'}  {self.what}: {self.measured:.3g}"


def verdicts_on(measured: Measured) -> list[Verdict]:
    """Return the promises on models of the paper's size, and on every other hybrid beside the first LuGre."""
    lugre = next((model for model in measured.models.values() if model.floor is None), None)
    result: list[Verdict] = []
    for name, model in measured.models.items():
        if model.published:
            result += _published(name, model)
        elif model.floor is not None and lugre is not None:
            ratio = _p50(model, "c") / _p50(lugre, "c")
            what = f"{name}: C below {LUGRE_RATIO:g} times the time of LuGre in C"
            result.append(Verdict(what, LUGRE_RATIO, ratio, ratio < LUGRE_RATIO))
    return result


def _published(name: str, model: ModelFigures) -> Iterator[Verdict]:
    own = model.contenders["c"].latency
    for other, least in LEAST_RATIOS:
        ratio = _p50(model, other) / own.p50_us
        what = f"{name}: C at least {least:g} times faster than {model.contenders[other].title}"
        yield Verdict(what, least, ratio, ratio >= least)
    tail = own.p999_us / own.p50_us
    spin = model.contenders["spin"].latency
    what = f"{name}: p99.9 of C below {TAIL_RATIO:g} times its p50 (arithmetic alone: {spin.p999_us / spin.p50_us:.3g})"
    yield Verdict(what, TAIL_RATIO, tail, tail < TAIL_RATIO)
    assert model.floor is not None
    ratio = own.p50_us / model.floor.bandwidth_us
    what = f"{name}: C within {FLOOR_RATIO:g} times the bandwidth floor"
    yield Verdict(what, FLOOR_RATIO, ratio, ratio <= FLOOR_RATIO)


def _p50(model: ModelFigures, contender: str) -> float:
    return model.contenders[contender].latency.p50_us
