/* Voltage of a cell with any number of RC pairs, its parameters over SoC: the twin of
 * circuits/cell.py.
 *
 * In blocks of samples that stay in the cache, each worked off in passes: all that does not wait
 * for the sample before is done for many samples at once; only the count of charge and the states
 * of the pairs go from sample to sample. */
#include <math.h>
#include <stdint.h>

#define BLOCK 512
#define MOST 16  /* pairs */
#define TERMS 18 /* of the series in `weigh`, exact to rounding up to a ratio of 1 */

/* Twice the same code on processors of this kind; the loader takes the one with wider registers. */
#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
#define INLINE static inline __attribute__((always_inline))

/* The table holds, per interval of SoC, the values at its left end and their rise to the right
 * end, in the order OCV, R0, R of each pair, and tau of each pair where it moves with SoC. */
typedef struct {
    int64_t intervals, width;
    const double *table;
} cell;

/* What a block knows of its samples; step, tau and weights are of the step to the sample. */
typedef struct {
    double step[BLOCK], share[BLOCK], tau[MOST][BLOCK];
    double decay[MOST][BLOCK], before[MOST][BLOCK], after[MOST][BLOCK];
    int32_t row[BLOCK];
} block;

static const double term[TERMS] = {
    1.0 / 2,           -1.0 / 6,             1.0 / 24,            -1.0 / 120,
    1.0 / 720,         -1.0 / 5040,          1.0 / 40320,         -1.0 / 362880,
    1.0 / 3628800,     -1.0 / 39916800,      1.0 / 479001600,     -1.0 / 6227020800,
    1.0 / 87178291200, -1.0 / 1307674368e3,  1.0 / 20922789888e3, -1.0 / 355687428096e3,
    1.0 / 6402373705728e3, -1.0 / 121645100408832e3};

/* Weights of a lag, as in lag.c, over x = step/tau: gain is 1 − exp(−x), late is 1 − gain/x. The
 * series of late needs no library; where it would be too long, in any sample, the library it is. */
INLINE void weigh(int64_t m, double first_order, block *restrict b, int64_t j) {
    double largest = 0.0;
    for (int64_t k = 0; k < m; k++)
        largest = b->step[k] > largest * b->tau[j][k] ? b->step[k] / b->tau[j][k] : largest;
    for (int64_t k = 0; largest <= 1.0 && k < m; k++) {
        const double x = b->step[k] / b->tau[j][k];
        double series = term[TERMS - 1];
#pragma GCC unroll 18
        for (int i = TERMS - 2; i >= 0; i--)
            series = series * x + term[i];
        const double late = x * series, gain = x - x * late;
        b->decay[j][k] = 1.0 - gain;
        b->before[j][k] = gain - first_order * late;
        b->after[j][k] = first_order * late;
    }
    for (int64_t k = 0; largest > 1.0 && k < m; k++) {
        const double x = b->step[k] / b->tau[j][k], gain = -expm1(-x);
        const double late = x > 0.0 ? 1.0 - gain / x : 0.0;
        b->decay[j][k] = 1.0 - gain;
        b->before[j][k] = gain - first_order * late;
        b->after[j][k] = first_order * late;
    }
}

/* Charge counted from the sample before the block; `from` is 1 in the first block, else 0. Four
 * samples at a time, so that the count waits for itself once in four. */
INLINE void count(int64_t from, int64_t m, const double *restrict current, double first_order,
                  double per_ampere_second, block *restrict b, double *restrict soc) {
    const double former = (1.0 - first_order / 2) * per_ampere_second;
    const double latter = first_order / 2 * per_ampere_second;
    for (int64_t k = from; k < m; k++)
        b->share[k] = b->step[k] * (former * current[k - 1] + latter * current[k]);
    double counted = soc[from - 1];
    int64_t k = from;
    for (; k + 4 <= m; k += 4) {
        const double one = b->share[k], two = one + b->share[k + 1];
        const double three = two + b->share[k + 2], four = three + b->share[k + 3];
        soc[k] = counted + one;
        soc[k + 1] = counted + two;
        soc[k + 2] = counted + three;
        soc[k + 3] = counted += four;
    }
    for (; k < m; k++) soc[k] = counted += b->share[k];
}

