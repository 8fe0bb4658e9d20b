/* A host in C: two instances, a state saved, stored, restored and freed, refusals. Ends with 0 where all holds. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3_types.h"
#include "fmu_model.h"

fmi3Instance fmi3InstantiateCoSimulation(fmi3String, fmi3String, fmi3String, fmi3Boolean, fmi3Boolean, fmi3Boolean,
                                         fmi3Boolean, const fmi3ValueReference[], size_t, fmi3InstanceEnvironment,
                                         fmi3LogMessageCallback, fmi3IntermediateUpdateCallback);
void fmi3FreeInstance(fmi3Instance);
fmi3Status fmi3EnterInitializationMode(fmi3Instance, fmi3Boolean, fmi3Float64, fmi3Float64, fmi3Boolean, fmi3Float64);
fmi3Status fmi3ExitInitializationMode(fmi3Instance);
fmi3Status fmi3SetFloat64(fmi3Instance, const fmi3ValueReference[], size_t, const fmi3Float64[], size_t);
fmi3Status fmi3GetFloat64(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Float64[], size_t);
fmi3Status fmi3GetFMUState(fmi3Instance, fmi3FMUState *);
fmi3Status fmi3SetFMUState(fmi3Instance, fmi3FMUState);
fmi3Status fmi3FreeFMUState(fmi3Instance, fmi3FMUState *);
fmi3Status fmi3SerializedFMUStateSize(fmi3Instance, fmi3FMUState, size_t *);
fmi3Status fmi3SerializeFMUState(fmi3Instance, fmi3FMUState, fmi3Byte[], size_t);
fmi3Status fmi3DeserializeFMUState(fmi3Instance, const fmi3Byte[], size_t, fmi3FMUState *);
fmi3Status fmi3DoStep(fmi3Instance, fmi3Float64, fmi3Float64, fmi3Boolean, fmi3Boolean *, fmi3Boolean *, fmi3Boolean *,
                      fmi3Float64 *);
fmi3Status fmi3Reset(fmi3Instance);
fmi3Status fmi3GetClock(fmi3Instance, const fmi3ValueReference[], size_t, fmi3Clock[]);

static int refusals;

static void logger(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String message)
{
    (void)e;
    (void)s;
    (void)c;
    refusals += message[0] != '\0';
}

static void expect(int holds, const char *what)
{
    if (!holds) {
        puts(what);
        exit(1);
    }
}

static fmi3Instance instantiate(const char *name, const char *token)
{
    return fmi3InstantiateCoSimulation(name, token, "", false, false, false, false, NULL, 0, NULL, logger, NULL);
}

static fmi3Status step(fmi3Instance c, double point_s, double step_s)
{
    fmi3Boolean event, end, early;
    fmi3Float64 last_s;
    return fmi3DoStep(c, point_s, step_s, true, &event, &end, &early, &last_s);
}

static double friction_after(fmi3Instance c, int from, int to)
{
    const fmi3ValueReference inputs[] = {FMU_VR_FIRST_INPUT, FMU_VR_FIRST_INPUT + 1, FMU_VR_FIRST_INPUT + 2};
    const fmi3ValueReference output = FMU_VR_FRICTION;
    double friction_n = 0.0;
    for (int i = from; i < to; i++) {
        const double sample[] = {8e5 + 1e4 * (i % 7), 9e5 - 1e3 * (i % 5),
                                 i == 20 ? (double)(0.0f / 0.0f) : 0.1 + 1e-5 * i};
        expect(fmi3SetFloat64(c, inputs, 3, sample, 3) == fmi3OK, "set");
        expect(step(c, i * FMU_MODEL_SAMPLE_TIME_S, FMU_MODEL_SAMPLE_TIME_S) == fmi3OK, "step");
    }
    expect(fmi3GetFloat64(c, &output, 1, &friction_n, 1) == fmi3OK, "get");
    return friction_n;
}

int main(void)
{
    fmi3Instance one = instantiate("one", FMU_MODEL_TOKEN);
    fmi3Instance two = instantiate("two", FMU_MODEL_TOKEN);
    fmi3FMUState saved = NULL, read = NULL;
    size_t size = 0;
    fmi3Byte *bytes;
    double expected_n;
    expect(one != NULL && two != NULL, "instantiate");
    expect(instantiate("three", "another") == NULL, "token");
    expect(fmi3EnterInitializationMode(one, false, 0.0, 0.0, false, 0.0) == fmi3OK &&
               fmi3ExitInitializationMode(one) == fmi3OK,
           "initialize");
    (void)friction_after(one, 0, 30);
    expect(fmi3GetFMUState(one, &saved) == fmi3OK && fmi3SerializedFMUStateSize(one, saved, &size) == fmi3OK, "save");
    bytes = malloc(size);
    expect(bytes != NULL && fmi3SerializeFMUState(one, saved, bytes, size) == fmi3OK, "store");
    expect(fmi3SerializeFMUState(one, saved, bytes, size - 1) == fmi3Error, "too little room");
    expected_n = friction_after(one, 30, 60);
    expect(fmi3DeserializeFMUState(two, bytes, size, &read) == fmi3OK && fmi3SetFMUState(two, read) == fmi3OK, "read");
    expect(friction_after(two, 30, 60) == expected_n, "another instance goes on alike");
    expect(fmi3SetFMUState(one, saved) == fmi3OK && friction_after(one, 30, 60) == expected_n, "going back");
    expect(step(one, 60 * FMU_MODEL_SAMPLE_TIME_S, 2.0 * FMU_MODEL_SAMPLE_TIME_S) == fmi3Error, "wrong step");
    expect(fmi3FreeFMUState(one, &saved) == fmi3OK && saved == NULL && fmi3FreeFMUState(two, &read) == fmi3OK, "free");
    expect(fmi3Reset(one) == fmi3OK && fmi3GetClock(one, NULL, 0, NULL) == fmi3Error && refusals == 4,
           "every refusal is logged");
    expect(step(NULL, 0.0, FMU_MODEL_SAMPLE_TIME_S) == fmi3Error, "no instance");
    free(bytes);
    fmi3FreeInstance(one);
    fmi3FreeInstance(two);
    fmi3FreeInstance(NULL);
    return 0;
}
