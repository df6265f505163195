/* Weighted least squares of a circuit to a spectrum: see protocols/impedance/levenberg.py, whose
 * numpy form takes the same steps.
 *
 * The circuit is a tree in one row, children before their parent. Per frequency: upwards the
 * impedance of each node, downwards what a change of it does to the whole. */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { SERIES, PARALLEL, R, C, L, CPE, W, FLW, FSW, G };
enum { NODES = 64, PARAMETERS = 32 };
#define HALF_PI 1.5707963267948966
#define LARGE 20.0
#define FARTHEST 2.0   /* of one step, in logarithms */
#define ARRIVED 1e-7   /* a step that moves less is the last */
#define STUCK 1e12     /* damping at which nothing helps any more */

typedef struct { double re, im; } complex_t;

static inline complex_t times(complex_t a, complex_t b) {
    return (complex_t){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}
static inline complex_t plus(complex_t a, complex_t b) {
    return (complex_t){a.re + b.re, a.im + b.im};
}
static inline complex_t over(complex_t a, complex_t b) {
    const double size = b.re * b.re + b.im * b.im;
    return (complex_t){(a.re * b.re + a.im * b.im) / size, (a.im * b.re - a.re * b.im) / size};
}
static inline complex_t scaled(double f, complex_t a) { return (complex_t){f * a.re, f * a.im}; }

typedef struct {
    int64_t n, nodes, parameters, free;
    const double *omega, *log_omega, *root, *real, *imaginary, *weight; /* root: 1/√(2 omega) */
    const int64_t *kind, *left, *right, *at, *column;
    const double *offset;
} problem;

/* tanh(x + jx) */
static complex_t wave_of(double x) {
    if (x > LARGE) return (complex_t){1.0, 0.0};
    const double below = cosh(2 * x) + cos(2 * x);
    return (complex_t){sinh(2 * x) / below, sin(2 * x) / below};
}

/* R·wave/u with u = x + jx, and its slope by ln(tau); wave is tanh or coth of u. */
static complex_t finite(double r, double x, complex_t wave, complex_t *slope) {
    const complex_t share = over(wave, (complex_t){x, x}), square = times(wave, wave);
    *slope = (complex_t){r / 2 * (1.0 - square.re - share.re), r / 2 * (-square.im - share.im)};
    return scaled(r, share);
}

/* Impedance of an element; `slope` by the logarithm of each parameter. `turn` is (cos, sin) of
 * P·pi/2 for a constant-phase element. */
static inline complex_t element(int64_t kind, double omega, double log_omega, double root,
                                const double *value, complex_t turn, complex_t *slope) {
    complex_t z = {0.0, 0.0};
    switch (kind) {
    case R: z.re = value[0]; slope[0] = z; break;
    case C: z.im = -1.0 / (omega * value[0]); slope[0] = scaled(-1.0, z); break;
    case L: z.im = omega * value[0]; slope[0] = z; break;
    case CPE: {
        const double size = exp(-value[1] * log_omega) / value[0];
        z = (complex_t){size * turn.re, -size * turn.im};
        slope[0] = scaled(-1.0, z);
        slope[1] = times(scaled(-value[1], z), (complex_t){log_omega, HALF_PI});
        break;
    }
    case W: {
        const double size = root / value[0];
        z = (complex_t){size, -size};
        slope[0] = scaled(-1.0, z);
        break;
    }
    case FLW: case FSW: {
        const double x = sqrt(omega * value[1] / 2.0);
        const complex_t wave = wave_of(x), one = {1.0, 0.0};
        z = finite(value[0], x, kind == FLW ? wave : over(one, wave), slope + 1);
        slope[0] = z;
        break;
    }
    case G: {
        const double x = omega * value[1], size = hypot(1.0, x);
        const complex_t root = {sqrt((size + 1.0) / 2.0), x / sqrt(2.0 * (size + 1.0))};
        z = over((complex_t){value[0], 0.0}, root);
        slope[0] = z;
        slope[1] = scaled(-0.5, times(z, over((complex_t){0.0, x}, (complex_t){1.0, x})));
        break;
    }
    }
    return z;
}

/* Half the sum of squares at x (logarithms of the free parameters), gram = JᵀJ and slope = Jᵀr. */
static double evaluate(const problem *p, const double *x, double *gram, double *gradient) {
    const int64_t q = p->free;
    double value[PARAMETERS], cost = 0.0;
    complex_t z[NODES], reach[NODES], of_left[NODES], of_right[NODES];
    complex_t own[PARAMETERS], turn[NODES], total[PARAMETERS];
    for (int64_t k = 0; k < p->parameters; k++)
        value[k] = exp(p->offset[k] + (p->column[k] >= 0 ? x[p->column[k]] : 0.0));
    for (int64_t m = 0; m < p->nodes; m++)
        if (p->kind[m] == CPE) {
            const double angle = value[p->at[m] + 1] * HALF_PI;
            turn[m] = (complex_t){cos(angle), sin(angle)};
        } else turn[m] = (complex_t){1.0, 0.0};
    memset(gram, 0, sizeof(double) * q * q);
    memset(gradient, 0, sizeof(double) * q);
    for (int64_t i = 0; i < p->n; i++) {
        for (int64_t m = 0; m < p->nodes; m++) {
            const int64_t kind = p->kind[m];
            if (kind > PARALLEL) {
                z[m] = element(kind, p->omega[i], p->log_omega[i], p->root[i], value + p->at[m],
                               turn[m], own + p->at[m]);
                continue;
            }
            const complex_t a = z[p->left[m]], b = z[p->right[m]], sum = plus(a, b);
            z[m] = sum;
            if (kind == SERIES) continue;
            const double size = sum.re * sum.re + sum.im * sum.im;
            const complex_t inverse = {sum.re / size, -sum.im / size};
            of_left[m] = times(b, inverse);
            of_right[m] = times(a, inverse);
            z[m] = times(a, of_left[m]);
        }
        const double w = p->weight[i];
        memset(total, 0, sizeof(complex_t) * q);
        reach[p->nodes - 1] = (complex_t){w, 0.0};
        for (int64_t m = p->nodes - 1; m >= 0; m--) {
            const int64_t kind = p->kind[m], a = p->left[m], b = p->right[m];
            if (kind == SERIES) {
                reach[a] = reach[b] = reach[m];
            } else if (kind == PARALLEL) {
                reach[a] = times(reach[m], times(of_left[m], of_left[m]));
                reach[b] = times(reach[m], times(of_right[m], of_right[m]));
            } else {
                const int64_t count = kind == R || kind == C || kind == L || kind == W ? 1 : 2;
                for (int64_t k = p->at[m]; k < p->at[m] + count; k++)
                    if (p->column[k] >= 0)
                        total[p->column[k]] =
                            plus(total[p->column[k]], times(reach[m], own[k]));
            }
        }
        const complex_t whole = z[p->nodes - 1];
        const complex_t off = {w * (whole.re - p->real[i]), w * (whole.im - p->imaginary[i])};
        cost += 0.5 * (off.re * off.re + off.im * off.im);
        for (int64_t a = 0; a < q; a++) {
            gradient[a] += total[a].re * off.re + total[a].im * off.im;
            for (int64_t b = 0; b <= a; b++)
                gram[a * q + b] += total[a].re * total[b].re + total[a].im * total[b].im;
        }
    }
    for (int64_t a = 0; a < q; a++)
        for (int64_t b = a + 1; b < q; b++) gram[a * q + b] = gram[b * q + a];
    return cost;
}

/* Step of the damped normal equations by Cholesky; what is at a bound and pushed outwards stays.
 * Returns 0 where the matrix is not positive. */
static int step_of(int64_t q, const double *gram, const double *gradient, double damping,
                   const int64_t *held, double *step) {
    double m[PARAMETERS * PARAMETERS], largest = 0.0;
    for (int64_t a = 0; a < q; a++) largest = fmax(largest, gram[a * q + a]);
    for (int64_t a = 0; a < q; a++) {
        for (int64_t b = 0; b <= a; b++)
            m[a * q + b] = held[a] || held[b] ? 0.0 : gram[a * q + b];
        m[a * q + a] = held[a] ? 1.0
                               : gram[a * q + a] + damping * fmax(gram[a * q + a], 1e-12 * largest);
        step[a] = held[a] ? 0.0 : -gradient[a];
    }
    for (int64_t a = 0; a < q; a++)
        for (int64_t b = 0; b <= a; b++) {
            double sum = m[a * q + b];
            for (int64_t k = 0; k < b; k++) sum -= m[a * q + k] * m[b * q + k];
            if (a == b && !(sum > 0.0)) return 0;
            m[a * q + b] = a == b ? sqrt(sum) : sum / m[b * q + b];
        }
    for (int64_t a = 0; a < q; a++) {
        for (int64_t k = 0; k < a; k++) step[a] -= m[a * q + k] * step[k];
        step[a] /= m[a * q + a];
    }
    for (int64_t a = q - 1; a >= 0; a--) {
        for (int64_t k = a + 1; k < q; k++) step[a] -= m[k * q + a] * step[k];
        step[a] /= m[a * q + a];
    }
    return 1;
}

/* Levenberg-Marquardt from one start, in place; returns the cost. */
static double search(const problem *p, const double *lower, const double *upper, int64_t most,
                     double *x, int64_t *passes) {
    const int64_t q = p->free;
    double gram[2][PARAMETERS * PARAMETERS], gradient[2][PARAMETERS];
    double step[PARAMETERS], trial[PARAMETERS], damping = 1e-2;
    int64_t held[PARAMETERS], now = 0;
    double cost = evaluate(p, x, gram[0], gradient[0]);
    for (*passes = 1; *passes < most && damping < STUCK; ++*passes) {
        for (int64_t a = 0; a < q; a++)
            held[a] = (x[a] <= lower[a] && gradient[now][a] > 0.0) ||
                      (x[a] >= upper[a] && gradient[now][a] < 0.0);
        if (!step_of(q, gram[now], gradient[now], damping, held, step)) {
            damping *= 10.0;
            continue;
        }
        double farthest = 0.0, moved = 0.0;
        for (int64_t a = 0; a < q; a++) farthest = fmax(farthest, fabs(step[a]));
        const double share = farthest > FARTHEST ? FARTHEST / farthest : 1.0;
        for (int64_t a = 0; a < q; a++) {
            trial[a] = fmin(fmax(x[a] + share * step[a], lower[a]), upper[a]);
            moved = fmax(moved, fabs(trial[a] - x[a]));
        }
        const double next = evaluate(p, trial, gram[1 - now], gradient[1 - now]);
        if (next < cost || moved < ARRIVED) { /* the last step is below what the cost resolves */
            memcpy(x, trial, sizeof(double) * q);
            cost = next;
            now = 1 - now;
            damping = fmax(damping / 10.0, 1e-12);
        } else {
            damping *= 10.0;
        }
        if (moved < ARRIVED) break;
    }
    return cost;
}

/* From one start (starts, free) after the other, in place, to an optimum: its cost (starts) and
 * passes. Done when `enough` of them have led to the best, the costs of the rest infinite. */
void impedance_search(int64_t n, int64_t nodes, int64_t parameters, int64_t free_, int64_t starts,
                      int64_t enough, int64_t most, double same, const double *omega,
                      const double *real, const double *imaginary, const double *weight,
                      const int64_t *kind, const int64_t *left, const int64_t *right,
                      const int64_t *at, const int64_t *column, const double *offset,
                      const double *lower, const double *upper, double *work, double *x,
                      double *cost, int64_t *passes) {
    const problem p = {n,      nodes, parameters, free_, omega, work,  work + n, real, imaginary,
                       weight, kind,  left,       right, at,    column, offset};
    for (int64_t i = 0; i < n; i++) {
        work[i] = log(omega[i]);
        work[n + i] = 1.0 / sqrt(2.0 * omega[i]);
    }
    int64_t arrived = 0;
    double best = INFINITY;
    for (int64_t s = 0; s < starts; s++) {
        cost[s] = INFINITY;
        passes[s] = 0;
        if (arrived >= enough) continue;
        cost[s] = search(&p, lower, upper, most, x + s * free_, passes + s);
        best = fmin(best, cost[s]);
        arrived = 0;
        for (int64_t k = 0; k <= s; k++) arrived += cost[k] <= best * (1.0 + same);
    }
}
