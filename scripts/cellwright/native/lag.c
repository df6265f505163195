/* First-order lags over true time steps, for the exact hold of the input: see models/kernels.py.
 *
 * Rows lie one after the other (n, m), so that the m inputs of one row share decay and weights,
 * and the exponential is taken anew only where step and time constant are not those of a step that
 * is kept. */
#include <math.h>
#include <stdint.h>
#include <string.h>

/* Steps whose weights are kept. They differ from row to row, but are few: whole samples of the
 * clock of a record. */
#define KNOWN_BITS 9
#define KNOWN (1 << KNOWN_BITS)

static int64_t slot_of(double step) {
    uint64_t bits;
    memcpy(&bits, &step, sizeof bits);
    return (int64_t)((bits * 0x9E3779B97F4A7C15u) >> (64 - KNOWN_BITS));
}

static void weights(double step, double tau, int64_t first_order, double *decay, double *before,
                    double *after) {
    const double ratio = step / tau;
    const double gain = -expm1(-ratio);
    *decay = 1.0 - gain;
    if (!first_order) {
        *before = gain;
        *after = 0.0;
        return;
    }
    const double mean = ratio > 0.0 ? gain / ratio : 1.0;
    *before = mean + gain - 1.0;
    *after = 1.0 - mean;
}

/* state[k+1] = decay·state[k] + before·drive[k] + after·drive[k+1], state[0] given in `state`. */
void lag(int64_t n, int64_t m, const double *step, const double *tau, int64_t tau_moves,
         int64_t first_order, const double *drive, double *state) {
    struct {
        double step, tau, decay, before, after;
    } known[KNOWN];
    for (int64_t i = 0; i < KNOWN; i++) known[i].step = -1.0;
    for (int64_t k = 0; k + 1 < n; k++) {
        const double here = tau_moves ? tau[k] : tau[0];
        const int64_t i = slot_of(step[k]);
        if (known[i].step != step[k] || known[i].tau != here) {
            known[i].step = step[k];
            known[i].tau = here;
            weights(step[k], here, first_order, &known[i].decay, &known[i].before,
                    &known[i].after);
        }
        const double decay = known[i].decay, before = known[i].before, after = known[i].after;
        const double *x = drive + k * m;
        const double *u = state + k * m;
        double *next = state + (k + 1) * m;
        for (int64_t j = 0; j < m; j++)
            next[j] = decay * u[j] + (before * x[j] + after * x[j + m]);
    }
}

/* The same for records that lie one after the other: step[k] is the time since row k − 1, in which
 * the drive moved on a straight line where linear[k] is not zero, else kept its value; where
 * fresh[k] is not zero the state begins anew at start[k]. */
void lag_fresh(int64_t n, const double *step, const double *fresh, const double *linear, double tau,
               const double *start, const double *drive, double *state) {
    struct {
        double step, linear, decay, before, after;
    } known[KNOWN];
    for (int64_t i = 0; i < KNOWN; i++) known[i].step = -1.0;
    for (int64_t k = 0; k < n; k++) {
        if (fresh[k] != 0.0) {
            state[k] = start[k];
            continue;
        }
        const int64_t i = slot_of(step[k]);
        if (known[i].step != step[k] || known[i].linear != linear[k]) {
            known[i].step = step[k];
            known[i].linear = linear[k];
            weights(step[k], tau, linear[k] != 0.0, &known[i].decay, &known[i].before,
                    &known[i].after);
        }
        state[k] = known[i].decay * state[k - 1] +
                   (known[i].before * drive[k - 1] + known[i].after * drive[k]);
    }
}
