/* Cells in parallel whose current is shared anew at every row, over records that lie one after the
 * other: see effects/groups/model.py, whose numpy form says the same.
 *
 * Between rows each branch's current runs on a straight line; its end is found implicitly, so that
 * a long step settles instead of swinging. Then the total steps, and the row is read. */
#include <stdint.h>

#include "pack_network.h"

enum { MOST = 64, PAIRS = 2, LAGS = 8 };
/* Columns of the conditions of a row, see `model.conditions`; tables over SoC of a branch. */
enum { OHMIC, FIRST, SECOND, RATE, PER_CAPACITY, WARMER, CONDITIONS };
enum { OCV, ENTROPIC, COURSE, TABLES = 5 };

typedef struct {
    int64_t lags, leads, courses;
    const double *table, *r, *tau; /* (TABLES, points); ohmic and of each lag; of each lag */
    double ampere_second, diffusivity;
    double soc, ampere, lead, ohmic;
    double volt[LAGS], ohm[LAGS], drive[LAGS], decay[LAGS], before[LAGS], after[LAGS], clock[2];
} branch;

/* All branches as sources behind resistances, the wires apart. */
typedef struct {
    double source[MOST], ohm[MOST], conductance[MOST];
} sources;

/* Most records are sampled evenly: the weights of the step before still hold. */
static void weigh(branch *b, int64_t slow, double clock) {
    if (clock == b->clock[slow]) return;
    b->clock[slow] = clock;
    for (int64_t j = slow ? PAIRS : 0; j < (slow ? b->lags : PAIRS); j++)
        lag_weights(clock / b->tau[j], 1, &b->decay[j], &b->before[j], &b->after[j]);
}

INLINE double held(const double *table, grid_place at) {
    return table[at.below] + at.inside * (table[at.below + 1] - table[at.below]);
}

/* How fast slow diffusion evens out at a SoC, over half charge; in the cold only that of particles. */
INLINE double speed(const branch *b, const double *now, double soc) {
    const double within = soc < 0.0 ? 0.0 : soc > 1.0 ? 1.0 : soc;
    return (b->diffusivity == 0.0 ? 1.0 : exp(b->diffusivity * (within - 0.5)))
           * (b->leads ? now[RATE] : 1.0);
}

/* OCV, its slope, and the resistances of the ohmic part and of the pairs at a SoC and a row. */
INLINE void look_up(branch *b, int64_t points, const double *now, double soc, double *ocv,
                    double *slope) {
    ocv_and_slope(b->table, points, soc + b->lead, ocv, slope);
    b->ohmic = now[OHMIC] * b->r[0];
    for (int j = 0; j < PAIRS; j++) b->ohm[j] = now[FIRST + j] * b->r[1 + j];
    if (!b->courses) return;
    const grid_place at = place_on_grid(soc, points);
    const double *course = b->table + COURSE * points;
    *ocv += now[WARMER] * held(b->table + ENTROPIC * points, at);
    b->ohmic *= held(course, at);
    for (int j = 0; j < PAIRS; j++) b->ohm[j] *= held(course + (1 + j) * points, at);
}

/* The one voltage at which the currents of all branches add up to the total. */
static double meet(branch *b, sources *of, const double *wire, int64_t cells, double total) {
    double source, resistance;
    star(cells, of->source, of->ohm, wire, of->conductance, &source, &resistance);
    const double volt = source + resistance * total;
    for (int64_t c = 0; c < cells; c++)
        b[c].ampere = of->conductance[c] * (volt - of->source[c]);
    return volt;
}

/* A branch before the end of a step, as a source behind a resistance that its end current passes. */
INLINE void foresee(branch *b, int64_t points, const double *now, double step, double share,
                    double *source, double *ohm) {
    const double soc = b->soc + share * b->ampere;
    double ocv, slope, volt = 0.0, behind = 0.0;
    b->lead = 0.0;
    if (b->lags > PAIRS) {
        const double faster = speed(b, now, soc);
        weigh(b, 1, step * faster);
        for (int64_t j = PAIRS; j < b->lags; j++) {
            b->ohm[j] = b->r[1 + j] / faster;
            b->volt[j] = b->decay[j] * b->volt[j] + b->before[j] * b->drive[j];
            volt += b->volt[j];
            behind += b->after[j] * b->ohm[j];
        }
        if (b->leads) b->lead = volt;
    }
    look_up(b, points, now, soc, &ocv, &slope);
    slope = slope > 0.0 ? slope : 0.0;
    *source = b->leads ? ocv : ocv + volt;
    *ohm = b->ohmic + slope * share + (b->leads ? slope * behind : behind);
    weigh(b, 0, step * now[RATE]);
    for (int64_t j = 0; j < PAIRS; j++) {
        b->volt[j] = b->decay[j] * b->volt[j] + b->before[j] * b->drive[j];
        *source += b->volt[j];
        *ohm += b->after[j] * b->ohm[j];
    }
}

