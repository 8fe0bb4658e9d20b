"""The numbers of one model for ``friction.c``: macros and constant arrays by name, for the generated header.

Numbers that Python squares, sums or divides once are computed here, so that C rounds no more often than Python.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.c_export.forest import FlatForest
from cylinder_friction.deployment.rendering import number, wrapped
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.friction_models.lugre import LUGRE_STEP_MULTIPLY_ADDS, LugreParameters
from cylinder_friction.realtime import sensor_offset as at
from cylinder_friction.realtime.flags import invalid_flag
from cylinder_friction.realtime.guard import UNKNOWN_FORCE_N
from cylinder_friction.realtime.history import TOLERANCE_M, History
from cylinder_friction.realtime.load_table import COLUMN, FIRST, NUMBERS, PER_METRE, PLACES, TABLE
from cylinder_friction.realtime.lstm import LstmWeights
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.packed import packed_lines
from cylinder_friction.realtime.position_load import PositionLoad
from cylinder_friction.realtime.unmodelled_force import force_limits
from cylinder_friction.recordings.columns import POSITION, REFERENCE_C
from cylinder_friction.recordings.line_loss import LossTerms
from cylinder_friction.signals.causal import one_sided_savitzky_golay_taps
from cylinder_friction.signals.causal_velocity import CausalVelocity

Data = dict[str, Any]
AT_ONCE, ACROSS = 8, 16  # Sources and gates of a tile of weights, as in ``friction.c``
# Most operations of a step that do not depend on the model's size
GUARD_OPERATIONS, FORCE_OPERATIONS, LIMIT_OPERATIONS, HISTORY_OPERATIONS = 40, 10, 3, 60
LOAD_OPERATIONS, BLOCK_OPERATIONS, LINE_OPERATIONS = 10, 150, 60
ACTIVATION_OPERATIONS = 14  # Operations of one sigmoid or hyperbolic tangent, with the division as one
C_TYPES = {"int32": "int", "uint16": "uint16_t", "uint32": "uint32_t", "float32": "float", "float64": "double"}


@dataclass(frozen=True)
class LugreModel:
    """One LuGre estimator as plain numbers."""

    step: StepModel  # Filters (smooth position and rate as its two features), guard and bounds; no network, no forest
    parameters: LugreParameters  # The model
    velocity: CausalVelocity  # Filter from position to velocity
    pressures: tuple[int, ...]  # Places of the two inputs whose sum scales dry friction; () for none


def lugre_model(estimator: LugreEstimator) -> LugreModel:
    """Describe one step of a fitted LuGre estimator; its bounds state nothing unless calibrated."""
    estimator._refuse_unfitted()
    assert estimator.parameters is not None
    assert estimator.sample_time_s is not None
    assert estimator.causal_velocity is not None
    velocity, inputs = estimator.causal_velocity, estimator.inputs
    taps = np.zeros((2, len(inputs), velocity.window))
    for derivative in (0, 1):
        taps[derivative, inputs.index(POSITION)] = one_sided_savitzky_golay_taps(
            velocity.window, velocity.order, derivative, estimator.sample_time_s
        )
    step = estimator._step_model(
        feature_taps=taps,
        feature_limits=np.zeros(2),
        feature_mean=np.zeros(2),
        feature_scale=np.ones(2),
        base_taps=np.zeros((len(inputs), 1)),
    )
    return LugreModel(step, estimator.parameters, velocity, estimator._pressures or ())


class FilterBank:
    """The distinct rows of all filters of a model: equal rows are computed once, and zeros at a row's ends never.

    Attributes:
        rows: Shape ``(rows, inputs, lags)``.
        feature: Row of each feature.
        base: Row of the base force; None if there is none.
        velocity: Row of the velocity.
    """

    def __init__(self, model: StepModel) -> None:
        base = [model.base_taps] if np.any(model.base_taps) else []
        every = [*model.feature_taps, model.velocity_taps, *base]
        lags = max(taps.shape[1] for taps in every)
        padded = np.stack([np.pad(taps, ((0, 0), (0, lags - taps.shape[1]))) for taps in every])
        _, first, place = np.unique(padded, axis=0, return_index=True, return_inverse=True)
        order = np.argsort(first)
        chosen = np.argsort(order)[place.ravel()].tolist()
        rows = padded[first[order]]
        used = np.flatnonzero(np.any(rows, axis=(0, 1)))
        self.rows: Array = rows[:, :, : int(used[-1]) + 1 if len(used) else 1]
        count = len(model.feature_taps)
        self.feature, self.velocity = chosen[:count], chosen[count]
        self.base = chosen[-1] if base else None

    def terms(self) -> Iterator[tuple[int, int, int, Array]]:
        """Yield row, channel, first lag and taps of each channel of a row."""
        for row, channels in enumerate(self.rows):
            for channel, taps in enumerate(channels):
                used = np.flatnonzero(taps)
                if len(used):
                    yield row, channel, int(used[0]), taps[used[0] : used[-1] + 1]

    def operations(self) -> int:
        """Count the multiply-adds of one step."""
        return sum(len(taps) for *_, taps in self.terms())


def model_data(model: StepModel | LugreModel, forest: FlatForest | None) -> Data:
    """Collect the macros and arrays of ``friction.c`` by name; guard and bounds have the names of their fields."""
    step = model.step if isinstance(model, LugreModel) else model
    bank, load, forces = FilterBank(step), step.position_load, force_limits(step)
    learned = step.network is not None or forest is not None
    data: Data = {
        "IS_LUGRE": isinstance(model, LugreModel),
        "HAS_FEATURES": learned,
        "HAS_HISTORY": learned and step.history is not None,
        "HAS_NETWORK": step.network is not None,
        "HAS_HEAD": has_head(step),
        "HEAD_COUNTS": step.head_counts,
        "HAS_FOREST": forest is not None,
        "HAS_CORRECTIONS": bool(step.corrections),
        "HAS_LINES": bool(step.line_loss),
        "HAS_LOAD": load is not None,
        "HAS_FORCE_LIMITS": forces.size > 0,
        "LEARNS_OFFSET": step.offset is not None,
        "INPUTS": len(step.inputs),
        "CHANNELS": len(step.channels),
        "POSITION": step.position,
        "PRESSURES": len(step.pressures),
        "PRESSURE": np.array(step.pressures, dtype=np.int32),
        "INVALID": np.array([invalid_flag(name) for name in step.inputs], dtype=np.uint32),
        "STEP_S": step.sample_time_s,
        **_filters(bank),
        "BASE_N": "0.0" if bank.base is None else f"filtered[{bank.base}]",
        "VELOCITY_ROW": bank.velocity,
        "TARGET_MEAN_N": step.target_mean_n,
        "TARGET_SCALE_N": step.target_scale_n,
        **_named("", vars(step.guard)),
        **_named("", vars(step.bounds)),
    }
    if isinstance(model, LugreModel):
        data |= _lugre(model, bank)
    if learned:
        data |= {
            "LINEAR_FEATURES": len(bank.feature),
            "FEATURES": step.feature_count,
            "FEATURE_ROW": np.array(bank.feature, dtype=np.int32),
            "FEATURE_LIMIT": np.maximum(step.feature_limits, 0.0),
            "FEATURE_MEAN": step.feature_mean,
            "FEATURE_SCALE": step.feature_scale,
        }
    if learned and step.history is not None:
        data |= _history(step.history, step.sample_time_s, bank)
    if step.network is not None:
        data |= _network(step.network)
    if forest is not None:
        data |= _forest(step, forest)
    if step.corrections:
        data["SIGN"] = np.array([float(each.sign) for each in step.input_corrections])
        data["ZERO_READING"] = np.array([each.offset for each in step.input_corrections])
    if step.line_loss:
        data |= _lines(step)
    if load is not None:
        data |= _load(load, step.inputs)
    if forces.size:
        data |= {"FORCE_OF": forces[0][:-3], "SUMMED": forces[1][:-3], "LINE_N": forces[0][-3:]}
        data["LINE_SLOPE"] = forces[1][-3:]
    if step.offset is not None:
        data |= _offset(step.offset, bank)
    return {name: value for name, value in data.items() if not isinstance(value, np.ndarray) or value.size}


def _named(prefix: str, fields: Mapping[str, Any]) -> Data:
    """Collect the numbers among a dataclass's fields by their names in capitals; tuples are arrays."""
    numbers = {name: value for name, value in fields.items() if not isinstance(value, str)}
    return {
        f"{prefix}{name.upper()}": np.array(value, dtype=np.float64) if isinstance(value, tuple) else value
        for name, value in numbers.items()
    }


