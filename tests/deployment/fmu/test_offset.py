"""The FMU of an estimator that learns the sensors' offset: the reference's numbers, whatever is known before."""

import math

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException

from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from fmu_host import ExtractedFmu, FmuInstance

NEWTONS = 0.01
START = ("start_offset", "start_offset_uncertainty")
LEARNED = ("offset", "offset_uncertainty")

pytestmark = pytest.mark.parametrize("hybrid", ["learning_hybrid"], indirect=True)


@pytest.mark.parametrize("start", [(90.0, 4.0), (90.0, -1.0), (-30.0, 0.0)])
def test_it_starts_from_a_known_offset(
    instance: FmuInstance, model: StepModel, offset_samples: np.ndarray, start: tuple[float, float]
) -> None:
    python, rest = RealTimeStream(model), offset_samples[100].tolist()
    python.reset(start[0], None if start[1] < 0.0 else start[1])
    for name, value in zip(START, start, strict=True):
        instance.set_real((name,), (value,))
    assert instance.get_real(*START) == start
    assert instance.get_real(*LEARNED) == pytest.approx(python.offset)
    instance.initialize(warm_up_steps=50, sample=tuple(rest))
    for _ in range(50):
        python.step(*rest)
    for sample in offset_samples[100:400].tolist():
        assert instance.step(sample) == pytest.approx(python.step(*sample), abs=NEWTONS)
        assert instance.get_real(*LEARNED) == pytest.approx(python.offset, abs=NEWTONS)


def test_what_was_learned_is_part_of_the_state_and_reset_forgets_it(
    opened: ExtractedFmu, instance: FmuInstance, offset_samples: np.ndarray
) -> None:
    instance.set_real(START, (20.0, 3.0))
    instance.initialize()
    for sample in offset_samples[:600].tolist():
        instance.step(sample)
    saved, other = instance.save(), opened.instance("another")
    other.restore(other.read(instance.store(saved)))
    other.time_s = instance.time_s
    assert other.get_real(*START, *LEARNED) == instance.get_real(*START, *LEARNED)
    for sample in offset_samples[600:900].tolist():
        assert other.step(sample) == instance.step(sample)
    instance.reset()
    assert instance.get_real(*START) == (0.0, -1.0)
    assert instance.get_real("offset") == (0.0,)
    other.close()


@pytest.mark.parametrize("value", [math.nan, math.inf, -1e10])
def test_an_offset_that_is_no_number_is_refused(instance: FmuInstance, value: float) -> None:
    before = instance.get_real(*LEARNED)
    for name in START:
        with pytest.raises(FMICallException):
            instance.set_real((name,), (value,))
        assert (
            f"expected a start offset and its uncertainty of at most 1e+09 N, but got {value:.9g} N" in instance.log[-1]
        )
    assert instance.get_real(*LEARNED) == before


def test_an_offset_is_known_before_the_simulation_starts_or_not_at_all(instance: FmuInstance) -> None:
    instance.initialize()
    for name, said in ((START[0], "is not allowed in the state: step mode"), (LEARNED[0], "is not an input")):
        with pytest.raises(FMICallException):
            instance.set_real((name,), (1.0,))
        assert said in instance.log[-1]


def test_it_is_described(opened: ExtractedFmu, model: StepModel) -> None:
    variables = {variable.name: variable for variable in opened.description.modelVariables}
    assert [(variables[name].causality, variables[name].unit) for name in START] == [("parameter", "N")] * 2
    assert [(variables[name].causality, variables[name].unit) for name in LEARNED] == [("output", "N")] * 2
    assert [float(variables[name].start) for name in START] == [0.0, -1.0]
    assert "below 0: as stated for the sensors, 80 N" in variables[START[1]].description
    initial = {unknown.variable.name: unknown.dependencies for unknown in opened.description.initialUnknowns}
    assert [[each.name for each in initial[name]] for name in LEARNED] == [[name] for name in START]
    page = (opened.folder / "documentation/index.html").read_text(encoding="utf-8")
    assert "start_offset and start_offset_uncertainty before initialization ends" in page
