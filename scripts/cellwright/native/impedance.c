/* Weighted least squares of a circuit to a spectrum: see protocols/impedance/fit.py, whose
 * numpy form takes the same steps.
 *
 * The circuit is a tree in one row, children before their parent. Upwards goes the impedance of each
 * node, downwards what a change of it does to the whole, for a block of frequencies at a time.
 *
 * Worth: the 18 spectra of the demo take 98 s of CPU more in numpy, over half of the run: many
 * starts on some forty points each, where numpy is mostly the cost of calling it. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "lanes.h"

enum { SERIES, PARALLEL, R, C, L, CPE, W, FLW, FSW, G };
enum { NODES = 64, PARAMETERS = 32, BLOCK = 64 };
#define HALF_PI 1.5707963267948966
#define LARGE 20.0
#define FARTHEST 2.0   /* of one step, in logarithms */
#define ARRIVED 1e-7   /* a step that moves less is the last */
#define STUCK 1e12     /* damping at which nothing helps any more */
#define EACH for (int64_t i = 0; i < BLOCK; i++)

/* Complex numbers of a block of frequencies. */
typedef struct {
    double re[BLOCK], im[BLOCK];
} row __attribute__((aligned(32)));

typedef struct {
    int64_t n, nodes, parameters, free;
    /* root: 1/√(2 omega); all filled up to whole blocks, with weight 0 */
    const double *omega, *log_omega, *root, *real, *imaginary, *weight;
    const int64_t *kind, *left, *right, *at, *column;
    const double *offset;
} problem;

static int64_t parameters_of(int64_t kind) {
    return kind == R || kind == C || kind == L || kind == W ? 1 : 2;
}

/* tanh or coth of u = x + jx, then R·wave/u and its slope by ln(tau). */
static void finite(int64_t kind, double r, double tau, const double *omega, row *z, row *slope) {
    EACH {
        const double x = sqrt(omega[i] * tau / 2.0);
        double re = 1.0, im = 0.0;
        if (x <= LARGE) {
            const double below = cosh(2 * x) + cos(2 * x);
            re = sinh(2 * x) / below;
            im = sin(2 * x) / below;
        }
        if (kind == FSW) {
            const double size = re * re + im * im;
            re = re / size;
            im = -im / size;
        }
        const double over_re = (re + im) / (2 * x), over_im = (im - re) / (2 * x);
        z->re[i] = r * over_re;
        z->im[i] = r * over_im;
        slope->re[i] = r / 2 * (1.0 - (re * re - im * im) - over_re);
        slope->im[i] = r / 2 * (-2 * re * im - over_im);
    }
}

static void gerischer(double r, double tau, const double *omega, row *z, row *slope) {
    EACH {
        const double x = omega[i] * tau, size = sqrt(1.0 + x * x);
        const double re = sqrt((size + 1.0) / 2.0), im = x / (2.0 * re);
        z->re[i] = r * re / size;
        z->im[i] = -r * im / size;
        /* −Z/2 · jx/(1 + jx) */
        const double a = -0.5 * x * x / (size * size), b = -0.5 * x / (size * size);
        slope->re[i] = z->re[i] * a - z->im[i] * b;
        slope->im[i] = z->re[i] * b + z->im[i] * a;
    }
}

/* exp(x), to rounding, for a block at once, which the library's is not. What is beyond ±700 is taken
 * there. */
static inline __attribute__((always_inline)) void exponential(double *x) {
    EACH x[i] = x[i] > -700.0 ? x[i] : -700.0;
    EACH x[i] = x[i] < 700.0 ? x[i] : 700.0;
    Lanes *lanes = (Lanes *)x;
    for (int64_t i = 0; i < BLOCK / 4; i++) {
        Lanes scale, rest, series;
        parted(&lanes[i], &scale, &rest);
        series_from(0, &rest, &series);
        lanes[i] = series * scale;
    }
}

/* Impedance of an element, and the slope by the logarithm of its second parameter, where it has
 * one. That by the first is the impedance itself, or its negative. */
static inline __attribute__((always_inline)) void element(
    int64_t kind, const problem *p, int64_t from, const double *value, row *z, row *slope) {
    const double *omega = p->omega + from, *log_omega = p->log_omega + from;
    const double first = value[0];
    if (kind == FLW || kind == FSW) finite(kind, first, value[1], omega, z, slope);
    if (kind == G) gerischer(first, value[1], omega, z, slope);
    if (kind == R) EACH z->re[i] = first, z->im[i] = 0.0;
    if (kind == L) EACH z->re[i] = 0.0, z->im[i] = omega[i] * first;
    if (kind == C) EACH z->re[i] = 0.0, z->im[i] = -1.0 / (omega[i] * first);
    if (kind == W) EACH z->re[i] = p->root[from + i] / first, z->im[i] = -z->re[i];
    if (kind == CPE) {
        const double power = value[1], re = cos(power * HALF_PI), im = sin(power * HALF_PI);
        const double scale = 1.0 / first;
        double size[BLOCK] __attribute__((aligned(32)));
        EACH size[i] = -power * log_omega[i];
        exponential(size);
        EACH {
            z->re[i] = scale * size[i] * re;
            z->im[i] = -scale * size[i] * im;
            slope->re[i] = -power * (z->re[i] * log_omega[i] - z->im[i] * HALF_PI);
            slope->im[i] = -power * (z->re[i] * HALF_PI + z->im[i] * log_omega[i]);
        }
    }
}