def has_head(model: StepModel) -> bool:
    """Check whether the network's linear head is computed."""
    return model.network is not None and (model.head_counts or model.forest_sees == "hidden_head_features")


def operations(model: StepModel | LugreModel, forest: FlatForest | None) -> int:
    """Count the operations of one step at worst: multiply-adds, comparisons and the like."""
    step = model.step if isinstance(model, LugreModel) else model
    bank, channels, network = FilterBank(step), len(step.channels), step.network
    total = GUARD_OPERATIONS + bank.operations()
    total += LUGRE_STEP_MULTIPLY_ADDS if isinstance(model, LugreModel) else 4
    if network is not None or forest is not None:
        total += 2 * len(bank.feature) + LIMIT_OPERATIONS * int(np.count_nonzero(step.feature_limits > 0.0))
        total += 0 if step.history is None else HISTORY_OPERATIONS
    if network is not None:
        total += sum(layer_weights(network, layer).size for layer in range(network.layers))
        total += network.layers * network.nodes * (5 * ACTIVATION_OPERATIONS + 3)
        total += network.nodes if has_head(step) else 0
    total += 0 if forest is None else forest.operations()
    total += 0 if step.position_load is None else LOAD_OPERATIONS * 2 ** (2 * len(step.position_load.axes) - 2)
    total += LINE_OPERATIONS * len(step.line_loss)
    total += FORCE_OPERATIONS + 2 * channels if step.guard.force_weights else 0
    total += 0 if step.offset is None else BLOCK_OPERATIONS + 5 * channels + 2 * len(bank.rows)
    return total


