/* FMI 2.0 for co-simulation around the estimator. */
#include "fmi2_types.h"
#include "fmu_instance.h"
#include "fmu_states.h"

/* Prototypes before definitions, so that no compiler asks for them. */
#define FUNCTION(result, name, arguments) \
    FMI2_EXPORT result FMI2(name) arguments; \
    FMI2_EXPORT result FMI2(name) arguments

/* No message holds a % sign: it can be the format itself, which hosts that do not fill formats in show as it is. */
static void log_error(const fmi2CallbackLogger logger, void *environment, const char *name, const char *message)
{
    if (logger != NULL) {
        logger(environment, name, fmi2Error, "logStatusError", message);
    }
}

/* fmi2OK, or fmi2Error with the instance's message in the host's log: a refusal is never silent. */
static fmi2Status status_of(fmu_instance *instance, bool done)
{
    if (!done) {
        log_error((fmi2CallbackLogger)instance->logger, instance->environment, instance->name, instance->message);
    }
    return done ? fmi2OK : fmi2Error;
}

static fmi2Status refused(fmi2Component c, const char *why)
{
    fmu_instance *instance = c;
    if (instance == NULL) {
        return fmi2Error;
    }
    (void)snprintf(instance->message, sizeof instance->message, "%s", why);
    return status_of(instance, false);
}

FUNCTION(const char *, fmi2GetTypesPlatform, (void))
{
    return "default";
}

FUNCTION(const char *, fmi2GetVersion, (void))
{
    return "2.0";
}

/* Errors are always logged, and there is nothing else to log. */
FUNCTION(fmi2Status, fmi2SetDebugLogging,
         (fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[]))
{
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Component, fmi2Instantiate,
         (fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID, fmi2String fmuResourceLocation,
          const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean loggingOn))
{
    const fmi2CallbackLogger logger = functions == NULL ? NULL : functions->logger;
    void *environment = functions == NULL ? NULL : functions->componentEnvironment;
    fmu_instance *instance;
    (void)fmuResourceLocation;
    (void)visible;
    (void)loggingOn;
    if (instanceName == NULL || instanceName[0] == '\0') {
        log_error(logger, environment, "?", "fmi2Instantiate: expected an instance name, but got none");
        return NULL;
    }
    if (fmuType != fmi2CoSimulation) {
        log_error(logger, environment, instanceName, "fmi2Instantiate: this FMU is for co-simulation only");
        return NULL;
    }
    if (fmuGUID == NULL || strcmp(fmuGUID, FMU_MODEL_TOKEN) != 0) {
        log_error(logger, environment, instanceName,
                  "fmi2Instantiate: the GUID is not this model's, " FMU_MODEL_TOKEN
                  ": modelDescription.xml and binary do not belong together");
        return NULL;
    }
    instance = fmu_new(instanceName);
    if (instance == NULL) {
        log_error(logger, environment, instanceName, "fmi2Instantiate: no memory for another instance");
        return NULL;
    }
    instance->logger = (void (*)(void))logger;
    instance->environment = environment;
    return instance;
}

FUNCTION(void, fmi2FreeInstance, (fmi2Component c))
{
    fmu_free(c);
}

FUNCTION(fmi2Status, fmi2SetupExperiment,
         (fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
          fmi2Boolean stopTimeDefined, fmi2Real stopTime))
{
    fmu_instance *instance = c;
    (void)toleranceDefined;
    (void)tolerance;
    if (instance == NULL) {
        return fmi2Error;
    }
    if (!fmu_allowed(instance, "fmi2SetupExperiment", instance->state.mode == FMU_INSTANTIATED)) {
        return status_of(instance, false);
    }
    instance->state.time_s = startTime;
    instance->state.stops = stopTimeDefined != 0;
    instance->state.stop_s = stopTime;
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2EnterInitializationMode, (fmi2Component c))
{
    fmu_instance *instance = c;
    if (instance == NULL) {
        return fmi2Error;
    }
    return status_of(instance, fmu_enter_initialization(instance, "fmi2EnterInitializationMode", instance->state.time_s,
                                                        instance->state.stops, instance->state.stop_s));
}

FUNCTION(fmi2Status, fmi2ExitInitializationMode, (fmi2Component c))
{
    return c == NULL ? fmi2Error : status_of(c, fmu_exit_initialization(c, "fmi2ExitInitializationMode"));
}

FUNCTION(fmi2Status, fmi2Terminate, (fmi2Component c))
{
    return c == NULL ? fmi2Error : status_of(c, fmu_terminate(c, "fmi2Terminate"));
}