/* z = ab/(a + b); what a change of a does to it is (b/(a + b))². */
static inline __attribute__((always_inline)) void join(const row *a, const row *b, row *z,
                                                       row *of_a, row *of_b) {
    EACH {
        const double re = a->re[i] + b->re[i], im = a->im[i] + b->im[i];
        const double size = re * re + im * im, x = re / size, y = -im / size;
        const double p = b->re[i] * x - b->im[i] * y, q = b->re[i] * y + b->im[i] * x;
        const double s = a->re[i] * x - a->im[i] * y, t = a->re[i] * y + a->im[i] * x;
        z->re[i] = a->re[i] * p - a->im[i] * q;
        z->im[i] = a->re[i] * q + a->im[i] * p;
        of_a->re[i] = p * p - q * q;
        of_a->im[i] = 2 * p * q;
        of_b->re[i] = s * s - t * t;
        of_b->im[i] = 2 * s * t;
    }
}

static inline __attribute__((always_inline)) void multiply(const row *a, const row *b, double sign,
                                                           row *to) {
    EACH {
        const double re = a->re[i] * b->re[i] - a->im[i] * b->im[i];
        const double im = a->re[i] * b->im[i] + a->im[i] * b->re[i];
        to->re[i] = sign * re;
        to->im[i] = sign * im;
    }
}

