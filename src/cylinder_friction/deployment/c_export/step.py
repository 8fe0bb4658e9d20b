"""C source of a step: guard, filters, estimate, bounds, as ``estimators.realtime.reference`` defines them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from cylinder_friction.deployment.c_export.block import StateField
from cylinder_friction.deployment.c_export.literals import number

if TYPE_CHECKING:
    from cylinder_friction.deployment.c_export.block import EstimateBlock
    from cylinder_friction.deployment.c_export.filters import FilterBank
    from cylinder_friction.deployment.c_export.literals import Type
    from cylinder_friction.realtime.model import StepModel

GUARD_OPERATIONS = 40


def guard_fields(lags: int) -> tuple[StateField, ...]:
    """Return the state of guard, filters and bounds."""
    return (
        StateField("real", "window", (3, 2 * lags), "last samples of each channel, newest at cursor, kept twice"),
        StateField("real", "held", (3,), "last sound value of each channel"),
        StateField("real", "constant_from_m", (2,), "position at which each pressure last changed"),
        StateField("uint32_t", "cursor", (), "where the newest sample is"),
        StateField("uint32_t", "ready", (), "1 once a sample was sound in all channels"),
        StateField("uint32_t", "frozen", (2,), "1 while a pressure is frozen"),
        StateField("uint32_t", "constant_samples", (), "for how many steps the position has been constant"),
        StateField("uint32_t", "warming", (), "steps of warm-up left"),
        StateField("uint32_t", "recovering", (), "steps of recovery left"),
        StateField("uint32_t", "reversal_left", (), "steps left of a reversal or start"),
        StateField("int32_t", "direction", (), "-1, 0 or 1: sign of the velocity, 0 at standstill"),
    )


def step_values(model: StepModel, bank: FilterBank, block: EstimateBlock, real: Type) -> dict[str, object]:
    """Return what ``STEP`` and ``PRELUDE`` ask for, the name excepted."""
    guard, bounds = model.guard, model.bounds

    def row(values: tuple[float, ...]) -> str:
        return "{" + ", ".join(number(value, real) for value in values) + "}"

    return {
        "lags": bank.lags,
        "accept_lower": row(guard.accept_lower),
        "accept_upper": row(guard.accept_upper),
        "trained_lower": row(guard.trained_lower),
        "trained_upper": row(guard.trained_upper),
        "freeze_travel": number(guard.freeze_travel_m, real),
        "freeze_force": number(guard.freeze_force_n, real),
        "freeze_samples": f"{guard.freeze_samples}u",
        "lower_n": row(bounds.lower_n),
        "upper_n": row(bounds.upper_n),
        "standstill": number(bounds.standstill_m_s, real),
        "creep": number(bounds.creep_m_s, real),
        "reversal_samples": f"{bounds.reversal_samples}u",
        "base": number(0.0, real) if bank.base is None else f"filtered[{bank.base}]",
        "velocity": f"filtered[{bank.velocity}]",
        "begin": block.begin,
        "absolute": "fabsf" if real == "float" else "fabs",
    }


PRELUDE = """\
/* @title@ */
/* Written by cylinder-friction @version@; do not edit. Model @model@. */
#include "@name@.h"

#include <math.h>
#include <string.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "-ffast-math takes the checks for NaN and infinity away; compile without it"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif
#if defined(__GNUC__)
#define ALIGNED __attribute__((aligned(64)))
#else
#define ALIGNED
#endif

#define R(x) @real_literal@
#define LAGS @lags@
#define PRESSURES 2
#define CHANNELS 3
#define POSITION 2

typedef @real@ real;
typedef char state_bytes_are_as_declared[sizeof(@name@_state) == @NAME@_STATE_BYTES ? 1 : -1];

"""

STEP = """\
/* Guard */
static const real ACCEPT_LOWER[CHANNELS] = @accept_lower@;
static const real ACCEPT_UPPER[CHANNELS] = @accept_upper@;
static const real TRAINED_LOWER[CHANNELS] = @trained_lower@;
static const real TRAINED_UPPER[CHANNELS] = @trained_upper@;

/* Puts a sample into the windows; each value is kept twice, so that the last LAGS values always lie in one piece. */
static void push(@name@_state *state, const real sample[CHANNELS])
{
    int channel;
    state->cursor = state->cursor == 0u ? LAGS - 1u : state->cursor - 1u;
    for (channel = 0; channel < CHANNELS; ++channel) {
        state->window[channel][state->cursor] = sample[channel];
        state->window[channel][state->cursor + LAGS] = sample[channel];
    }
}

static void begin(@name@_state *state, const real sample[CHANNELS])
{
    int channel, lag;
    state->ready = 1u;
    state->warming = @NAME@_WARM_UP_SAMPLES;
    for (channel = 0; channel < CHANNELS; ++channel) {
        state->held[channel] = sample[channel];
        for (lag = 0; lag < 2 * LAGS; ++lag) {
            state->window[channel][lag] = sample[channel];
        }
    }
    for (channel = 0; channel < PRESSURES; ++channel) {
        state->constant_from_m[channel] = sample[POSITION];
    }
}

