/* What FMI 3.0 wants to be there and this FMU does not offer: each function reports that. Part of fmi3.c. */
#ifndef FMI3_ABSENT_H
#define FMI3_ABSENT_H

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard fixes them; a refusal has no use for them */
#elif defined(_MSC_VER)
#pragma warning(disable : 4100)
#endif

#define ABSENT(name, arguments, why) \
    FUNCTION(fmi3Status, name, arguments) \
    { \
        return refused(instance, #name, why); \
    }

/* There is no variable of these types; to ask for none of them is fine. */
#define NO_VARIABLES(type) \
    FUNCTION(fmi3Status, fmi3Get##type, \
             (fmi3Instance instance, const fmi3ValueReference references[], size_t nReferences, fmi3##type values[], \
              size_t nValues)) \
    { \
        return nReferences == 0 && instance != NULL ? fmi3OK : refused(instance, "fmi3Get" #type, NO_VARIABLE); \
    } \
    NO_SETTABLE(type)
#define NO_SETTABLE(type) \
    FUNCTION(fmi3Status, fmi3Set##type, \
             (fmi3Instance instance, const fmi3ValueReference references[], size_t nReferences, \
              const fmi3##type values[], size_t nValues)) \
    { \
        return nReferences == 0 && instance != NULL ? fmi3OK : refused(instance, "fmi3Set" #type, NO_VARIABLE); \
    }
#define NO_VARIABLE "there is no such variable of this type"

NO_VARIABLES(Float32)
NO_VARIABLES(Int8)
NO_VARIABLES(UInt8)
NO_VARIABLES(Int16)
NO_VARIABLES(UInt16)
NO_VARIABLES(UInt32)
NO_VARIABLES(Int64)
NO_VARIABLES(UInt64)
NO_VARIABLES(String)
NO_SETTABLE(Boolean)

#define REFERENCES fmi3Instance instance, const fmi3ValueReference references[], size_t nReferences

ABSENT(fmi3GetBinary, (REFERENCES, size_t valueSizes[], fmi3Binary values[], size_t nValues), NO_VARIABLE)
ABSENT(fmi3SetBinary, (REFERENCES, const size_t valueSizes[], const fmi3Binary values[], size_t nValues), NO_VARIABLE)
ABSENT(fmi3GetClock, (REFERENCES, fmi3Clock values[]), NO_VARIABLE)
ABSENT(fmi3SetClock, (REFERENCES, const fmi3Clock values[]), NO_VARIABLE)

#define NO_CLOCK "there is no clock"
ABSENT(fmi3GetIntervalDecimal, (REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), NO_CLOCK)
ABSENT(fmi3GetIntervalFraction,
       (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]), NO_CLOCK)
ABSENT(fmi3GetShiftDecimal, (REFERENCES, fmi3Float64 shifts[]), NO_CLOCK)
ABSENT(fmi3GetShiftFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), NO_CLOCK)
ABSENT(fmi3SetIntervalDecimal, (REFERENCES, const fmi3Float64 intervals[]), NO_CLOCK)
ABSENT(fmi3SetIntervalFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), NO_CLOCK)
ABSENT(fmi3SetShiftDecimal, (REFERENCES, const fmi3Float64 shifts[]), NO_CLOCK)
ABSENT(fmi3SetShiftFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), NO_CLOCK)

#define NOT_PROVIDED "not provided"
ABSENT(fmi3GetNumberOfVariableDependencies,
       (fmi3Instance instance, fmi3ValueReference reference, size_t *nDependencies), NOT_PROVIDED)
ABSENT(fmi3GetVariableDependencies,
       (fmi3Instance instance, fmi3ValueReference dependent, size_t elementIndicesOfDependent[],
        fmi3ValueReference independents[], size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
        size_t nDependencies),
       NOT_PROVIDED)
#define DERIVATIVE_ARGUMENTS \
    (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns, const fmi3ValueReference knowns[], \
     size_t nKnowns, const fmi3Float64 seed[], size_t nSeed, fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT(fmi3GetDirectionalDerivative, DERIVATIVE_ARGUMENTS, NOT_PROVIDED)
ABSENT(fmi3GetAdjointDerivative, DERIVATIVE_ARGUMENTS, NOT_PROVIDED)
ABSENT(fmi3GetOutputDerivatives, (REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues),
       NOT_PROVIDED)

#define NO_STRUCTURE "there is no structural parameter"
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance instance), NO_STRUCTURE)
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance instance), NO_STRUCTURE)

#define NO_EVENTS "there is no event mode"
ABSENT(fmi3EnterEventMode, (fmi3Instance instance), NO_EVENTS)
ABSENT(fmi3EnterStepMode, (fmi3Instance instance), NO_EVENTS)
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance instance), NO_EVENTS)
ABSENT(fmi3UpdateDiscreteStates,
       (fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate, fmi3Boolean *terminateSimulation,
        fmi3Boolean *nominalsOfContinuousStatesChanged, fmi3Boolean *valuesOfContinuousStatesChanged,
        fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime),
       NO_EVENTS)

#define CO_SIMULATION "this FMU is for co-simulation only"
FUNCTION(fmi3Instance, fmi3InstantiateModelExchange,
         (fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
          fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage))
{
    log_error(logMessage, instanceEnvironment, "fmi3InstantiateModelExchange: " CO_SIMULATION);
    return NULL;
}
FUNCTION(fmi3Instance, fmi3InstantiateScheduledExecution,
         (fmi3String instanceName, fmi3String instantiationToken, fmi3String resourcePath, fmi3Boolean visible,
          fmi3Boolean loggingOn, fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
          fmi3ClockUpdateCallback clockUpdate, fmi3LockPreemptionCallback lockPreemption,
          fmi3UnlockPreemptionCallback unlockPreemption))
{
    log_error(logMessage, instanceEnvironment, "fmi3InstantiateScheduledExecution: " CO_SIMULATION);
    return NULL;
}
ABSENT(fmi3ActivateModelPartition,
       (fmi3Instance instance, fmi3ValueReference clockReference, fmi3Float64 activationTime), CO_SIMULATION)
ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance instance), CO_SIMULATION)
ABSENT(fmi3CompletedIntegratorStep,
       (fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *enterEventMode,
        fmi3Boolean *terminateSimulation),
       CO_SIMULATION)
ABSENT(fmi3SetTime, (fmi3Instance instance, fmi3Float64 time), CO_SIMULATION)
ABSENT(fmi3SetContinuousStates, (fmi3Instance instance, const fmi3Float64 continuousStates[], size_t nContinuousStates),
       CO_SIMULATION)
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 derivatives[], size_t nContinuousStates),
       CO_SIMULATION)
ABSENT(fmi3GetEventIndicators, (fmi3Instance instance, fmi3Float64 eventIndicators[], size_t nEventIndicators),
       CO_SIMULATION)
ABSENT(fmi3GetContinuousStates, (fmi3Instance instance, fmi3Float64 continuousStates[], size_t nContinuousStates),
       CO_SIMULATION)
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 nominals[], size_t nContinuousStates),
       CO_SIMULATION)
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance instance, size_t *nEventIndicators), CO_SIMULATION)
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance instance, size_t *nContinuousStates), CO_SIMULATION)

#endif
