/* An instance of the model: what it does alike for FMI 2 and FMI 3.
 *
 * Functions return a message about what is wrong, or 0. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "model.h"

#define OK 0
#define ERROR 3
#define TOLERANCE 1e-6 /* of a step, relative; masters add up their time with rounding */
#define MAX_SAMPLES 1e9
#define NO_VARIABLE "there is no variable of the value reference %u"
#define UNUSED(x) ((void)(x))
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

typedef void (*function)(void);

typedef struct {
    double values[MODEL_VARIABLES];
    double memory[MODEL_MEMORY];
    double start; /* s, time at the beginning */
    int64_t samples;
    bool initialised;
    const char *name;
    void *environment;
    function logger;
    char message[512]; /* about the last error */
} instance;

static const char *instance_message(instance *self, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    vsnprintf(self->message, sizeof self->message, format, values);
    va_end(values);
    return self->message;
}

static void instance_reset(instance *self)
{
    memcpy(self->values, model_starts, sizeof self->values);
    memset(self->memory, 0, sizeof self->memory);
    self->start = 0.0;
    self->samples = 0;
    self->initialised = false;
}

static instance *instance_new(const char *name, const char *token, void *environment, function logger)
{
    if (token == NULL || strcmp(token, MODEL_TOKEN) != 0)
        return NULL;
    const size_t size = name == NULL ? 1 : strlen(name) + 1;
    instance *self = calloc(1, sizeof *self + size);
    if (self == NULL)
        return NULL;
    char *copy = (char *)(self + 1);
    if (name != NULL)
        memcpy(copy, name, size);
    self->name = copy;
    self->environment = environment;
    self->logger = logger;
    instance_reset(self);
    return self;
}

static const char *instance_initialise(instance *self)
{
    return model_initialise(self->values, self->memory) ? "the model cannot begin with these numbers" : NULL;
}

static double instance_time(const instance *self)
{
    return self->start + (double)self->samples * MODEL_PERIOD;
}

static const char *instance_get(instance *self, const uint32_t *references, size_t count, double *values)
{
    if (!self->initialised) {
        const char *wrong = instance_initialise(self);
        if (wrong != NULL)
            return wrong;
    }
    for (size_t k = 0; k < count; k++) {
        if (references[k] > MODEL_VARIABLES)
            return instance_message(self, NO_VARIABLE, (unsigned)references[k]);
        values[k] = references[k] == MODEL_VARIABLES ? instance_time(self) : self->values[references[k]];
    }
    return NULL;
}

static const char *instance_set(instance *self, const uint32_t *references, size_t count, const double *values)
{
    for (size_t k = 0; k < count; k++) {
        const uint32_t place = references[k];
        if (place >= MODEL_VARIABLES)
            return instance_message(self, NO_VARIABLE, (unsigned)place);
        const char kind = model_kinds[place], *name = model_names[place];
        if (kind != 'i' && (kind != 'p' || self->initialised))
            return instance_message(self, "%s is set to %g, but only inputs can be set, and parameters before the "
                                    "end of initialisation", name, values[k]);
        if (!(values[k] >= model_lowest[place] && values[k] <= model_highest[place]))
            return instance_message(self, "%s = %g is outside of its bounds, %g to %g", name, values[k],
                                    model_lowest[place], model_highest[place]);
        self->values[place] = values[k];
    }
    return NULL;
}

static const char *instance_finish_initialisation(instance *self)
{
    const char *wrong = instance_initialise(self);
    self->initialised = wrong == NULL;
    return wrong;
}

static const char *instance_step(instance *self, double time, double size)
{
    const double samples = floor(size / MODEL_PERIOD + 0.5), now = instance_time(self);
    if (!self->initialised)
        return "a step before the end of initialisation";
    if (!(samples >= 1.0 && samples <= MAX_SAMPLES && fabs(size / MODEL_PERIOD - samples) <= TOLERANCE * samples))
        return instance_message(self, "a step of %.9g s is no whole multiple of the period of the model, %.9g s",
                                size, MODEL_PERIOD);
    if (!(fabs(time - now) <= TOLERANCE * (MODEL_PERIOD + fabs(time))))
        return instance_message(self, "a step begins at %.9g s, but the last one ended at %.9g s", time, now);
    const int status = model_step(self->values, self->memory, (int64_t)samples);
    if (status)
        return instance_message(self, "the model cannot go on in the step from %.9g s, status %d (%s)", now, status,
                                MODEL_FAILURE);
    self->samples += (int64_t)samples;
    return NULL;
}
