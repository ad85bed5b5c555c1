/* `nmpc`: nonlinear model predictive control by real-time iterations, with limits on speed and acceleration.
 *
 *     cc -O2 -shared -fPIC -ffp-contract=off -Icranectl/loaders -o nmpc.so \
 *         validation/benchmark/nmpc/nmpc.c validation/benchmark/nmpc/model.c -lm
 *     cranectl run fast-diagonal --controller nmpc.so
 *
 * Every EVERY periods, with the load z and its path z_d, the drives' accelerations u and speeds v,
 *
 *     min sum over N steps of |z - z_d|^2/l^2 + rate |z' - z_d'|^2/(g l) + effort |u|^2/g^2
 *     over u,   under   |u_i| <= acceleration g,   |v_i| <= speed sqrt(g l)
 *
 * The problem is linearised about the previous plan, shifted by one step. The model is the rigid crane
 * (`model.c`, by CasADi) with constant observed disturbances. Operator splitting (ADMM) reduces the limits to
 * clipping; its multipliers pass from plan to plan. What remains is a linear-quadratic problem, with one
 * Riccati recursion per plan.
 *
 * - Measured: the full state, and the disturbance if there is an observer. It uses a preview of the path.
 * - Assumed: gravity; masses are not used.
 * - Certain: the method. Weights and horizon are ours. The iterations use the Gauss-Newton Hessian.
 * - Limits: a constant disturbance that no observer estimates leaves an error. Commands change in steps from
 *   plan to plan, so with a small `effort` the drives' limits on acceleration make the loop unstable. It
 *   neglects the lag of the drives: with an effort of 1, the harbour crane's load keeps swinging by 0.8 m.
 *
 * Sources: Diehl, Bock, Schloeder, SIAM J. Control Optim. 43 (2005), real-time iterations. Boyd and others,
 * Found. Trends Mach. Learn. 3 (2011), section 5, the quadratic program.
 */
#include <math.h>
#include <string.h>

#include "cranectl.h"

enum { N = 40, NX = 10, NU = 3, NZ = 6, EVERY = 25, SPLITS = 40, ROW = 15 };
enum { WIDTH = 3 * NU }; /* of a step of a plan: u, then the multipliers of the limits on u and v */
enum { RATE, EFFORT, ACCELERATION, SPEED, GRAVITY, PERIOD, NUMBERS }; /* indices of parameters */

/* from model.c, with CasADi's calling convention; neither needs work memory */
int crane_slope(const double **arg, double **res, long long *iw, double *w, int mem);
int crane_load(const double **arg, double **res, long long *iw, double *w, int mem);

static const cranectl_parameter parameters[] = {
    {"rate", "1", "weight of the error's rate", 0.3, 0.0, 1e3, {0.03, 3.0}, 0.0},
    {"effort", "1", "weight of accelerations", 3.0, 1e-9, 1e3, {0.1, 10.0}, 0.0},
    {"acceleration", "g", "limit of each drive", 0.5, 1e-3, 1e2, {0.05, 2.0}, 0.0},
    {"speed", "sqrt(g l)", "limit of each drive", 1.0, 1e-3, 1e2, {0.1, 3.0}, 0.0},
};

static const cranectl_declaration declaration = {
    .abi = CRANECTL_ABI,
    .size = sizeof declaration,
    .name = "nmpc",
    .title = "nonlinear model predictive control, real-time iterations",
    .command = CRANECTL_ACCELERATION,
    .follows = CRANECTL_PATH,
    .measures = CRANECTL_STATE,
    .every = EVERY,
    .preview = EVERY * N,
    .memory = N * WIDTH,
    .numbers = NUMBERS,
    .parameter_count = sizeof parameters / sizeof *parameters,
    .parameters = parameters,
    .reads = "gravity",
};

CRANECTL_EXPORT const cranectl_declaration *cranectl_controller(void) { return &declaration; }

CRANECTL_EXPORT int64_t cranectl_prepare(const cranectl_nominal *nominal, double *numbers, double *memory)
{
    (void)memory;
    numbers[GRAVITY] = nominal->gravity;
    numbers[PERIOD] = nominal->period;
    return 0;
}

static const double SHARE = 20.0; /* ADMM's penalty over the weight of u */

static double clipped(double value, double limit) { return fmin(fmax(value, -limit), limit); }

