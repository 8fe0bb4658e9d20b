"""Public measurements, read where they lie; without them these tests are skipped."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from cylinder_friction.evaluation.inspection.files import inspect_files
from cylinder_friction.labelling.label import Labeller
from cylinder_friction.reporting.inspection.recording_pane import Panes

if TYPE_CHECKING:
    from cylinder_friction.recordings.checks.limits import LoadMode
    from cylinder_friction.reporting.inspection.recording_pane import Pane

DATA = Path(__file__).parents[3] / "../shared/data"

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the public measurements are not here")


@pytest.fixture(scope="module")
def public() -> Any:
    """What the benchmark prints; tests call the same functions."""
    return import_module("public_figures")


@pytest.fixture(scope="module")
def emps(public: Any) -> Any:
    return public.emps(DATA)


def test_emps_gives_the_published_mass_and_friction_within_two_percent(public: Any, emps: Any) -> None:
    for name, published in public.PUBLISHED_EMPS.items():
        assert emps.parameters[name] == pytest.approx(published, rel=0.02), name
    low, high = emps.motion.mass_interval_kg
    assert low < 95.1 < high
    assert high - low < 2.0


def test_what_emps_identified_predicts_the_force_of_the_other_file(emps: Any) -> None:
    assert emps.block_error_percent["DATA_EMPS"] < 4.5
    assert emps.block_error_percent["DATA_EMPS_PULSES"] < 6.0
    assert emps.force_error_percent["DATA_EMPS_PULSES"] < 12.0


@pytest.fixture(scope="module")
def crane(public: Any) -> Any:
    return public.crane(DATA, generations=8)


@pytest.mark.slow
@pytest.mark.parametrize("run", ["JibSineTest", "Dual2SineTest"])
def test_friction_comes_out_of_a_crane_that_nobody_told_its_load(crane: Any, run: str) -> None:
    load = crane[run].found.load
    assert 3000.0 < load.coulomb_n < 4500.0
    assert load.coulomb_interval_n[0] > 3000.0
    assert load.coulomb_interval_n[1] < 4500.0
    assert crane[run].greatest_asymmetry_percent < 20.0
    assert 24e3 < load.load_range_n[0] < load.load_range_n[1] < 38e3


def inspected(public: Any, rig: str, path: Path, load: LoadMode) -> Pane:
    """Return what the inspection makes of a file, its load being stated as ``load``."""
    rules = sys.modules[public.recordings_of.__module__]
    labeller, recipe = Labeller(rules.CYLINDERS[rig], load=load), rules.recipe_of(rig)
    recipe = replace(recipe, limits=replace(recipe.limits, load=load))
    (subject,) = inspect_files({f"{rig}_{path.name}": path}, recipe)
    return Panes(labeller, {"savitzky_golay": rules.FILTERS[rig]}, "savitzky_golay").pane(1, subject)


@pytest.mark.parametrize(("run", "least_n"), [("JibSineTest", 3500.0), ("Dual2SineTest", 3600.0)])
def test_inspection_states_the_crane_s_friction_once_its_load_is_taken_off(
    public: Any, run: str, least_n: float
) -> None:
    path = DATA / f"crane/{run}_230425__100Hz.csv.gz"
    loaded = inspected(public, "crane", path, "none")
    assert loaded.friction == {}
    assert loaded.subject.verdict.startswith("not usable: the force is not friction alone: 3")
    taken_off = inspected(public, "crane", path, "position")
    assert taken_off.subject.verdict.startswith("usable for labelling")
    for mean in taken_off.friction.values():
        assert least_n < mean.mean_n < 4000.0
        assert math.isnan(mean.half_width_n)


@pytest.mark.slow
def test_the_crane_s_offset_is_stated_as_inseparable_from_its_load(public: Any, crane: Any) -> None:
    run = crane["JibSineTest"]
    words = import_module("public_recordings").crane_offset
    assert run.stated_zero_n is None
    assert words(run).startswith("sensor offset: inseparable from the load, both together known to ± 1124 N (k = 2)")
    assert words(run).endswith(
        "the file states no accuracy: 1767 N for each bar that the zero of the piston side may be "
        "off, 982 N of the rod side"
    )
    assert words(replace(run, stated_zero_n=50.0)).endswith("not in friction; ± 100 N as the zeros are stated (k = 2)")


@pytest.mark.slow
@pytest.mark.parametrize("run", ["JibSineTest", "Dual2SineTest"])
def test_lugre_of_one_crane_run_holds_on_the_other(crane: Any, run: str) -> None:
    assert crane[run].lugre_percent < 8.0
    assert crane[run].own_percent < crane[run].lugre_percent


def test_friction_of_seals_grows_with_pressure(public: Any) -> None:
    for seal, pressures in public.seals(DATA).items():
        found = [pressures[bar].load for bar in public.SEAL_PRESSURES_BAR]
        for lower, higher in pairwise(found):
            assert lower.coulomb_interval_n[1] < higher.coulomb_interval_n[0], seal
        # A piston of nominally 25 mm: the load is the pressure's force.
        for bar, load in zip(public.SEAL_PRESSURES_BAR, found, strict=True):
            assert load.load_range_n[0] == pytest.approx(49.1 * bar, rel=0.05)


def test_uneven_stamps_of_the_seals_become_one_rate(public: Any) -> None:
    recordings = public.recordings_of(DATA / "pneumatic-seals/O-ring_3bar.csv.gz", "pneumatic-seals")
    # The logger waits 10 ms between samples, and its delays add up.
    (step_s,) = {recording.sample_time_s for recording in recordings}
    assert step_s == pytest.approx(0.01013, rel=1e-3)
    # A gap of 2.7 s splits the recording.
    assert len(recordings) >= 2
    assert sum(len(recording) for recording in recordings) > 7500


def test_tribometer_tells_its_presliding_stiffness(public: Any) -> None:
    figures = public.tribometer(DATA)
    found = figures.reversals
    low, high = found.interval_n_m
    assert low < found.stiffness_n_m < high
    assert found.stiffness_n_m == pytest.approx(43.9e3, rel=0.03)
    assert high - low < 0.01 * found.stiffness_n_m
    assert found.reversals_extend == found.reversals_retract == 49
    assert found.extend_n_m == pytest.approx(found.retract_n_m, rel=0.03)
    assert all(value == pytest.approx(found.stiffness_n_m, rel=0.03) for value in figures.by_level.values())
    assert figures.lugre_interval_n_m[0] < figures.lugre.bristle_stiffness_n_m < figures.lugre_interval_n_m[1]
    # LuGre's curve is not the measured one: it trades stiffness for a sharper bend.
    assert figures.lugre.bristle_stiffness_n_m == pytest.approx(found.stiffness_n_m, rel=0.2)
    assert figures.lugre_percent < 12.0
