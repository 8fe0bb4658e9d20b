"""Friction inside a hydraulic cylinder: from logger files to an estimate in real time.

Read logs, label them by the equation of motion, train, estimate and compare:

>>> import cylinder_friction as cf
>>> cylinder = cf.Cylinder(bore_diameter_m=0.063, rod_diameter_m=0.028, stroke_m=0.25, moving_mass_kg=6.0)
>>> recordings = cf.read_recordings("data/raw/rig/*.csv", channels="conf/ingest/rig.yaml", cylinder=cylinder)
>>> labelled = cf.label(recordings, cylinder)
>>> train, test = cf.split(labelled)
>>> hybrid = cf.HybridEstimator(cylinder).fit(train)
>>> lugre = cf.LugreEstimator(cylinder).fit(train)
>>> friction_n = hybrid.estimate(test[0])
>>> comparison = cf.compare({"hybrid": hybrid, "LuGre": lugre}, test)
>>> print(comparison)  # doctest: +ELLIPSIS
Mean absolute error against the label...
>>> figure = cf.plot(test[0], friction_n)

In a control loop, one sample at a time, pressures in Pa (gauge) and position in m:

>>> stream = hybrid.stream()
>>> newtons = [stream.step(*sample) for sample in test[0].samples()[:3]]
>>> newtons == friction_n[:3].tolist()
True

The examples of the single names continue this one: ``cylinder``, ``recordings``, ``labelled``, ``train``, ``test`` and
``hybrid`` come from here.

With ``channels=None`` the mapping is guessed from the channels' names and units, and a warning states each guess.
Friction is positive when it opposes positive velocity; extension and velocity are positive together; pressures are
gauge pressures.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from cylinder_friction.cylinder import Cylinder
    from cylinder_friction.estimation.from_logs import estimate_logs
    from cylinder_friction.estimation.identification import identify_logs
    from cylinder_friction.estimators.base import FrictionEstimator
    from cylinder_friction.estimators.hybrid import HybridEstimator
    from cylinder_friction.estimators.linear import RidgeEstimator
    from cylinder_friction.estimators.loading import load_estimator as load
    from cylinder_friction.estimators.lugre import LugreEstimator
    from cylinder_friction.evaluation.comparison import compare
    from cylinder_friction.labelling.label import label, position_load
    from cylinder_friction.labelling.offset_identification import fit_offset_model
    from cylinder_friction.recordings.reading_logs import read_recordings
    from cylinder_friction.recordings.recording import Recording
    from cylinder_friction.recordings.splits import split
    from cylinder_friction.reporting.figures import plot

__all__ = [
    "Cylinder",
    "FrictionEstimator",
    "HybridEstimator",
    "LugreEstimator",
    "Recording",
    "RidgeEstimator",
    "compare",
    "estimate_logs",
    "fit_offset_model",
    "identify_logs",
    "label",
    "load",
    "plot",
    "position_load",
    "read_recordings",
    "split",
]

_DEFINED_IN = {
    "Cylinder": "cylinder",
    "FrictionEstimator": "estimators.base",
    "HybridEstimator": "estimators.hybrid",
    "LugreEstimator": "estimators.lugre",
    "Recording": "recordings.recording",
    "RidgeEstimator": "estimators.linear",
    "compare": "evaluation.comparison",
    "estimate_logs": "estimation.from_logs",
    "fit_offset_model": "labelling.offset_identification",
    "identify_logs": "estimation.identification",
    "label": "labelling.label",
    "load": "estimators.loading:load_estimator",
    "plot": "reporting.figures",
    "position_load": "labelling.label",
    "read_recordings": "recordings.reading_logs",
    "split": "recordings.splits",
}
"""Each name's module, imported when the name is first used, so that ``import cylinder_friction`` costs nothing."""


def __getattr__(name: str) -> Any:
    if name not in _DEFINED_IN:
        raise AttributeError(f"module 'cylinder_friction' has no attribute {name!r}; it offers {', '.join(__all__)}")
    module, _, original = _DEFINED_IN[name].partition(":")
    value = getattr(import_module(f"{__name__}.{module}"), original or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__