/* Predict one step by the midpoint rule, with its Jacobians in CasADi's order, column by column. */
static void predict(const double *p, const double *x, const double *u, const double *push, double *next,
                    double a[NX][NX], double b[NU][NX])
{
    double first[NX], second[NX], middle[NX], a_1[NX][NX], a_2[NX][NX], b_1[NU][NX], b_2[NU][NX];
    const double h = p[PERIOD], *arg[] = {x, u, push, p + GRAVITY};
    double *res[] = {first, a_1[0], b_1[0]};
    crane_slope(arg, res, 0, 0, 0);
    for (int i = 0; i < NX; i++)
        middle[i] = x[i] + 0.5 * h * first[i];
    arg[0] = middle;
    res[0] = second, res[1] = a_2[0], res[2] = b_2[0];
    crane_slope(arg, res, 0, 0, 0);
    for (int i = 0; i < NX; i++) {
        next[i] = x[i] + h * second[i];
        for (int j = 0; j < NX; j++) {
            a[j][i] = (i == j) + h * a_2[j][i];
            for (int s = 0; s < NX; s++)
                a[j][i] += 0.5 * h * h * a_2[s][i] * a_1[j][s];
        }
        for (int j = 0; j < NU; j++) {
            b[j][i] = h * b_2[j][i];
            for (int s = 0; s < NX; s++)
                b[j][i] += 0.5 * h * h * a_2[s][i] * b_1[j][s];
        }
    }
}

typedef struct { /* quadratic program: x+ = a x + b u, cost x'(q x/2 + c) + u'(r u/2 + d) */
    double a[N][NX][NX], b[N][NU][NX];            /* columns */
    double q[N + 1][NX][NX], c[N + 1][NX];
    double gain[N][NU][NX], solved[N][NU][NU];    /* u = -gain x - solved g; (r + b'P b)^-1 */
} program;

/* Invert a symmetric positive definite 3 x 3 matrix. */
static void inverted(double m[NU][NU], double found[NU][NU])
{
    double determinant = 0.0;
    for (int i = 0; i < NU; i++)
        for (int j = 0; j < NU; j++) {
            int k = (i + 1) % NU, l = (i + 2) % NU, s = (j + 1) % NU, t = (j + 2) % NU;
            found[j][i] = m[k][s] * m[l][t] - m[k][t] * m[l][s];
        }
    for (int i = 0; i < NU; i++)
        determinant += m[0][i] * found[i][0];
    for (int i = 0; i < NU; i++)
        for (int j = 0; j < NU; j++)
            found[i][j] /= determinant;
}

