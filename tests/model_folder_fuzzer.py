"""Damages saved estimators in a process of its own, and counts what loading each of them gave.

Run as ``python model_folder_fuzzer.py FOLDER MUTATIONS SEED``; each subfolder of FOLDER is a saved estimator. Prints
JSON: counts, and the mebibytes that the process took more. Half of the mutations keep the hashes that ``save`` wrote,
and must be refused or give the same estimates; the others have new hashes, and must be refused or run in every runtime.
"""

import collections
import copy
import json
import random
import resource
import shutil
import signal
import sys
import tempfile
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx

from cylinder_friction.deployment.c_export.compiled import CompiledEstimator, CompiledStream
from cylinder_friction.deployment.c_export.export import export_model, generate_c
from cylinder_friction.deployment.onnx_graphs.step import step_graph
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
COMPILED_EACH = 100  # Of the models that are taken with new hashes, one in so many is compiled and compared
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
            folder = Path(scratch) / "model"
            shutil.copytree(kind, folder)
            how = mutate(folder, chance)
            keeps_hashes = chance.random() < 0.5
            if not keeps_hashes:
                seal(folder)
            signal.alarm(HANG_S)
            try:
                compiled = counts["taken"] % COMPILED_EACH == 0
                counts[outcome(folder, originals[kind] if keeps_hashes else None, compiled=compiled)] += 1
            except Exception:
                failures.append(f"{kind.name}, {how}:\n{traceback.format_exc(limit=-3)}")
            signal.alarm(0)
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    sys.stdout.write(json.dumps({**counts, "grown_mib": round(grown), "failures": failures}))


def outcome(folder: Path, original: np.ndarray | None, *, compiled: bool) -> str:
    """Return what loading a damaged model gave; raises what it must not give."""
    try:
        estimator = load_estimator(folder)
    except (SavedModelError, FileNotFoundError) as error:
        if str(folder) not in str(error):
            raise AssertionError(f"the message does not name the file: {error}") from error
        return "refused"
    found = outputs_of(estimator)
    if original is None:
        runs_everywhere(estimator, folder, compiled=compiled)
        return "taken"
    if not np.array_equal(found, original, equal_nan=True):
        raise AssertionError("other newtons, without a word")
    return "same bits"


def outputs_of(estimator: FrictionEstimator) -> np.ndarray:
    """Return newtons and flags of a few hundred samples, some of them hostile."""
    chance = np.random.default_rng(1)
    samples = np.column_stack(
        [
            np.cumsum(chance.normal(0.0, 1e-4 if name == "position_m" else 1e4, 300))
            + (0.1 if name == "position_m" else 3e6)
            for name in estimator.inputs
        ]
    )
    samples[100:103] = [[np.nan], [1e300], [-1e9]]
    if type(estimator).step_model is FrictionEstimator.step_model:
        state = estimator.new_state()
        return np.asarray(estimator.advance(state, estimator.channels_of(samples[:100])))
    newtons, flags = estimator.real_time().run(samples)
    return np.column_stack([newtons, flags])


def runs_everywhere(estimator: FrictionEstimator, folder: Path, *, compiled: bool) -> None:
    """Export the model to C and ONNX; compile it where that is asked for, and compare with Python bit for bit."""
    if type(estimator).step_model is FrictionEstimator.step_model:
        return
    model = estimator.step_model()
    generate_c(model, "fuzzed", "double", estimator.kind)
    step_graph(model)
    if compiled:
        stream = CompiledStream(CompiledEstimator(export_model(model, folder)))
        python = estimator.real_time()
        for sample in np.random.default_rng(2).normal(0.0, 1.0, (50, len(model.inputs))):
            if not np.array_equal(stream.step(*sample), python.step(*sample), equal_nan=True):
                raise AssertionError("C differs from Python")


def seal(folder: Path) -> None:
    """Give a damaged model new hashes, where it can still be read."""
    try:
        content = json.loads((folder / DESCRIPTION_FILE).read_text())
        files = content.pop(FILES, {})
        content.pop(CONTENT_HASH, None)
        write_description(folder, content, list(files))
    except (ValueError, AttributeError, TypeError, OSError):
        return


