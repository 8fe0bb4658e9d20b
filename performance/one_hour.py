"""All runtimes beside the training framework over an hour of the rig's recordings, one after the other, never reset.

The training framework is PyTorch's LSTM over the whole stretch and scikit-learn's forest on what it gives; both are put
together again from the stored model. Run after `dvc repro`: `python performance/one_hour.py [model folder ...]`.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from tqdm import tqdm
from training_framework import TorchNetwork, scikit_learn_forest

from cylinder_friction.deployment.c_export.compiled import CompiledEstimator
from cylinder_friction.deployment.c_export.export import export_c
from cylinder_friction.deployment.fmu.export import export_fmu
from cylinder_friction.deployment.onnx_graphs.export import export_onnx
from cylinder_friction.deployment.onnx_graphs.stream import open_sequence, open_step
from cylinder_friction.estimators.front_end import FrontEndBlock
from cylinder_friction.estimators.hybrid import HybridEstimator, forest_input
from cylinder_friction.estimators.loading import load_estimator
from cylinder_friction.recordings.storage import read_recordings

if TYPE_CHECKING:
    from collections.abc import Callable

    from cylinder_friction.arrays import Array


HOUR = 720_000
FOLDERS = ("models/hybrid", "models/paper_hybrid")
LIMIT_N = 0.5


def main() -> None:
    """Print, for every runtime, its greatest distance from the training framework and how often it is above 0.5 N."""
    folders = ("test", "validation", "train")
    recordings = [each for folder in folders for each in read_recordings(Path("data/processed") / folder)]
    samples = np.concatenate([recording.samples() for recording in recordings])[:HOUR]
    for folder in sys.argv[1:] or FOLDERS:
        estimator = load_estimator(Path(folder))
        if not isinstance(estimator, HybridEstimator):
            raise SystemExit(f"{folder}: is no hybrid; expected models/hybrid or models/paper_hybrid")
        estimator.offset = None  # the training framework learns none
        expected = training_framework(estimator, samples)
        title = f"{folder}: {len(samples)} samples"
        print(f"\n{title:40} {'greatest':>10} {'99.99 %':>10} {'above 0.5 N':>12}")
        with tempfile.TemporaryDirectory() as scratch:
            for name, estimate in runtimes(estimator, Path(scratch)).items():
                away = np.abs(estimate(samples) - expected)
                above = 100.0 * np.mean(away > LIMIT_N)
                print(f"{name:40} {away.max():8.4f} N {np.quantile(away, 0.9999):8.4f} N {above:10.4f} %", flush=True)


def training_framework(estimator: HybridEstimator, samples: Array) -> Array:
    """Return friction [N] by PyTorch and scikit-learn."""
    parts = estimator.parts
    assert parts is not None
    block = FrontEndBlock(parts.front_end)
    features, base_n = block.advance(block.new_state(), samples)
    network = TorchNetwork(parts.network)
    with torch.no_grad():
        hidden, _ = network.lstm(torch.from_numpy(features)[None])
        head = network.head(hidden)[0, :, 0].numpy()
    corrected_n = base_n + parts.target_mean_n + parts.target_scale_n * head.astype(np.float64)
    if parts.forest is None:
        return np.asarray(corrected_n)
    forest = scikit_learn_forest(parts.forest)
    rows = forest_input(parts.design, hidden[0].numpy(), head, features)
    forest_n = parts.target_scale_n * forest.predict(rows)
    return np.asarray((base_n + parts.target_mean_n if parts.design == "paper" else corrected_n) + forest_n)


def runtimes(estimator: HybridEstimator, folder: Path) -> dict[str, Callable[[Array], Array]]:
    """Return every runtime as a function of all samples."""
    double = CompiledEstimator(export_c(estimator, folder / "double"))
    single = CompiledEstimator(export_c(estimator, folder / "single", precision="float"))
    onnx = export_onnx(estimator, folder / "onnx")
    return {
        "Python, a recording at once": lambda samples: estimator.advance(estimator.new_state(), samples),
        "Python, stream": lambda samples: stepped(estimator.stream().step, samples),
        "Python, real time": lambda samples: estimator.real_time().run(samples)[0][:, 0],
        "C, double": lambda samples: double.stream().run(samples)[0][:, 0],
        "C, float": lambda samples: single.stream().run(samples)[0][:, 0],
        "ONNX, sequence graph": lambda samples: open_sequence(onnx.sequence).run(samples)[0][:, 0],
        "ONNX, step graph": lambda samples: onnx_steps(onnx.step, samples),
        "FMI 2.0": lambda samples: fmu_run(estimator, folder / "estimator.fmu", samples),
    }


def onnx_steps(graph: Path, samples: Array) -> Array:
    """Return friction [N] of the step graph."""
    stream = open_step(graph)
    return stepped(lambda *sample: stream.step(*sample)[0], samples)


def stepped(step: Callable[..., float], samples: Array) -> Array:
    """Return the outputs of one step a sample."""
    return np.array([step(*sample) for sample in tqdm(samples.tolist(), leave=False, disable=None)])


def fmu_run(estimator: HybridEstimator, path: Path, samples: Array) -> Array:
    """Return friction [N] of the FMU at its declared step, driven by FMPy."""
    from fmpy import extract, read_model_description
    from fmpy.fmi2 import FMU2Slave

    export_fmu(estimator, path, fmi=2)
    description = read_model_description(str(path))
    of = {variable.name: variable.valueReference for variable in description.modelVariables}
    step_s = float(description.defaultExperiment.stepSize)
    fmu = FMU2Slave(
        guid=description.guid,
        unzipDirectory=extract(str(path), str(path.with_suffix(""))),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="hour",
    )
    fmu.instantiate()
    fmu.setupExperiment(startTime=0.0)
    fmu.enterInitializationMode()
    inputs, output = [of["pressure_1"], of["pressure_2"], of["position"]], [of["friction"]]
    fmu.setReal(inputs, samples[0].tolist())
    fmu.exitInitializationMode()
    friction_n = np.empty(len(samples))
    for number, sample in enumerate(tqdm(samples.tolist(), leave=False, disable=None)):
        fmu.setReal(inputs, sample)
        fmu.doStep(currentCommunicationPoint=number * step_s, communicationStepSize=step_s)
        friction_n[number] = fmu.getReal(output)[0]
    fmu.terminate()
    fmu.freeInstance()
    return friction_n


if __name__ == "__main__":
    main()
