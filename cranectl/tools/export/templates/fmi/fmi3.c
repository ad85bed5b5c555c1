/* The functions of FMI 3.0 for co-simulation. */
#include "instance.h"

typedef void (*logger3)(void *, int, const char *, const char *);

static int report(instance *self, const char *wrong)
{
    if (wrong == NULL)
        return OK;
    if (self->logger != NULL)
        ((logger3)self->logger)(self->environment, ERROR, "error", wrong);
    return ERROR;
}

EXPORT const char *fmi3GetVersion(void) { return "3.0"; }
EXPORT int fmi3SetDebugLogging(void *self, bool on, size_t count, const char *const *categories)
{
    return UNUSED(self), UNUSED(on), UNUSED(count), UNUSED(categories), OK;
}

EXPORT void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible,
                                         bool logging, bool events, bool early_return, const uint32_t *intermediate,
                                         size_t count, void *environment, function logger, function update)
{
    UNUSED(resources), UNUSED(visible), UNUSED(logging), UNUSED(events), UNUSED(early_return);
    UNUSED(intermediate), UNUSED(count), UNUSED(update);
    return instance_new(name, token, environment, logger);
}
EXPORT void *fmi3InstantiateModelExchange(void) { return NULL; }
EXPORT void *fmi3InstantiateScheduledExecution(void) { return NULL; }
EXPORT void fmi3FreeInstance(void *self) { free(self); }

EXPORT int fmi3EnterInitializationMode(instance *self, bool has_tolerance, double tolerance, double start,
                                       bool has_stop, double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance), UNUSED(has_stop), UNUSED(stop);
    self->start = start;
    return OK;
}
EXPORT int fmi3ExitInitializationMode(instance *self)
{
    return report(self, instance_finish_initialisation(self));
}
EXPORT int fmi3Terminate(void *self) { return UNUSED(self), OK; }
EXPORT int fmi3Reset(instance *self) { return instance_reset(self), OK; }

EXPORT int fmi3GetFloat64(instance *self, const uint32_t *references, size_t count, double *values, size_t size)
{
    return report(self, size == count ? instance_get(self, references, count, values) : "all variables are scalars");
}
EXPORT int fmi3SetFloat64(instance *self, const uint32_t *references, size_t count, const double *values, size_t size)
{
    return report(self, size == count ? instance_set(self, references, count, values) : "all variables are scalars");
}
EXPORT int fmi3DoStep(instance *self, double time, double size, bool no_return, bool *event, bool *terminate,
                      bool *early_return, double *last)
{
    UNUSED(no_return);
    const char *wrong = instance_step(self, time, size);
    *event = *terminate = *early_return = false;
    *last = instance_time(self);
    return report(self, wrong);
}

/* Variables of other types, of which this model has none, and what it does not provide. Callers give these functions
 * more arguments, which they do not need. */
#define NONE_OF(name)                                                                                     \
    EXPORT int fmi3##name(instance *self, const uint32_t *references, size_t count)                       \
    {                                                                                                     \
        return UNUSED(references), report(self, count ? "all variables are of the type Float64" : NULL);  \
    }
#define WITHOUT(name) \
    EXPORT int fmi3##name(instance *self) { return report(self, "fmi3" #name " is not provided"); }
NONE_OF(GetFloat32)
NONE_OF(GetInt8)
NONE_OF(GetUInt8)
NONE_OF(GetInt16)
NONE_OF(GetUInt16)
NONE_OF(GetInt32)
NONE_OF(GetUInt32)
NONE_OF(GetInt64)
NONE_OF(GetUInt64)
NONE_OF(GetBoolean)
NONE_OF(GetString)
NONE_OF(GetBinary)
NONE_OF(GetClock)
NONE_OF(SetFloat32)
NONE_OF(SetInt8)
NONE_OF(SetUInt8)
NONE_OF(SetInt16)
NONE_OF(SetUInt16)
NONE_OF(SetInt32)
NONE_OF(SetUInt32)
NONE_OF(SetInt64)
NONE_OF(SetUInt64)
NONE_OF(SetBoolean)
NONE_OF(SetString)
NONE_OF(SetBinary)
NONE_OF(SetClock)
WITHOUT(EnterEventMode)
WITHOUT(GetNumberOfVariableDependencies)
WITHOUT(GetVariableDependencies)
WITHOUT(GetFMUState)
WITHOUT(SetFMUState)
WITHOUT(FreeFMUState)
WITHOUT(SerializedFMUStateSize)
WITHOUT(SerializeFMUState)
WITHOUT(DeserializeFMUState)
WITHOUT(GetDirectionalDerivative)
WITHOUT(GetAdjointDerivative)
WITHOUT(EnterConfigurationMode)
WITHOUT(ExitConfigurationMode)
WITHOUT(GetIntervalDecimal)
WITHOUT(GetIntervalFraction)
WITHOUT(GetShiftDecimal)
WITHOUT(GetShiftFraction)
WITHOUT(SetIntervalDecimal)
WITHOUT(SetIntervalFraction)
WITHOUT(SetShiftDecimal)
WITHOUT(SetShiftFraction)
WITHOUT(EvaluateDiscreteStates)
WITHOUT(UpdateDiscreteStates)
WITHOUT(EnterContinuousTimeMode)
WITHOUT(CompletedIntegratorStep)
WITHOUT(SetTime)
WITHOUT(SetContinuousStates)
WITHOUT(GetContinuousStateDerivatives)
WITHOUT(GetEventIndicators)
WITHOUT(GetContinuousStates)
WITHOUT(GetNominalsOfContinuousStates)
WITHOUT(GetNumberOfEventIndicators)
WITHOUT(GetNumberOfContinuousStates)
WITHOUT(EnterStepMode)
WITHOUT(GetOutputDerivatives)
WITHOUT(ActivateModelPartition)
