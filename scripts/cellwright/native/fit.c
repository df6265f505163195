/* Products of all columns of a circuit's linear model in one pass: see models/normal.py.
 *
 * Columns are made a block at a time, small enough to stay in the nearest cache, and multiplied
 * there; no matrix of the length of the record is ever written. */
#include <math.h>
#include <stdint.h>

#include "lanes.h"

enum { BLOCK = 128, PAIRS = 24, COLUMNS = 56 };

/* Weights of one lag over a step, and their derivatives by ln(tau). */
typedef struct {
    double decay, before, after, decay_slope, before_slope, after_slope;
} Weights;

static Weights weights_of(double step, double tau, int64_t first_order) {
    const double ratio = step / tau;
    const double gain = -expm1(-ratio);
    const double decay = 1.0 - gain;
    Weights w = {decay, gain, 0.0, ratio * decay, -ratio * decay, 0.0};
    if (first_order) {
        const double mean = ratio > 0.0 ? gain / ratio : 1.0;
        w.before = mean + gain - 1.0;
        w.after = 1.0 - mean;
        w.before_slope = mean - decay - ratio * decay;
        w.after_slope = decay - mean;
    }
    return w;
}

static inline __attribute__((always_inline)) double sum_of(const Lanes *x) {
    return ((*x)[0] + (*x)[1]) + ((*x)[2] + (*x)[3]);
}

/* Two products with one column at a time: each value is read half as often. */
static inline __attribute__((always_inline)) void add_products(
    int64_t columns, double (*column)[BLOCK], double *gram) {
    for (int64_t i = 0; i < columns; i++) {
        const Lanes *x = (const Lanes *)column[i];
        double *row = gram + i * columns;
        for (int64_t j = i; j < columns; j += 2) {
            const int64_t second = j + 1 < columns ? j + 1 : j;
            const Lanes *y = (const Lanes *)column[j], *z = (const Lanes *)column[second];
            Lanes even = {0.0}, odd = {0.0}, next_even = {0.0}, next_odd = {0.0};
            for (int64_t k = 0; k < BLOCK / 4; k += 2) {
                even += x[k] * y[k];
                next_even += x[k] * z[k];
                odd += x[k + 1] * y[k + 1];
                next_odd += x[k + 1] * z[k + 1];
            }
            even += odd;
            next_even += next_odd;
            row[j] += sum_of(&even);
            if (second > j) row[second] += sum_of(&next_even);
        }
    }
}

static inline __attribute__((always_inline)) double neighbours(const double *x) {
    double sum[4] = {0.0}, last = 0.0;
    for (int64_t k = 0; k + 4 < BLOCK; k += 4)
        for (int64_t lane = 0; lane < 4; lane++) sum[lane] += x[k + lane] * x[k + lane + 1];
    for (int64_t k = BLOCK - 4; k + 1 < BLOCK; k++) last += x[k] * x[k + 1];
    return last + ((sum[0] + sum[1]) + (sum[2] + sum[3]));
}

/* Columns of one block: fixed, lags, derivatives of the lags (where sloped), residual. `pairs` and
 * `sloped` are constants where this is inlined for the common case. */
static inline __attribute__((always_inline)) void run(
    int64_t n, int64_t fixed, int64_t pairs, int64_t sloped, const double *step,
    const double *drive, const double *fixed_column, const double *target, int64_t first_order,
    const double *tau, const double *gain, double *gram, double *near) {
    const int64_t linear = fixed + pairs, columns = linear + (sloped ? pairs : 0) + 1;
    double column[COLUMNS][BLOCK] __attribute__((aligned(32)));
    double lagged[PAIRS] = {0.0}, slope[PAIRS] = {0.0}, last_step = -1.0, before = 0.0;
    Weights w[PAIRS] = {{0.0}};
    for (int64_t from = 0; from < n; from += BLOCK) {
        const int64_t size = n - from < BLOCK ? n - from : BLOCK;
        double *residual = column[columns - 1];
        for (int64_t c = 0; c < columns; c++)
            for (int64_t k = size; k < BLOCK; k++) column[c][k] = 0.0;
        for (int64_t k = 0; k < size; k++) {
            for (int64_t j = 0; j < pairs; j++) {
                column[fixed + j][k] = lagged[j];
                if (sloped) column[linear + j][k] = slope[j];
            }
            const int64_t at = from + k;
            if (at + 1 >= n) break;
            if (step[at] != last_step) {
                last_step = step[at];
                for (int64_t j = 0; j < pairs; j++) w[j] = weights_of(last_step, tau[j], first_order);
            }
            const double here = drive[at], next = drive[at + 1];
            for (int64_t j = 0; j < pairs; j++) {
                if (sloped)
                    slope[j] = w[j].decay * slope[j] + (w[j].decay_slope * lagged[j] +
                               (w[j].before_slope * here + w[j].after_slope * next));
                lagged[j] = w[j].decay * lagged[j] + (w[j].before * here + w[j].after * next);
            }
        }
        for (int64_t c = 0; c < fixed; c++)
            for (int64_t k = 0; k < size; k++) column[c][k] = fixed_column[c * n + from + k];
        for (int64_t k = 0; k < size; k++) residual[k] = target[from + k];
        for (int64_t c = 0; c < linear; c++)
            for (int64_t k = 0; k < size; k++) residual[k] -= gain[c] * column[c][k];
        *near += before * residual[0] + neighbours(residual);
        before = residual[BLOCK - 1];
        add_products(columns, column, gram);
    }
    for (int64_t i = 0; i < columns; i++)
        for (int64_t j = 0; j < i; j++) gram[i * columns + j] = gram[j * columns + i];
}

/* gram (columns, columns) and near (1), both zero at first, get the products of all columns, and
 * of each residual with the one before it. */
CLONES void circuit_products(int64_t n, int64_t fixed, int64_t pairs, int64_t sloped, const double *step,
                      const double *drive, const double *fixed_column, const double *target,
                      int64_t first_order, const double *tau, const double *gain, double *gram,
                      double *near) {
#define RUN(PAIRS_, SLOPED_)                                                                      \
    run(n, fixed, PAIRS_, SLOPED_, step, drive, fixed_column, target, first_order, tau, gain, gram, \
        near)
    if (sloped && pairs == 1) RUN(1, 1);
    else if (sloped && pairs == 2) RUN(2, 1);
    else RUN(pairs, sloped);
#undef RUN
}
