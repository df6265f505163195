/* Cells in parallel, step by step: see models/pack.py, whose numpy form says the same.
 *
 * Every cell keeps the interval of SoC that it is in, with the parameters there, and looks into the
 * tables only where it leaves it, so that the loops over the cells run through short, dense rows. */
#include <math.h>
#include <stdint.h>

#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
#define INLINE static inline __attribute__((always_inline))

/* The arrays of a loop are not the same: its cells may be worked off at once. */
#define EACH _Pragma("GCC ivdep") for

/* The arrays of a loop are not the same: its cells may be worked off at once. */
#define EACH _Pragma("GCC ivdep") for

/* Tables (cells, points) and (cells, pairs, points), and per cell what is given of it. */
typedef struct {
    int64_t cells, pairs, points;
    const double *ocv, *r0, *r, *tau, *ampere_second, *wire;
} group;

/* Per cell (cells,), per pair (pairs, cells): what holds in the present interval and step, the
 * share of the interval where the cell is (held: within it), and its states. */
typedef struct {
    double *left, *ocv, *rise, *r0, *r0_rise, *charge, *share, *held, *source, *conductance, *soc;
    double *r, *r_rise, *tau, *gain, *relaxed;
} states;

INLINE void enter(const group *g, const states *s, int64_t cell, double step, int64_t anew) {
    const int64_t last = g->points - 1;
    const double place = s->soc[cell] * (double)last;
    const int64_t left = place > 0.0 ? place < (double)last ? (int64_t)place : last - 1 : 0;
    const double *ocv = g->ocv + cell * g->points + left, *r0 = g->r0 + cell * g->points + left;
    s->left[cell] = (double)left;
    s->ocv[cell] = ocv[0];
    s->rise[cell] = ocv[1] - ocv[0];
    s->r0[cell] = r0[0] + g->wire[cell];
    s->r0_rise[cell] = r0[1] - r0[0];
    s->charge[cell] = step / g->ampere_second[cell];
    for (int64_t j = 0; j < g->pairs; j++) {
        const int64_t at = j * g->cells + cell;
        const int64_t entry = (cell * g->pairs + j) * g->points + left;
        s->r[at] = g->r[entry];
        s->r_rise[at] = g->r[entry + 1] - g->r[entry];
        if (anew || s->tau[at] != g->tau[entry])
            s->gain[at] = -expm1(-step / g->tau[entry]);
        s->tau[at] = g->tau[entry];
    }
}

/* Where each cell is; into the tables for those that left their interval, for all where the step
 * is a new one. */
INLINE void look(const group *g, const states *s, double step, int64_t anew) {
    const double last = (double)(g->points - 1);
    int64_t moved = anew;
    EACH(int64_t c = 0; c < g->cells; c++) {
        s->share[c] = s->soc[c] * last - s->left[c];
        moved |= !(s->share[c] >= 0.0 && s->share[c] < 1.0);
    }
    for (int64_t c = 0; moved && c < g->cells; c++)
        if (anew || !(s->share[c] >= 0.0 && s->share[c] < 1.0)) {
            enter(g, s, c, step, anew);
            s->share[c] = s->soc[c] * last - s->left[c];
        }
}

/* Each cell as a source behind a resistance (here still in `conductance`). */
INLINE void reduce(const group *g, const states *s) {
    const double last = (double)(g->points - 1);
    EACH(int64_t c = 0; c < g->cells; c++) {
        const double above = s->share[c] > 0.0 ? s->share[c] : 0.0;
        const double steep = s->rise[c] > 0.0 ? s->rise[c] : 0.0;
        s->held[c] = above < 1.0 ? above : 1.0;
        s->source[c] = s->ocv[c] + s->rise[c] * s->share[c];
        s->conductance[c] = s->r0[c] + s->r0_rise[c] * s->held[c] + steep * last * s->charge[c];
    }
    for (int64_t j = 0; j < g->pairs; j++)
        EACH(int64_t c = 0; c < g->cells; c++) {
            const int64_t at = j * g->cells + c;
            s->source[c] += s->relaxed[at] * (1.0 - s->gain[at]);
            s->conductance[c] += s->gain[at] * (s->r[at] + s->r_rise[at] * s->held[c]);
        }
}

/* The one voltage at which the currents add up to the total. Voltages are taken from that of the
 * first cell, so that a large group's currents add up to rounding; four sums at once, for speed. */
INLINE double meet(const group *g, const states *s, double total) {
    const double from = s->source[0];
    double inflow[4] = {0}, conductance[4] = {0};
    EACH(int64_t c = 0; c < g->cells; c++)
        s->conductance[c] = 1.0 / s->conductance[c];
    const int64_t fours = g->cells - g->cells % 4;
    for (int64_t c = 0; c < fours; c += 4)
        for (int64_t i = 0; i < 4; i++) {
            inflow[i] += s->conductance[c + i] * (s->source[c + i] - from);
            conductance[i] += s->conductance[c + i];
        }
    for (int64_t c = fours; c < g->cells; c++) {
        inflow[0] += s->conductance[c] * (s->source[c] - from);
        conductance[0] += s->conductance[c];
    }
    return from
           + (total + ((inflow[0] + inflow[1]) + (inflow[2] + inflow[3])))
                 / ((conductance[0] + conductance[1]) + (conductance[2] + conductance[3]));
}

INLINE void advance(const group *g, const states *s, double voltage, double *current, double *soc) {
    EACH(int64_t c = 0; c < g->cells; c++) {
        current[c] = s->conductance[c] * (voltage - s->source[c]);
        s->soc[c] = soc[c] = s->soc[c] + s->charge[c] * current[c];
    }
    for (int64_t j = 0; j < g->pairs; j++)
        EACH(int64_t c = 0; c < g->cells; c++) {
            const int64_t at = j * g->cells + c;
            const double goal = (s->r[at] + s->r_rise[at] * s->held[c]) * current[c];
            s->relaxed[at] = s->relaxed[at] * (1.0 - s->gain[at]) + s->gain[at] * goal;
        }
}

/* work is (11 + 5·pairs, cells), all zero but for the first state of charge, its row 10. */
WIDE void parallel(int64_t n, const double *step, const double *total, int64_t cells,
                   int64_t pairs, int64_t points, const double *ocv, const double *r0,
                   const double *r, const double *tau, const double *ampere_second,
                   const double *wire, double *work, double *current, double *voltage,
                   double *soc) {
    const group g = {cells, pairs, points, ocv, r0, r, tau, ampere_second, wire};
    double *row[11], *block[5];
    for (int64_t k = 0; k < 11; k++)
        row[k] = work + k * cells;
    for (int64_t k = 0; k < 5; k++)
        block[k] = work + (11 + k * pairs) * cells;
    const states s = {row[0],   row[1],   row[2],   row[3],   row[4],  row[5],
                      row[6],   row[7],   row[8],   row[9],   row[10], block[0],
                      block[1], block[2], block[3], block[4]};
    for (int64_t k = 0; k < n; k++) {
        look(&g, &s, step[k], k == 0 || step[k] != step[k - 1]);
        reduce(&g, &s);
        voltage[k] = meet(&g, &s, total[k]);
        advance(&g, &s, voltage[k], current + k * cells, soc + k * cells);
    }
}
