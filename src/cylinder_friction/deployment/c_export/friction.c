/* One step of a friction estimator, sample by sample. This file is the same for every model: the numbers of a model, the
   shape of its state and the prefix of every public name come from the header that is written beside it. */
#define ESTIMATOR_SOURCE
#include "friction.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "-ffast-math takes the checks for NaN and infinity away; compile without it"
#endif
#if FLT_EVAL_METHOD != 0
#error "numbers would keep digits beyond their type; add -msse2 -mfpmath=sse on x86"
#endif
#if DBL_MANT_DIG != 53
#error "a double must have 64 bits, also with float samples; choose the compiler's option for that"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

typedef char state_bytes_are_as_declared[sizeof(estimator_state) == STATE_BYTES ? 1 : -1];

/* Adds the products of taps and samples to a sum. A window holds the newest sample first. */
static double weighted(double total, const double *taps, const double *window, int count)
{
    int lag;
    for (lag = 0; lag < count; ++lag) {
        total += taps[lag] * window[lag];
    }
    return total;
}

/* Makes each row of the filter bank: its terms, one channel each, one after the other. */
static void filter_samples(const double *const window[CHANNELS], double filtered[ROWS])
{
    int row;
    for (row = 0; row < ROWS; ++row) {
        filtered[row] = 0.0;
    }
#define TERM(row, channel, start, first, count) \
    filtered[row] = weighted(filtered[row], TAPS + (start), window[channel] + (first), count);
    TERMS(TERM)
}

#if IS_LUGRE
/* Velocity counts only while the smooth position has lately pushed the backlash, in the direction of the push. */
static double gated_velocity(estimator_state *state, double position, double rate)
{
    if (position > state->backlash_centre_m + LUGRE_BACKLASH_M) {
        state->backlash_centre_m = position - LUGRE_BACKLASH_M;
        state->push = 1.0;
        state->pushed = LUGRE_WINDOW;
    } else if (position < state->backlash_centre_m - LUGRE_BACKLASH_M) {
        state->backlash_centre_m = position + LUGRE_BACKLASH_M;
        state->push = -1.0;
        state->pushed = LUGRE_WINDOW;
    } else if (state->pushed > 0u) {
        --state->pushed;
    }
#if LUGRE_HAS_BACKLASH
    if (!(state->pushed > 0u && rate * state->push > 0.0)) {
        return 0.0;
    }
#endif
    return fabs(rate) >= LUGRE_DEAD_BAND_M_S ? rate : 0.0;
}

/* LuGre (Canudas de Wit et al. 1995), solved exactly at a velocity that is held over the step. */
static double estimate(estimator_state *state, const double filtered[ROWS])
{
    const double velocity = gated_velocity(state, filtered[LUGRE_POSITION_ROW], filtered[LUGRE_RATE_ROW]);
    const double speed = fabs(velocity);
    const double ratio = velocity / LUGRE_DAMPING_VELOCITY_M_S;
    double dry, decay, after, rise;
    if (!(speed > 0.0)) {
        return LUGRE_BRISTLE_STIFFNESS_N_M * state->bristle_m;
    }
    dry = LUGRE_COULOMB_N
        + LUGRE_FALLING_N * exp(-exp(LUGRE_STRIBECK_EXPONENT * (log(speed) - LUGRE_LOG_STRIBECK)));
#if LUGRE_HAS_PRESSURES
    {
        const double pressure = state->held[LUGRE_PRESSURE_1] + state->held[LUGRE_PRESSURE_2];
        dry *= 1.0 + LUGRE_PRESSURE_SLOPE_N_PA * (pressure > 0.0 ? pressure : 0.0) / LUGRE_COULOMB_N;
    }
#endif
    if (velocity < 0.0) {
        dry *= LUGRE_RETRACT_RATIO;
    }
    decay = LUGRE_BRISTLE_STIFFNESS_N_M * speed * STEP_S / dry;
    after = state->bristle_m * exp(-decay)
        - expm1(-decay) * (velocity / speed) * (dry / LUGRE_BRISTLE_STIFFNESS_N_M);
    rise = (after - state->bristle_m) / STEP_S;
    state->bristle_m = after;
    return LUGRE_BRISTLE_STIFFNESS_N_M * after + LUGRE_BRISTLE_DAMPING_N_S_M * exp(-(ratio * ratio)) * rise
        + LUGRE_VISCOUS_N_S_M * velocity;
}
#endif

#if HAS_HISTORY
/* History of the motion from the smoothed position, which drags a backlash along: direction, dwell so far, dwell before
   this motion, travel since the last reversal or start over a short and a long distance, time of motion. */
