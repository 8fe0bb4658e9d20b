"""FMI 2.0 co-simulation, driven by FMPy at the declared step."""

from pathlib import Path

import pytest

from contracts.runtimes import Output, Stream
from cylinder_friction.deployment.fmu.export import FmiVersion, export_model_fmu
from cylinder_friction.realtime.model import StepModel
from fmu_host import FmuInstance


class _Fmu:
    def __init__(self, instance: FmuInstance) -> None:
        self._instance = instance
        self._instance.initialize()

    def step(self, *sample: float) -> Output:
        return self._instance.step(sample)

    def reset(self, offset_n: float = 0.0, uncertainty_n: float | None = None) -> None:
        self._instance.reset()
        if (offset_n, uncertainty_n) != (0.0, None):
            start = (offset_n, -1.0 if uncertainty_n is None else uncertainty_n)
            self._instance.set_real(("start_offset", "start_offset_uncertainty"), start)
        self._instance.initialize()

    @property
    def offset(self) -> tuple[float, ...]:
        return self._instance.get_real("offset", "offset_uncertainty")

    def warm_up(self, *sample: float, steps: int) -> None:
        self._instance.reset()
        self._instance.initialize(warm_up_steps=steps, sample=sample)

    def close(self) -> None:
        self._instance.close()


class FmuRuntime:
    """The FMU with a binary for this computer, exported once a folder."""

    def __init__(self, fmi: FmiVersion) -> None:
        self.name, self.fmi = f"fmi{fmi}", fmi

    def open(self, model: StepModel, folder: Path) -> Stream:
        pytest.importorskip("fmpy", reason="pip install cylinder-friction[fmu]")
        from fmu_host import ExtractedFmu

        path = folder / "contract.fmu"
        if not path.exists():
            exported = export_model_fmu(model, path, self.fmi)
            if exported.binary is None:
                path.unlink()
                pytest.skip(exported.note)
        return _Fmu(ExtractedFmu(path, folder / "unpacked").instance())


RUNTIMES = [FmuRuntime(2)]
