"""The golden trajectory of a registered model, which its engine must meet before it gives newtons."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cylinder_friction.arrays import Array
from cylinder_friction.deployment.golden_trajectory import GOLDEN_FILE, GoldenError, difference_n
from cylinder_friction.recordings.files import read_json, write_bytes
from cylinder_friction.service.live.engine import Engine
from cylinder_friction.service.live.frames import EstimateBlock


def take_golden(folder: Path, estimator: Path) -> None:
    """Copy the golden trajectory beside a saved estimator, where a registered model has it, into its engine's folder.

    Raises:
        GoldenError: The engine does not meet it; a trajectory that is there already stays.
    """
    golden, own = estimator.resolve().with_name(GOLDEN_FILE), folder / GOLDEN_FILE
    if golden.is_file() and not (own.is_file() and own.read_bytes() == golden.read_bytes()):
        _difference_n(Engine(folder), golden)
        write_bytes(own, golden.read_bytes())


def checked_engine(folder: Path) -> Engine:
    """Return the engine in a folder, which meets the golden trajectory there, if there is one.

    Raises:
        OSError: The folder holds no engine that this machine can load.
        GoldenError: The engine is too far from the trajectory.
    """
    engine, golden = Engine(folder), folder / GOLDEN_FILE
    if golden.is_file():
        engine.golden_difference_n = _difference_n(engine, golden)
    return engine


def _difference_n(engine: Engine, golden: Path) -> float:
    slot = engine.add()
    try:
        trajectory = read_json(golden)
        columns = np.shape(trajectory["samples"])[1:]
        if columns != (len(engine.inputs),):
            raise GoldenError(f"its golden trajectory has columns {columns}; expected {list(engine.inputs)}")
        return difference_n(lambda samples: _stepped(engine, slot, samples), trajectory)
    except (ValueError, KeyError, TypeError) as error:
        found = str(error) if isinstance(error, GoldenError) else f"its golden trajectory cannot be read ({error!r})"
        raise GoldenError(
            f"model {engine.model[:12]}: {found} ({golden}); it gives no newtons: register it again, or name another"
        ) from error
    finally:
        engine.remove(slot)


def _stepped(engine: Engine, slot: int, samples: Array) -> tuple[Array, NDArray[np.uint32]]:
    block = EstimateBlock(0, 0, 0.0, *engine.run([(slot, samples, False)])[0])
    return block.newtons, block.flags