static void add_history(estimator_state *state, double position, float history[HISTORY_FEATURES])
{
    const int32_t before = state->push_direction;
    int pushed = 1;
    double travel;
    if (position > state->backlash_centre_m + HISTORY_EDGE_M) {
        state->backlash_centre_m = position - HISTORY_BACKLASH_M;
        state->push_direction = 1;
    } else if (position < state->backlash_centre_m - HISTORY_EDGE_M) {
        state->backlash_centre_m = position + HISTORY_BACKLASH_M;
        state->push_direction = -1;
    } else {
        pushed = 0;
    }
    if (pushed && (state->push_direction != before || state->dwell_steps > 0u)) {
        state->dwell_before_steps = state->dwell_steps;
        state->moved_from_m = position;
        state->moving_steps = 0u;
    }
    if (pushed) {
        state->moving_left = HISTORY_MOVES_STEPS;
    } else if (state->moving_left > 0u) {
        --state->moving_left;
    }
    if (state->moving_left > 0u) {
        state->dwell_steps = 0u;
        state->moving_steps += state->moving_steps < UINT32_MAX;
    } else {
        state->dwell_steps += state->dwell_steps < UINT32_MAX;
    }
    travel = fabs(position - state->moved_from_m);
#define HISTORY(place, value) history[place] = (float)(((value) - HISTORY_MEAN[place]) / HISTORY_SCALE[place])
    HISTORY(0, (double)state->push_direction);
    HISTORY(1, log1p(STEP_S * (double)state->dwell_steps / HISTORY_DWELL_S));
    HISTORY(2, log1p(STEP_S * (double)state->dwell_before_steps / HISTORY_DWELL_S));
    HISTORY(3, 1.0 - exp(-travel / HISTORY_TRAVEL_SHORT_M));
    HISTORY(4, 1.0 - exp(-travel / HISTORY_TRAVEL_LONG_M));
    HISTORY(5, 1.0 - exp(-STEP_S * (double)state->moving_steps / HISTORY_MOVING_S));
}
#endif

#if HAS_FEATURES
static void make_features(estimator_state *state, const double filtered[ROWS], float features[FEATURES])
{
    int feature;
    for (feature = 0; feature < LINEAR_FEATURES; ++feature) {
        const double value = filtered[FEATURE_ROW[feature]], limit = FEATURE_LIMIT[feature];
        const double soft = limit > 0.0 ? value / (fabs(value) + limit) : value;
        features[feature] = (float)((soft - FEATURE_MEAN[feature]) / FEATURE_SCALE[feature]);
    }
#if HAS_HISTORY
    add_history(state, filtered[HISTORY_ROW], features + LINEAR_FEATURES);
#else
    (void)state;
#endif
}
#endif

#if HAS_NETWORK
/* Network: LSTM layers of NODES nodes; the gates i, o, f, c of all nodes are one row, as wide as whole tiles are. Weights
   lie in the order in which they are read: a layer's bias, tiles of AT_ONCE sources by ACROSS gates, and the sources too
   few for a tile. */
#define AT_ONCE 8
#define ACROSS 16
#define GATES ((4 * NODES + ACROSS - 1) / ACROSS * ACROSS)
#define WIDEST (FEATURES > NODES ? FEATURES : NODES)

/* x P(x^2) / Q(x^2), which is tanh but for 4.2e-7 of it; beyond 9 it no longer changes. */
static float hyperbolic_tangent(float x)
{
    const float y = x < -9.0f ? -9.0f : x > 9.0f ? 9.0f : x;
    const float square = y * y;
    const float p =
        (((1.3234346e-08f * square + 2.0533322e-05f) * square + 0.0034915418f) * square + 0.13377817f) * square + 1.0f;
    const float q =
        (((7.730435e-07f * square + 0.0003278613f) * square + 0.025862204f) * square + 0.46711138f) * square + 1.0f;
    return y * p / q;
}

static float sigmoid(float x)
{
    return 0.5f * hyperbolic_tangent(0.5f * x) + 0.5f;
}

/* Values that decay towards zero would become denormal, and slow on many processors. */
static float flushed(float x)
{
    return x > -1e-30f && x < 1e-30f ? 0.0f : x;
}

