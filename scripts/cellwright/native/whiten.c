/* Whitening of white noise beside an Ornstein-Uhlenbeck process: see numerics/noise.py.
 *
 * The gains of the scalar Kalman filter depend on the clock alone, so that they are made once and
 * every column of a matrix runs through the same recursion.
 *
 * Worth: about 11 % of the CPU of the demo. The columns by LAPACK's banded solve take eight times
 * as long, the gains in Python 24 times; both are asked for thousands of times by a search. */
#include <math.h>
#include <stdint.h>

#include "lanes.h"
#include "settled.h"

/* keep[k]: what is left of the slow part since the row before, 0 at the first row of a record;
 * white[k]: variance of the white part. Gives the gains and one over the innovation's deviation. */
void whitening_gains(int64_t n, const double *keep, const double *white, double slow, double *gain,
                     double *scale) {
    double left = slow;
    for (int64_t k = 0; k < n; k++) {
        const double prior = keep[k] * keep[k] * left + (1.0 - keep[k] * keep[k]) * slow;
        const double total = prior + white[k];
        gain[k] = prior / total;
        scale[k] = 1.0 / sqrt(total);
        left = (1.0 - gain[k]) * prior;
    }
}

enum { ABREAST = 8 }; /* columns: the recursion of one waits for itself, of many for none */

/* `m` columns, at most ABREAST. */
static inline __attribute__((always_inline)) void abreast(int64_t n, int64_t m, const double *keep,
        const double *gain, const double *scale, double *columns) {
    double state[ABREAST] = {0.0};
    for (int64_t from = 0; from < n; from += BLOCK) {
        const int64_t end = n - from < BLOCK ? n : from + BLOCK;
        for (int64_t k = from; k < end; k++) {
#pragma GCC unroll 8
            for (int64_t j = 0; j < m; j++) {
                const double expected = keep[k] * state[j];
                const double news = columns[j * n + k] - expected;
                state[j] = expected + gain[k] * news;
                columns[j * n + k] = scale[k] * news;
            }
        }
        for (int64_t j = 0; j < m; j++) state[j] = settled(state[j]);
    }
}

enum { QUARTETS = 3 }; /* of columns: enough that none waits for itself, and registers hold them */

/* 4 · QUARTETS columns, four to a register. */
CLONES static void in_lanes(int64_t n, const double *keep, const double *gain, const double *scale,
                            double *columns) {
    Lanes state[QUARTETS] = {{0.0}};
    for (int64_t from = 0; from < n; from += BLOCK) {
        const int64_t end = n - from < BLOCK ? n : from + BLOCK;
        for (int64_t k = from; k < end; k++) {
#pragma GCC unroll 3
            for (int64_t q = 0; q < QUARTETS; q++) {
                double *at = columns + 4 * q * n + k;
                const Lanes row = {at[0], at[n], at[2 * n], at[3 * n]};
                const Lanes expected = keep[k] * state[q], news = row - expected;
                const Lanes white = scale[k] * news;
                state[q] = expected + gain[k] * news;
                at[0] = white[0], at[n] = white[1], at[2 * n] = white[2], at[3 * n] = white[3];
            }
        }
        for (int64_t q = 0; q < QUARTETS; q++)
            for (int64_t j = 0; j < 4; j++) state[q][j] = settled(state[q][j]);
    }
}

/* Columns (m, n) in place, one after the other in memory. */
void whiten(int64_t n, int64_t m, const double *keep, const double *gain, const double *scale,
            double *columns) {
    int64_t j = 0;
    for (; j + 4 * QUARTETS <= m; j += 4 * QUARTETS)
        in_lanes(n, keep, gain, scale, columns + j * n);
    for (; j + ABREAST <= m; j += ABREAST) abreast(n, ABREAST, keep, gain, scale, columns + j * n);
    for (; j < m; j++) abreast(n, 1, keep, gain, scale, columns + j * n);
}
