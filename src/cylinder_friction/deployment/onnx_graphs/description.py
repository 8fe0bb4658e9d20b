"""What an exported graph says about itself: meaning, units, range, and the session options it is made for."""

from __future__ import annotations

import hashlib
import json
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import onnxruntime

from cylinder_friction.realtime.flags import Flag

if TYPE_CHECKING:
    from collections.abc import Mapping

    from cylinder_friction.realtime.model import StepModel

INPUTS = "raw sample: pressure 1 [Pa, gauge, piston side], pressure 2 [Pa, gauge, rod side], position [m]"
OUTPUTS = {
    "friction_n": "friction [N], positive when it opposes positive velocity",
    "lower_n": "lower bound of friction [N]",
    "upper_n": "upper bound of friction [N]",
    "flags": "bits: " + ", ".join(f"{flag.value} {flag.name}" for flag in Flag),
}
SPINNING = ("session.intra_op.allow_spinning", "session.inter_op.allow_spinning")
"""Entries of a session's configuration: a thread that waits for work in a loop starves the rest of the machine."""
ORT_CONFIG = "ort_config"
"""Key that ONNX Runtime itself reads where the environment has ``ORT_LOAD_CONFIG_FROM_MODEL=1``."""

MODEL_HASH = "model_sha256"


def described(model: StepModel) -> dict[str, str]:
    """Return a graph's metadata, each value a string."""
    guard = model.guard
    columns = ("pressure_1_pa", "pressure_2_pa", "position_m")
    threads = {"intra_op_num_threads": 1, "inter_op_num_threads": 1, "execution_mode": 0}
    return {
        ORT_CONFIG: json.dumps({"session_options": threads}),
        **dict.fromkeys(SPINNING, "0"),
        "sample_time_s": repr(float(model.sample_time_s)),
        "input": INPUTS,
        "output": json.dumps(OUTPUTS),
        "training_range_with_margin": _ranges(columns, guard.trained_lower, guard.trained_upper),
        "accepted_range": _ranges(columns, guard.accept_lower, guard.accept_upper),
        "bounds_probability": repr(float(model.bounds.probability)),
        "warm_up_samples": str(guard.warm_up_samples),
        "recovery_samples": str(guard.recovery_samples),
        MODEL_HASH: model_hash(model),
    }


def session_options(metadata: Mapping[str, str]) -> onnxruntime.SessionOptions:
    """Return the options that a graph's metadata names.

    Raises:
        KeyError: The metadata names none.
    """
    stored = json.loads(metadata[ORT_CONFIG])["session_options"]
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = stored["intra_op_num_threads"]
    options.inter_op_num_threads = stored["inter_op_num_threads"]
    options.execution_mode = onnxruntime.ExecutionMode(stored["execution_mode"])
    for entry in SPINNING:
        options.add_session_config_entry(entry, metadata[entry])
    options.log_severity_level = 3
    return options


def model_hash(model: StepModel) -> str:
    """Return the SHA-256 of every number in the model: step and sequence graph of one model share it."""
    digest = hashlib.sha256()
    _feed(digest, model)
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    if is_dataclass(value):
        for field in fields(value):
            digest.update(field.name.encode())
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode() + np.ascontiguousarray(value).tobytes())
    else:
        digest.update(repr(value).encode())


def _ranges(columns: tuple[str, ...], lower: tuple[float, ...], upper: tuple[float, ...]) -> str:
    return json.dumps({name: [low, high] for name, low, high in zip(columns, lower, upper, strict=True)})