def definitions(data: Mapping[str, Any]) -> list[str]:
    """List the C of macros and arrays: fractions in double precision, float32 arrays as such."""
    lines = []
    for name, value in data.items():
        if isinstance(value, list):
            lines.append(_array("estimator_node", name, value))
        elif isinstance(value, np.ndarray):
            kind = C_TYPES[value.dtype.name]
            if value.dtype.kind == "f":
                texts = [number(each, "float" if kind == "float" else "double") for each in value.tolist()]
            else:
                texts = [f"{each}u" if value.dtype.kind == "u" else str(each) for each in value.tolist()]
            lines.append(_array(kind, name, texts))
        else:
            lines.append(f"#define {name} {_literal(value)}")
    return lines


def _array(kind: str, name: str, items: list[str]) -> str:
    return f"static const {kind} {name}[{len(items)}] ALIGNED = {{\n{wrapped(items)}\n}};"


def _literal(value: object) -> str:
    if isinstance(value, float):
        text = number(value)
        return f"({text})" if text.startswith("-") else text
    return str(int(value)) if isinstance(value, bool) else str(value)


def _lines(step: StepModel) -> Data:
    lines = packed_lines(step)
    terms = {f"LINE_{name.upper()}": lines.terms[:, place] for place, name in enumerate(LossTerms._fields)}
    return terms | {
        "LINES": len(lines.places),
        "LINE_CHANNEL": lines.places.astype(np.int32),
        "LINE_SIGN": lines.signs,
        "LINE_TAPS": lines.velocity,
        "LINE_LAGS": len(lines.velocity),
    }


def _load(load: PositionLoad, inputs: Sequence[str]) -> Data:
    axes = load.packed(inputs)[1:TABLE].reshape(-1, NUMBERS)[: len(load.axes)]
    strides = np.cumprod([1, *load.load_n.shape[:0:-1]])[::-1]
    whole = {"LOAD_COLUMN": axes[:, COLUMN], "LOAD_PLACES": axes[:, PLACES], "LOAD_STRIDE": strides}
    data: Data = {name: values.astype(np.int32) for name, values in whole.items()}
    data |= {"LOAD_AXES": len(axes), "LOAD_FIRST_M": axes[:, FIRST], "LOAD_PER_METRE": axes[:, PER_METRE]}
    unknown = np.empty(0) if load.known is None or load.known.all() else ~load.known.ravel()
    return data | {
        "LOAD_N": load.load_n.ravel(),
        "LOAD_UNKNOWN": unknown.astype(np.float64),
        "LOAD_IS_UNKNOWN": unknown.size > 0,
    }


def _filters(bank: FilterBank) -> Data:
    """Build all taps, one term after the other, and a macro that takes each term."""
    taps: list[float] = []
    calls = []
    for row, channel, first, own in bank.terms():
        calls.append(f"T({row}, {channel}, {len(taps)}, {first}, {len(own)})")
        taps.extend(own.tolist())
    lags, rows = bank.rows.shape[2], len(bank.rows)
    return {"LAGS": lags, "ROWS": rows, "TAPS": np.array(taps or [0.0]), "TERMS(T)": _calls(calls)}


def _calls(calls: Iterable[str]) -> str:
    """Return the body of a macro that makes these calls of its argument."""
    return " \\\n    ".join(["", *calls])


def _lugre(model: LugreModel, bank: FilterBank) -> Data:
    law, motion = model.parameters, model.velocity
    return {
        **_named("LUGRE_", vars(law)),
        **_named("LUGRE_", vars(motion)),
        **{f"LUGRE_PRESSURE_{which}": place for which, place in enumerate(model.pressures, 1)},
        "LUGRE_HAS_PRESSURES": bool(model.pressures),
        "LUGRE_HAS_BACKLASH": motion.backlash_m != 0.0,
        "LUGRE_POSITION_ROW": bank.feature[0],
        "LUGRE_RATE_ROW": bank.feature[1],
        "LUGRE_FALLING_N": law.static_n - law.coulomb_n,
        "LUGRE_LOG_STRIBECK": math.log(law.stribeck_velocity_m_s),
    }


