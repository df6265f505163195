/* Whitening of white noise beside an Ornstein-Uhlenbeck process: see effects/noise.py.
 *
 * The gains of the scalar Kalman filter depend on the clock alone, so that they are made once and
 * every column of a matrix (n, m) runs through the same recursion. */
#include <math.h>
#include <stdint.h>

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

/* Rows in place; `state` (m,) is room for the slow part of each column. */
void whiten(int64_t n, int64_t m, const double *keep, const double *gain, const double *scale,
            double *state, double *matrix) {
    for (int64_t k = 0; k < n; k++) {
        double *row = matrix + k * m;
        const double held = keep[k], share = gain[k], size = scale[k];
        for (int64_t j = 0; j < m; j++) {
            const double expected = held * state[j];
            const double news = row[j] - expected;
            state[j] = expected + share * news;
            row[j] = size * news;
        }
    }
}