/* Adds each source times its weights to the gates, tile by tile. */
static void add_products(float *restrict gates, const float *restrict weights, const float *restrict sources, int count)
{
    int from, gate;
    for (; count >= AT_ONCE; count -= AT_ONCE, sources += AT_ONCE) {
        for (from = 0; from < GATES; from += ACROSS, weights += AT_ONCE * ACROSS) {
            for (gate = 0; gate < ACROSS; ++gate) {
                float total = gates[from + gate];
                total += weights[0 * ACROSS + gate] * sources[0];
                total += weights[1 * ACROSS + gate] * sources[1];
                total += weights[2 * ACROSS + gate] * sources[2];
                total += weights[3 * ACROSS + gate] * sources[3];
                total += weights[4 * ACROSS + gate] * sources[4];
                total += weights[5 * ACROSS + gate] * sources[5];
                total += weights[6 * ACROSS + gate] * sources[6];
                total += weights[7 * ACROSS + gate] * sources[7];
                gates[from + gate] = total;
            }
        }
    }
    for (; count > 0; --count, ++sources, weights += GATES) {
        for (gate = 0; gate < GATES; ++gate) {
            gates[gate] += weights[gate] * sources[0];
        }
    }
}

static void run_layer(const float *weights, int inputs, const float *input, float hidden[NODES], float cell[NODES])
{
    float gates[GATES] ALIGNED;
    float sources[WIDEST + NODES];
    int gate, node;
    memcpy(gates, weights, sizeof gates);
    memcpy(sources, input, (size_t)inputs * sizeof *input);
    memcpy(sources + inputs, hidden, NODES * sizeof *hidden);
    add_products(gates, weights + GATES, sources, inputs + NODES);
    for (gate = 0; gate < 3 * NODES; ++gate) {
        gates[gate] = sigmoid(gates[gate]);
    }
    for (gate = 3 * NODES; gate < 4 * NODES; ++gate) {
        gates[gate] = hyperbolic_tangent(gates[gate]);
    }
    for (node = 0; node < NODES; ++node) {
        cell[node] = flushed(gates[2 * NODES + node] * cell[node] + gates[node] * gates[3 * NODES + node]);
        hidden[node] = flushed(gates[NODES + node] * hyperbolic_tangent(cell[node]));
    }
}

static void run_network(estimator_state *state, const float features[FEATURES])
{
    int layer;
    run_layer(WEIGHTS, FEATURES, features, state->hidden[0], state->cell[0]);
    for (layer = 1; layer < LAYERS; ++layer) {
        const float *weights = WEIGHTS + GATES * (1 + FEATURES + NODES + (layer - 1) * (1 + 2 * NODES));
        run_layer(weights, NODES, state->hidden[layer - 1], state->hidden[layer], state->cell[layer]);
    }
}

#if HAS_HEAD
static float run_head(const float hidden[NODES])
{
    float total = HEAD_BIAS;
    int node;
    for (node = 0; node < NODES; ++node) {
        total += hidden[node] * HEAD[node];
    }
    return total;
}
#endif
#endif

#if HAS_FOREST
/* Forest: SIDE trees walked side by side. A node's content is its threshold as `ordered` makes it; a leaf is its own
   child, and its content is the bits of its value. */
#define SIDE 8

typedef union {
    int32_t bits;
    float value;
} word;

/* Integers in the order of floats; adding 0 makes -0 and 0 the same. */
static int32_t ordered(float x)
{
    word w;
    w.value = x + 0.0f;
    return w.bits < 0 ? w.bits ^ 0x7fffffff : w.bits;
}

static double run_forest(const float inputs[FOREST_INPUTS])
{
    int32_t seen[FOREST_INPUTS + 1];
    double total = 0.0;
    int group, level, k;
    for (k = 0; k < FOREST_INPUTS; ++k) {
        seen[k] = ordered(inputs[k]);
    }
    seen[FOREST_INPUTS] = INT32_MIN; /* what leaves compare with */
    for (group = 0; group < FOREST_GROUPS; ++group) {
        const estimator_node *at[SIDE];
        const int depth = (int)DEPTHS[group];
        for (k = 0; k < SIDE; ++k) {
            at[k] = FOREST + ROOTS[group * SIDE + k];
        }
        for (level = 0; level < depth; ++level) {
            for (k = 0; k < SIDE; ++k) {
                at[k] += at[k]->child + (seen[at[k]->source] > at[k]->content);
            }
        }
        for (k = 0; k < SIDE; ++k) {
            word leaf;
            leaf.bits = at[k]->content;
            total += (double)leaf.value;
        }
    }
    return total;
}
#endif

