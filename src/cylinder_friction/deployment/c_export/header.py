"""The header of an exported estimator: constants, state, functions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.deployment.c_export.literals import number

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cylinder_friction.deployment.c_export.block import StateField
    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.realtime.model import StepModel

BYTES = {"float": 4, "double": 8, "uint32_t": 4, "int32_t": 4}


def ordered_fields(fields: Sequence[StateField], real: Type) -> list[tuple[str, str, str, int]]:
    """Return ``(C type, declarator, comment, bytes)`` of each field, widest types first: none needs padding."""
    rows: list[tuple[str, str, str, int]] = []
    for field in fields:
        c_type = real if field.role == "real" else field.role
        rows.append((c_type, field.declarator, field.comment, BYTES[c_type] * field.count))
    rows.sort(key=lambda row: -BYTES[row[0]])
    if any(BYTES[row[0]] == 8 for row in rows) and sum(row[3] for row in rows) % 8:
        rows.append(("uint32_t", "unused", "rounds the size to a multiple of 8", 4))
    return rows


def header_values(model: StepModel, rows: Sequence[tuple[str, str, str, int]], real: Type) -> dict[str, object]:
    """Return what ``HEADER`` asks for, beside names, hash and version."""
    width = max(len(c_type) + len(declarator) for c_type, declarator, _, _ in rows) + 2
    fields = [f"    {f'{c_type} {declarator};':<{width}} /* {comment} */" for c_type, declarator, comment, _ in rows]
    return {
        "sample_time": number(model.sample_time_s, "double"),
        "state_bytes": sum(row[3] for row in rows),
        "state_fields": "\n".join(fields),
        "warm_up_samples": f"{model.guard.warm_up_samples}u",
        "recovery_samples": f"{model.guard.recovery_samples}u",
        "probability": number(model.bounds.probability, "double"),
        "ranges": "\n".join(_ranges(model, real)),
    }


def _ranges(model: StepModel, real: Type) -> list[str]:
    names = ("PRESSURE_1_PA", "PRESSURE_2_PA", "POSITION_M")
    ends = (("TRAINED_LOWER", model.guard.trained_lower), ("TRAINED_UPPER", model.guard.trained_upper))
    return [
        f"#define @NAME@_{end}_{name} ({number(values[channel], real)})"
        for channel, name in enumerate(names)
        for end, values in ends
    ]


HEADER = """\
/* @title@

   Written by cylinder-friction @version@; do not edit.

   Call @name@_init once, then @name@_step once every @NAME@_SAMPLE_TIME_S seconds with the raw sample as
   the sensors give it: gauge pressure 1 (piston side) [Pa], gauge pressure 2 (rod side) [Pa], position [m], growing
   with extension. Out comes friction [N], positive when it opposes extension, with bounds and flags.

   No allocation, no variable outside the state, no dependency but libm. Instances do not touch each other. */
#ifndef @NAME@_H
#define @NAME@_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* SHA-256 of the model: of every number that a step uses. */
#define @NAME@_MODEL "@model@"
#define @NAME@_KIND "@kind@"
#define @NAME@_PRECISION "@precision@"

/* The one time between two samples [s]. */
#define @NAME@_SAMPLE_TIME_S @sample_time@
/* sizeof(@name@_state), checked when compiled. */
#define @NAME@_STATE_BYTES @state_bytes@
/* Multiply-adds, comparisons and the like of one step, at worst; all steps cost the same but the ones before NOT_READY
   is over. */
#define @NAME@_OPERATIONS @operations@
/* Steps after a reset, and after the last bad sample, in which the estimate is not to be trusted yet. */
#define @NAME@_WARM_UP_SAMPLES @warm_up_samples@
#define @NAME@_RECOVERY_SAMPLES @recovery_samples@
/* That friction lies between the bounds, on recordings like those of the calibration. */
#define @NAME@_PROBABILITY @probability@
/* Beyond these an estimate is an extrapolation. */
@ranges@

/* No sample with all three channels valid has come yet; estimate and bounds are 0. */
#define @NAME@_FLAG_NOT_READY 1u
/* The state still remembers the reset. */
#define @NAME@_FLAG_WARMING 2u
/* A channel lies outside the training range widened by 5 %; the estimate is an extrapolation. */
#define @NAME@_FLAG_OUTSIDE 4u
/* A channel is NaN, infinite or no reading of a working sensor; its last valid value stands in. */
#define @NAME@_FLAG_INVALID_PRESSURE_1 8u
#define @NAME@_FLAG_INVALID_PRESSURE_2 16u
#define @NAME@_FLAG_INVALID_POSITION 32u
/* A channel repeats one value although it cannot be constant. */
#define @NAME@_FLAG_FROZEN 64u
/* Channels are sound again, but the state still remembers invalid or frozen ones. */
#define @NAME@_FLAG_RECOVERING 128u

typedef @real@ @name@_real;

typedef struct {
    @real@ friction_n; /* friction [N] */
    @real@ lower_n; /* bounds around it [N] */
    @real@ upper_n;
    uint32_t flags;
} @name@_output;

/* All that an instance remembers. It holds no pointer: assign, copy or store it to save an instance and restore it. */
typedef struct {
@state_fields@
} @name@_state;

/* Makes an instance of memory with any content. */
void @name@_init(@name@_state *state);

/* Forgets everything; the next step is a first step. */
void @name@_reset(@name@_state *state);

/* Resets, then takes `steps` steps on one and the same sample, so that the state comes to rest at it. */
void @name@_warm_up(@name@_state *state, @real@ pressure_1_pa, @real@ pressure_2_pa, @real@ position_m, uint32_t steps);

/* Takes one step, whatever the sample is. */
void @name@_step(@name@_state *state, @real@ pressure_1_pa, @real@ pressure_2_pa, @real@ position_m,
                 @name@_output *output);

#ifdef __cplusplus
}
#endif

#endif
"""
