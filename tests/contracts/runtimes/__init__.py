"""Every runtime behind one small protocol; one module a runtime: its adapter is ``RUNTIME``, several ``RUNTIMES``."""

from importlib import import_module
from pathlib import Path
from typing import Protocol

import numpy as np

from cylinder_friction.realtime.model import StepModel

Output = tuple[float, float, float, int]


class Stream(Protocol):
    """One running estimate; streams of one runtime do not touch each other.

    One that takes many samples at once also has ``run``: samples, shape ``(n, inputs)``, to newtons, shape ``(n, 3)``,
    and flags, shape ``(n,)``. One that holds something outside Python has ``close``.
    """

    def step(self, *sample: float) -> Output:
        """Return friction, lower, upper [N] and flags."""

    def reset(self) -> None:
        """Forget everything."""

    def warm_up(self, *sample: float, steps: int) -> None:
        """Reset, then take ``steps`` steps on one sample."""


class Runtime(Protocol):
    """Something that runs a ``StepModel``."""

    name: str
    """In the table of tolerances."""

    def open(self, model: StepModel, folder: Path) -> Stream:
        """Return a fresh stream.

        Args:
            model: What to run; always the same for one ``folder``.
            folder: Its own, for what is built; still there at the next ``open``, which may use it again.

        Skips the test (``pytest.skip``) where the machine lacks what the runtime needs.
        """


def all_runtimes() -> list[Runtime]:
    """Return the adapters of every module in this folder."""
    modules = sorted(path.stem for path in Path(__file__).parent.glob("*.py") if path.stem != "__init__")
    found = []
    for module in modules:
        adapters = import_module(f"{__name__}.{module}")
        found += adapters.RUNTIMES if hasattr(adapters, "RUNTIMES") else [adapters.RUNTIME]
    return found


def run(stream: Stream, samples: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return newtons, shape ``(n, 3)``, and flags, shape ``(n,)``, of samples, shape ``(n, inputs)``."""
    if hasattr(stream, "run"):
        newtons, flags = stream.run(samples)
        return np.asarray(newtons), np.asarray(flags).astype(np.int64)
    outputs = [stream.step(*map(float, sample)) for sample in samples]
    return np.array([output[:3] for output in outputs]), np.array([int(output[3]) for output in outputs])
