"""Damages saved estimators in a process of its own, and counts what loading each of them gave.

Run as ``python model_folder_fuzzer.py FOLDER MUTATIONS SEED``; each subfolder of FOLDER is a saved estimator. Prints
JSON: counts, and the mebibytes that the process took more. Half of the mutations keep the hashes that ``save`` wrote,
and must be refused or give the same estimates; the others have new hashes, and must be refused or be exported.
"""

import collections
import json
import random
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

import numpy as np
import onnx

from cylinder_friction.deployment.c_export.export import generate_c
from cylinder_friction.estimators.base import FrictionEstimator
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.estimators.saved_folder import (
    CONTENT_HASH,
    DESCRIPTION_FILE,
    FILES,
    SavedModelError,
    write_description,
)

HOSTILE: tuple[Any, ...] = (
    None, True, "", "x", "../x", "/dev/zero", -1, 0, 1, 0.5, 7, 10**8, 2**63, 1e308, -1e308, 1e-308, float("nan"),
    [], {}, [[]], [1.0], [1.0, 2.0], {"a": 1},
)  # fmt: skip
HANG_S = 60


def main() -> None:
    source, count, seed = Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    chance, counts, failures = random.Random(seed), collections.Counter[str](), []
    kinds = sorted(path for path in source.iterdir() if path.is_dir())
    originals = {kind: outputs_of(load_estimator(kind)) for kind in kinds}
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.signal(signal.SIGALRM, _hangs)
    for number in range(count):
        kind = kinds[number % len(kinds)]
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(shutil.copytree(kind, Path(scratch) / "model"))
            path = chance.choice(sorted(folder.iterdir()))
            how = chance.choice((_bytes, _json if path.suffix == ".json" else _onnx))(path, chance)
            keeps_hashes = chance.random() < 0.5
            if not keeps_hashes:
                write_new_hashes(folder)
            signal.alarm(HANG_S)
            try:
                counts[outcome(folder, originals[kind] if keeps_hashes else None)] += 1
            except Exception:
                failures.append(f"{kind.name}, {path.name}, {how}:\n{traceback.format_exc(limit=-3)}")
            signal.alarm(0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    sys.stdout.write(json.dumps({**counts, "grown_mib": round(grown), "failures": failures}))


def outcome(folder: Path, original: np.ndarray | None) -> str:
    """Return what loading a damaged model gave; raises what it must not give."""
    try:
        estimator = load_estimator(folder)
    except (SavedModelError, FileNotFoundError) as error:
        if str(folder) not in str(error):
            raise AssertionError(f"the message does not name the file: {error}") from error
        return "refused"
    found = outputs_of(estimator)
    if original is None:
        if has_step(estimator):
            generate_c(estimator.step_model(), folder, "fuzzed", "double", estimator.kind)
        return "taken"
    if not np.array_equal(found, original, equal_nan=True):
        raise AssertionError("other newtons, without a word")
    return "same bits"


def has_step(estimator: FrictionEstimator) -> bool:
    return type(estimator).step_model is not FrictionEstimator.step_model


def outputs_of(estimator: FrictionEstimator) -> np.ndarray:
    """Return newtons and flags of a few hundred samples, some of them hostile."""
    chance = np.random.default_rng(1)
    places = np.array([name == "position_m" for name in estimator.inputs])
    steps = chance.normal(0.0, np.where(places, 1e-4, 1e4), (300, len(places)))
    samples = np.cumsum(steps, axis=0) + np.where(places, 0.1, 3e6)
    samples[100:103] = [[np.nan], [1e300], [-1e9]]
    if not has_step(estimator):
        return np.asarray(estimator.advance(estimator.new_state(), estimator.channels_of(samples[:100])))
    newtons, flags = estimator.real_time().run(samples)
    return np.column_stack([newtons, flags])


def write_new_hashes(folder: Path) -> None:
    """Give a damaged model new hashes, if it can still be read."""
    try:
        content = json.loads((folder / DESCRIPTION_FILE).read_text())
        files = content.pop(FILES, {})
        content.pop(CONTENT_HASH, None)
        write_description(folder, content, list(files))
    except (ValueError, AttributeError, TypeError, OSError):
        return


def _bytes(path: Path, chance: random.Random) -> str:
    """Flip a bit, cut the end off, or take some bytes out; return which."""
    content = bytearray(path.read_bytes())
    place = chance.randrange(len(content))
    way = chance.choice(("flip", "cut", "drop"))
    if way == "flip":
        content[place] ^= 1 << chance.randrange(8)
    else:
        del content[place : None if way == "cut" else place + chance.choice((1, 4, 64))]
    path.write_bytes(content)
    return f"{way} at {place}"


def _json(path: Path, chance: random.Random) -> str:
    """Delete, negate, scale or replace something anywhere in the description; return what."""
    content = json.loads(path.read_text())
    holder, key = content, chance.choice(sorted(content))
    while isinstance(holder[key], dict | list) and holder[key] and chance.random() < 0.8:
        holder = holder[key]
        key = chance.choice(sorted(holder)) if isinstance(holder, dict) else chance.randrange(len(holder))
    way, value = chance.choice(("replace", "replace", "delete", "scale")), holder[key]
    if way == "delete":
        del holder[key]
    elif way == "scale" and isinstance(value, int | float) and not isinstance(value, bool):
        holder[key] = value * chance.choice((-1.0, 1e-12, 1e25))
    else:
        holder[key] = chance.choice(HOSTILE)
    path.write_text(json.dumps(content))
    return f"{way} {key}"


def _onnx(path: Path, chance: random.Random) -> str:
    """Change an operator, one of its attributes or a tensor, or leave a node out; return what."""
    model = onnx.load(path)
    node, tensors = chance.choice(model.graph.node), list(model.graph.initializer)
    way = chance.choice(("operator", "attribute", "attribute", "tensor", "shape", "drop"))
    if way == "operator":
        node.op_type = chance.choice(("Add", "Sub", "MatMul", "LSTM", "TreeEnsembleRegressor", "Loop", "GRU"))
    elif way == "attribute" and node.attribute:
        attribute = chance.choice(node.attribute)
        for values, hostile in (
            (attribute.ints, (-1, 10**8, 0, 1, 2**62)),
            (attribute.floats, (float("nan"), 1e38, 0.0)),
            (attribute.strings, (b"LEAF", b"")),
        ):
            if len(values):
                values[chance.randrange(len(values))] = chance.choice(hostile)
        attribute.i, attribute.f = chance.choice((-1, 0, 3, 10**8)), chance.choice((0.0, -1.0))
    elif way == "tensor" and tensors:
        tensor = chance.choice(tensors)
        tensor.raw_data = tensor.raw_data[:-4] + chance.choice((b"\0\0\xc0\x7f", b"\xff\xff\x7f\x7f", b""))
    elif way == "shape" and tensors:
        chance.choice(tensors).dims[0] = chance.choice((0, 1, -1, 10**9, 3))
    else:
        model.graph.node.remove(node)
    path.write_bytes(model.SerializeToString())
    return way


def _hangs(*_: object) -> None:
    raise TimeoutError("loading or running hangs")


if __name__ == "__main__":
    main()
