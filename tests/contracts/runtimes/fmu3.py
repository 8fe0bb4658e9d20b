"""FMI 3.0 co-simulation, driven by FMPy at the declared step."""

from __future__ import annotations

from contracts.runtimes.fmu2 import FmuRuntime

RUNTIMES = [FmuRuntime(3)]