/* Where each SoC lies in the table, held at its ends; whether any lies outside. */
INLINE int64_t locate(int64_t m, const double *restrict soc, int32_t intervals, block *restrict b) {
    const double last = (double)intervals;
    int64_t outside = 0;
    for (int64_t k = 0; k < m; k++) {
        const double above = soc[k] * last > 0.0 ? soc[k] * last : 0.0;
        const double at = above < last ? above : last;
        const int32_t floor = (int32_t)at;
        b->row[k] = floor < intervals ? floor : intervals - 1;
        b->share[k] = at - (double)b->row[k];
        outside |= at != soc[k] * last;
    }
    return outside;
}

/* Outside 0 to 1 the OCV goes on as steeply as it ends; all else stays what it is. */
static void go_on(int64_t m, const double *soc, const cell *c, const block *b, double *voltage) {
    const double last = (double)c->intervals;
    for (int64_t k = 0; k < m; k++) {
        const double rise = c->table[2 * c->width * b->row[k] + c->width];
        const double beyond = soc[k] < 0.0 ? soc[k] : soc[k] > 1.0 ? soc[k] - 1.0 : 0.0;
        voltage[k] += beyond * last * rise;
    }
}

/* The states of the pairs from sample to sample. `pairs` is a constant where this is inlined. */
INLINE void march(int64_t m, const int64_t pairs, const double *restrict current, const cell *c,
                  const block *restrict b, double *restrict state, double *restrict drive,
                  double *restrict voltage) {
    for (int64_t k = 0; k < m; k++) {
        const double *restrict row = c->table + 2 * c->width * b->row[k];
        const double *restrict rise = row + c->width;
        const double share = b->share[k], now = current[k];
        double volt = (row[0] + share * rise[0]) + (row[1] + share * rise[1]) * now;
        for (int64_t j = 0; j < pairs; j++) {
            const double next = (row[2 + j] + share * rise[2 + j]) * now;
            state[j] = b->decay[j][k] * state[j]
                       + (b->before[j][k] * drive[j] + b->after[j][k] * next);
            drive[j] = next;
            volt += state[j];
        }
        voltage[k] = volt;
    }
}

/* The values of a table's interval for two pairs (OCV, R0, R1, R2), and two pairs side by side. */
typedef double four __attribute__((vector_size(32), aligned(8)));
typedef double two __attribute__((vector_size(16)));

/* The same for two pairs whose weights are those of one step (decay, before, after of each pair).
 * Four samples at a time: what the drives add is known before, so a state waits for itself once in
 * four. begins : 1 where the first sample is that of the record, to which there is no step. */
INLINE void march_evenly(int64_t m, int64_t begins, const double weight[3][2],
                         const double *restrict current, const cell *c, const block *restrict b,
                         double *state, double *drive, double *restrict voltage) {
    two pushed[BLOCK + 4], found[BLOCK + 4];
    const two decay = {weight[0][0], weight[0][1]}, before = {weight[1][0], weight[1][1]};
    const two after = {weight[2][0], weight[2][1]};
    two last = {drive[0], drive[1]}, now = {state[0], state[1]};
    for (int64_t k = 0; k < m; k++) {
        const double *row = c->table + 8 * b->row[k];
        const four value = *(const four *)row + b->share[k] * *(const four *)(row + 4);
        const four driven = value * current[k];
        const two next = {driven[2], driven[3]};
        voltage[k] = value[0] + driven[1];
        pushed[k] = before * last + after * next;
        last = next;
    }
    for (int64_t k = m; k < m + 4; k++) pushed[k] = (two){0.0, 0.0};
    if (begins) pushed[0] = (two){0.0, 0.0};
    const two squared = decay * decay, cubed = squared * decay, fourth = squared * squared;
    for (int64_t k = 0; k < m; k += 4) {
        const two first = pushed[k], second = decay * first + pushed[k + 1];
        const two third = decay * second + pushed[k + 2];
        found[k] = decay * now + first;
        found[k + 1] = squared * now + second;
        found[k + 2] = cubed * now + third;
        now = found[k + 3] = fourth * now + (decay * third + pushed[k + 3]);
    }
    for (int64_t k = 0; k < m; k++) voltage[k] += found[k][0] + found[k][1];
    for (int64_t j = 0; j < 2; j++) {
        state[j] = found[m - 1][j];
        drive[j] = last[j];
    }
}

/* The step to the first sample is none: after no time the states still rest. */
static void step_of(int64_t first, int64_t m, const double *step, int64_t uniform, block *b) {
    for (int64_t k = 0; k < m; k++)
        b->step[k] = first + k == 0 ? 0.0 : step[uniform ? 0 : first + k - 1];
}