#if !IS_LUGRE
/* What is corrected, and the corrections of network and forest. */
static double estimate(estimator_state *state, const double filtered[ROWS])
{
    double friction = BASE_N + TARGET_MEAN_N;
#if HAS_FEATURES
    float features[FEATURES];
#endif
#if HAS_HEAD
    float head;
#endif
#if HAS_FOREST
    float inputs[FOREST_INPUTS];
    int index;
    float *next = inputs;
#endif
#if HAS_FEATURES
    make_features(state, filtered, features);
#else
    (void)state;
    (void)filtered;
#endif
#if HAS_NETWORK
    run_network(state, features);
#endif
#if HAS_HEAD
    head = run_head(state->hidden[LAYERS - 1]);
#endif
#if HEAD_COUNTS
    friction += TARGET_SCALE_N * (double)head;
#endif
#if HAS_FOREST
#if FOREST_SEES_HIDDEN
    for (index = 0; index < NODES; ++index) {
        *next++ = state->hidden[LAYERS - 1][index];
    }
#endif
#if FOREST_SEES_HEAD
    *next++ = head;
#endif
#if FOREST_SEES_FEATURES
    for (index = 0; index < FEATURES; ++index) {
        *next++ = features[index];
    }
#endif
    friction += TARGET_SCALE_N * run_forest(inputs);
#endif
    return friction;
}
#endif

#if HAS_LOAD
/* The value of a table over positions; in straight lines between its places, held beyond the ends. */
static double table_at(const double *table, const double sample[CHANNELS])
{
    double part[LOAD_AXES], corner[1 << LOAD_AXES];
    int axis, at, begin = 0;
    for (axis = 0; axis < LOAD_AXES; ++axis) {
        const double last = (double)(LOAD_PLACES[axis] - 1);
        double place = (sample[LOAD_COLUMN[axis]] - LOAD_FIRST_M[axis]) * LOAD_PER_METRE[axis];
        int index;
        place = place > 0.0 ? place : 0.0;
        place = place < last ? place : last;
        index = (int)place;
        index = index < LOAD_PLACES[axis] - 2 ? index : LOAD_PLACES[axis] - 2;
        part[axis] = place - (double)index;
        begin += index * LOAD_STRIDE[axis];
    }
    for (at = 0; at < 1 << LOAD_AXES; ++at) { /* the last axis is the lowest bit */
        int place = begin;
        for (axis = 0; axis < LOAD_AXES; ++axis) {
            place += ((at >> (LOAD_AXES - 1 - axis)) & 1) * LOAD_STRIDE[axis];
        }
        corner[at] = table[place];
    }
    for (axis = LOAD_AXES - 1; axis >= 0; --axis) {
        for (at = 0; at < 1 << axis; ++at) {
            corner[at] = corner[2 * at] + part[axis] * (corner[2 * at + 1] - corner[2 * at]);
        }
    }
    return corner[0];
}
#endif

#if HAS_LINES
/* Pressures in the chambers: what the lines to them lose at the causal velocity is taken off those of the sensors. */
static void to_chambers(const estimator_state *state, const double sample[CHANNELS], double chamber[CHANNELS])
{
    const double *before = state->window[POSITION] + state->cursor;
    double velocity = 0.0;
    int lag, line;
    for (lag = 1; lag < LINE_LAGS; ++lag) {
        velocity += LINE_TAPS[lag] * (before[lag - 1] - sample[POSITION]);
    }
    memcpy(chamber, sample, CHANNELS * sizeof *chamber);
    for (line = 0; line < LINES; ++line) {
        const double along = LINE_SIGN[line] * velocity;
        const double speed = fabs(along);
        double lost = LINE_LAMINAR[line] * speed + LINE_SQUARE[line] * speed * speed;
        if (speed > LINE_TURBULENT_FROM_M_S[line]) {
            const double turbulent = LINE_TURBULENT[line] * speed * sqrt(speed) * sqrt(sqrt(speed));
            lost = turbulent > lost ? turbulent : lost;
        }
        chamber[LINE_CHANNEL[line]] -= along > 0.0 ? lost : -lost;
    }
}
#endif

/* Puts a sample into the windows; each value is kept twice, so that the last LAGS values always lie in one piece. */
static void push(estimator_state *state, const double sample[CHANNELS])
{
    int channel;
    state->cursor = state->cursor == 0u ? LAGS - 1u : state->cursor - 1u;
    for (channel = 0; channel < CHANNELS; ++channel) {
        state->window[channel][state->cursor] = sample[channel];
        state->window[channel][state->cursor + LAGS] = sample[channel];
    }
}

static void begin(estimator_state *state, const double sample[CHANNELS])
{
    int channel, lag;
    state->ready = 1u;
    state->warming = WARM_UP_SAMPLES;
    for (channel = 0; channel < CHANNELS; ++channel) {
        state->held[channel] = sample[channel];
        for (lag = 0; lag < 2 * LAGS; ++lag) {
            state->window[channel][lag] = sample[channel];
        }
    }
#if PRESSURES > 0
    for (channel = 0; channel < PRESSURES; ++channel) {
        state->constant_from_m[channel] = sample[POSITION];
    }
#endif
}

