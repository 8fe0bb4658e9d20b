/* What FMI 2.0 wants to be there and this FMU does not offer: each function reports that. Part of fmi2.c. */
#ifndef FMI2_ABSENT_H
#define FMI2_ABSENT_H

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter" /* the standard fixes them; a refusal has no use for them */
#elif defined(_MSC_VER)
#pragma warning(disable : 4100)
#endif

FUNCTION(fmi2Status, fmi2GetString, (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2String value[]))
{
    return nvr == 0 && c != NULL ? fmi2OK : refused(c, "fmi2GetString: there is no string variable");
}

FUNCTION(fmi2Status, fmi2SetBoolean,
         (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Boolean value[]))
{
    return nvr == 0 && c != NULL ? fmi2OK : refused(c, "fmi2SetBoolean: there is no Boolean variable that can be set");
}

FUNCTION(fmi2Status, fmi2SetString,
         (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2String value[]))
{
    return nvr == 0 && c != NULL ? fmi2OK : refused(c, "fmi2SetString: there is no string variable");
}

FUNCTION(fmi2Status, fmi2GetDirectionalDerivative,
         (fmi2Component c, const fmi2ValueReference unknowns[], size_t nUnknowns, const fmi2ValueReference knowns[],
          size_t nKnowns, const fmi2Real dvKnown[], fmi2Real dvUnknown[]))
{
    return refused(c, "fmi2GetDirectionalDerivative: not provided");
}

FUNCTION(fmi2Status, fmi2SetRealInputDerivatives,
         (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[],
          const fmi2Real value[]))
{
    return refused(c, "fmi2SetRealInputDerivatives: inputs are samples, they are not interpolated");
}

FUNCTION(fmi2Status, fmi2GetRealOutputDerivatives,
         (fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer order[], fmi2Real value[]))
{
    return refused(c, "fmi2GetRealOutputDerivatives: not provided");
}

FUNCTION(fmi2Status, fmi2CancelStep, (fmi2Component c))
{
    return refused(c, "fmi2CancelStep: a step is done when fmi2DoStep returns");
}

FUNCTION(fmi2Status, fmi2GetStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Status *value))
{
    return fmi2Discard; /* only asked for after fmi2Pending, which no step returns */
}

FUNCTION(fmi2Status, fmi2GetIntegerStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2Integer *value))
{
    return fmi2Discard;
}

FUNCTION(fmi2Status, fmi2GetStringStatus, (fmi2Component c, const fmi2StatusKind kind, fmi2String *value))
{
    return fmi2Discard;
}

#endif
