"""Metadata of an exported graph: meaning, units, ranges, and the session options it is made for."""

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING

from cylinder_friction.deployment.descriptions import described_inputs, flags_of
from cylinder_friction.deployment.rendering import model_hash
from cylinder_friction.realtime.flags import Flag
from cylinder_friction.realtime.model import StepModel

if TYPE_CHECKING:
    import onnxruntime

OUTPUTS = {
    "friction_n": "friction [N], positive when it opposes positive velocity",
    "lower_n": "lower bound of friction [N]",
    "upper_n": "upper bound of friction [N]",
    "flags": "bits: " + ", ".join(f"{flag.value} {flag.name}" for flag in Flag),
}
OFFSET_OUTPUTS = {
    "offset_n": "offset of the sensors' zeros in friction that the next step takes off [N]",
    "offset_uncertainty_n": "its standard uncertainty [N]",
}
"""Those of a model that learns the offset."""
SPINNING = ("session.intra_op.allow_spinning", "session.inter_op.allow_spinning")
"""Entries of a session's configuration: a thread that waits for work in a loop starves the rest of the machine."""
ORT_CONFIG = "ort_config"
"""Key that ONNX Runtime itself reads where the environment has ``ORT_LOAD_CONFIG_FROM_MODEL=1``."""

MODEL_HASH = "model_sha256"


def outputs_of(model: StepModel) -> dict[str, str]:
    """Return the meaning of each output but the states, by name."""
    return OUTPUTS if model.offset is None else OUTPUTS | OFFSET_OUTPUTS


def input_text(model: StepModel) -> str:
    """Return the meaning and order of a sample's numbers."""
    return "raw sample: " + ", ".join(each.meaning for each in described_inputs(model.inputs))


def described(model: StepModel) -> dict[str, str]:
    """Return a graph's metadata, each value a string."""
    guard = model.guard
    threads = {"intra_op_num_threads": 1, "inter_op_num_threads": 1, "execution_mode": 0}
    return {
        ORT_CONFIG: json.dumps({"session_options": threads}),
        **dict.fromkeys(SPINNING, "0"),
        "sample_time_s": repr(float(model.sample_time_s)),
        "lag_s": repr(float(model.lag_s)),
        "input": input_text(model),
        "output": json.dumps(outputs_of(model)),
        "flags": json.dumps({str(flag.value): flag.name for flag in flags_of(model)}),
        **({} if model.position_load is None else {"position_load": model.position_load.in_words()}),
        **({} if model.trained_for is None else {"trained_for": model.trained_for.in_words()}),
        "training_range_with_margin": _ranges(model.inputs, guard.trained_lower, guard.trained_upper),
        "accepted_range": _ranges(model.inputs, guard.accept_lower, guard.accept_upper),
        "bounds_probability": repr(float(model.bounds.probability)),
        "bounds_hold": model.bounds.in_words(),
        "warm_up_samples": str(guard.warm_up_samples),
        "recovery_samples": str(guard.recovery_samples),
        MODEL_HASH: model_hash(model),
    }


def session_options(metadata: Mapping[str, str]) -> "onnxruntime.SessionOptions":
    """Return the options that a graph's metadata names; raises ``KeyError`` if the metadata names none."""
    stored = json.loads(metadata[ORT_CONFIG])["session_options"]
    import onnxruntime  # only running a graph needs it, not writing one

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = stored["intra_op_num_threads"]
    options.inter_op_num_threads = stored["inter_op_num_threads"]
    options.execution_mode = onnxruntime.ExecutionMode(stored["execution_mode"])
    for entry in SPINNING:
        options.add_session_config_entry(entry, metadata[entry])
    options.log_severity_level = 3
    return options


def _ranges(columns: tuple[str, ...], lower: tuple[float, ...], upper: tuple[float, ...]) -> str:
    return json.dumps({name: [low, high] for name, low, high in zip(columns, lower, upper, strict=True)})
