"""Checks of a step model before a runtime is made from it: shapes, ranges, and trees that end.

A saved model may be damaged or foreign. Every runtime is made from a ``StepModel``, so this one check serves them all.
"""

from typing import Any

import numpy as np

from cylinder_friction.realtime.bounds import REGIMES
from cylinder_friction.realtime.forest import Forest
from cylinder_friction.realtime.history import HISTORY_NAMES
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OWN, POWERS, QUANTITIES, RANGED, ZERO

LARGEST = 1e30  # Largest number in a model; larger ones would overflow in single precision
LONGEST_SAMPLE_S = 10.0
MOST_SAMPLES = 10**8  # Longest duration [samples]
MOST_LAGS = 20_000  # Longest filter [samples]
ANY = -1  # Stands for a length that the model itself decides


def check_step_model(model: StepModel) -> None:
    """Refuse a model that no runtime could run, or that runtimes would run differently.

    Raises:
        ValueError: The message names the field, what it holds and what was expected.
    """
    channels, features = len(model.channels), len(model.feature_taps)
    check_timing(model.sample_time_s, model.lag_s)
    _numbers("feature_taps", model.feature_taps, (features, channels, ANY))
    _numbers("feature_limits", model.feature_limits, (features,), 0.0)
    _numbers("feature_mean", model.feature_mean, (features,))
    _numbers("feature_scale", model.feature_scale, (features,), np.finfo(float).tiny)
    _numbers("base_taps", model.base_taps, (channels, ANY))
    _numbers("velocity_taps", model.velocity_taps, (channels, ANY))
    _numbers("target_mean_n", model.target_mean_n, ())
    _numbers("target_scale_n", model.target_scale_n, ())
    for name, own in model.corrections.items():
        _numbers(f"corrections.{name}", own.offset, ())
    for name, line in model.line_loss.items():
        _numbers(f"line_loss.{name}", line.terms(), (len(line.terms()),), 0.0)
    _check_guard(model, channels)
    _check_bounds(model)
    if model.history is not None:
        count = len(HISTORY_NAMES)
        _numbers("history.mean", model.history.mean, (count,))
        _numbers("history.scale", model.history.scale, (count,), np.finfo(float).tiny)
        _numbers("history.settings", model.history.settings(), (count,), np.finfo(float).tiny)
        _whole("history.position_feature", model.history.position_feature, features - 1)
    if model.offset is not None:
        _check_offset(model, channels)
    nodes = 0
    if model.network is not None:
        check_network(model.network)
        nodes = model.network.nodes
        _expect("network.inputs", model.network.inputs, model.feature_count)
    if model.forest is not None:
        check_forest(model.forest)
        seen = {"hidden": nodes, "features": model.feature_count}
        _expect("forest.inputs", model.forest.inputs, seen.get(model.forest_sees, nodes + 1 + model.feature_count))


def check_timing(sample_time_s: float, lag_s: float) -> None:
    """Refuse a sample time or lag [s] that no model has; raises ``ValueError``."""
    _numbers("sample_time_s", sample_time_s, (), 1e-6, LONGEST_SAMPLE_S)
    _numbers("lag_s", lag_s, (), 0.0, 1000.0 * sample_time_s)


def check_network(network: LstmWeights) -> None:
    """Refuse weights whose shapes do not fit together, or that are not finite; raises ``ValueError``."""
    layers, nodes = network.layers, network.nodes
    widest = network.inputs if layers == 1 else max(network.inputs, nodes)
    _numbers("network.input", network.input, (layers, widest, 4 * nodes))
    _numbers("network.recurrent", network.recurrent, (layers, nodes, 4 * nodes))
    _numbers("network.bias", network.bias, (layers, 4 * nodes))
    _numbers("network.head", network.head, (nodes,))
    _numbers("network.head_bias", network.head_bias, ())


def check_forest(forest: Forest) -> None:
    """Refuse a forest with a feature that is not there, or trees that do not end; raises ``ValueError``."""
    count = len(forest.feature)
    _numbers("forest.threshold", forest.threshold, (count,))
    _numbers("forest.value", forest.value, (count,))
    _numbers("forest.feature", forest.feature, (count,), -1, forest.inputs - 1)
    _numbers("forest.roots", forest.roots, (ANY,), 0, count - 1)
    check_children(forest.feature >= 0, forest.left, forest.right, forest.roots)


def check_children(inner: Any, left: Any, right: Any, roots: Any) -> None:
    """Refuse children outside their parent's tree or before their parent, so that each path ends in a leaf.

    Args:
        inner: Whether each node has children, shape ``(nodes,)``; trees follow one another.
        left: Index of one child, shape ``(nodes,)``.
        right: Index of the other.
        roots: Index of each tree's first node, shape ``(trees,)``.
    """
    own = np.arange(len(inner))
    if len(roots) == 0 or roots[0] != 0 or (np.diff(roots) <= 0).any():
        raise ValueError("forest.roots: expected trees that follow one another from node 0")
    ends = np.append(roots[1:], len(inner))[np.searchsorted(roots, own, side="right") - 1]
    for name, child in (("left", left), ("right", right)):
        wrong = inner & ((child <= own) | (child >= ends))
        if wrong.any():
            node = int(np.flatnonzero(wrong)[0])
            raise ValueError(
                f"forest.{name}: node {node} leads to node {int(child[node])}, but expected a later node of its tree"
            )


