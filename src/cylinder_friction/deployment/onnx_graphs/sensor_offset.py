"""The offset of the sensors' zeros in ONNX: what a step takes off, and what is learned at the end of a block.

What is averaged over a block is linear in its samples, so that the step graph needs no sums of its own: filters as long
as a block stand in for them, and run at its end alone.
"""

import math

import numpy as np
from onnx import TensorProto

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.onnx_graphs.graph import Graph
from cylinder_friction.deployment.onnx_graphs.rows import Rows
from cylinder_friction.realtime import sensor_offset as at
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OWN, OffsetTracker
from cylinder_friction.recordings.columns import REFERENCE_C

GIVEN = 2  # Numbers that may be given before the first sample: the offset and its standard uncertainty [N]
VARIANCE = OWN
"""Place of the offset's variance [N²] in what is learned, see ``new_learned``; that of the offset [N] is 0."""
KNOWN = OWN + OWN * OWN + 2  # Place of whether the piston has slid in both directions
LEARNED = KNOWN + 2  # How many numbers are learned
AVERAGES = ("balance", "pressure", "velocity", "load", "warm", "along")
"""Of a block: force balance less inertia and asymmetry [N], pressure [Pa], velocity [m/s], load [N], temperature over
the reference [°C], and position over half its range."""
EXPLAINED = ("left_n", "size_n", "side", "standard_speed", "in_range")
"""Of a block: what training leaves of the force balance [N], size of the friction it knows [N], direction, standardised
speed, and 1 where the block is like those of training."""


def settling_rows(tracker: OffsetTracker) -> int:
    """Return how many rows of a stroke do not count."""
    return math.floor(tracker.settings.settling)


def block_rows(tracker: OffsetTracker) -> int:
    """Return how many rows make a block."""
    return max(1, math.ceil(tracker.settings.block))


def block_taps(model: StepModel, tracker: OffsetTracker) -> Array:
    """Return filters that make ``AVERAGES`` at a block's end but for constants, shape ``(6, channels, lags)``."""
    rows, settings, velocity = block_rows(tracker), tracker.settings, model.velocity_taps
    lags = rows + velocity.shape[1] - 1
    taps = np.zeros((len(AVERAGES), len(model.channels), lags))
    sums = tracker.weights / rows
    pressure = sums[at.PRESSURE]
    taps[:, :, :rows] = np.stack(
        [
            sums[at.BALANCE] - settings.even_pressure * pressure,
            *(pressure, np.zeros_like(pressure), sums[at.LOAD], sums[at.WARM]),
            2.0 / _span_m(tracker) / rows * (np.arange(len(model.channels)) == model.position),
        ]
    )[:, :, None]
    for lag in range(rows):
        taps[2, :, lag : lag + velocity.shape[1]] += velocity / rows
    inertia = settings.mass_kg / settings.duration_s
    taps[0, :, : velocity.shape[1]] -= inertia * velocity
    taps[0, :, rows - 1 :] += inertia * velocity
    return taps


def averaged(graph: Graph, model: StepModel, tracker: OffsetTracker, window: str, lags: int, to: str) -> str:
    """Return ``AVERAGES``, shape ``(n, 6)``, from each block's last samples, shape ``(n, channels · lags)``."""
    taps, settings = block_taps(model, tracker), tracker.settings
    taps = np.pad(taps, ((0, 0), (0, 0), (0, lags - taps.shape[2])))
    middle = (settings.first_position_m + settings.last_position_m) / _span_m(tracker)
    constants = graph.constant([[-settings.even_constant_n, 0.0, 0.0, 0.0, -REFERENCE_C, -middle]])
    newest_first = taps.transpose(2, 1, 0).reshape(-1, len(AVERAGES))
    return graph.add("Gemm", window, graph.constant(newest_first), constants, to=to)


def take_off(graph: Graph, model: StepModel, tracker: OffsetTracker) -> None:
    """Make ``raw_features`` and ``base_n`` from ``measured`` and ``offset_taken_n``."""
    bank = [*model.feature_taps, model.base_taps]
    zeros = np.array([tracker.zero_of(taps[None])[0] for taps in bank])
    graph.add("Gemm", "offset_taken_n", graph.constant(-zeros[None]), "measured", to="without_offset")
    widths = {"raw_features": len(model.feature_taps), "base_n": 1}
    graph.split("without_offset", {name: width for name, width in widths.items() if width})