def mutate(folder: Path, chance: random.Random) -> str:
    """Damage one file; return how."""
    path = chance.choice(sorted(folder.iterdir()))
    ways: list[Callable[[Path, random.Random], str]] = [_bytes, _bytes, _json if path.suffix == ".json" else _onnx]
    ways += ways[-1:] * 3
    return f"{path.name}: {chance.choice(ways)(path, chance)}"


def _bytes(path: Path, chance: random.Random) -> str:
    content = bytearray(path.read_bytes())
    place, length = chance.randrange(len(content)), chance.choice((1, 1, 4, 64, 1000))
    way = chance.choice(("flip", "cut", "drop", "repeat", "zero"))
    if way == "flip":
        content[place] ^= 1 << chance.randrange(8)
    elif way == "cut":
        del content[place:]
    elif way == "drop":
        del content[place : place + length]
    elif way == "repeat":
        content[place:place] = content[place : place + length]
    else:
        content[place : place + length] = bytes(len(content[place : place + length]))
    path.write_bytes(content)
    return f"{way} {length} at {place}"


def _json(path: Path, chance: random.Random) -> str:
    content = json.loads(path.read_text())
    holder, key = content, chance.choice(sorted(content))
    names = [key]
    while isinstance(holder[key], dict | list) and holder[key] and chance.random() < 0.8:
        holder = holder[key]
        key = chance.choice(sorted(holder)) if isinstance(holder, dict) else chance.randrange(len(holder))
        names.append(str(key))
    way = chance.choice(("replace", "replace", "delete", "add", "negate", "scale"))
    value = holder[key]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if way == "delete":
        del holder[key]
    elif way == "add":
        holder.insert(key, copy.deepcopy(value)) if isinstance(holder, list) else holder.update(more=1)
    elif number and way == "negate":
        holder[key] = -value
    elif number and way == "scale":
        holder[key] = value * chance.choice((1e-12, 1e6, 1e25))
    else:
        holder[key] = chance.choice(HOSTILE)
    path.write_text(json.dumps(content))
    return f"{way} {'.'.join(names)}"


def _onnx(path: Path, chance: random.Random) -> str:
    model = onnx.load(path)
    node = chance.choice(model.graph.node)
    tensors = list(model.graph.initializer)
    way = chance.choice(("operator", "attribute", "attribute", "tensor", "shape", "input", "drop", "twice"))
    if way == "operator":
        node.op_type = chance.choice(("Add", "Sub", "MatMul", "LSTM", "TreeEnsembleRegressor", "Loop", "GRU"))
    elif way == "attribute" and node.attribute:
        attribute = chance.choice(node.attribute)
        for field in ("ints", "floats", "strings"):
            values = getattr(attribute, field)
            if len(values):
                hostile = {
                    "ints": (-1, 10**8, 0, 1, 2**62),
                    "floats": (float("nan"), 1e38, 0.0),
                    "strings": (b"LEAF", b""),
                }
                values[chance.randrange(len(values))] = chance.choice(hostile[field])
        attribute.i, attribute.f = chance.choice((-1, 0, 3, 10**8)), chance.choice((0.0, -1.0))
    elif way == "tensor" and tensors:
        tensor = chance.choice(tensors)
        content = bytearray(tensor.raw_data)
        content[-4:] = chance.choice((b"\0\0\xc0\x7f", b"\xff\xff\x7f\x7f", b"", b"\0\0\0\0"))
        tensor.raw_data = bytes(content)
    elif way == "shape" and tensors:
        tensor = chance.choice(tensors)
        tensor.dims[chance.randrange(len(tensor.dims))] = chance.choice((0, 1, -1, 10**9, 3))
    elif way == "input":
        node.input[chance.randrange(len(node.input))] = chance.choice(("", "features", "nothing"))
    elif way == "drop":
        model.graph.node.remove(node)
    else:
        model.graph.node.append(node)
    path.write_bytes(model.SerializeToString())
    return f"{way} of {node.op_type}"


def _hangs(*_: object) -> None:
    raise TimeoutError("loading or running hangs")


if __name__ == "__main__":
    main()
