"""Networks with memory: the hybrid and its parts, GRU, TCN, and the published hybrid.

Where raw pressures are there, a network corrects a force balance whose error changes within a few samples, so it steps
at every sample: an LSTM after 10 epochs is 1.43 % wrong on the default campaign's tests (identity), and 1.76 % if it
steps at every fourth sample. Without them what tells is how the piston was moved for many seconds: a recurrent network
steps at every fourth sample and a TCN at every tenth, and the time that this saves goes into epochs, which bring more.
``effort`` cuts the epochs, and the rows that a forest is fitted on; deeper stacks get fewer epochs in proportion.
The published hybrid, ten times as costly, has its 40 epochs cut by effort to the power 1.7: 4 serve it as well as 10.
"""

from __future__ import annotations

import math

from cylinder_friction.estimators.hybrid import ForestPlan, HybridEstimator
from cylinder_friction.estimators.training_plan import Architecture, TrainingPlan
from cylinder_friction.recordings.columns import SAMPLE_COLUMNS
from friction_benchmark.models.gru import GruEstimator
from friction_benchmark.models.lstm_correction import LstmEstimator, LstmForestEstimator
from friction_benchmark.models.sequence_estimator import SequencePlan
from friction_benchmark.models.tcn import TcnArchitecture, TcnEstimator
from friction_benchmark.roster.entry import (
    Making,
    OneOf,
    Range,
    RosterEntry,
    Value,
    needs_raw_pressures,
)

RECURRENT_STRIDE, TCN_STRIDE = 4, 10
FOREST_LEAF, FOREST_ROWS = 20, 60_000

RECURRENT_SPACE: dict[str, Range | OneOf] = {
    "layers": OneOf((1, 2)),
    "nodes": Range(16, 48, logarithmic=True, integer=True),
    "learning_rate": Range(4e-3, 3e-2, logarithmic=True),
    "dropout": OneOf((0.0, 0.05, 0.1)),
}
RECURRENT_FIRST: dict[str, Value] = {"layers": 1, "nodes": 32, "learning_rate": 1e-2, "dropout": 0.05}


def _plan(making: Making, full: int, slow: int, layers: int, steps: int, batch_size: int = 16) -> SequencePlan:
    """Return the plan of this effort; ``full`` are the epochs of effort 1 and one layer at every sample, ``slow`` the
    stride where there are no raw pressures."""
    stride = 1 if needs_raw_pressures(making.inputs) else slow
    epochs = max(1, round(making.effort * full * stride / layers))
    return SequencePlan(epochs, epochs, steps, batch_size, stride)


def _recurrent(making: Making) -> Architecture:
    choice = making.choice
    return Architecture(
        int(choice["layers"]), int(choice["nodes"]), float(choice["dropout"]), float(choice["learning_rate"])
    )


def _lstm(making: Making) -> LstmEstimator:
    architecture = _recurrent(making)
    plan = _plan(making, 60, RECURRENT_STRIDE, architecture.layers, 100)
    return LstmEstimator(making.cylinder, architecture, plan, making.inputs, making.seed)


def _hybrid(making: Making) -> LstmForestEstimator:
    architecture = _recurrent(making)
    rows = max(1000, round(making.effort * FOREST_ROWS))
    forest = ForestPlan(int(making.choice["trees"]), int(making.choice["depth"]), rows, FOREST_LEAF)
    plan = _plan(making, 40, RECURRENT_STRIDE, architecture.layers, 100)
    return LstmForestEstimator(making.cylinder, architecture, plan, forest, making.inputs, making.seed)


def _gru(making: Making) -> GruEstimator:
    architecture = _recurrent(making)
    plan = _plan(making, 24, RECURRENT_STRIDE, architecture.layers, 75, 32)
    return GruEstimator(making.cylinder, architecture, plan, making.inputs, making.seed)


