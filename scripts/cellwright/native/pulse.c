/* Squared errors of many circuits on one pulse: see identification/methods/genetic.py.
 *
 * decay, pushed (n - 1, k, m): of each RC pair over each step, what is left and what the current
 * adds [A]; r (k, m), r0 (k,) [ohm]; drive, target (n,) [A], [V]. Adds to power (k,) [V^2] the
 * squared errors of all samples but the first; `state` (k, m) is room for the pairs' currents. */
#include <stdint.h>

void pulse_power(int64_t n, int64_t k, int64_t m, const double *decay, const double *pushed,
                 const double *r0, const double *r, const double *drive, const double *target,
                 double *state, double *power) {
    for (int64_t row = 1; row < n; row++) {
        const double *left = decay + (row - 1) * k * m, *added = pushed + (row - 1) * k * m;
        for (int64_t i = 0; i < k; i++) {
            double over = 0.0;
            for (int64_t j = i * m; j < (i + 1) * m; j++) {
                state[j] = left[j] * state[j] + added[j];
                over += r[j] * state[j];
            }
            const double error = target[row] - r0[i] * drive[row] - over;
            power[i] += error * error;
        }
    }
}
