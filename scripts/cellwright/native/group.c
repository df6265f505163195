/* Cells in parallel whose current is shared anew at every row, over records that lie one after the
 * other: see effects/groups/model.py, whose numpy form says the same.
 *
 * Between rows each branch's current runs on a straight line; its end is found implicitly, so that
 * a long step settles instead of swinging. Then the total steps, and the row is read. */
#include <stdint.h>

#include "pack_network.h"

enum { MOST = 64, PAIRS = 2 };

typedef struct {
    double soc, ampere, volt[PAIRS], decay[PAIRS], before[PAIRS], after[PAIRS], weighed;
} branch;

/* All branches as sources behind resistances, the wires apart. */
typedef struct {
    double source[MOST], ohm[MOST], conductance[MOST];
} sources;

/* Most records are sampled evenly: the weights of the step before still hold. */
static void weigh(branch *b, const double *tau, double step) {
    if (step == b->weighed) return;
    b->weighed = step;
    for (int j = 0; j < PAIRS; j++)
        lag_weights(step / tau[j], 1, &b->decay[j], &b->before[j], &b->after[j]);
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

/* r is (cells, 3): ohmic and both pairs; resistance_factor (n, cells) multiplies it; tau is (cells, 2). */
void group_run(int64_t n, int64_t cells, int64_t points, int64_t first_order, const double *step,
               const double *fresh, const double *total, const double *ocv, const double *r,
               const double *tau, const double *wire, const double *ampere_second,
               const double *resistance_factor, const double *soc_at_start, double *current,
               double *voltage, double *soc) {
    branch b[MOST];
    sources of;
    int64_t record = -1;
    for (int64_t c = 0; c < cells; c++) b[c].weighed = -1.0;
    for (int64_t k = 0; k < n; k++) {
        const double *factor = resistance_factor + k * cells;
        if (fresh[k] > 0.0) {
            record++;
            for (int64_t c = 0; c < cells; c++) {
                b[c].soc = soc_at_start[record * cells + c];
                b[c].volt[0] = b[c].volt[1] = b[c].ampere = 0.0;
            }
        } else {
            double from[MOST];
            for (int64_t c = 0; c < cells; c++) {
                const double share = step[k] / ampere_second[c] / 2.0;
                double source, slope, ohm = factor[c] * r[3 * c];
                from[c] = b[c].ampere;
                ocv_and_slope(ocv + c * points, points, b[c].soc + share * from[c], &source, &slope);
                weigh(&b[c], tau + 2 * c, step[k]);
                ohm += (slope > 0.0 ? slope : 0.0) * share;
                for (int j = 0; j < PAIRS; j++) {
                    const double pair = factor[c] * r[3 * c + 1 + j];
                    source += b[c].decay[j] * b[c].volt[j] + pair * b[c].before[j] * from[c];
                    ohm += pair * b[c].after[j];
                }
                of.source[c] = source;
                of.ohm[c] = ohm;
            }
            meet(b, &of, wire, cells, first_order ? total[k] : total[k - 1]);
            for (int64_t c = 0; c < cells; c++) {
                const double share = step[k] / ampere_second[c] / 2.0;
                b[c].soc += share * (from[c] + b[c].ampere);
                for (int j = 0; j < PAIRS; j++)
                    b[c].volt[j] = b[c].decay[j] * b[c].volt[j]
                                   + factor[c] * r[3 * c + 1 + j]
                                         * (b[c].before[j] * from[c] + b[c].after[j] * b[c].ampere);
            }
        }
        for (int64_t c = 0; c < cells; c++) {
            double open_circuit, slope;
            ocv_and_slope(ocv + c * points, points, b[c].soc, &open_circuit, &slope);
            of.source[c] = open_circuit + b[c].volt[0] + b[c].volt[1];
            of.ohm[c] = factor[c] * r[3 * c];
        }
        voltage[k] = meet(b, &of, wire, cells, total[k]);
        for (int64_t c = 0; c < cells; c++) {
            current[k * cells + c] = b[c].ampere;
            soc[k * cells + c] = b[c].soc;
        }
    }
}