/* The same branch at a row, behind its ohmic resistance. */
INLINE void read(branch *b, int64_t points, const double *now, double *source, double *ohm) {
    double ocv, slope, volt = 0.0;
    for (int64_t j = PAIRS; j < b->lags; j++) volt += b->volt[j];
    b->lead = b->leads ? volt : 0.0;
    look_up(b, points, now, b->soc, &ocv, &slope);
    *source = (b->leads ? ocv : ocv + volt) + b->volt[0] + b->volt[1];
    *ohm = b->ohmic;
}

/* tables is (cells, TABLES, points), of which all but the OCV counts where courses is not 0; lags
 * is (cells, LAGS): time constants of both pairs, then of slow diffusion, 0 after the last; r is
 * (cells, 1 + LAGS): ohmic and of each lag; leads and diffusivity say how it diffuses. conditions
 * is (cells, n, CONDITIONS). */
void group_run(int64_t n, int64_t cells, int64_t points, int64_t first_order, const double *step,
               const double *fresh, const double *total, const double *tables,
               const double *courses, const double *r, const double *tau, const double *leads,
               const double *diffusivity, const double *wire, const double *ampere_second,
               const double *conditions, const double *soc_at_start, double *current,
               double *voltage, double *soc) {
    branch b[MOST];
    sources of;
    int64_t record = -1;
    for (int64_t c = 0; c < cells; c++) {
        b[c] = (branch){.table = tables + c * TABLES * points, .r = r + c * (1 + LAGS),
                        .tau = tau + c * LAGS, .leads = leads[c] > 0.0, .courses = courses[c] > 0.0,
                        .diffusivity = diffusivity[c], .ampere_second = ampere_second[c],
                        .clock = {-1.0, -1.0}, .lags = PAIRS};
        while (b[c].lags < LAGS && b[c].tau[b[c].lags] > 0.0) b[c].lags++;
    }
    for (int64_t k = 0; k < n; k++) {
        if (fresh[k] > 0.0) {
            record++;
            for (int64_t c = 0; c < cells; c++) {
                b[c].soc = soc_at_start[record * cells + c];
                for (int64_t j = 0; j < b[c].lags; j++) b[c].volt[j] = 0.0;
            }
        } else {
            double from[MOST], share[MOST];
            for (int64_t c = 0; c < cells; c++) {
                const double *now = conditions + (c * n + k) * CONDITIONS;
                share[c] = step[k] / b[c].ampere_second * now[PER_CAPACITY] / 2.0;
                from[c] = b[c].ampere;
                foresee(&b[c], points, now, step[k], share[c], &of.source[c], &of.ohm[c]);
            }
            meet(b, &of, wire, cells, first_order ? total[k] : total[k - 1]);
            for (int64_t c = 0; c < cells; c++) {
                b[c].soc += share[c] * (from[c] + b[c].ampere);
                for (int64_t j = 0; j < b[c].lags; j++)
                    b[c].volt[j] += b[c].after[j] * b[c].ohm[j] * b[c].ampere;
            }
        }
        for (int64_t c = 0; c < cells; c++) {
            const double *now = conditions + (c * n + k) * CONDITIONS;
            read(&b[c], points, now, &of.source[c], &of.ohm[c]);
        }
        voltage[k] = meet(b, &of, wire, cells, total[k]);
        for (int64_t c = 0; c < cells; c++) {
            const double *now = conditions + (c * n + k) * CONDITIONS;
            const double faster = b[c].lags > PAIRS ? speed(&b[c], now, b[c].soc) : 1.0;
            for (int64_t j = 0; j < b[c].lags; j++)
                b[c].drive[j] = b[c].ampere * (j < PAIRS ? b[c].ohm[j] : b[c].r[1 + j] / faster);
            current[k * cells + c] = b[c].ampere;
            soc[k * cells + c] = b[c].soc;
        }
    }
}