FUNCTION(fmi2Status, fmi2Reset, (fmi2Component c))
{
    if (c == NULL) {
        return fmi2Error;
    }
    fmu_reset(c);
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Real value[]))
{
    for (size_t i = 0; c != NULL && i < nvr; i++) {
        if (!fmu_get_real(c, "fmi2GetReal", vr[i], &value[i])) {
            return status_of(c, false);
        }
    }
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetInteger, (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[]))
{
    for (size_t i = 0; c != NULL && i < nvr; i++) {
        int32_t number = 0;
        if (!fmu_get_integer(c, "fmi2GetInteger", vr[i], &number)) {
            return status_of(c, false);
        }
        value[i] = number;
    }
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetBoolean, (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Boolean value[]))
{
    for (size_t i = 0; c != NULL && i < nvr; i++) {
        bool truth = false;
        if (!fmu_get_boolean(c, "fmi2GetBoolean", vr[i], &truth)) {
            return status_of(c, false);
        }
        value[i] = truth ? 1 : 0;
    }
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Status, fmi2SetReal, (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Real value[]))
{
    for (size_t i = 0; c != NULL && i < nvr; i++) {
        if (!fmu_set_real(c, "fmi2SetReal", vr[i], value[i])) {
            return status_of(c, false);
        }
    }
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Status, fmi2SetInteger,
         (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[]))
{
    for (size_t i = 0; c != NULL && i < nvr; i++) {
        if (!fmu_set_integer(c, "fmi2SetInteger", vr[i], value[i])) {
            return status_of(c, false);
        }
    }
    return c == NULL ? fmi2Error : fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetFMUstate, (fmi2Component c, fmi2FMUstate *FMUstate))
{
    if (c == NULL || FMUstate == NULL) {
        return refused(c, "fmi2GetFMUstate: expected a place for the state, but got none");
    }
    return status_of(c, fmu_save(c, "fmi2GetFMUstate", FMUstate));
}

FUNCTION(fmi2Status, fmi2SetFMUstate, (fmi2Component c, fmi2FMUstate FMUstate))
{
    fmu_instance *instance = c;
    if (instance == NULL || FMUstate == NULL) {
        return refused(c, "fmi2SetFMUstate: expected a saved state, but got none");
    }
    memcpy(&instance->state, FMUstate, sizeof(fmu_state));
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2FreeFMUstate, (fmi2Component c, fmi2FMUstate *FMUstate))
{
    if (c == NULL) {
        return fmi2Error;
    }
    if (FMUstate != NULL) {
        free(*FMUstate);
        *FMUstate = NULL;
    }
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2SerializedFMUstateSize, (fmi2Component c, fmi2FMUstate FMUstate, size_t *size))
{
    if (c == NULL || FMUstate == NULL) {
        return refused(c, "fmi2SerializedFMUstateSize: expected a saved state, but got none");
    }
    *size = fmu_stored_size();
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2SerializeFMUstate,
         (fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte serializedState[], size_t size))
{
    if (c == NULL || FMUstate == NULL) {
        return refused(c, "fmi2SerializeFMUstate: expected a saved state, but got none");
    }
    return status_of(c, fmu_store(c, "fmi2SerializeFMUstate", FMUstate, (unsigned char *)serializedState, size));
}

FUNCTION(fmi2Status, fmi2DeSerializeFMUstate,
         (fmi2Component c, const fmi2Byte serializedState[], size_t size, fmi2FMUstate *FMUstate))
{
    if (c == NULL || serializedState == NULL || FMUstate == NULL) {
        return refused(c, "fmi2DeSerializeFMUstate: expected bytes and a place for the state, but got none");
    }
    return status_of(c,
                     fmu_restore(c, "fmi2DeSerializeFMUstate", (const unsigned char *)serializedState, size, FMUstate));
}

FUNCTION(fmi2Status, fmi2DoStep,
         (fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
          fmi2Boolean noSetFMUStatePriorToCurrentPoint))
{
    (void)noSetFMUStatePriorToCurrentPoint;
    if (c == NULL) {
        return fmi2Error;
    }
    return status_of(c, fmu_step(c, "fmi2DoStep", currentCommunicationPoint, communicationStepSize));
}

FUNCTION(fmi2Status, fmi2GetRealStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Real *value))
{
    const fmu_instance *instance = c;
    if (instance == NULL || kind != fmi2LastSuccessfulTime) {
        return fmi2Discard;
    }
    *value = instance->state.time_s;
    return fmi2OK;
}

FUNCTION(fmi2Status, fmi2GetBooleanStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value))
{
    if (c == NULL || kind != fmi2Terminated) {
        return fmi2Discard;
    }
    *value = 0; /* the estimator never asks to end */
    return fmi2OK;
}

#include "fmi2_absent.h"