def _tcn(making: Making) -> TcnEstimator:
    choice = making.choice
    kernel, field = int(choice["kernel"]), int(choice["receptive_field_steps"])
    levels = math.ceil(math.log2(1.0 + (field - 1) / (2 * (kernel - 1))))
    architecture = TcnArchitecture(
        levels, int(choice["channels"]), kernel, float(choice["dropout"]), float(choice["learning_rate"])
    )
    plan = _plan(making, 24, TCN_STRIDE, 1, 100)
    return TcnEstimator(making.cylinder, architecture, plan, making.inputs, making.seed)


def _paper_hybrid(making: Making) -> HybridEstimator:
    epochs = max(1, round(making.effort**1.7 * 40))
    choice, rows = making.choice, max(1000, round(making.effort * 40_000))
    return HybridEstimator(
        making.cylinder,
        "paper",
        _recurrent(making),
        TrainingPlan(epochs, 8, 200, 100, 16, "constant"),
        ForestPlan(int(choice["trees"]), int(choice["depth"]), rows, 5),
        making.seed,
    )


def _has_the_papers_inputs(inputs: tuple[str, ...]) -> bool:
    return inputs == SAMPLE_COLUMNS


TREES: dict[str, Range | OneOf] = {"trees": Range(16, 32, integer=True), "depth": Range(6, 12, integer=True)}

ENTRIES: tuple[RosterEntry, ...] = (
    RosterEntry(
        "hybrid",
        "Hybrid: LSTM and forest",
        "modern",
        "after the paper; Hochreiter and Schmidhuber 1997, Breiman 2001",
        _hybrid,
        {**RECURRENT_SPACE, **TREES},
        {**RECURRENT_FIRST, "trees": 24, "depth": 10},
        chosen="The LSTM corrects the force balance where there is one; the forest learns what the LSTM leaves, from "
        "its state, its output and the features; leaves of 20 rows or more; mean absolute error, AdamW, cosine.",
    ),
    RosterEntry(
        "lstm",
        "LSTM",
        "modern",
        "Hochreiter and Schmidhuber 1997",
        _lstm,
        RECURRENT_SPACE,
        RECURRENT_FIRST,
        chosen="The hybrid without its forest, with the forest's time spent on epochs.",
    ),
    RosterEntry(
        "gru",
        "GRU",
        "modern",
        "Cho et al. 2014",
        _gru,
        RECURRENT_SPACE,
        RECURRENT_FIRST,
        chosen="Reset gate after the recurrent product; linear head; mean absolute error, AdamW, cosine.",
    ),
    RosterEntry(
        "tcn",
        "Causal TCN",
        "modern",
        "Bai, Kolter and Koltun 2018",
        _tcn,
        {
            "receptive_field_steps": OneOf((128, 256, 512)),
            "kernel": OneOf((3, 4)),
            "channels": Range(8, 20, integer=True),
            "learning_rate": Range(2e-3, 2e-2, logarithmic=True),
            "dropout": OneOf((0.0, 0.05)),
        },
        {"receptive_field_steps": 128, "kernel": 4, "channels": 16, "learning_rate": 1e-2, "dropout": 0.0},
        chosen="As many blocks as the receptive field needs: at least 128 steps, 0.64 s or, without pressures, 6.4 s; "
        "weight normalisation, spatial dropout.",
    ),
    RosterEntry(
        "paper_hybrid",
        "Published hybrid: LSTM 4×64 and forest",
        "related work",
        "the paper",
        _paper_hybrid,
        {
            "layers": OneOf((3, 4, 5)),
            "nodes": OneOf((16, 32, 64)),
            "learning_rate": Range(1e-5, 1e-3, logarithmic=True),
            "dropout": OneOf((0.1, 0.2, 0.3, 0.4, 0.5)),
            "trees": Range(32, 100, integer=True),
            "depth": Range(10, 50, integer=True),
        },
        {"layers": 4, "nodes": 64, "learning_rate": 1e-3, "dropout": 0.3, "trees": 64, "depth": 10},
        can=_has_the_papers_inputs,
        chosen="Whole sequences with carried state, a linear head for training, the last hidden state into the forest. "
        "A small effort leaves so large a network an epoch or two; the pipeline's own report has it fully trained.",
    ),
)