static inline __attribute__((always_inline)) double product(const row *a, const row *b) {
    const Lanes *x = (const Lanes *)a->re, *y = (const Lanes *)b->re;
    Lanes one = {0.0}, two = {0.0}, three = {0.0}, four = {0.0};
    for (int64_t k = 0; k < BLOCK / 2; k += 4) { /* the real parts, and the imaginary ones behind */
        one += x[k] * y[k];
        two += x[k + 1] * y[k + 1];
        three += x[k + 2] * y[k + 2];
        four += x[k + 3] * y[k + 3];
    }
    const Lanes sum = (one + two) + (three + four);
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* From the whole (last node, whose reach is the weight) down to the elements: by what each node's
 * impedance enters the whole, and so the slope of each free parameter. Nodes in parallel hand on
 * what is in of_left, of_right; the slopes of own become those of the whole. */
static inline __attribute__((always_inline)) void downwards(
    const problem *p, const row *weight, row *z, row *of_left, row *of_right, row *own,
    row **slope) {
    const row *reach[NODES];
    reach[p->nodes - 1] = weight;
    for (int64_t c = 0; c < p->free; c++) slope[c] = NULL;
    for (int64_t m = p->nodes - 1; m >= 0; m--) {
        const int64_t kind = p->kind[m], a = p->left[m], b = p->right[m];
        if (kind == SERIES) reach[a] = reach[b] = reach[m];
        if (kind == PARALLEL) {
            multiply(reach[m], of_left + m, 1.0, of_left + m);
            multiply(reach[m], of_right + m, 1.0, of_right + m);
            reach[a] = of_left + m;
            reach[b] = of_right + m;
        }
        const double sign = kind == C || kind == CPE || kind == W ? -1.0 : 1.0;
        for (int64_t k = 0; kind > PARALLEL && k < parameters_of(kind); k++) {
            const int64_t c = p->column[p->at[m] + k];
            row *here = own + p->at[m] + k;
            if (c < 0) continue;
            multiply(reach[m], k ? here : z + m, k ? 1.0 : sign, here);
            if (!slope[c]) slope[c] = here;
            else EACH slope[c]->re[i] += here->re[i], slope[c]->im[i] += here->im[i];
        }
    }
}

/* Half the sum of squares at x (logarithms of the free parameters), gram = JᵀJ and gradient = Jᵀr.
 * rows, where not NULL, gets the weighted error and below it J (free + 1, 2n): the real parts of
 * all points, then the imaginary ones. */
CLONES static double evaluate(const problem *p, const double *x, double *gram, double *gradient,
                              double *rows) {
    const int64_t q = p->free, last = p->nodes - 1;
    double value[PARAMETERS], cost = 0.0;
    row z[NODES], of_left[NODES], of_right[NODES], own[PARAMETERS], weight, off;
    row *slope[PARAMETERS];
    for (int64_t k = 0; k < p->parameters; k++)
        value[k] = exp(p->offset[k] + (p->column[k] >= 0 ? x[p->column[k]] : 0.0));
    memset(gram, 0, sizeof(double) * q * q);
    memset(gradient, 0, sizeof(double) * q);
    for (int64_t from = 0; from < p->n; from += BLOCK) {
        for (int64_t m = 0; m <= last; m++) {
            const int64_t kind = p->kind[m], a = p->left[m], b = p->right[m];
            if (kind == SERIES)
                EACH z[m].re[i] = z[a].re[i] + z[b].re[i], z[m].im[i] = z[a].im[i] + z[b].im[i];
            else if (kind == PARALLEL) join(z + a, z + b, z + m, of_left + m, of_right + m);
            else element(kind, p, from, value + p->at[m], z + m, own + p->at[m] + 1);
        }
        const double *w = p->weight + from;
        EACH {
            off.re[i] = w[i] * (z[last].re[i] - p->real[from + i]);
            off.im[i] = w[i] * (z[last].im[i] - p->imaginary[from + i]);
            weight.re[i] = w[i], weight.im[i] = 0.0;
        }
        downwards(p, &weight, z, of_left, of_right, own, slope);
        const int64_t size = p->n - from < BLOCK ? p->n - from : BLOCK;
        for (int64_t a = 0; rows && a <= q; a++) {
            const row *one = a ? slope[a - 1] : &off;
            memcpy(rows + 2 * a * p->n + from, one->re, sizeof(double) * size);
            memcpy(rows + (2 * a + 1) * p->n + from, one->im, sizeof(double) * size);
        }
        cost += 0.5 * product(&off, &off);
        for (int64_t a = 0; a < q; a++) {
            gradient[a] += product(slope[a], &off);
            for (int64_t b = 0; b <= a; b++) gram[a * q + b] += product(slope[a], slope[b]);
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
    for (int64_t a = 0; a < q; a++) x[a] = fmin(fmax(x[a], lower[a]), upper[a]);
    double cost = evaluate(p, x, gram[0], gradient[0], NULL);
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
        if (moved < ARRIVED) { /* below what the cost resolves: made without another look */
            memcpy(x, trial, sizeof(double) * q);
            break;
        }
        const double next = evaluate(p, trial, gram[1 - now], gradient[1 - now], NULL);
        if (next < cost) {
            memcpy(x, trial, sizeof(double) * q);
            cost = next;
            now = 1 - now;
            damping = fmax(damping / 10.0, 1e-12);
        } else {
            damping *= 10.0;
        }
    }
    return cost;
}

/* From one start (starts, free) after the other, in place, to an optimum: its cost (starts) and
 * passes. Done when `enough` of them have led to the best, the costs of the rest infinite. rows :
 * as of `evaluate`, at the best.
 * impedance : real and imaginary part (n, 2). tree : kind, left, right, at (nodes) each.
 * work : six rows of n filled up to whole blocks. */
void impedance_search(int64_t n, int64_t nodes, int64_t parameters, int64_t free_, int64_t starts,
                      int64_t enough, int64_t most, double same, const double *frequency,
                      const double *impedance, const double *weight, const int64_t *tree,
                      const int64_t *column, const double *offset, const double *lower,
                      const double *upper, double *work, double *x, double *cost,
                      int64_t *passes, double *rows) {
    const int64_t room = (n + BLOCK - 1) / BLOCK * BLOCK;
    for (int64_t i = 0; i < room; i++) {
        const int64_t k = i < n ? i : n - 1;
        work[i] = 4.0 * HALF_PI * frequency[k];
        work[room + i] = log(work[i]);
        work[2 * room + i] = 1.0 / sqrt(2.0 * work[i]);
        work[3 * room + i] = impedance[2 * k];
        work[4 * room + i] = impedance[2 * k + 1];
        work[5 * room + i] = i < n ? weight[k] : 0.0;
    }
    const problem p = {n, nodes, parameters, free_, work, work + room, work + 2 * room,
                       work + 3 * room, work + 4 * room, work + 5 * room, tree, tree + nodes,
                       tree + 2 * nodes, tree + 3 * nodes, column, offset};
    int64_t arrived = 0;
    int64_t best_start = 0;
    double best = INFINITY;
    for (int64_t s = 0; s < starts; s++) {
        cost[s] = INFINITY;
        passes[s] = 0;
        if (arrived >= enough) continue;
        cost[s] = search(&p, lower, upper, most, x + s * free_, passes + s);
        if (cost[s] < best) best = cost[s], best_start = s;
        arrived = 0;
        for (int64_t k = 0; k <= s; k++) arrived += cost[k] <= best * (1.0 + same);
    }
    double gram[PARAMETERS * PARAMETERS], gradient[PARAMETERS];
    evaluate(&p, x + best_start * free_, gram, gradient, rows);
}