/* Follows how long each channel has been constant; a held value is not the sensor's and starts afresh. */
static int is_frozen(estimator_state *state, const double sample[CHANNELS], const int invalid[INPUTS], double base_n)
{
    int frozen = 0;
#if PRESSURES > 0
    int index;
    for (index = 0; index < PRESSURES; ++index) {
        const int channel = PRESSURE[index];
        if (invalid[channel] || sample[channel] != state->held[channel]) {
            state->constant_from_m[index] = sample[POSITION];
            state->frozen[index] = 0u;
        } else if (fabs(sample[POSITION] - state->constant_from_m[index]) > FREEZE_TRAVEL_M) {
            state->frozen[index] = 1u;
        }
        frozen |= (int)state->frozen[index];
    }
#endif
    if (invalid[POSITION] || sample[POSITION] != state->held[POSITION]) {
        state->constant_samples = 0u;
    } else if (state->constant_samples <= FREEZE_SAMPLES) {
        ++state->constant_samples;
    }
    return frozen || (state->constant_samples > FREEZE_SAMPLES && fabs(base_n) > FREEZE_FORCE_N);
}

static uint32_t trust(estimator_state *state, int bad)
{
    uint32_t flags = 0u;
    if (state->warming > 0u) {
        --state->warming;
        flags |= FLAG_WARMING;
    }
    if (bad) {
        state->recovering = RECOVERY_SAMPLES;
    } else if (state->recovering > 0u) {
        --state->recovering;
        flags |= FLAG_RECOVERING;
    }
    return flags;
}

/* Regimes of motion: 0 standstill, 1 creep, 2 sliding, 3 just after a reversal or start. */
static int next_regime(estimator_state *state, double velocity_m_s)
{
    const int32_t now = velocity_m_s >= STANDSTILL_M_S ? 1 : velocity_m_s <= -STANDSTILL_M_S ? -1 : 0;
    if (now != 0 && now != state->direction) {
        state->reversal_left = REVERSAL_SAMPLES;
    }
    state->direction = now;
    if (state->reversal_left > 0u) {
        --state->reversal_left;
        return 3;
    }
    return now == 0 ? 0 : fabs(velocity_m_s) < CREEP_M_S ? 1 : 2;
}

#if HAS_FORCE_LIMITS
/* Beyond its lines over the sum of the pressures, the force balance holds a force that is not modelled; that is taken to
   remain until the piston has moved a while. The first two lines enclose the balance along the motion while the piston
   slides, the third its size otherwise. A smaller sum of the pressures than the least is no pascal, or none of a cylinder
   at work. */
static uint32_t unmodelled_force(estimator_state *state, const double sample[CHANNELS], int regime)
{
    double force = 0.0, pressure = 0.0, along;
    int channel, within;
    for (channel = 0; channel < CHANNELS; ++channel) {
        force += FORCE_OF[channel] * sample[channel];
        pressure += SUMMED[channel] * sample[channel];
    }
    along = (double)state->direction * force;
    within = LINE_N[0] + LINE_SLOPE[0] * pressure <= along && along <= LINE_N[1] + LINE_SLOPE[1] * pressure;
    if (regime == 2 ? !within : fabs(force) > LINE_N[2] + LINE_SLOPE[2] * pressure) {
        state->unmodelled = CLEAR_SAMPLES;
    } else if (state->unmodelled == 0u) {
        return pressure < LEAST_PRESSURE_PA ? FLAG_UNMODELLED_FORCE : 0u;
    } else if (within && (regime == 1 || regime == 2)) {
        --state->unmodelled;
    }
    return FLAG_UNMODELLED_FORCE;
}
#endif

#if LEARNS_OFFSET
/* The offset of the sensors' zeros in friction [N], learned while the cylinder slides. Friction changes its sign with
   the direction of motion, a zero does not: over steady sliding, averaged in blocks, the force balance is

     direction * g + h + offset + asymmetry + scale * direction * |g| + slope * direction * |g| * speed + stroke + noise

   with friction g and its asymmetry h as known from training. A Kalman filter follows the five others, in this order;
   the stroke's error begins anew with each stroke. Rest does not count: friction may be any up to breakaway there. What
   is learned corrects the next sample. */
#define OWN 5
#define EXTENDED 1u
#define RETRACTED 2u

