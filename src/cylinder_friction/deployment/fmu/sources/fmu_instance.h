/* One instance of the estimator as FMI 2 and FMI 3 both see it: what it holds and what may be done when.
 *
 * Every function is static, so that several FMUs can be linked into one program. No function keeps anything outside
 * the instance. If a function refuses, it returns false and the instance's message states what, got and expected.
 */
#ifndef FMU_INSTANCE_H
#define FMU_INSTANCE_H

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmu_model.h"

#define FMU_TOLERANCE_S (1e-6 * FMU_MODEL_SAMPLE_TIME_S) /* of a step's size and of where it begins */
#define FMU_STOP_TOLERANCE_S (1e-3 * FMU_MODEL_SAMPLE_TIME_S)
#define FMU_LONGEST_WARM_UP 10000000
#define FMU_LARGEST_OFFSET_N 1e9

typedef enum { FMU_INSTANTIATED, FMU_INITIALIZING, FMU_STEPPING, FMU_TERMINATED } fmu_mode;

/* All that a saved state holds: plain values and no pointer, so that its bytes can be stored. */
typedef struct {
    fmu_mode mode;
    bool stops;
    double time_s;
    double stop_s;
    double inputs[FMU_MODEL_INPUTS];
    int32_t warm_up_steps;
    uint32_t flags;
#ifdef FMU_VR_START_OFFSET
    double start_offset_n;
    double start_uncertainty_n; /* below 0: as stated for the sensors */
#endif
    double outputs[3]; /* friction, lower bound, upper bound [N] */
    fmu_model_state estimator;
} fmu_state;

typedef struct {
    fmu_state state;
    char *name;
    void *environment; /* of the host; handed back to its logger */
    void (*logger)(void);
    char message[1024];
} fmu_instance;

static const char *const fmu_mode_names[] = {"instantiated", "initialization mode", "step mode", "terminated"};

static const double fmu_model_starts[FMU_MODEL_INPUTS] = FMU_MODEL_STARTS;

/* The state right after instantiation: no sample seen yet. */
static void fmu_reset(fmu_instance *instance)
{
    fmu_state *state = &instance->state;
    memset(state, 0, sizeof *state); /* the gaps between members too: stored states of equal instances are equal */
    state->mode = FMU_INSTANTIATED;
    memcpy(state->inputs, fmu_model_starts, sizeof fmu_model_starts);
    state->flags = FMU_MODEL_FLAG_NOT_READY;
    fmu_model_init(&state->estimator);
#ifdef FMU_VR_START_OFFSET
    state->start_uncertainty_n = -1.0;
#endif
}

static fmu_instance *fmu_new(const char *name)
{
    const size_t length = strlen(name) + 1;
    fmu_instance *instance = calloc(1, sizeof *instance);
    char *copy = malloc(length);
    if (instance == NULL || copy == NULL) {
        free(instance);
        free(copy);
        return NULL;
    }
    memcpy(copy, name, length);
    instance->name = copy;
    fmu_reset(instance);
    return instance;
}

static void fmu_free(fmu_instance *instance)
{
    if (instance != NULL) {
        free(instance->name);
        free(instance);
    }
}

static bool fmu_allowed(fmu_instance *instance, const char *what, bool allowed)
{
    if (!allowed) {
        (void)snprintf(instance->message, sizeof instance->message, "%s is not allowed in the state: %s", what,
                       fmu_mode_names[instance->state.mode]);
    }
    return allowed;
}

static bool fmu_enter_initialization(fmu_instance *instance, const char *what, double start_s, bool stops,
                                     double stop_s)
{
    fmu_state *state = &instance->state;
    if (!fmu_allowed(instance, what, state->mode == FMU_INSTANTIATED)) {
        return false;
    }
    if (!isfinite(start_s) || (stops && !(stop_s >= start_s))) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected a finite start time and a stop time not before it, but got %.9g s and %.9g s",
                       what, start_s, stop_s);
        return false;
    }
    state->time_s = start_s;
    state->stops = stops;
    state->stop_s = stop_s;
    state->mode = FMU_INITIALIZING;
    return true;
}

