/* First-order lags over true time steps, for the exact hold of the input: see numerics/lags.py.
 *
 * Rows lie one after the other (n, m), so that the m inputs of one row share decay and weights,
 * and the exponential is taken anew only where step and time constant are not those of a step that
 * is kept. */
#include <stdint.h>
#include <string.h>

#include "cell.h"
#include "lanes.h"
#include "settled.h"

/* Steps whose weights are kept. They differ from row to row, but are few: whole samples of the
 * clock of a record. */
#define KNOWN_BITS 9
#define KNOWN (1 << KNOWN_BITS)

static int64_t slot_of(double step) {
    uint64_t bits;
    memcpy(&bits, &step, sizeof bits);
    return (int64_t)((bits * 0x9E3779B97F4A7C15u) >> (64 - KNOWN_BITS));
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
            lag_weights(step[k] / here, first_order, &known[i].decay, &known[i].before,
                        &known[i].after);
        }
        const double decay = known[i].decay, before = known[i].before, after = known[i].after;
        const double *x = drive + k * m;
        const double *u = state + k * m;
        double *next = state + (k + 1) * m;
        for (int64_t j = 0; j < m; j++)
            next[j] = decay * u[j] + (before * x[j] + after * x[j + m]);
        if (k % BLOCK == 0)
            for (int64_t j = 0; j < m; j++) next[j] = settled(next[j]);
    }
}

#define TINY 1e-300 /* no time, no change: their ratio is one */
#define EACH for (int64_t i = 0; i < BLOCK; i++)

/* 1 - exp(-x) of x >= 0, to rounding, for a block at once. */
static inline __attribute__((always_inline)) void gains(double *x) {
    EACH x[i] = x[i] < 700.0 ? -x[i] : -700.0;
    Lanes *lanes = (Lanes *)x;
    for (int64_t i = 0; i < BLOCK / 4; i++) {
        Lanes scale, rest, series;
        parted(&lanes[i], &scale, &rest);
        series_from(1, &rest, &series);
        lanes[i] = (1.0 - scale) - scale * (series * rest);
    }
}

/* The same for records that lie one after the other: step[k] is the time since row k - 1, in which
 * the drive moved on a straight line where linear[k] is 1, and kept its value where it is 0; where
 * fresh[k] is 1, not 0, the state begins anew at start[k].
 *
 * Steps hardly repeat where rows are means of many, so that none is looked up: what does not wait
 * for the row before is made for a block of rows at once. */
CLONES void lag_fresh(int64_t n, const double *step, const double *fresh, const double *linear,
                      double tau, const double *start, const double *drive, double *state) {
    double gain[BLOCK] __attribute__((aligned(32))), ratio[BLOCK], decay[BLOCK], pull[BLOCK];
    double last = 0.0, earlier[BLOCK];
    for (int64_t from = 0; from < n; from += BLOCK) {
        const int64_t rows = n - from < BLOCK ? n - from : BLOCK;
        const double *x = drive + from, *line = linear + from;
        const double *begun = fresh + from, *first = start + from;
        for (int64_t i = 0; i < rows; i++) ratio[i] = step[from + i] / tau;
        for (int64_t i = rows; i < BLOCK; i++) ratio[i] = 0.0;
        EACH gain[i] = ratio[i];
        gains(gain);
        earlier[0] = from ? x[-1] : 0.0;
        memcpy(earlier + 1, x, (size_t)(rows - 1) * sizeof *x);
        for (int64_t i = 0; i < rows; i++) {
            /* By factors of one and zero: where a value is chosen, rows do not go abreast. */
            const double mean = (gain[i] + TINY) / (ratio[i] + TINY);
            const double before = gain[i] + line[i] * (mean - 1.0);
            const double after = line[i] * (1.0 - mean);
            decay[i] = (1.0 - begun[i]) * (1.0 - gain[i]);
            pull[i] = begun[i] * first[i] + (1.0 - begun[i]) * (before * earlier[i] + after * x[i]);
        }
        for (int64_t i = 0; i < rows; i++) state[from + i] = last = decay[i] * last + pull[i];
        last = settled(last);
    }
}

/* Hysteresis of m stops: u += moved·slope, kept within -1 to 1, from start[k] where fresh[k] is 1;
 * state: mean of all; stop: room for m values. */
CLONES void stops(int64_t n, int64_t m, const double *moved, const double *fresh, const double *start,
           const double *slope, double *stop, double *state) {
    for (int64_t k = 0; k < n; k++) {
        /* By factors of one and zero, so that stops go abreast. */
        const double kept = 1.0 - fresh[k], begun = fresh[k] * start[k], by = kept * moved[k];
        double sum = 0.0;
        for (int64_t j = 0; j < m; j++) {
            const double next = begun + kept * stop[j] + by * slope[j];
            stop[j] = next > 1.0 ? 1.0 : next < -1.0 ? -1.0 : next;
        }
        for (int64_t j = 0; j < m; j++) sum += stop[j];
        state[k] = sum / (double)m;
    }
}