static void begin_offset(estimator_state *state, double offset_n, double uncertainty_n)
{
    /* Comparisons with NaN are false. */
    const int possible = fabs(offset_n) <= OFFSET_LIMIT_N && uncertainty_n <= OFFSET_LIMIT_N;
    int own;
    for (own = 0; own < OWN; ++own) {
        state->own_covariance[own][own] = STATED_VARIANCE[own];
    }
    if (possible) {
        state->own[0] = offset_n;
    }
    if (possible && uncertainty_n >= 0.0) {
        /* What is stated of it is what was given, but for what all sessions share. */
        const double variance = uncertainty_n * uncertainty_n - COMMON_VARIANCE;
        state->own_covariance[0][0] = (variance > 0.0 ? variance : 0.0) / CAUTION_SQUARE;
        state->directions = EXTENDED | RETRACTED;
    }
}

/* Whether friction is like that of training. If it is not, zeros cannot be separated from it and are left alone. */
static int offset_supported(const estimator_state *state)
{
    const double scale = state->own[2], slope = state->own[3];
    return SCALE_SUPPORT * scale * scale + SLOPE_SUPPORT * slope * slope <= 1.0;
}

static double learned_offset(const estimator_state *state)
{
    return offset_supported(state) ? state->own[0] : 0.0;
}

static double offset_uncertainty(const estimator_state *state)
{
    const double variance = state->own_covariance[0][0];
    const double most = variance > LARGEST_VARIANCE ? variance : LARGEST_VARIANCE;
    const double careful = CAUTION_SQUARE * variance;
    const double stated = offset_supported(state) ? (careful < most ? careful : most) : LARGEST_VARIANCE;
    return sqrt(stated + COMMON_VARIANCE);
}

/* The factor by which an unknown offset widens the bounds. */
static double further(const estimator_state *state, int regime)
{
    double ratio;
    if (!(SPREAD_N[regime] > 0.0)) {
        return 1.0;
    }
    ratio = offset_uncertainty(state) / SPREAD_N[regime];
    return sqrt(1.0 + ratio * ratio);
}

static void take_offset_off(double offset_n, double filtered[ROWS])
{
#define ZERO(row, zero) filtered[row] -= offset_n * (zero);
    ZEROS(ZERO)
}

static double block_mean(const estimator_state *state, const double of[CHANNELS])
{
    double total = 0.0;
    int channel;
    for (channel = 0; channel < CHANNELS; ++channel) {
        total += of[channel] * state->block_sums[channel];
    }
    return total / (double)state->block_samples;
}

static void clear_block(estimator_state *state)
{
    state->block_samples = 0u;
    state->block_velocity_m_s = 0.0;
    memset(state->block_sums, 0, sizeof state->block_sums);
}

static void begin_stroke(estimator_state *state, int32_t direction)
{
    int own;
    state->stroke_direction = direction;
    state->stroke_samples = 0u;
    state->own[OWN - 1] = 0.0;
    for (own = 0; own < OWN; ++own) {
        state->own_covariance[OWN - 1][own] = 0.0;
        state->own_covariance[own][OWN - 1] = 0.0;
    }
    state->own_covariance[OWN - 1][OWN - 1] = STROKE_VARIANCE;
    clear_block(state);
}

/* g [N] but for what varies with position: coefficients of pressure p, its root, speed, its logarithm l, l * l, load and
   |load|; then, times temperature, of 1, temperature, p, root, speed, l and l * l. */
static double known_friction(double pressure, double speed, double load, double warm)
{
    const double root = sqrt(pressure > 0.0 ? pressure : 0.0);
    const double logarithm = log(speed > 1e-12 ? speed : 1e-12);
    const double square = logarithm * logarithm;
    double cold = KNOWN[0] * pressure + KNOWN[1] * root + KNOWN[2] * speed + KNOWN[3] * logarithm;
    double changing = KNOWN[7] + KNOWN[8] * warm + KNOWN[9] * pressure + KNOWN[10] * root;
    cold += KNOWN[4] * square + KNOWN[5] * load + KNOWN[6] * fabs(load);
    changing += KNOWN[11] * speed + KNOWN[12] * logarithm + KNOWN[13] * square;
    return cold + warm * changing;
}

/* The rest of g [N]: a polynomial in the position over its half range. */
static double friction_along(double position_m)
{
    double along = (2.0 * position_m - FIRST_POSITION_M - LAST_POSITION_M) / SPAN_M;
    double total = 0.0;
    int power;
    along = along < -1.0 ? -1.0 : along > 1.0 ? 1.0 : along;
    for (power = POWERS - 1; power >= 0; --power) {
        total = total * along + ALONG[power];
    }
    return total;
}

/* The Kalman filter's step for one number [N] that was not known from training. Returns 0 and changes nothing if it is
   further from what was expected than LARGEST_SURPRISE standard deviations, the stated zeros' among them: a saturated
   sensor or an end stop is no offset. */