/* Time constants over a step are those at its first sample: that of the block before for k = 0. */
static void tau_of(int64_t m, int64_t pairs, const cell *c, block *b, double *before) {
    for (int64_t j = 0; j < pairs; j++)
        for (int64_t k = 0; k < m; k++) {
            const double *row = c->table + 2 * c->width * b->row[k] + 2 + pairs + j;
            b->tau[j][k] = before[j];
            before[j] = row[0] + b->share[k] * row[c->width];
        }
}

/* Per interval the values at its left end, then their rises: see `cell`. tau, where it moves, is
 * one row of `points` for each pair, as r is. */
static void lay_out(int64_t intervals, int64_t pairs, int64_t tau_moves, const double *ocv,
                    const double *r0, const double *r, const double *tau, double *table) {
    const int64_t points = intervals + 1, width = 2 + pairs + (tau_moves ? pairs : 0);
    for (int64_t c = 0; c < width; c++) {
        const double *column = c == 0          ? ocv
                               : c == 1        ? r0
                               : c < 2 + pairs ? r + (c - 2) * points
                                               : tau + (c - 2 - pairs) * points;
        for (int64_t i = 0; i < intervals; i++) {
            table[2 * width * i + c] = column[i];
            table[2 * width * i + width + c] = column[i + 1] - column[i];
        }
    }
}

/* 1 where the currents of a block are finite. One that is not makes the count that it enters, and
 * all after it, no number; to that of its own step the last of a record need not belong. */
INLINE int64_t all_finite(int64_t m, const double *current, const double *soc) {
    return current[m - 1] - current[m - 1] == 0.0 && soc[m - 1] - soc[m - 1] == 0.0;
}

/* From rest; the SoC is counted from soc[0] over a capacity [A s]. table : room for what `lay_out`
 * writes. Returns 1, or 0 where a current is not finite. */
WIDE int64_t simulate(int64_t n, const double *step, int64_t uniform, int64_t is_first_order,
                      const double *current, int64_t pairs, int64_t intervals, const double *ocv,
                      const double *r0, const double *r, const double *tau, int64_t tau_moves,
                      double *table, double ampere_second, double *soc, double *voltage) {
    const double first_order = is_first_order ? 1.0 : 0.0;
    const cell c = {intervals, 2 + pairs + (tau_moves ? pairs : 0), table};
    const int64_t even = uniform && !tau_moves && pairs == 2;
    double state[MOST] = {0}, drive[MOST] = {0}, before[MOST], weight[3][2];
    block b;
    lay_out(intervals, pairs, tau_moves, ocv, r0, r, tau, table);
    for (int64_t j = 0; j < pairs; j++) {
        before[j] = tau_moves ? 1.0 : tau[j];
        for (int64_t k = 0; k < (even ? 2 : BLOCK); k++) b.tau[j][k] = before[j];
    }
    /* Weights are those of the second sample: to the first there is no step. */
    for (int64_t j = 0; even && j < pairs; j++) {
        step_of(0, 2, step, uniform, &b);
        weigh(2, first_order, &b, j);
        weight[0][j] = b.decay[j][1];
        weight[1][j] = b.before[j][1];
        weight[2][j] = b.after[j][1];
    }
    for (int64_t first = 0; first < n; first += BLOCK) {
        const int64_t m = n - first < BLOCK ? n - first : BLOCK;
        if (!uniform || first <= BLOCK)
            step_of(first, m, step, uniform, &b);
        count(first == 0, m, current + first, first_order, 1.0 / ampere_second, &b, soc + first);
        if (!all_finite(m, current + first, soc + first)) return 0;
        const int64_t outside = locate(m, soc + first, (int32_t)intervals, &b);
        if (tau_moves)
            tau_of(m, pairs, &c, &b, before);
        /* From the second block on a uniform record has the weights that it had. */
        const int64_t same = uniform && !tau_moves && first > BLOCK;
        for (int64_t j = 0; !even && !same && j < pairs; j++)
            weigh(m, first_order, &b, j);
        if (even)
            march_evenly(m, first == 0, weight, current + first, &c, &b, state, drive,
                         voltage + first);
        else if (pairs == 2)
            march(m, 2, current + first, &c, &b, state, drive, voltage + first);
        else
            march(m, pairs, current + first, &c, &b, state, drive, voltage + first);
        if (outside)
            go_on(m, soc + first, &c, &b, voltage + first);
    }
    return 1;
}
