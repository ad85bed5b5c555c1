/* The functions of FMI 2.0 for co-simulation. */
#include "instance.h"

typedef void (*logger2)(void *, const char *, int, const char *, const char *, ...);
typedef struct {
    logger2 logger;
    void *(*allocate)(size_t, size_t);
    void (*release)(void *);
    void (*finished)(void *, int);
    void *environment;
} callbacks;

static int report(instance *self, const char *wrong)
{
    if (wrong == NULL)
        return OK;
    if (self->logger != NULL)
        ((logger2)self->logger)(self->environment, self->name, ERROR, "error", "%s", wrong);
    return ERROR;
}

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }
EXPORT const char *fmi2GetVersion(void) { return "2.0"; }
EXPORT int fmi2SetDebugLogging(void *self, int on, size_t count, const char *const *categories)
{
    UNUSED(self), UNUSED(on), UNUSED(count), UNUSED(categories);
    return OK;
}

EXPORT void *fmi2Instantiate(const char *name, int type, const char *token, const char *resources,
                             const callbacks *given, int visible, int logging)
{
    UNUSED(resources), UNUSED(visible), UNUSED(logging);
    if (type != 1) /* only co-simulation */
        return NULL;
    return instance_new(name, token, given ? given->environment : NULL,
                        given ? (function)given->logger : NULL);
}
EXPORT void fmi2FreeInstance(void *self) { free(self); }

EXPORT int fmi2SetupExperiment(instance *self, int has_tolerance, double tolerance, double start, int has_stop,
                               double stop)
{
    UNUSED(has_tolerance), UNUSED(tolerance), UNUSED(has_stop), UNUSED(stop);
    self->start = start;
    return OK;
}
EXPORT int fmi2EnterInitializationMode(void *self) { return UNUSED(self), OK; }
EXPORT int fmi2ExitInitializationMode(instance *self)
{
    return report(self, instance_finish_initialisation(self));
}
EXPORT int fmi2Terminate(void *self) { return UNUSED(self), OK; }
EXPORT int fmi2Reset(instance *self) { return instance_reset(self), OK; }

EXPORT int fmi2GetReal(instance *self, const uint32_t *references, size_t count, double *values)
{
    return report(self, instance_get(self, references, count, values));
}
EXPORT int fmi2SetReal(instance *self, const uint32_t *references, size_t count, const double *values)
{
    return report(self, instance_set(self, references, count, values));
}
EXPORT int fmi2DoStep(instance *self, double time, double size, int no_return)
{
    UNUSED(no_return);
    return report(self, instance_step(self, time, size));
}

/* Variables of other types, of which this model has none, and what it does not provide. Callers give these functions
 * more arguments, which they do not need. */
#define NONE_OF(name)                                                                                     \
    EXPORT int fmi2##name(instance *self, const uint32_t *references, size_t count)                       \
    {                                                                                                     \
        return UNUSED(references), report(self, count ? "all variables are of the type Real" : NULL);     \
    }
#define WITHOUT(name) \
    EXPORT int fmi2##name(instance *self) { return report(self, "fmi2" #name " is not provided"); }
NONE_OF(GetInteger)
NONE_OF(GetBoolean)
NONE_OF(GetString)
NONE_OF(SetInteger)
NONE_OF(SetBoolean)
NONE_OF(SetString)
WITHOUT(GetFMUstate)
WITHOUT(SetFMUstate)
WITHOUT(FreeFMUstate)
WITHOUT(SerializedFMUstateSize)
WITHOUT(SerializeFMUstate)
WITHOUT(DeSerializeFMUstate)
WITHOUT(GetDirectionalDerivative)
WITHOUT(SetRealInputDerivatives)
WITHOUT(GetRealOutputDerivatives)
WITHOUT(CancelStep)
WITHOUT(GetStatus)
WITHOUT(GetRealStatus)
WITHOUT(GetIntegerStatus)
WITHOUT(GetBooleanStatus)
WITHOUT(GetStringStatus)