static int update_own(estimator_state *state, double left, const double explains[OWN])
{
    double gain[OWN];
    double variance = NOISE_VARIANCE;
    int row, column;
    for (row = 0; row < OWN; ++row) {
        gain[row] = 0.0;
        for (column = 0; column < OWN; ++column) {
            gain[row] += state->own_covariance[row][column] * explains[column];
        }
        variance += explains[row] * gain[row];
        left -= explains[row] * state->own[row];
    }
    if (left * left > LARGEST_SURPRISE * LARGEST_SURPRISE * (variance + LARGEST_VARIANCE)) {
        return 0;
    }
    for (row = 0; row < OWN; ++row) {
        state->own[row] += gain[row] * left / variance;
        for (column = 0; column < OWN; ++column) {
            state->own_covariance[row][column] -= gain[row] * gain[column] / variance;
        }
    }
    return 1;
}

/* Lets what the session has of its own explain a block's mean force balance. */
static void take_block(estimator_state *state, double velocity_m_s)
{
    const double direction = (double)state->stroke_direction;
    const double samples = (double)state->block_samples;
    const double speed = direction * state->block_velocity_m_s / samples;
    const double ranged[4] = {block_mean(state, PRESSURE_OF), speed, block_mean(state, LOAD_OF),
                            block_mean(state, TEMPERATURE_OF) - REFERENCE_C};
    const double balance = block_mean(state, BALANCE_OF)
        - MASS_KG * ((velocity_m_s - state->block_first_m_s) / DURATION_S);
    const double even = EVEN_CONSTANT_N + EVEN_PRESSURE * ranged[0];
    double explains[OWN] = {1.0, 0.0, 0.0, 0.0, 1.0};
    double known, level, first_level_n;
    uint32_t directions;
    int each;
    for (each = 0; each < 4; ++each) {
        if (ranged[each] < LOWEST[each] || ranged[each] > HIGHEST[each]) {
            return;
        }
    }
    known = known_friction(ranged[0], speed, ranged[2], ranged[3])
        + friction_along(state->block_sums[POSITION] / samples);
    /* Until both directions were seen the level is the first block's: one that varies would seem to separate the scale
       from the offset, though by no more than the known friction is right. */
    directions = state->directions;
    first_level_n = state->level_n;
    level = fabs(direction * known);
    state->directions |= state->stroke_direction > 0 ? EXTENDED : RETRACTED;
    state->level_n = state->level_n == 0.0 ? level : state->level_n;
    level = state->directions == (EXTENDED | RETRACTED) ? level : state->level_n;
    explains[1] = level;
    explains[2] = direction * level;
    explains[3] = explains[2] * (speed - SPEED_MEAN) / SPEED_DEVIATION;
    if (!update_own(state, balance - direction * known - even, explains)) {
        state->directions = directions;
        state->level_n = first_level_n;
    }
}

static void learn_offset(estimator_state *state, double velocity_m_s, const double sample[CHANNELS], int valid)
{
    const int32_t moving = velocity_m_s >= SLOWEST_M_S ? 1 : velocity_m_s <= -SLOWEST_M_S ? -1 : 0;
    const int32_t direction = valid ? moving : 0;
    int channel;
    state->own_covariance[0][0] += WALK;
    if (direction != state->stroke_direction) {
        begin_stroke(state, direction);
    }
    if (state->stroke_samples <= SETTLING_SAMPLES) {
        ++state->stroke_samples;
    }
    if (direction == 0 || state->stroke_samples <= SETTLING_SAMPLES) {
        return;
    }
    if (state->block_samples == 0u) {
        state->block_first_m_s = velocity_m_s;
    }
    ++state->block_samples;
    state->block_velocity_m_s += velocity_m_s;
    for (channel = 0; channel < CHANNELS; ++channel) {
        state->block_sums[channel] += sample[channel];
    }
    if (state->block_samples >= BLOCK_SAMPLES) {
        take_block(state, velocity_m_s);
        clear_block(state);
    }
}
#endif

void NAMED(init)(estimator_state *state)
{
    memset(state, 0, sizeof *state);
#if LEARNS_OFFSET
    begin_offset(state, 0.0, -1.0);
#endif
}

void NAMED(reset)(estimator_state *state)
{
    NAMED(init)(state);
}

#if LEARNS_OFFSET
void NAMED(reset_from)(estimator_state *state, estimator_real offset_n, estimator_real uncertainty_n)
{
    memset(state, 0, sizeof *state);
    begin_offset(state, (double)offset_n, (double)uncertainty_n);
}

