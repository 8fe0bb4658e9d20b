"""The FMU of an estimator that learns the sensors' offset: the reference's numbers, whatever is known before."""

import math

import pytest
from fmpy.fmi1 import FMICallException

from cylinder_friction.realtime.model import StepModel
from fmu_host import ExtractedFmu, FmuInstance

START = ("start_offset", "start_offset_uncertainty")
LEARNED = ("offset", "offset_uncertainty")

pytestmark = pytest.mark.parametrize("hybrid", ["learning_hybrid"], indirect=True)


def test_a_start_offset_is_part_of_the_state_and_reset_forgets_it(opened: ExtractedFmu, instance: FmuInstance) -> None:
    instance.set_real(START, (20.0, 3.0))
    instance.initialize()
    other = opened.instance("another")
    other.restore(other.read(instance.store(instance.save())))
    assert other.get_real(*START, *LEARNED) == instance.get_real(*START, *LEARNED) == (20.0, 3.0, 20.0, 3.0)
    other.close()
    instance.reset()
    assert instance.get_real(*START) == (0.0, -1.0)
    assert instance.get_real("offset") == (0.0,)


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
