/* A controller for cranectl in any language that makes C functions. All numbers in SI units.
 *
 *     cc -O2 -shared -fPIC -ffp-contract=off -o law.so law.c
 *     cranectl run fixed-position --controller ./law.so
 *
 * Nothing may be remembered outside of `memory`: two cranes step one controller in turn.
 */
#ifndef CRANECTL_H
#define CRANECTL_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined _WIN32
#define CRANECTL_EXPORT __declspec(dllexport)
#else
#define CRANECTL_EXPORT __attribute__((visibility("default")))
#endif

#define CRANECTL_ABI 5

enum { CRANECTL_ACCELERATION, CRANECTL_VELOCITY, CRANECTL_FORCE }; /* commanded: m/s^2, m/s, N */
enum { CRANECTL_PATH, CRANECTL_SET_POINT };                        /* followed; the latter: where a segment ends */
enum { CRANECTL_STATE, CRANECTL_ENCODERS };                        /* measured */

typedef struct {
    const char *name, *unit, *description;
    double initial, lowest, highest; /* --set controller.CONTROLLER.PARAMETER=..., within these */
    double search[2];                /* sizes between which `cranectl tune` looks, 0 < low < high; none: 0 */
    double length_power;             /* both are the laboratory rig's, times L^length_power on one L times as
                                        large: -0.5 for 1/s */
} cranectl_parameter;

typedef struct {
    const char *name, *unit, *description;
    int64_t place; /* of the memory, logged as the step leaves it */
} cranectl_signal;

typedef struct {
    uint32_t abi;  /* CRANECTL_ABI */
    uint32_t size; /* sizeof(cranectl_declaration) */
    const char *name; /* lower case letters, digits, hyphens */
    const char *title;
    int32_t command, follows, measures;
    int32_t every;   /* control periods between two steps, at least 1 */
    int32_t preview; /* rows of the reference after the present one */
    int32_t memory;  /* doubles, all zero at the start unless cranectl_prepare sets them */
    int32_t numbers; /* doubles that the step gets as `parameters`, the declared ones first */
    int32_t parameter_count, signal_count;
    const cranectl_parameter *parameters;
    const cranectl_signal *signals;
    const char *reads; /* of cranectl_nominal what cranectl_prepare uses up to time_constants, separated by
                          spaces: "gravity load_mass"; all else is NaN. NULL: not declared, it gets all */
    double period;     /* between two steps [s], for which the code was made: another is refused. 0: any */
} cranectl_declaration;

/* The crane for which a controller is prepared; it takes the real one for it. */
typedef struct {
    double gravity, bridge_mass, trolley_mass, winch_mass, load_mass;
    double trolley_motor_mass; /* moves along y alone, besides the trolley */
    double time_constants[3]; /* of velocity drives: bridge, trolley, winch [s] */
    double period;            /* between two steps [s] */
    double state[10];         /* at the start: x_c, y_c, l, alpha, beta, each with its rate */
    double reference[15];     /* at the start */
} cranectl_nominal;

CRANECTL_EXPORT const cranectl_declaration *cranectl_controller(void);

/* What cranectl_step returns: 0 to go on, or why it cannot; any other number says that the controller failed. */
enum {
    CRANECTL_RUNNING = 0,
    CRANECTL_SLACK_ROPE = 2,
    CRANECTL_ANGLE_SINGULAR = 3,
    CRANECTL_LENGTH_SINGULAR = 4,
    CRANECTL_NON_FINITE = 5
};

/* measured: 10 states in the order above and two estimated disturbances [rad/s^2]; or 5 encoder readings.
 * reference: 15 a row, the load's path x, y, z and four derivatives; 1 + preview rows.
 * command: bridge, trolley, rope (positive pays out). */
CRANECTL_EXPORT int64_t cranectl_step(const double *parameters, const double *measured, const double *reference,
                                      double *memory, double *command);

/* May be left out. Returns 0, or that it cannot be prepared. */
CRANECTL_EXPORT int64_t cranectl_prepare(const cranectl_nominal *nominal, double *parameters, double *memory);

#ifdef __cplusplus
}
#endif
#endif
