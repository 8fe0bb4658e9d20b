"""A host for FMUs of either version, on FMPy: one instance, driven call by call."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fmpy import extract, read_model_description
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.fmi3 import FMU3Slave

if TYPE_CHECKING:
    from pathlib import Path

ESTIMATES = ("friction", "friction_lower", "friction_upper")


class ExtractedFmu:
    """An FMU's files and description, unpacked into a folder."""

    def __init__(self, path: Path, folder: Path) -> None:
        if not folder.exists():
            extract(str(path), str(folder))
        self.folder = folder
        self.description = read_model_description(str(folder))
        self.version = 2 if self.description.fmiVersion == "2.0" else 3
        variables = self.description.modelVariables
        self.references = {variable.name: variable.valueReference for variable in variables}
        self.inputs = tuple(variable.name for variable in variables if variable.causality == "input")

    def instance(self, name: str = "one", token: str | None = None) -> FmuInstance:
        return FmuInstance(self, name, token)


class FmuInstance:
    """One instance; ``log`` holds what it said."""

    def __init__(self, fmu: ExtractedFmu, name: str, token: str | None = None) -> None:
        self.fmu, self.log, self.time_s = fmu, [], 0.0
        kind = FMU2Slave if fmu.version == 2 else FMU3Slave
        self.raw = kind(
            instanceName=name,
            guid=token or fmu.description.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier=fmu.description.coSimulation.modelIdentifier,
        )
        if fmu.version == 2:
            callbacks = fmi2CallbackFunctions()
            callbacks.logger = fmi2CallbackLoggerTYPE(self._log_2)
            callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(0)
            callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(0)
            self.raw.instantiate(callbacks=callbacks)
        else:
            self.raw.instantiate(logMessage=self._log_3)

    def _log_2(self, environment, name, status, category, message) -> None:
        self.log.append(f"{name.decode()}: {message.decode()}")

    def _log_3(self, environment, status, category, message) -> None:
        self.log.append(message.decode())

    def initialize(
        self, start_s: float = 0.0, stop_s: float | None = None, warm_up_steps: int = 0, sample: tuple | None = None
    ) -> None:
        """Go from instantiated to step mode; a sample set here is the one that warm-up steps repeat."""
        if self.fmu.version == 2:
            self.raw.setupExperiment(startTime=start_s, stopTime=stop_s)
            self.raw.enterInitializationMode()
        else:
            self.raw.enterInitializationMode(startTime=start_s, stopTime=stop_s)
        self.set_integer("warm_up_steps", warm_up_steps)
        if sample is not None:
            self.set_real(self.fmu.inputs, sample)
        self.raw.exitInitializationMode()
        self.time_s = start_s

    def set_real(self, names: tuple[str, ...], values: tuple[float, ...]) -> None:
        references = [self.fmu.references[name] for name in names]
        (self.raw.setReal if self.fmu.version == 2 else self.raw.setFloat64)(
            references, [float(value) for value in values]
        )

    def get_real(self, *names: str) -> tuple[float, ...]:
        references = [self.fmu.references[name] for name in names]
        return tuple((self.raw.getReal if self.fmu.version == 2 else self.raw.getFloat64)(references))

    def set_integer(self, name: str, value: int) -> None:
        setter = self.raw.setInteger if self.fmu.version == 2 else self.raw.setInt32
        setter([self.fmu.references[name]], [value])

    def get_integer(self, name: str) -> int:
        getter = self.raw.getInteger if self.fmu.version == 2 else self.raw.getInt32
        return int(getter([self.fmu.references[name]])[0])

    def get_boolean(self, name: str) -> bool:
        return bool(self.raw.getBoolean([self.fmu.references[name]])[0])

    def outputs(self) -> tuple[float, float, float, int]:
        return (*self.get_real(*ESTIMATES), self.get_integer("flags"))

    def do_step(self, point_s: float, step_s: float) -> None:
        self.raw.doStep(currentCommunicationPoint=point_s, communicationStepSize=step_s)

    def step(self, sample: tuple[float, ...]) -> tuple[float, float, float, int]:
        """Set a sample, take one step of the declared size, and return friction, bounds and flags."""
        step_s = float(self.fmu.description.defaultExperiment.stepSize)
        self.set_real(self.fmu.inputs, sample)
        self.do_step(self.time_s, step_s)
        self.time_s += step_s
        return self.outputs()

    def save(self) -> object:
        return self.raw.getFMUState()

    def restore(self, state: object) -> None:
        self.raw.setFMUState(state)

    def free(self, state: object) -> None:
        self.raw.freeFMUState(state)

    def store(self, state: object) -> bytes:
        return self.raw.serializeFMUState(state)

    def read(self, stored: bytes) -> object:
        return self.raw.deserializeFMUState(stored)

    def reset(self) -> None:
        self.raw.reset()

    def close(self) -> None:
        self.raw.freeInstance()
