/* FMI 3.0 for co-simulation around the estimator. */
#include "fmi3_types.h"
#include "fmu_instance.h"
#include "fmu_states.h"

/* Prototypes before definitions, so that no compiler asks for them. */
#define FUNCTION(result, name, arguments) \
    FMI3_Export result FMI3(name) arguments; \
    FMI3_Export result FMI3(name) \
    arguments

static void log_error(const fmi3LogMessageCallback logger, void *environment, const char *message)
{
    if (logger != NULL) {
        logger(environment, fmi3Error, "logStatusError", message);
    }
}

/* fmi3OK, or fmi3Error with the instance's message in the host's log: a refusal is never silent. */
static fmi3Status status_of(fmu_instance *instance, bool done)
{
    if (!done) {
        log_error((fmi3LogMessageCallback)instance->logger, instance->environment, instance->message);
    }
    return done ? fmi3OK : fmi3Error;
}

static fmi3Status refused(fmi3Instance instance, const char *name, const char *why)
{
    fmu_instance *here = instance;
    if (here == NULL) {
        return fmi3Error;
    }
    (void)snprintf(here->message, sizeof here->message, "%s: %s", name, why);
    return status_of(here, false);
}

FUNCTION(const char *, fmi3GetVersion, (void))
{
    return "3.0";
}

/* Errors are always logged, and there is nothing else to log. */
FUNCTION(fmi3Status, fmi3SetDebugLogging,
         (fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories, const fmi3String categories[]))
{
    (void)loggingOn;
    (void)nCategories;
    (void)categories;
    return instance == NULL ? fmi3Error : fmi3OK;
}

FUNCTION(fmi3Instance, fmi3InstantiateCoSimulation,
         (fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
          fmi3Boolean loggingOn, fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
          const fmi3ValueReference requiredIntermediateVariables[], size_t nRequiredIntermediateVariables,
          fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
          fmi3IntermediateUpdateCallback intermediateUpdate))
{
    fmu_instance *instance;
    (void)resourcePath;
    (void)visible;
    (void)loggingOn;
    (void)earlyReturnAllowed;
    (void)requiredIntermediateVariables;
    (void)intermediateUpdate;
    if (instanceName == NULL || instanceName[0] == '\0') {
        log_error(logMessage, instanceEnvironment,
                  "fmi3InstantiateCoSimulation: expected an instance name, but got none");
        return NULL;
    }
    if (instantiationToken == NULL || strcmp(instantiationToken, FMU_MODEL_TOKEN) != 0) {
        log_error(logMessage, instanceEnvironment,
                  "fmi3InstantiateCoSimulation: the instantiation token is not this model's, " FMU_MODEL_TOKEN
                  ": modelDescription.xml and binary do not belong together");
        return NULL;
    }
    if (eventModeUsed || nRequiredIntermediateVariables > 0) {
        log_error(logMessage, instanceEnvironment,
                  "fmi3InstantiateCoSimulation: there is no event mode and no intermediate variable");
        return NULL;
    }
    instance = fmu_new(instanceName);
    if (instance == NULL) {
        log_error(logMessage, instanceEnvironment, "fmi3InstantiateCoSimulation: no memory for another instance");
        return NULL;
    }
    instance->logger = (void (*)(void))logMessage;
    instance->environment = instanceEnvironment;
    return instance;
}

FUNCTION(void, fmi3FreeInstance, (fmi3Instance instance))
{
    fmu_free(instance);
}

FUNCTION(fmi3Status, fmi3EnterInitializationMode,
         (fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance, fmi3Float64 startTime,
          fmi3Boolean stopTimeDefined, fmi3Float64 stopTime))
{
    (void)toleranceDefined;
    (void)tolerance;
    if (instance == NULL) {
        return fmi3Error;
    }
    return status_of(instance, fmu_enter_initialization(instance, "fmi3EnterInitializationMode", startTime,
                                                        stopTimeDefined, stopTime));
}

FUNCTION(fmi3Status, fmi3ExitInitializationMode, (fmi3Instance instance))
{
    return instance == NULL ? fmi3Error
                            : status_of(instance, fmu_exit_initialization(instance, "fmi3ExitInitializationMode"));
}

FUNCTION(fmi3Status, fmi3Terminate, (fmi3Instance instance))
{
    return instance == NULL ? fmi3Error : status_of(instance, fmu_terminate(instance, "fmi3Terminate"));
}