def _history(history: History, sample_time_s: float, bank: FilterBank) -> Data:
    moves_steps, passed_s = 0, 0.0
    while passed_s < history.moves_s:  # as Python sums it up, step by step
        moves_steps, passed_s = moves_steps + 1, passed_s + sample_time_s
    return {
        **_named("HISTORY_", vars(history)),
        "HISTORY_FEATURES": len(history.mean),
        "HISTORY_ROW": bank.feature[history.position_feature],
        "HISTORY_EDGE_M": history.backlash_m + TOLERANCE_M,
        "HISTORY_MOVES_STEPS": moves_steps,
    }


def _network(weights: LstmWeights) -> Data:
    layers = [layer_weights(weights, layer) for layer in range(weights.layers)]
    bias = number(weights.head_bias, "float")
    return {
        "LAYERS": weights.layers,
        "NODES": weights.nodes,
        "WEIGHTS": np.concatenate(layers),
        "HEAD": weights.head,
        "HEAD_BIAS": f"({bias})",
    }


def layer_weights(weights: LstmWeights, layer: int) -> NDArray[np.float32]:
    """Return one layer's weights in the order in which C reads them: bias, tiles, rows too few for a tile.

    Every source adds its weights to the gates of all nodes, eight sources in one pass, so that a sum is loaded and
    stored once for eight products. Neighbouring sums do not depend on each other, so any compiler vectorises them
    without permission to reorder sums: each still adds bias, inputs and recurrent inputs one after the other, as
    ``realtime.lstm`` does.
    """
    inputs = weights.inputs if layer == 0 else weights.nodes
    rows = np.concatenate([weights.bias[layer][None], weights.input[layer][:inputs], weights.recurrent[layer]])
    rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % ACROSS)))
    tiled = len(rows) - 1 - (len(rows) - 1) % AT_ONCE
    tiles = rows[1 : 1 + tiled].reshape(-1, AT_ONCE, rows.shape[1] // ACROSS, ACROSS).transpose(0, 2, 1, 3)
    return np.concatenate([rows[0], tiles.ravel(), rows[1 + tiled :].ravel()])


def _forest(model: StepModel, forest: FlatForest) -> Data:
    return {
        "FOREST_INPUTS": forest.inputs,
        "FOREST_GROUPS": len(forest.depths),
        "FOREST_SEES_HIDDEN": "hidden" in model.forest_sees,
        "FOREST_SEES_HEAD": "head" in model.forest_sees,
        "FOREST_SEES_FEATURES": "features" in model.forest_sees,
        "FOREST": list(forest.nodes()),
        "ROOTS": forest.roots.astype(np.uint32),
        "DEPTHS": forest.depths.astype(np.uint16),
    }


def _offset(tracker: at.OffsetTracker, bank: FilterBank) -> Data:
    settings, weights, zeros = tracker.settings, tracker.weights, tracker.zero_of(bank.rows).tolist()
    return {
        "ZEROS(Z)": _calls(f"Z({row}, {number(zero)})" for row, zero in enumerate(zeros) if zero != 0.0),
        "BALANCE_OF": weights[at.BALANCE],
        "PRESSURE_OF": weights[at.PRESSURE],
        "LOAD_OF": weights[at.LOAD],
        "TEMPERATURE_OF": weights[at.WARM],
        "REFERENCE_C": REFERENCE_C,
        "LOWEST": tracker.ranges[0],  # Of mean pressure [Pa], speed [m/s], load [N] and temperature over the reference
        "HIGHEST": tracker.ranges[1],
        "KNOWN": tracker.friction,
        "POWERS": len(tracker.position),
        "ALONG": tracker.position,
        "STATED_VARIANCE": tracker.prior**2,
        "LARGEST_SURPRISE": at.LARGEST_SURPRISE,
        **_named("", settings._asdict()),
        "SETTLING_SAMPLES": math.floor(settings.settling),
        "BLOCK_SAMPLES": math.ceil(settings.block),
        "NOISE_VARIANCE": settings.noise_n**2,
        "STROKE_VARIANCE": settings.stroke_n**2,
        "COMMON_VARIANCE": settings.common_n**2,
        "CAUTION_SQUARE": settings.caution**2,
        "SPAN_M": settings.last_position_m - settings.first_position_m,
        "OFFSET_LIMIT_N": UNKNOWN_FORCE_N,
    }
