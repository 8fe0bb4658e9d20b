"""An estimator as one C99 source and one header."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from cylinder_friction.deployment.c_export.forest import flatten
from cylinder_friction.deployment.c_export.model_data import (
    FilterBank,
    LugreModel,
    definitions,
    lugre_model,
    model_data,
    operations,
)
from cylinder_friction.deployment.descriptions import described_inputs, flags_of, offset_texts
from cylinder_friction.deployment.rendering import Type, model_hash, render
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.lugre import LugreEstimator
from cylinder_friction.files.whole_files import write_text
from cylinder_friction.realtime.bounds import unknown_bounds
from cylinder_friction.realtime.history import History
from cylinder_friction.realtime.model import StepModel
from cylinder_friction.realtime.sensor_offset import OWN

Precision = Literal["double", "float"]
Part = Literal["whole", "lstm", "base"]
BYTES = {"float": 4, "double": 8, "uint32_t": 4, "int32_t": 4}
SOURCE = Path(__file__).with_name("friction.c")

_IDENTIFIER = re.compile(r"[a-z][a-z0-9_]*")


@dataclass(frozen=True)
class ExportedC:
    """The header and source that ``export_c`` wrote, and what a controller needs to know of them.

    Reserve ``state_bytes`` for each instance; the code allocates nothing and has no global state. ``operations`` bounds
    the cost of a step: it does the same work at every sample.
    """

    header: Path
    source: Path
    name: str  # Prefix of every public name
    model: str  # SHA-256 of all numbers of the step
    inputs: tuple[str, ...]  # Columns that a step takes, in order
    real: Type  # Type of samples and estimates
    state_bytes: int  # Size of an instance
    operations: int  # Multiply-adds, comparisons and the like of one step, at worst
    learns_offset: bool  # Whether it learns the offset of the sensors' zeros


def export_c(
    estimator: FrictionEstimator,
    folder: Path,
    name: str = "friction",
    precision: Precision = "double",
    part: Part = "whole",
) -> ExportedC:
    """Write ``name.c`` and ``name.h`` into ``folder``: C99 without dependencies, for a controller.

    The code makes the same step as ``RealTimeStream``, with guard, bounds and flags.

    Args:
        estimator: A fitted estimator of any kind with a real-time step.
        folder: Created if it does not exist.
        name: Prefix of every public name: lower-case letters, digits and underscores.
        precision: Type of samples and estimates. Both compute alike: with ``float``, the estimates are those of
            ``double`` for the same samples, rounded. Network and forest are single in both, as they were trained.
        part: ``lstm`` leaves a hybrid's forest out, ``base`` its network too.

    Raises:
        NotFittedError: The estimator is neither fitted nor loaded.
        ValueError: The estimator cannot run in real time, or name, precision or part is not valid.

    Example:
        >>> from pathlib import Path
        >>> from tempfile import mkdtemp
        >>> from cylinder_friction.deployment.c_export.export import export_c
        >>> folder = Path(mkdtemp())
        >>> exported = export_c(hybrid, folder, name="press")
        >>> sorted(path.name for path in folder.iterdir())
        ['press.c', 'press.h']
    """
    kind = estimator.kind if part == "whole" else f"{estimator.kind}, {part} alone"
    return export_model(part_of(c_model(estimator), part), folder, name, precision, kind)


def export_model(
    model: StepModel | LugreModel,
    folder: Path,
    name: str = "friction",
    precision: Precision = "double",
    kind: str = "hybrid",
) -> ExportedC:
    """Write ``name.c`` and ``name.h`` of a step model, for a model that you have changed or made yourself.

    Arguments and errors are those of ``export_c``; ``kind`` only appears in the comment at the head of the files. For a
    fitted estimator use ``export_c``. Equal models give equal bytes.
    """
    exported, texts = generate_c(model, folder, name, precision, kind)
    for path, text in texts.items():
        write_text(path, text)
    return exported


def c_model(estimator: FrictionEstimator) -> StepModel | LugreModel:
    """Describe the step from which the C of a fitted estimator is made: a step model, or that of LuGre.

    Use it to inspect or change a model before ``export_model`` or ``export_model_fmu``. It copies no arrays.

    Raises:
        NotFittedError: The estimator is neither fitted nor loaded.
        ValueError: The estimator cannot run in real time.
    """
    return lugre_model(estimator) if isinstance(estimator, LugreEstimator) else estimator.step_model()


def part_of(model: StepModel | LugreModel, part: Part) -> StepModel | LugreModel:
    """Cut a smaller model out of a hybrid: ``lstm`` leaves the forest out, ``base`` the network too.

    Use it on a controller without memory for the whole model. Its bounds state nothing, since they were calibrated on
    the whole model.

    Raises:
        ValueError: The model has no such part.
    """
    if part not in get_args(Part):
        raise ValueError(f"part must be one of {', '.join(get_args(Part))}, but got {part!r}")
    if part == "whole":
        return model
    if isinstance(model, LugreModel) or (part == "lstm" and model.network is None):
        raise ValueError(f"the model has no LSTM; expected a hybrid for part {part!r}")
    if part == "base" and not np.any(model.base_taps):
        raise ValueError("the model corrects no force balance, so nothing is left without network and forest")
    network = model.network if part == "lstm" else None
    wide = unknown_bounds(model.sample_time_s)
    return replace(
        model,
        network=network,
        forest=None,
        forest_sees="nothing",
        head_counts=network is not None,
        bounds=replace(wide, standstill_m_s=model.bounds.standstill_m_s, creep_m_s=model.bounds.creep_m_s),
    )


def generate_c(
    model: StepModel | LugreModel, folder: Path, name: str, precision: Precision, kind: str
) -> tuple[ExportedC, dict[Path, str]]:
    """Generate header and source of a step model without writing them: their description, and their texts by path.

    Use it to embed the code in files of your own, such as the FMU's. Arguments and errors are those of ``export_c``;
    ``folder`` only decides the paths.
    """
    if not _IDENTIFIER.fullmatch(name):
        raise ValueError(f"name must be lower-case letters, digits and underscores, a letter first, but got {name!r}")
    if precision not in ("double", "float"):
        raise ValueError(f"precision must be 'double' or 'float', but got {precision!r}")
    step = model.step if isinstance(model, LugreModel) else model
    forest = None if step.forest is None else flatten(step.forest)
    fields = state_fields(model)
    inputs = described_inputs(step.inputs)
    exported = ExportedC(
        header=folder / f"{name}.h",
        source=folder / f"{name}.c",
        name=name,
        model=model_hash(model),
        inputs=step.inputs,
        real=precision,
        state_bytes=sum(field.bytes for field in fields),
        operations=operations(model, forest),
        learns_offset=step.offset is not None,
    )
    header = render(
        "estimator.h.j2",
        **vars(exported),
        NAME=name.upper(),
        title=f"Friction of a hydraulic cylinder, sample by sample: {kind}, {precision} precision.",
        version=version("cylinder-friction"),
        kind=kind,
        step=step,
        described_inputs=inputs,
        flags=flags_of(step),
        fields=fields,
        trained=step.trained_readings,
        offset=offset_texts(step),
        parameters=", ".join(f"{precision} {each.name}" for each in inputs),
        names=", ".join(each.name for each in inputs),
        samples=", ".join(f"(double){each.name}" for each in inputs),
        data=definitions(model_data(model, forest)),
    )
    source = SOURCE.read_text(encoding="utf-8").replace('#include "friction.h"', f'#include "{name}.h"', 1)
    return exported, {exported.header: header, exported.source: source}


@dataclass(frozen=True)
class StateField:
    """One array of an instance's state in C: type, name, shape (empty for a single value) and meaning.

    ``bytes`` is its size. The fields stand in the struct in the order of ``state_fields``, so that a debugger or a
    restored state can be read by name.
    """

    type: str
    name: str
    shape: tuple[int, ...]
    comment: str

    @property
    def bytes(self) -> int:
        return BYTES[self.type] * int(np.prod(self.shape, dtype=np.int64))

    @property
    def declarator(self) -> str:
        return self.name + "".join(f"[{extent}]" for extent in self.shape)


def state_fields(exported: StepModel | LugreModel) -> Sequence[StateField]:
    """List the fields of an instance's state, widest types first, so that the struct needs no padding.

    All of them are zero after a reset. Use the list to size, save or display an instance.
    """
    lugre = isinstance(exported, LugreModel)
    model = exported.step if isinstance(exported, LugreModel) else exported
    channels, pressures, lags = len(model.channels), len(model.pressures), FilterBank(model).rows.shape[2]
    learned = model.network is not None or model.forest is not None
    history: History | None = model.history if learned else None
    fields = [
        StateField(
            "double", "window", (channels, 2 * lags), "last samples of each channel, newest at cursor, kept twice"
        ),
        StateField("double", "held", (channels,), "last valid value of each channel"),
        StateField("double", "constant_from_m", (pressures,), "position at which each pressure last changed"),
        StateField("uint32_t", "cursor", (), "index of the newest sample"),
        StateField("uint32_t", "ready", (), "1 once a sample was valid in all inputs"),
        StateField("uint32_t", "frozen", (pressures,), "1 while a pressure is frozen"),
        StateField("uint32_t", "constant_samples", (), "for how many steps the position has been constant"),
        StateField("uint32_t", "warming", (), "steps of warm-up left"),
        StateField("uint32_t", "recovering", (), "steps of recovery left"),
        StateField("uint32_t", "reversal_left", (), "steps left of a reversal or start"),
        StateField("int32_t", "direction", (), "-1, 0 or 1: sign of the velocity, 0 at standstill"),
    ]
    if model.guard.force_weights:
        fields.append(StateField("uint32_t", "unmodelled", (), "steps of motion until an unmodelled force is refuted"))
    if model.network is not None:
        shape = (model.network.layers, model.network.nodes)
        fields += [
            StateField("float", "hidden", shape, "output of each layer's nodes"),
            StateField("float", "cell", shape, "memory of each layer's nodes"),
        ]
    if lugre or history is not None:
        fields.append(StateField("double", "backlash_centre_m", (), "centre of the backlash in the position"))
    if lugre:
        fields += [
            StateField("double", "push", (), "-1, 0 or 1: direction of the last push against the backlash"),
            StateField("double", "bristle_m", (), "deflection of the bristles"),
            StateField("uint32_t", "pushed", (), "steps for which that push counts"),
        ]
    if history is not None:
        fields += [
            StateField("double", "moved_from_m", (), "position of the last reversal or start"),
            StateField("int32_t", "push_direction", (), "-1, 0 or 1: direction of the last push against the backlash"),
            StateField("uint32_t", "moving_left", (), "steps for which that push counts as motion"),
            StateField("uint32_t", "moving_steps", (), "steps of motion since the last reversal or start"),
            StateField("uint32_t", "dwell_steps", (), "steps at rest so far"),
            StateField("uint32_t", "dwell_before_steps", (), "steps at rest before this motion"),
        ]
    if model.offset is not None:
        fields += _offset_fields(channels)
    fields = sorted((field for field in fields if field.bytes), key=lambda field: -BYTES[field.type])
    if any(BYTES[field.type] == 8 for field in fields) and sum(field.bytes for field in fields) % 8:
        fields.append(StateField("uint32_t", "unused", (), "rounds the size to a multiple of 8"))
    return fields


def _offset_fields(channels: int) -> list[StateField]:
    """List the fields of an instance that hold the sensors' offset."""
    return [
        StateField("double", "own", (OWN,), "offset, asymmetry, scale, slope and the stroke's error of this session"),
        StateField("double", "own_covariance", (OWN, OWN), "their covariance"),
        StateField("double", "level_n", (), "friction's level in the first block"),
        StateField("double", "block_sums", (channels,), "sum of each channel over this block"),
        StateField("double", "block_velocity_m_s", (), "the same of the velocity"),
        StateField("double", "block_first_m_s", (), "velocity at this block's first sample"),
        StateField("uint32_t", "block_samples", (), "samples in this block so far"),
        StateField("uint32_t", "stroke_samples", (), "samples in this stroke until it has settled"),
        StateField("uint32_t", "directions", (), "bits: 1 once a block extended, 2 once one retracted"),
        StateField("int32_t", "stroke_direction", (), "-1 or 1: direction of this stroke; 0: at rest or invalid"),
    ]