def _check_guard(model: StepModel, channels: int) -> None:
    guard, inputs = model.guard, len(model.inputs)
    for kind in ("accept", "trained"):
        lower, upper = getattr(guard, f"{kind}_lower"), getattr(guard, f"{kind}_upper")
        _numbers(f"guard.{kind}_lower", lower, (inputs,))
        _numbers(f"guard.{kind}_upper", upper, (inputs,))
        if (np.array(lower) > np.array(upper)).any():
            raise ValueError(f"guard.{kind}_lower: {lower} is above {kind}_upper, {upper}")
    _numbers("guard.freeze_travel_m", guard.freeze_travel_m, (), 0.0)
    _numbers("guard.freeze_force_n", guard.freeze_force_n, (), 0.0)
    for name in ("freeze_samples", "warm_up_samples", "recovery_samples", "clear_samples"):
        _whole(f"guard.{name}", getattr(guard, name), MOST_SAMPLES)
    if guard.force_weights:
        _numbers("guard.force_weights", guard.force_weights, (channels,))
        for name in ("sliding_lower", "sliding_upper", "largest_force"):
            _numbers(f"guard.{name}", getattr(guard, name), (2,))
    _numbers("guard.least_pressure_pa", guard.least_pressure_pa, ())


def _check_bounds(model: StepModel) -> None:
    bounds, count = model.bounds, len(REGIMES)
    _numbers("bounds.lower_n", bounds.lower_n, (count,))
    _numbers("bounds.upper_n", bounds.upper_n, (count,))
    if (np.array(bounds.lower_n) > np.array(bounds.upper_n)).any():
        raise ValueError(f"bounds.lower_n: {bounds.lower_n} is above upper_n, {bounds.upper_n}")
    _numbers("bounds.spread_n", bounds.spread_n, (count,), 0.0)
    _numbers("bounds.standstill_m_s", bounds.standstill_m_s, (), 0.0)
    _numbers("bounds.creep_m_s", bounds.creep_m_s, (), bounds.standstill_m_s)
    _numbers("bounds.probability", bounds.probability, (), 0.0, 1.0)
    _whole("bounds.reversal_samples", bounds.reversal_samples, MOST_SAMPLES)
    if bounds.holds not in ("friction", "label"):
        raise ValueError(f"bounds.holds: got {bounds.holds!r}, expected 'friction' or 'label'")


def _check_offset(model: StepModel, channels: int) -> None:
    tracker = model.offset
    assert tracker is not None
    _numbers("offset.weights", tracker.weights, (ZERO + 1, channels))
    _numbers("offset.friction", tracker.friction, (QUANTITIES,))
    _numbers("offset.position", tracker.position, (POWERS,))
    _numbers("offset.ranges", tracker.ranges, (2, RANGED))
    _numbers("offset.prior", tracker.prior, (OWN,), 0.0)
    settings = tracker.settings
    for name, value in settings._asdict().items():
        _numbers(f"offset.settings.{name}", value, ())
    for name in ("block", "duration_s", "speed_deviation", "noise_n"):
        _numbers(f"offset.settings.{name}", getattr(settings, name), (), np.finfo(float).tiny)
    for name in ("slowest_m_s", "settling", "mass_kg", "stroke_n", "walk", "common_n", "largest_variance"):
        _numbers(f"offset.settings.{name}", getattr(settings, name), (), 0.0)
    if not settings.first_position_m < settings.last_position_m:
        raise ValueError("offset.settings: expected first_position_m below last_position_m")


def _numbers(name: str, values: Any, shape: tuple[int, ...], least: float = -LARGEST, most: float = LARGEST) -> None:
    """Refuse anything but finite numbers of this shape between ``least`` and ``most``."""
    array = np.asarray(values)
    if array.dtype.kind not in "iuf":
        raise ValueError(f"{name}: expected numbers, but got {str(values)[:80]!r}")
    wanted = tuple(found if length == ANY else length for found, length in zip(array.shape, shape, strict=False))
    if array.ndim != len(shape) or array.shape != wanted:
        expected = tuple("any" if length == ANY else length for length in shape)
        raise ValueError(f"{name}: has shape {array.shape}, but expected {expected}")
    if max(array.shape[-1:], default=0) > MOST_LAGS and shape[-1] == ANY and array.ndim > 1:
        raise ValueError(f"{name}: looks back on {array.shape[-1]} samples, but expected at most {MOST_LAGS}")
    with np.errstate(invalid="ignore"):
        wrong = ~((array >= least) & (array <= most))
    if wrong.any():
        raise ValueError(f"{name}: holds {array[wrong].ravel()[0]}, but expected numbers from {least:g} to {most:g}")


def _whole(name: str, value: Any, most: int) -> None:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise ValueError(f"{name}: got {value!r}, but expected a whole number from 0 to {most}")


def _expect(name: str, found: int, expected: int) -> None:
    if found != expected:
        raise ValueError(f"{name}: the model gives it {expected} numbers, but it takes {found}")
