/* A day of samples through an exported estimator: drift against a fresh start, time of holds and of motion.

   Usage: c_day SAMPLES STEPS    SAMPLES: rows of three doubles: pressure 1 [Pa], pressure 2 [Pa], position [m]. */
#define _POSIX_C_SOURCE 199309L
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "friction.h"

#define FRESH_STEPS 20000 /* what the fresh instance sees before the two are compared */
#define HOLD_EVERY 720000 /* an hour */
#define HOLD_STEPS 120000 /* ten minutes on one sample */
#define BLOCK 1000

typedef struct {
    double least, most, sum;
    long blocks;
} timing;

static double now_ns(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return 1e9 * (double)time.tv_sec + (double)time.tv_nsec;
}

static void note(timing *into, double ns)
{
    into->least = into->blocks == 0 || ns < into->least ? ns : into->least;
    into->most = ns > into->most ? ns : into->most;
    into->sum += ns;
    ++into->blocks;
}

static void print_timing(const char *what, const timing *measured)
{
    printf("%-22s mean %7.1f ns a step, blocks of %d from %.1f to %.1f ns\n", what,
           measured->sum / (double)measured->blocks, BLOCK, measured->least, measured->most);
}

/* The sample of a step: the recordings over and over, and in each hour ten minutes on one of their samples. */
static long row_at(long step, long rows)
{
    const long in_hour = step % HOLD_EVERY;
    return (in_hour < HOLD_STEPS ? step - in_hour : step) % rows;
}

int main(int argc, char **argv)
{
    static friction_state day, fresh;
    friction_output now, then;
    timing first = {0}, last = {0}, hold = {0};
    double worst = 0.0, difference_sum = 0.0, began = 0.0, *samples;
    long rows, step, steps, bad = 0, above = 0;
    FILE *file = argc == 3 ? fopen(argv[1], "rb") : NULL;
    if (file == NULL) {
        fprintf(stderr, "usage: c_day SAMPLES STEPS\n");
        return 1;
    }
    steps = atol(argv[2]);
    fseek(file, 0, SEEK_END);
    rows = ftell(file) / (long)(3 * sizeof *samples);
    rewind(file);
    samples = malloc((size_t)rows * 3 * sizeof *samples);
    if (samples == NULL || fread(samples, 3 * sizeof *samples, (size_t)rows, file) != (size_t)rows) {
        fprintf(stderr, "%s: cannot be read\n", argv[1]);
        return 1;
    }
    fclose(file);
    friction_init(&day);
    friction_init(&fresh);
    for (step = 0; step < steps; ++step) {
        const double *row = samples + 3 * row_at(step, rows);
        const long in_hour = step % HOLD_EVERY;
        if (step % BLOCK == 0) {
            began = now_ns();
        }
        friction_step(&day, (friction_real)row[0], (friction_real)row[1], (friction_real)row[2], &now);
        bad += !isfinite(now.friction_n);
        if (step % BLOCK == BLOCK - 1) {
            const double ns = (now_ns() - began) / BLOCK;
            if (in_hour >= HOLD_STEPS / 2 && in_hour < HOLD_STEPS) {
                note(&hold, ns);
            } else if (in_hour > HOLD_STEPS && step < HOLD_EVERY) {
                note(&first, ns);
            } else if (in_hour > HOLD_STEPS && step >= steps - HOLD_EVERY) {
                note(&last, ns);
            }
        }
    }
    for (step = steps; step < steps + 2 * FRESH_STEPS; ++step) {
        const double *row = samples + 3 * (step % rows);
        friction_step(&day, (friction_real)row[0], (friction_real)row[1], (friction_real)row[2], &now);
        friction_step(&fresh, (friction_real)row[0], (friction_real)row[1], (friction_real)row[2], &then);
        if (step >= steps + FRESH_STEPS) {
            const double difference = fabs((double)now.friction_n - (double)then.friction_n);
            worst = difference > worst ? difference : worst;
            difference_sum += difference;
            above += difference > 0.5;
        }
    }
    printf("%ld steps, %ld of them not a number\n", steps, bad);
    printf("difference from a fresh start, after its first %d steps: mean %.3g N, greatest %.3g N, above 0.5 N in %.3f %%\n",
           FRESH_STEPS, difference_sum / FRESH_STEPS, worst, 100.0 * (double)above / FRESH_STEPS);
    print_timing("motion, first hour", &first);
    print_timing("motion, last hour", &last);
    print_timing("holds, from minute 5", &hold);
    free(samples);
    return 0;
}