def block_ends(graph: Graph, tracker: OffsetTracker, rows: Rows, valid: str) -> tuple[str, str]:
    """Return whether a row is a block's last, ``(n, 1)``, and for how many rows it has lasted, ``(n, 3)``.

    What lasts is sliding outwards, sliding inwards, and rest, of which the first block alone counts.

    The graph has ``strokes_m_s``; ``valid``, shape ``(n, 1)``, is whether a row counts at all.
    """
    settling, block = settling_rows(tracker), block_rows(tracker)
    graph.add("ReduceMax", "strokes_m_s", to="stroke_m_s", axes=[1])
    slowest = graph.constant(tracker.settings.slowest_m_s)
    graph.add("GreaterOrEqual", "strokes_m_s", slowest, to="fast")
    graph.add("Less", "stroke_m_s", slowest, to="slow")
    graph.add("Concat", "fast", "slow", to="moves", axis=1)
    graph.add("And", "moves", valid, to="sliding")
    lasted = rows.lasting("sliding")
    graph.add("Equal", lasted, graph.constant([[-1.0, -1.0, float(block)]]), to="rest_block")
    graph.add("Mul", lasted, graph.constant([[1.0, 1.0, 0.0]]), to="slid_rows")
    graph.add("Where", "rest_block", graph.constant(float(settling + block)), "slid_rows", to="counted_rows")
    graph.add("ReduceMax", "counted_rows", to="sliding_longest", axes=[1])
    never_ends = graph.constant(settling + 0.5)
    graph.add("Max", "sliding_longest", never_ends, to="sliding_rows")
    graph.add("Mod", "sliding_rows", graph.constant(float(block)), to="block_phase", fmod=1)
    return graph.add("Equal", "block_phase", graph.constant(float(settling % block)), to="block_ends"), lasted


def first_block(graph: Graph, tracker: OffsetTracker) -> str:
    """Return whether the block that ends is its stroke's first, shape ``(n, 1)``; after ``block_ends``."""
    rows = settling_rows(tracker) + block_rows(tracker)
    return graph.add("Equal", "sliding_rows", graph.constant(float(rows)), to="first_block")


def new_learned(graph: Graph, tracker: OffsetTracker, given: str, to: str) -> tuple[str, str]:
    """Return what is learned before the first sample, shape ``(1, 34)``, and the variance of the offset in it.

    These are the means and the covariance of what a session has of its own; whether the piston has slid outwards,
    inwards, and both; and the level of friction (see ``realtime.sensor_offset``).

    ``given`` is offset and standard uncertainty [N], shape ``(1, 2)``; an uncertainty of 0 stands for none.
    """
    variances, settings, zero = tracker.prior**2, tracker.settings, graph.constant(0.0)
    graph.split(given, {"given_n": 1, "given_uncertainty_n": 1})
    graph.add("Greater", "given_uncertainty_n", zero, to="given_known")
    graph.add("Mul", "given_uncertainty_n", "given_uncertainty_n", to="given_variance")
    graph.add("Sub", "given_variance", graph.constant(settings.common_n**2), to="given_own_or_less")
    graph.add("Max", "given_own_or_less", zero, to="given_own")  # what all sessions share is stated beside it
    graph.add("Div", "given_own", graph.constant(settings.caution**2), to="given_learned")
    variance = graph.add("Where", "given_known", "given_learned", graph.constant(variances[0]), to="new_variance")
    graph.cast("given_known", "given_number", TensorProto.DOUBLE)
    others = graph.constant(np.diag(variances).reshape(1, -1)[:, 1:])
    zeros, level = graph.constant(np.zeros((1, OWN - 1))), graph.constant([[0.0]])
    parts = ["given_n", zeros, variance, others, *["given_number"] * 3, level]
    return graph.add("Concat", *parts, to=to, axis=1), variance


def walk(tracker: OffsetTracker) -> Array:
    """Return what one step adds to what is learned, shape ``(1, 34)``: the offset may have drifted."""
    result = np.zeros((1, LEARNED))
    result[0, VARIANCE] = tracker.settings.walk
    return result


def shown(graph: Graph, tracker: OffsetTracker, learned: str, to: tuple[str, str, str]) -> None:
    """Make offset [N], learned variance and whether it is known of what is learned, each of shape ``(1, 1)``.

    Where the session's friction is not that of training, an offset of 0 that is as uncertain as stated.
    """
    settings, (offset, variance, known) = tracker.settings, to
    graph.add("Gather", learned, graph.indices(at.SCALE, at.SLOPE), to=offset + "_scale_and_slope", axis=1)
    graph.add("Mul", offset + "_scale_and_slope", offset + "_scale_and_slope", to=offset + "_squares")
    support = graph.constant([[settings.scale_support], [settings.slope_support]])
    graph.add("MatMul", offset + "_squares", support, to=offset + "_unlike")
    like = graph.add("LessOrEqual", offset + "_unlike", graph.constant(1.0), to=offset + "_supported")
    zero, unknown = graph.constant(0.0), graph.constant(settings.largest_variance / max(settings.caution, 1.0) ** 2)
    for place, other, name in ((0, zero, offset), (VARIANCE, unknown, variance), (KNOWN, zero, known)):
        graph.add("Gather", learned, graph.indices(place), to=name + "_learned", axis=1)
        graph.add("Where", like, name + "_learned", other, to=name)