/* Leaves initialization; where warm-up steps were asked for, the samples set so far have stood for that long. */
static bool fmu_exit_initialization(fmu_instance *instance, const char *what)
{
    fmu_state *state = &instance->state;
    if (!fmu_allowed(instance, what, state->mode == FMU_INITIALIZING)) {
        return false;
    }
    for (int32_t left = state->warm_up_steps; left > 0; left--) {
        fmu_model_output ignored;
        fmu_model_step(&state->estimator, FMU_MODEL_SAMPLE(state->inputs), &ignored);
    }
    state->mode = FMU_STEPPING;
    return true;
}

static bool fmu_terminate(fmu_instance *instance, const char *what)
{
    if (!fmu_allowed(instance, what, instance->state.mode == FMU_STEPPING)) {
        return false;
    }
    instance->state.mode = FMU_TERMINATED;
    return true;
}

/* Takes the samples that are set as those of point_s; the outputs are theirs. A refused step changes nothing. */
static bool fmu_step(fmu_instance *instance, const char *what, double point_s, double step_s)
{
    fmu_state *state = &instance->state;
    const double rounding_s = 8.0 * DBL_EPSILON * fabs(state->time_s);
    fmu_model_output output;
    if (!fmu_allowed(instance, what, state->mode == FMU_STEPPING)) {
        return false;
    }
    if (!(fabs(point_s - state->time_s) <= FMU_TOLERANCE_S + rounding_s)) {
        (void)snprintf(
            instance->message, sizeof instance->message,
            "%s: expected the current communication point at %.9g s, where the last step ended, but got %.9g s", what,
            state->time_s, point_s);
        return false;
    }
    if (!(fabs(step_s - FMU_MODEL_SAMPLE_TIME_S) <= FMU_TOLERANCE_S + rounding_s)) {
        (void)snprintf(
            instance->message, sizeof instance->message,
            "%s: expected a communication step size of %.9g s, the sample time that the model was trained at, "
            "but got %.9g s",
            what, FMU_MODEL_SAMPLE_TIME_S, step_s);
        return false;
    }
    if (state->stops && !(point_s + step_s <= state->stop_s + FMU_STOP_TOLERANCE_S + rounding_s)) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected a step that ends by the stop time of %.9g s, but got one to %.9g s", what,
                       state->stop_s, point_s + step_s);
        return false;
    }
    fmu_model_step(&state->estimator, FMU_MODEL_SAMPLE(state->inputs), &output);
    state->outputs[0] = (double)output.friction_n;
    state->outputs[1] = (double)output.lower_n;
    state->outputs[2] = (double)output.upper_n;
    state->flags = output.flags;
    state->time_s = point_s + step_s;
    return true;
}

static bool fmu_unknown(fmu_instance *instance, const char *what, uint32_t reference)
{
    (void)snprintf(instance->message, sizeof instance->message, "%s: no such variable: value reference %lu", what,
                   (unsigned long)reference);
    return false;
}

static bool fmu_is_input(uint32_t reference)
{
    return reference >= FMU_VR_FIRST_INPUT && reference < FMU_VR_FIRST_INPUT + FMU_MODEL_INPUTS;
}

static bool fmu_get_real(fmu_instance *instance, const char *what, uint32_t reference, double *value)
{
    const fmu_state *state = &instance->state;
    if (fmu_is_input(reference)) {
        *value = state->inputs[reference - FMU_VR_FIRST_INPUT];
        return true;
    }
    switch (reference) {
    case FMU_VR_TIME: *value = state->time_s; return true;
    case FMU_VR_SAMPLE_TIME: *value = FMU_MODEL_SAMPLE_TIME_S; return true;
    case FMU_VR_FRICTION: *value = state->outputs[0]; return true;
    case FMU_VR_FRICTION_LOWER: *value = state->outputs[1]; return true;
    case FMU_VR_FRICTION_UPPER: *value = state->outputs[2]; return true;
#ifdef FMU_VR_START_OFFSET
    case FMU_VR_START_OFFSET: *value = state->start_offset_n; return true;
    case FMU_VR_START_OFFSET_UNCERTAINTY: *value = state->start_uncertainty_n; return true;
    case FMU_VR_OFFSET: *value = (double)fmu_model_offset_n(&state->estimator); return true;
    case FMU_VR_OFFSET_UNCERTAINTY: *value = (double)fmu_model_offset_uncertainty_n(&state->estimator); return true;
#endif
    default: return fmu_unknown(instance, what, reference);
    }
}

