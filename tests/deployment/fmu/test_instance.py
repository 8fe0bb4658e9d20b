"""The FMU at work: Python's numbers, saved states, several instances, and refusals with a reason."""

import math
from collections.abc import Callable

import pytest
from fmpy.fmi1 import FMICallException

from cylinder_friction.deployment.descriptions import flags_of
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.stream import RealTimeStream
from fmu_host import ExtractedFmu, FmuInstance

Samples = list[tuple[float, float, float]]

NEWTONS = 0.01


def test_steps_are_pythons(instance: FmuInstance, model: StepModel, samples: Samples) -> None:
    python = RealTimeStream(model)
    instance.initialize()
    for row, sample in enumerate(samples):
        bad = (math.nan, sample[1], math.inf) if 450 <= row < 455 else sample
        expected = python.step(*bad)
        friction_n, lower_n, upper_n, flags = instance.step(bad)
        assert (friction_n, lower_n, upper_n) == pytest.approx(expected[:3], abs=NEWTONS)
        assert flags == expected.flags
        assert instance.get_boolean("trusted") == (flags == 0)
        for flag in flags_of(model):
            assert instance.get_boolean(flag.name.lower()) == bool(flags & flag)


def test_before_the_first_step_nothing_is_ready_and_time_follows_the_steps(
    instance: FmuInstance, model: StepModel, samples: Samples
) -> None:
    instance.initialize(start_s=3.0)
    assert instance.outputs() == (0.0, 0.0, 0.0, Flag.NOT_READY)
    assert not instance.get_boolean("trusted")
    assert instance.get_real("time", "sample_time") == (3.0, model.sample_time_s)
    for sample in samples[:4]:
        instance.step(sample)
    assert instance.get_real("time") == pytest.approx((3.02,))


def test_a_restored_state_goes_on_as_before(instance: FmuInstance, samples: Samples) -> None:
    instance.initialize()
    for sample in samples[:100]:
        instance.step(sample)
    saved, outputs, time_s = instance.save(), instance.outputs(), instance.time_s
    after = [instance.step(sample) for sample in samples[100:200]]
    instance.restore(saved)
    instance.time_s = time_s
    assert instance.outputs() == outputs
    assert [instance.step(sample) for sample in samples[100:200]] == after
    instance.free(saved)


def test_a_stored_state_goes_on_in_another_instance(
    opened: ExtractedFmu, instance: FmuInstance, samples: Samples
) -> None:
    instance.initialize()
    for sample in samples[:100]:
        instance.step(sample)
    saved = instance.save()
    stored = instance.store(saved)
    instance.free(saved)
    other = opened.instance("another")
    read = other.read(stored)
    other.restore(read)
    other.free(read)
    other.time_s = instance.time_s
    assert other.outputs() == instance.outputs()
    assert [other.step(sample) for sample in samples[100:150]] == [instance.step(sample) for sample in samples[100:150]]
    other.close()


@pytest.mark.parametrize(
    ("harm", "said"),
    [
        (lambda stored: stored[:-1], "expected a stored state of"),
        (lambda stored: bytes([stored[0] ^ 1]) + stored[1:], "expected a stored state of this model"),
        (lambda stored: stored[:-1] + bytes([stored[-1] ^ 1]), "the stored state is damaged"),
    ],
    ids=["short", "another model's", "damaged"],
)
def test_a_stored_state_that_does_not_fit_is_refused(instance: FmuInstance, harm, said: str) -> None:
    instance.initialize()
    stored = instance.store(instance.save())
    with pytest.raises(FMICallException):
        instance.read(harm(stored))
    assert said in instance.log[-1]


STEP = "DoStep: expected a communication step size of 0.005 s, the sample time that the model was trained at, but got"
POINT = "expected the current communication point at 0.05 s, where the last step ended, but got"
REFUSED: dict[str, tuple[Callable[[FmuInstance], object], str]] = {
    **{
        f"a step of {step_s}": (lambda it, step_s=step_s: it.do_step(it.time_s, step_s), f"{STEP} {step_s:.9g} s")
        for step_s in (0.01, 0.005 * (1.0 + 2e-6), math.nan)
    },
    **{
        f"a step from {point_s}": (lambda it, at_s=point_s: it.do_step(at_s, 0.005), f"{POINT} {point_s:.9g} s")
        for point_s in (0.045, 0.055, math.nan)
    },
    "a step past the stop time": (
        lambda it: it.step((1e6, 1e6, 0.1)),
        "expected a step that ends by the stop time of 0.05 s, but got one to 0.055 s",
    ),
    "a mode that is over": (lambda it: it.raw.enterInitializationMode(), "is not allowed in the state: step mode"),
    "warm-up in step mode": (lambda it: it.set_integer("warm_up_steps", 1), "is not allowed in the state: step mode"),
    "an output that is set": (
        lambda it: it.set_real(("friction",), (1.0,)),
        "is not an input; the inputs are pressure_1",
    ),
    "a number read as a truth": (lambda it: it.get_boolean("friction"), ""),
}


@pytest.mark.parametrize("call", REFUSED)
def test_what_does_not_fit_is_refused_and_changes_nothing(instance: FmuInstance, samples: Samples, call: str) -> None:
    refused, said = REFUSED[call]
    instance.initialize(stop_s=0.05)
    before = [instance.step(sample) for sample in samples[:10]]
    with pytest.raises(FMICallException):
        refused(instance)
    assert said in (instance.log[-1] if said else "")
    assert instance.outputs() == before[-1]


def test_a_step_size_off_by_rounding_is_taken(instance: FmuInstance, samples: Samples) -> None:
    instance.initialize(start_s=1e6)
    for row, sample in enumerate(samples[:100]):
        point_s, next_s = 1e6 + row * 0.005, 1e6 + (row + 1) * 0.005
        instance.set_real(("pressure_1", "pressure_2", "position"), sample)
        instance.do_step(point_s, next_s - point_s)
    assert instance.log == []


def test_calls_out_of_order_and_unknown_variables_are_refused(instance: FmuInstance) -> None:
    for steps in (-1, 10_000_001):
        with pytest.raises(FMICallException):
            instance.set_integer("warm_up_steps", steps)
        assert f"expected warm_up_steps from 0 to 10000000, but got {steps}" in instance.log[-1]
    with pytest.raises(FMICallException):
        instance.do_step(0.0, 0.005)
    assert "DoStep is not allowed in the state: instantiated" in instance.log[-1]
    instance.initialize()
    instance.fmu.references["nothing"] = 99
    with pytest.raises(FMICallException):
        instance.get_real("nothing")
    assert "no such variable: value reference 99" in instance.log[-1]
    instance.raw.terminate()
    with pytest.raises(FMICallException):
        instance.do_step(0.0, 0.005)
    assert "DoStep is not allowed in the state: terminated" in instance.log[-1]


def test_another_models_token_is_refused(opened: ExtractedFmu, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(Exception, match="Failed to instantiate"):
        opened.instance(token="{00000000-0000-0000-0000-000000000000}")