def stated(graph: Graph, tracker: OffsetTracker, variance: str, to: str) -> str:
    """Return the variance that is stated of an offset of this learned variance, shape ``(n, 1)``."""
    settings = tracker.settings
    graph.add("Mul", variance, graph.constant(settings.caution**2), to=to + "_careful")
    graph.add("Max", variance, graph.constant(settings.largest_variance), to=to + "_largest")
    graph.add("Min", to + "_careful", to + "_largest", to=to + "_learned")
    return graph.add("Add", to + "_learned", graph.constant(settings.common_n**2), to=to)


def explained(graph: Graph, tracker: OffsetTracker, averages: str, to: str) -> str:
    """Return ``EXPLAINED`` of blocks, shape ``(n, 5)``, from their ``AVERAGES``, shape ``(n, 6)``."""
    settings = tracker.settings
    graph.split(averages, {f"mean_{name}": 1 for name in AVERAGES})
    graph.add("Abs", "mean_velocity", to="mean_size")
    graph.add("Less", "mean_size", graph.constant(settings.slowest_m_s), to="rests")
    graph.add("Where", "rests", graph.constant(settings.speed_mean), "mean_size", to="mean_speed")
    graph.add("Where", "rests", graph.constant(0.0), graph.add("Sign", "mean_velocity", to="way"), to="side")
    graph.add("Mul", "side", _friction(graph, tracker), to="directed_n")
    graph.add("Sub", "mean_balance", "directed_n", to="left_n")
    graph.add("Abs", "directed_n", to="size_n")
    graph.add("Sub", "mean_speed", graph.constant(settings.speed_mean), to="speed_over_mean")
    graph.add("Div", "speed_over_mean", graph.constant(settings.speed_deviation), to="standard_speed")
    parts = ["left_n", "size_n", "side", "standard_speed", _in_ranges(graph, tracker)]
    return graph.add("Concat", *parts, to=to, axis=1)


def learn(graph: Graph, tracker: OffsetTracker, block: str, first: str, before: str, to: str) -> str:
    """Return what is learned after a block.

    ``block`` is ``EXPLAINED``, shape ``(1, 5)``; ``first`` whether it is its stroke's first, shape ``(1, 1)``;
    ``before`` is as in ``new_learned``.
    """
    graph.split(block, {f"block_{name}": 1 for name in EXPLAINED})
    graph.split(before, {"own_before": OWN * (OWN + 1), "seen_before": 2, "known_before": 1, "level_before": 1})
    graph.add("Reshape", "own_before", graph.indices(OWN + 1, OWN), to="own_of_last")
    kept, begins = np.ones((OWN + 1, OWN)), np.zeros((OWN + 1, OWN))
    kept[OWN, :] = kept[:, OWN - 1] = 0.0
    begins[OWN, OWN - 1] = 1.0
    graph.add("Equal", "block_side", graph.constant(0.0), to="rest")
    stroke, rest = (graph.constant(each**2 * begins) for each in (tracker.settings.stroke_n, tracker.settings.rest_n))
    begun = graph.add("Where", "rest", rest, stroke, to="begun")
    graph.add("Mul", "own_of_last", graph.constant(kept), to="own_of_session")
    graph.add("Add", "own_of_session", begun, to="own_of_next")
    graph.add("Where", first, "own_of_next", "own_of_last", to="own")
    _explains(graph)
    _kalman(graph, tracker.settings.noise_n, tracker.settings.largest_variance)
    flat = graph.indices(1, -1)
    graph.add("Reshape", "own", flat, to="own_unchanged")
    graph.add("Concat", "own_unchanged", "seen_before", "known_before", "level_before", to="not_learned", axis=1)
    graph.add("Reshape", "own_learned", flat, to="own_changed")
    graph.add("Concat", "own_changed", "seen", "seen_both", "first_level", to="newly_learned", axis=1)
    known = graph.cast("block_in_range", "like_training", TensorProto.BOOL)
    graph.add("ReduceMax", "seen_before", to="seen_any", axes=[1])
    graph.add("Less", "seen_any", graph.constant(0.5), to="not_slid")
    graph.add("Or", graph.add("Not", "rest", to="slides"), "not_slid", to="shows")
    counts = graph.add("And", graph.add("And", known, "likely", to="believed"), "shows", to="counts")
    return graph.add("Where", counts, "newly_learned", "not_learned", to=to)