static double dot(const double *a, const double *b, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

/* Compute the part of the Riccati recursion that does not change during the splitting iterations. */
static void factorise(program *of, double r)
{
    double cost[NX][NX], ca[NX][NX], cb[NU][NX], m[NU][NU];
    memcpy(cost, of->q[N], sizeof cost);
    for (int k = N - 1; k >= 0; k--) {
        for (int j = 0; j < NX; j++)
            for (int i = 0; i < NX; i++)
                ca[j][i] = dot(cost[i], of->a[k][j], NX); /* column j of P A */
        for (int j = 0; j < NU; j++)
            for (int i = 0; i < NX; i++)
                cb[j][i] = dot(cost[i], of->b[k][j], NX);
        for (int i = 0; i < NU; i++)
            for (int j = 0; j < NU; j++)
                m[i][j] = dot(of->b[k][i], cb[j], NX) + (i == j ? r : 0.0);
        inverted(m, of->solved[k]);
        for (int i = 0; i < NU; i++)
            for (int j = 0; j < NX; j++) {
                of->gain[k][i][j] = 0.0;
                for (int s = 0; s < NU; s++)
                    of->gain[k][i][j] += of->solved[k][i][s] * dot(of->b[k][s], ca[j], NX);
            }
        for (int i = 0; i < NX; i++)
            for (int j = 0; j < NX; j++) {
                cost[i][j] = of->q[k][i][j] + dot(of->a[k][i], ca[j], NX);
                for (int s = 0; s < NU; s++)
                    cost[i][j] -= dot(of->a[k][i], cb[s], NX) * of->gain[k][s][j];
            }
    }
}

/* Find inputs u (N, NU) and states x (N + 1, NX) with the least cost from x = 0, for the linear parts c, d. */
static void solve(const program *of, double c[N + 1][NX], double d[N][NU], double x[N + 1][NX],
                  double u[N][NU])
{
    double p[NX], next[NX], push[N][NU];
    memcpy(p, c[N], sizeof p);
    for (int k = N - 1; k >= 0; k--) {
        double g[NU];
        for (int i = 0; i < NU; i++)
            g[i] = dot(of->b[k][i], p, NX) + d[k][i];
        for (int i = 0; i < NU; i++)
            push[k][i] = dot(of->solved[k][i], g, NU);
        for (int i = 0; i < NX; i++) {
            next[i] = c[k][i] + dot(of->a[k][i], p, NX);
            for (int s = 0; s < NU; s++)
                next[i] -= of->gain[k][s][i] * g[s];
        }
        memcpy(p, next, sizeof p);
    }
    memset(x[0], 0, sizeof x[0]);
    for (int k = 0; k < N; k++) {
        for (int i = 0; i < NU; i++)
            u[k][i] = -dot(of->gain[k][i], x[k], NX) - push[k][i];
        for (int i = 0; i < NX; i++) {
            x[k + 1][i] = 0.0;
            for (int j = 0; j < NX; j++)
                x[k + 1][i] += of->a[k][j][i] * x[k][j];
            for (int j = 0; j < NU; j++)
                x[k + 1][i] += of->b[k][j][i] * u[k][j];
        }
    }
}

/* Improve `plan` (N, WIDTH) by one iteration from the state `measured` along the path. */
CRANECTL_EXPORT void nmpc_improve(const double *p, const double *measured, const double *reference,
                                  double *plan)
{
    static const int speeds[NU] = {1, 3, 5}; /* indices of states */
    double x[N + 1][NX], dx[N + 1][NX], du[N][NU], c[N + 1][NX], d[N][NU], kept[N][2 * NU];
    double(*u)[WIDTH] = (double(*)[WIDTH])plan;
    const double gravity = p[GRAVITY], length = measured[4];
    const double weight[2] = {1.0 / (length * length), p[RATE] / (gravity * length)};
    const double limits[2] = {p[ACCELERATION] * gravity, p[SPEED] * sqrt(gravity * length)};
    const double r = p[EFFORT] / (gravity * gravity);
    const double rho[2] = {SHARE * r, SHARE * p[EFFORT] / (gravity * length)};
    program of;
    memset(&of, 0, sizeof of);
    memcpy(x[0], measured, sizeof x[0]);
    for (int k = 0; k < N; k++) {
        double seen[NZ], jacobian[NX][NZ];
        predict(p, x[k], u[k], measured + NX, x[k + 1], of.a[k], of.b[k]);
        const double *arg[] = {x[k + 1]};
        double *res[] = {seen, jacobian[0]};
        crane_load(arg, res, 0, 0, 0);
        for (int s = 0; s < NZ; s++)
            seen[s] -= reference[EVERY * (k + 1) * ROW + s];
        for (int i = 0; i < NX; i++)
            for (int s = 0; s < NZ; s++) {
                of.c[k + 1][i] += weight[s / 3] * jacobian[i][s] * seen[s];
                for (int j = 0; j < NX; j++)
                    of.q[k + 1][i][j] += weight[s / 3] * jacobian[i][s] * jacobian[j][s];
            }
        for (int i = 0; i < NU; i++) {
            of.q[k + 1][speeds[i]][speeds[i]] += rho[1];
            kept[k][i] = clipped(u[k][i] + u[k][NU + i], limits[0]);
            kept[k][NU + i] = clipped(x[k + 1][speeds[i]] + u[k][2 * NU + i], limits[1]);
        }
    }
    factorise(&of, r + rho[0]);
    for (int split = 0; split < SPLITS; split++) {
        memcpy(c, of.c, sizeof c);
        for (int k = 0; k < N; k++)
            for (int i = 0; i < NU; i++) {
                d[k][i] = r * u[k][i] + rho[0] * (u[k][i] - kept[k][i] + u[k][NU + i]);
                c[k + 1][speeds[i]] += rho[1] * (x[k + 1][speeds[i]] - kept[k][NU + i] + u[k][2 * NU + i]);
            }
        solve(&of, c, d, dx, du);
        for (int k = 0; k < N; k++)
            for (int i = 0; i < NU; i++) {
                double found[2] = {u[k][i] + du[k][i], x[k + 1][speeds[i]] + dx[k + 1][speeds[i]]};
                for (int s = 0; s < 2; s++) {
                    double *z = &kept[k][s * NU + i], *price = &u[k][(s + 1) * NU + i];
                    *z = clipped(found[s] + *price, limits[s]);
                    *price += found[s] - *z;
                }
            }
    }
    for (int k = 0; k < N; k++)
        for (int i = 0; i < NU; i++)
            u[k][i] = clipped(u[k][i] + du[k][i], limits[0]);
}

CRANECTL_EXPORT int64_t cranectl_step(const double *p, const double *measured, const double *reference,
                                      double *memory, double *command)
{
    nmpc_improve(p, measured, reference, memory);
    memcpy(command, memory, NU * sizeof *memory);
    memmove(memory, memory + WIDTH, (N - 1) * WIDTH * sizeof *memory); /* keep the last step */
    return 0;
}