static bool fmu_get_integer(fmu_instance *instance, const char *what, uint32_t reference, int32_t *value)
{
    switch (reference) {
    case FMU_VR_FLAGS: *value = (int32_t)instance->state.flags; return true;
    case FMU_VR_WARM_UP_STEPS: *value = instance->state.warm_up_steps; return true;
    default: return fmu_unknown(instance, what, reference);
    }
}

static bool fmu_get_boolean(fmu_instance *instance, const char *what, uint32_t reference, bool *value)
{
    if (reference == FMU_VR_TRUSTED) {
        *value = instance->state.flags == 0U;
        return true;
    }
    if (reference >= FMU_VR_FIRST_FLAG && reference < FMU_VR_FIRST_FLAG + FMU_MODEL_FLAGS) {
        *value = ((instance->state.flags >> (reference - FMU_VR_FIRST_FLAG)) & 1U) != 0U;
        return true;
    }
    return fmu_unknown(instance, what, reference);
}

#ifdef FMU_VR_START_OFFSET
/* Sets one number of a known offset; the estimator, which has taken no step yet, starts from both at once. */
static bool fmu_set_start(fmu_instance *instance, const char *what, double *number, double value)
{
    fmu_state *state = &instance->state;
    if (!fmu_allowed(instance, what, state->mode == FMU_INSTANTIATED || state->mode == FMU_INITIALIZING)) {
        return false;
    }
    if (!(fabs(value) <= FMU_LARGEST_OFFSET_N)) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected a start offset and its uncertainty of at most %.9g N, but got %.9g N", what,
                       FMU_LARGEST_OFFSET_N, value);
        return false;
    }
    *number = value;
    fmu_model_reset_from(&state->estimator, (fmu_model_real)state->start_offset_n,
                         (fmu_model_real)state->start_uncertainty_n);
    return true;
}
#endif

/* Any number is taken, NaN and infinity too: the estimator's own guard holds and flags what is no reading. */
static bool fmu_set_real(fmu_instance *instance, const char *what, uint32_t reference, double value)
{
    fmu_state *state = &instance->state;
    if (!fmu_allowed(instance, what, state->mode != FMU_TERMINATED)) {
        return false;
    }
    if (fmu_is_input(reference)) {
        state->inputs[reference - FMU_VR_FIRST_INPUT] = value;
        return true;
    }
    switch (reference) {
    case FMU_VR_TIME:
    case FMU_VR_SAMPLE_TIME:
    case FMU_VR_FRICTION:
    case FMU_VR_FRICTION_LOWER:
    case FMU_VR_FRICTION_UPPER:
#ifdef FMU_VR_START_OFFSET
    case FMU_VR_OFFSET:
    case FMU_VR_OFFSET_UNCERTAINTY:
#endif
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: value reference %lu is not an input; the inputs are " FMU_MODEL_INPUT_NAMES, what,
                       (unsigned long)reference);
        return false;
#ifdef FMU_VR_START_OFFSET
    case FMU_VR_START_OFFSET: return fmu_set_start(instance, what, &state->start_offset_n, value);
    case FMU_VR_START_OFFSET_UNCERTAINTY: return fmu_set_start(instance, what, &state->start_uncertainty_n, value);
#endif
    default: return fmu_unknown(instance, what, reference);
    }
}

static bool fmu_set_integer(fmu_instance *instance, const char *what, uint32_t reference, int32_t value)
{
    fmu_state *state = &instance->state;
    if (reference != FMU_VR_WARM_UP_STEPS) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: value reference %lu is no integer that can be set; that is warm_up_steps", what,
                       (unsigned long)reference);
        return false;
    }
    if (!fmu_allowed(instance, what, state->mode == FMU_INSTANTIATED || state->mode == FMU_INITIALIZING)) {
        return false;
    }
    if (value < 0 || value > FMU_LONGEST_WARM_UP) {
        (void)snprintf(instance->message, sizeof instance->message,
                       "%s: expected warm_up_steps from 0 to %d, but got %ld", what, FMU_LONGEST_WARM_UP, (long)value);
        return false;
    }
    state->warm_up_steps = value;
    return true;
}

#endif