def _in_ranges(graph: Graph, tracker: OffsetTracker) -> str:
    """Return whether a block is like those of training, as a number, shape ``(n, 1)``."""
    lower, upper = (graph.constant(each[None]) for each in tracker.ranges)
    graph.add("Concat", "mean_pressure", "mean_speed", "mean_load", "mean_warm", to="ranged", axis=1)
    graph.add("GreaterOrEqual", "ranged", lower, to="above_lowest")
    graph.add("LessOrEqual", "ranged", upper, to="below_highest")
    graph.add("And", "above_lowest", "below_highest", to="each_in_range")
    graph.cast("each_in_range", "each_in_range_number", TensorProto.DOUBLE)
    return graph.add("ReduceMin", "each_in_range_number", to="in_range", axes=[1])


def _friction(graph: Graph, tracker: OffsetTracker) -> str:
    """Return ``known_n``, friction as known from training, shape ``(n, 1)``."""
    friction, zero, one = tracker.friction, graph.constant(0.0), graph.constant(1.0)
    graph.add("Sqrt", graph.add("Max", "mean_pressure", zero, to="no_vacuum"), to="root")
    graph.add("Log", graph.add("Max", "mean_speed", graph.constant(1e-12), to="no_rest"), to="logarithm")
    graph.add("Mul", "logarithm", "logarithm", to="square")
    graph.add("Abs", "mean_load", to="load_size")
    depends = ("mean_pressure", "root", "mean_speed", "logarithm", "square", "mean_load", "load_size", "mean_warm")
    graph.add("Concat", *depends, to="depends_on", axis=1)
    cold, changing = [*friction[:7], 0.0], [*friction[9:14], 0.0, 0.0, friction[8]]
    weights, bias = graph.constant(np.array([cold, changing]).T), graph.constant([[0.0, friction[7]]])
    graph.add("Gemm", "depends_on", weights, bias, to="cold_and_changing")
    graph.split("cold_and_changing", {"cold_n": 1, "changing": 1})
    graph.add("Mul", "mean_warm", "changing", to="warm_n")
    graph.add("Clip", "mean_along", graph.constant(-1.0), one, to="along")
    graph.add("Pow", "along", graph.constant(np.arange(float(at.POWERS))[None]), to="powers")
    graph.add("MatMul", "powers", graph.constant(tracker.position[:, None]), to="along_n")
    return graph.add("Sum", "cold_n", "warm_n", "along_n", to="known_n")


def _explains(graph: Graph) -> None:
    """Make ``explains``, by what a session's own may explain a block, shape ``(5, 1)``, and what is seen after it.

    Until both directions were seen, friction's level is that of the first block (see ``realtime.sensor_offset``).
    """
    one = graph.constant([[1.0]])
    graph.add("Mul", "block_side", graph.constant([[1.0, -1.0]]), to="sides")
    graph.add("Max", "seen_before", "sides", to="seen")
    graph.add("ReduceMin", "seen", to="seen_both", axes=[1])
    graph.add("Equal", "level_before", graph.constant(0.0), to="no_level")
    graph.add("Where", "no_level", "block_size_n", "level_before", to="first_level")
    graph.cast("seen_both", "both", TensorProto.BOOL)
    graph.add("Where", "both", "block_size_n", "first_level", to="level_n")
    graph.add("Mul", "block_side", "level_n", to="scaled_n")
    graph.add("Mul", "scaled_n", "block_standard_speed", to="slope_n")
    graph.add("Concat", one, "level_n", "scaled_n", "slope_n", one, to="explains", axis=0)


def _kalman(graph: Graph, noise_n: float, largest_variance: float) -> None:
    """Make ``own_learned`` from ``own``: means above covariance, shape ``(6, 5)``; and whether it is ``likely``."""
    first = np.zeros((OWN + 1, 1))
    first[0] = 1.0
    graph.add("MatMul", "own", "explains", to="expected_and_gain")
    graph.split("expected_and_gain", {"expected_n": 1, "gain": OWN}, axis=0)
    graph.add("Transpose", "gain", to="gain_across", perm=[1, 0])
    noise = graph.constant([[noise_n**2]])
    graph.add("Gemm", "gain_across", "explains", noise, to="variance")
    graph.add("Mul", "block_left_n", graph.constant(first), to="left_first")
    graph.add("Sub", "left_first", "expected_and_gain", to="surprise_and_gain")
    graph.add("Slice", "surprise_and_gain", graph.indices(0), graph.indices(1), graph.indices(0), to="surprise")
    graph.add("Mul", "surprise", "surprise", to="surprise_square")
    graph.add("Add", "variance", graph.constant(largest_variance), to="surprise_variance")
    graph.add("Mul", "surprise_variance", graph.constant(at.LARGEST_SURPRISE**2), to="largest_surprise_square")
    graph.add("LessOrEqual", "surprise_square", "largest_surprise_square", to="likely")
    graph.add("Div", "gain_across", "variance", to="weights")
    graph.add("Gemm", "surprise_and_gain", "weights", "own", to="own_learned")


def _span_m(tracker: OffsetTracker) -> float:
    return float(tracker.settings.last_position_m - tracker.settings.first_position_m)
