/* A host in C: two instances, a state saved, stored, restored and freed, refusals. Ends with 0 where all holds. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2_types.h"
#include "fmu_model.h"

fmi2Component fmi2Instantiate(fmi2String, fmi2Type, fmi2String, fmi2String, const fmi2CallbackFunctions *, fmi2Boolean,
                              fmi2Boolean);
void fmi2FreeInstance(fmi2Component);
fmi2Status fmi2EnterInitializationMode(fmi2Component);
fmi2Status fmi2ExitInitializationMode(fmi2Component);
fmi2Status fmi2SetReal(fmi2Component, const fmi2ValueReference[], size_t, const fmi2Real[]);
fmi2Status fmi2GetReal(fmi2Component, const fmi2ValueReference[], size_t, fmi2Real[]);
fmi2Status fmi2GetFMUstate(fmi2Component, fmi2FMUstate *);
fmi2Status fmi2SetFMUstate(fmi2Component, fmi2FMUstate);
fmi2Status fmi2FreeFMUstate(fmi2Component, fmi2FMUstate *);
fmi2Status fmi2SerializedFMUstateSize(fmi2Component, fmi2FMUstate, size_t *);
fmi2Status fmi2SerializeFMUstate(fmi2Component, fmi2FMUstate, fmi2Byte[], size_t);
fmi2Status fmi2DeSerializeFMUstate(fmi2Component, const fmi2Byte[], size_t, fmi2FMUstate *);
fmi2Status fmi2DoStep(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean);
fmi2Status fmi2Reset(fmi2Component);

static int refusals;

static void logger(fmi2ComponentEnvironment e, fmi2String name, fmi2Status s, fmi2String c, fmi2String message, ...)
{
    (void)e;
    (void)name;
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

static double friction_after(fmi2Component c, int from, int to)
{
    const fmi2ValueReference inputs[] = {FMU_VR_FIRST_INPUT, FMU_VR_FIRST_INPUT + 1, FMU_VR_FIRST_INPUT + 2};
    const fmi2ValueReference output = FMU_VR_FRICTION;
    double friction_n = 0.0;
    for (int i = from; i < to; i++) {
        const double sample[] = {8e5 + 1e4 * (i % 7), 9e5 - 1e3 * (i % 5),
                                 i == 20 ? (double)(0.0f / 0.0f) : 0.1 + 1e-5 * i};
        expect(fmi2SetReal(c, inputs, 3, sample) == fmi2OK, "set");
        expect(fmi2DoStep(c, i * FMU_MODEL_SAMPLE_TIME_S, FMU_MODEL_SAMPLE_TIME_S, 1) == fmi2OK, "step");
    }
    expect(fmi2GetReal(c, &output, 1, &friction_n) == fmi2OK, "get");
    return friction_n;
}

int main(void)
{
    const fmi2CallbackFunctions callbacks = {logger, NULL, NULL, NULL, NULL};
    fmi2Component one = fmi2Instantiate("one", fmi2CoSimulation, FMU_MODEL_TOKEN, "", &callbacks, 0, 0);
    fmi2Component two = fmi2Instantiate("two", fmi2CoSimulation, FMU_MODEL_TOKEN, "", &callbacks, 0, 0);
    fmi2FMUstate saved = NULL, read = NULL;
    size_t size = 0;
    char *bytes;
    double expected_n;
    expect(one != NULL && two != NULL, "instantiate");
    expect(fmi2Instantiate("three", fmi2CoSimulation, "another", "", &callbacks, 0, 0) == NULL, "token");
    expect(fmi2EnterInitializationMode(one) == fmi2OK && fmi2ExitInitializationMode(one) == fmi2OK, "initialize");
    (void)friction_after(one, 0, 30);
    expect(fmi2GetFMUstate(one, &saved) == fmi2OK && fmi2SerializedFMUstateSize(one, saved, &size) == fmi2OK, "save");
    bytes = malloc(size);
    expect(bytes != NULL && fmi2SerializeFMUstate(one, saved, bytes, size) == fmi2OK, "store");
    expect(fmi2SerializeFMUstate(one, saved, bytes, size - 1) == fmi2Error, "too little room");
    expected_n = friction_after(one, 30, 60);
    expect(fmi2DeSerializeFMUstate(two, bytes, size, &read) == fmi2OK && fmi2SetFMUstate(two, read) == fmi2OK, "read");
    expect(friction_after(two, 30, 60) == expected_n, "another instance goes on alike");
    expect(fmi2SetFMUstate(one, saved) == fmi2OK && friction_after(one, 30, 60) == expected_n, "going back");
    expect(fmi2DoStep(one, 60 * FMU_MODEL_SAMPLE_TIME_S, 2.0 * FMU_MODEL_SAMPLE_TIME_S, 1) == fmi2Error, "wrong step");
    expect(fmi2FreeFMUstate(one, &saved) == fmi2OK && saved == NULL && fmi2FreeFMUstate(two, &read) == fmi2OK, "free");
    expect(fmi2Reset(one) == fmi2OK && refusals == 3, "every refusal is logged");
    expect(fmi2DoStep(NULL, 0.0, FMU_MODEL_SAMPLE_TIME_S, 1) == fmi2Error, "no instance");
    free(bytes);
    fmi2FreeInstance(one);
    fmi2FreeInstance(two);
    fmi2FreeInstance(NULL);
    return 0;
}