FUNCTION(fmi3Status, fmi3Reset, (fmi3Instance instance))
{
    if (instance == NULL) {
        return fmi3Error;
    }
    fmu_reset(instance);
    return fmi3OK;
}

/* Getters and setters: every variable is a scalar, so there are as many values as references. */
#define ACCESS(name, type, const_or_not, one) \
    FUNCTION(fmi3Status, name, \
             (fmi3Instance instance, const fmi3ValueReference references[], size_t nReferences, \
              const_or_not type values[], size_t nValues)) \
    { \
        if (instance == NULL) { \
            return fmi3Error; \
        } \
        if (nReferences != nValues) { \
            return refused(instance, #name, \
                           "expected as many values as value references: every variable is a scalar"); \
        } \
        for (size_t i = 0; i < nValues; i++) { \
            if (!one) { \
                return status_of(instance, false); \
            } \
        } \
        return fmi3OK; \
    }

ACCESS(fmi3GetFloat64, fmi3Float64, , fmu_get_real(instance, "fmi3GetFloat64", references[i], &values[i]))
ACCESS(fmi3GetInt32, fmi3Int32, , fmu_get_integer(instance, "fmi3GetInt32", references[i], &values[i]))
ACCESS(fmi3GetBoolean, fmi3Boolean, , fmu_get_boolean(instance, "fmi3GetBoolean", references[i], &values[i]))
ACCESS(fmi3SetFloat64, fmi3Float64, const, fmu_set_real(instance, "fmi3SetFloat64", references[i], values[i]))
ACCESS(fmi3SetInt32, fmi3Int32, const, fmu_set_integer(instance, "fmi3SetInt32", references[i], values[i]))

FUNCTION(fmi3Status, fmi3GetFMUState, (fmi3Instance instance, fmi3FMUState *FMUState))
{
    if (instance == NULL || FMUState == NULL) {
        return refused(instance, "fmi3GetFMUState", "expected a place for the state, but got none");
    }
    return status_of(instance, fmu_save(instance, "fmi3GetFMUState", FMUState));
}

FUNCTION(fmi3Status, fmi3SetFMUState, (fmi3Instance instance, fmi3FMUState FMUState))
{
    fmu_instance *here = instance;
    if (here == NULL || FMUState == NULL) {
        return refused(instance, "fmi3SetFMUState", "expected a saved state, but got none");
    }
    memcpy(&here->state, FMUState, sizeof(fmu_state));
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3FreeFMUState, (fmi3Instance instance, fmi3FMUState *FMUState))
{
    if (instance == NULL) {
        return fmi3Error;
    }
    if (FMUState != NULL) {
        free(*FMUState);
        *FMUState = NULL;
    }
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3SerializedFMUStateSize, (fmi3Instance instance, fmi3FMUState FMUState, size_t *size))
{
    if (instance == NULL || FMUState == NULL) {
        return refused(instance, "fmi3SerializedFMUStateSize", "expected a saved state, but got none");
    }
    *size = fmu_stored_size();
    return fmi3OK;
}

FUNCTION(fmi3Status, fmi3SerializeFMUState,
         (fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte serializedState[], size_t size))
{
    if (instance == NULL || FMUState == NULL) {
        return refused(instance, "fmi3SerializeFMUState", "expected a saved state, but got none");
    }
    return status_of(instance, fmu_store(instance, "fmi3SerializeFMUState", FMUState, serializedState, size));
}

FUNCTION(fmi3Status, fmi3DeserializeFMUState,
         (fmi3Instance instance, const fmi3Byte serializedState[], size_t size, fmi3FMUState *FMUState))
{
    if (instance == NULL || serializedState == NULL || FMUState == NULL) {
        return refused(instance, "fmi3DeserializeFMUState", "expected bytes and a place for the state, but got none");
    }
    return status_of(instance, fmu_restore(instance, "fmi3DeserializeFMUState", serializedState, size, FMUState));
}

FUNCTION(fmi3Status, fmi3DoStep,
         (fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
          fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
          fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime))
{
    const fmu_instance *here = instance;
    bool done;
    (void)noSetFMUStatePriorToCurrentPoint;
    if (here == NULL) {
        return fmi3Error;
    }
    done = fmu_step(instance, "fmi3DoStep", currentCommunicationPoint, communicationStepSize);
    *eventHandlingNeeded = false;
    *terminateSimulation = false;
    *earlyReturn = false;
    *lastSuccessfulTime = here->state.time_s;
    return status_of(instance, done);
}

#include "fmi3_absent.h"