/* Follows how long each channel has been constant; a held value is not the sensor's and starts afresh. */
static int is_frozen(@name@_state *state, const real sample[CHANNELS], const int invalid[CHANNELS], real base_n)
{
    int channel;
    for (channel = 0; channel < PRESSURES; ++channel) {
        if (invalid[channel] || sample[channel] != state->held[channel]) {
            state->constant_from_m[channel] = sample[POSITION];
            state->frozen[channel] = 0u;
        } else if (@absolute@(sample[POSITION] - state->constant_from_m[channel]) > @freeze_travel@) {
            state->frozen[channel] = 1u;
        }
    }
    if (invalid[POSITION] || sample[POSITION] != state->held[POSITION]) {
        state->constant_samples = 0u;
    } else if (state->constant_samples <= @freeze_samples@) {
        ++state->constant_samples;
    }
    return state->frozen[0] || state->frozen[1]
        || (state->constant_samples > @freeze_samples@ && @absolute@(base_n) > @freeze_force@);
}

static uint32_t trust(@name@_state *state, int bad)
{
    uint32_t flags = 0u;
    if (state->warming > 0u) {
        --state->warming;
        flags |= @NAME@_FLAG_WARMING;
    }
    if (bad) {
        state->recovering = @NAME@_RECOVERY_SAMPLES;
    } else if (state->recovering > 0u) {
        --state->recovering;
        flags |= @NAME@_FLAG_RECOVERING;
    }
    return flags;
}

/* Bounds by regime: 0 standstill, 1 creep, 2 sliding, 3 just after a reversal or start. */
static const real LOWER_N[4] = @lower_n@;
static const real UPPER_N[4] = @upper_n@;

static int next_regime(@name@_state *state, real velocity_m_s)
{
    const int32_t now = velocity_m_s >= @standstill@ ? 1 : velocity_m_s <= -@standstill@ ? -1 : 0;
    if (now != 0 && now != state->direction) {
        state->reversal_left = @reversal_samples@;
    }
    state->direction = now;
    if (state->reversal_left > 0u) {
        --state->reversal_left;
        return 3;
    }
    return now == 0 ? 0 : @absolute@(velocity_m_s) < @creep@ ? 1 : 2;
}

void @name@_init(@name@_state *state)
{
    memset(state, 0, sizeof *state);
}

void @name@_reset(@name@_state *state)
{
    @name@_init(state);
}

void @name@_warm_up(@name@_state *state, @real@ pressure_1_pa, @real@ pressure_2_pa, @real@ position_m, uint32_t steps)
{
    @name@_output ignored;
    @name@_init(state);
    for (; steps > 0u; --steps) {
        @name@_step(state, pressure_1_pa, pressure_2_pa, position_m, &ignored);
    }
}

void @name@_step(@name@_state *state, @real@ pressure_1_pa, @real@ pressure_2_pa, @real@ position_m,
                 @name@_output *output)
{
    real sample[CHANNELS];
    real filtered[ROWS];
    int invalid[CHANNELS];
    uint32_t flags = 0u, outside = 0u;
    int channel, regime, frozen, first;
    sample[0] = pressure_1_pa;
    sample[1] = pressure_2_pa;
    sample[2] = position_m;
    for (channel = 0; channel < CHANNELS; ++channel) {
        /* Comparisons with NaN are false. */
        invalid[channel] = !(sample[channel] >= ACCEPT_LOWER[channel] && sample[channel] <= ACCEPT_UPPER[channel]);
        flags |= (uint32_t)invalid[channel] * (@NAME@_FLAG_INVALID_PRESSURE_1 << channel);
    }
    first = !state->ready;
    if (first) {
        if (flags != 0u) {
            output->friction_n = R(0.0);
            output->lower_n = R(0.0);
            output->upper_n = R(0.0);
            output->flags = flags | @NAME@_FLAG_NOT_READY;
            return;
        }
        begin(state, sample);
    }
    for (channel = 0; channel < CHANNELS; ++channel) {
        sample[channel] = invalid[channel] ? state->held[channel] : sample[channel];
        outside |= (uint32_t)(sample[channel] < TRAINED_LOWER[channel] || sample[channel] > TRAINED_UPPER[channel]);
    }
    push(state, sample);
    filter_samples(state->window[0] + state->cursor, state->window[1] + state->cursor,
                   state->window[2] + state->cursor, filtered);
@begin@    frozen = is_frozen(state, sample, invalid, @base@);
    memcpy(state->held, sample, sizeof sample);
    flags |= outside * @NAME@_FLAG_OUTSIDE | (uint32_t)frozen * @NAME@_FLAG_FROZEN;
    flags |= trust(state, frozen || invalid[0] || invalid[1] || invalid[2]);
    output->friction_n = estimate(state, filtered);
    regime = next_regime(state, @velocity@);
    output->lower_n = output->friction_n + LOWER_N[regime];
    output->upper_n = output->friction_n + UPPER_N[regime];
    output->flags = flags;
}
"""