estimator_real NAMED(offset_n)(const estimator_state *state)
{
    return (estimator_real)learned_offset(state);
}

estimator_real NAMED(offset_uncertainty_n)(const estimator_state *state)
{
    return (estimator_real)offset_uncertainty(state);
}
#endif

void NAMED(warm_up)(estimator_state *state, SAMPLE_PARAMETERS, uint32_t steps)
{
    estimator_output ignored;
    NAMED(init)(state);
    for (; steps > 0u; --steps) {
        NAMED(step)(state, SAMPLE_NAMES, &ignored);
    }
}

void NAMED(step)(estimator_state *state, SAMPLE_PARAMETERS, estimator_output *output)
{
#if HAS_CORRECTIONS
    const double reading[INPUTS] = {SAMPLES};
    double given[INPUTS];
#else
    const double given[INPUTS] = {SAMPLES};
#endif
    const double *window[CHANNELS];
    double sample[CHANNELS];
#if HAS_LINES
    double chamber[CHANNELS];
#else
    const double *const chamber = sample;
#endif
    double filtered[ROWS];
    double friction_n;
    double wider = 1.0;
    int invalid[INPUTS];
    uint32_t flags = 0u, outside = 0u;
    int channel, regime, first, frozen = 0, bad = 0;
#if HAS_CORRECTIONS
    for (channel = 0; channel < INPUTS; ++channel) {
        given[channel] = SIGN[channel] * (reading[channel] - ZERO_READING[channel]);
    }
#endif
    for (channel = 0; channel < INPUTS; ++channel) {
        /* Comparisons with NaN are false. */
        invalid[channel] = !(given[channel] >= ACCEPT_LOWER[channel] && given[channel] <= ACCEPT_UPPER[channel]);
        flags |= (uint32_t)invalid[channel] * INVALID[channel];
        bad |= invalid[channel];
    }
    first = !state->ready;
    if (first && bad) {
        output->friction_n = (estimator_real)0.0;
        output->lower_n = (estimator_real)0.0;
        output->upper_n = (estimator_real)0.0;
        output->flags = flags | FLAG_NOT_READY;
        return;
    }
    for (channel = 0; channel < INPUTS; ++channel) {
        sample[channel] = invalid[channel] ? state->held[channel] : given[channel];
        outside |= (uint32_t)(sample[channel] < TRAINED_LOWER[channel] || sample[channel] > TRAINED_UPPER[channel]);
    }
#if HAS_LOAD
    sample[INPUTS] = table_at(LOAD_N, sample);
#if LOAD_IS_UNKNOWN
    outside |= (uint32_t)(table_at(LOAD_UNKNOWN, sample) > 0.5);
#endif
#endif
    if (first) {
        begin(state, sample);
    }
#if HAS_LINES
    to_chambers(state, sample, chamber);
#endif
    push(state, chamber);
    for (channel = 0; channel < CHANNELS; ++channel) {
        window[channel] = state->window[channel] + state->cursor;
    }
    filter_samples(window, filtered);
#if LEARNS_OFFSET
    take_offset_off(learned_offset(state), filtered);
#endif
#if IS_LUGRE
    if (first) {
        state->backlash_centre_m = filtered[LUGRE_POSITION_ROW];
    }
#elif HAS_HISTORY
    if (first) {
        state->backlash_centre_m = filtered[HISTORY_ROW];
        state->moved_from_m = filtered[HISTORY_ROW];
    }
#endif
    frozen = is_frozen(state, sample, invalid, BASE_N);
    memcpy(state->held, sample, sizeof sample);
    flags |= outside * FLAG_OUTSIDE | (uint32_t)frozen * FLAG_FROZEN;
    flags |= trust(state, frozen || bad);
    friction_n = estimate(state, filtered);
    regime = next_regime(state, filtered[VELOCITY_ROW]);
#if HAS_FORCE_LIMITS
    flags |= unmodelled_force(state, chamber, regime);
    bad |= (flags & FLAG_UNMODELLED_FORCE) != 0u;
#endif
#if LEARNS_OFFSET
    wider = further(state, regime);
    flags |= state->directions == (EXTENDED | RETRACTED) && offset_supported(state) ? 0u : FLAG_OFFSET_UNKNOWN;
    learn_offset(state, filtered[VELOCITY_ROW], chamber, !(frozen || bad));
#endif
    output->friction_n = (estimator_real)friction_n;
    output->lower_n = (estimator_real)(friction_n + wider * LOWER_N[regime]);
    output->upper_n = (estimator_real)(friction_n + wider * UPPER_N[regime]);
    output->flags = flags;
}
