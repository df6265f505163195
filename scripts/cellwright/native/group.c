/* Cells in parallel whose current is shared anew at every row, over records that lie one after the
 * other: see effects/groups/model.py, whose numpy form says the same.
 *
 * Between rows each branch's current runs on a straight line; its end is found implicitly, so that
 * a long step settles instead of swinging. Then the total steps, and the row is read. */
#include <stdint.h>

#include "cell.h"

enum { MOST = 64, PAIRS = 2 };

typedef struct {
    double ocv, rise, soc, ampere, volt[PAIRS], decay[PAIRS], before[PAIRS], after[PAIRS];
    double source, conductance, weighed;
} branch;

static void look(branch *b, const double *table, int64_t points, double soc) {
    const double last = (double)(points - 1);
    const int64_t left = point_below(soc * last, points);
    b->rise = (table[left + 1] - table[left]) * last;
    b->ocv = table[left] + b->rise * (soc - (double)left / last);
}

/* Most records are sampled evenly: the weights of the step before still hold. */
static void weigh(branch *b, const double *tau, double step) {
    if (step == b->weighed) return;
    b->weighed = step;
    for (int j = 0; j < PAIRS; j++)
        lag_weights(step / tau[j], 1, &b->decay[j], &b->before[j], &b->after[j]);
}

/* The one voltage at which the currents add up to the total. */
static double meet(branch *b, int64_t cells, double total) {
    double inflow = total, conductance = 0.0;
    for (int64_t c = 0; c < cells; c++) {
        inflow += b[c].conductance * (b[c].source - b[0].source);
        conductance += b[c].conductance;
    }
    const double volt = b[0].source + inflow / conductance;
    for (int64_t c = 0; c < cells; c++)
        b[c].ampere = b[c].conductance * (volt - b[c].source);
    return volt;
}

/* r is (cells, 3): ohmic and both pairs; resistance_factor (n, cells) multiplies it; tau is (cells, 2). */
void group_run(int64_t n, int64_t cells, int64_t points, int64_t first_order, const double *step,
               const double *fresh, const double *total, const double *ocv, const double *r,
               const double *tau, const double *wire, const double *ampere_second,
               const double *resistance_factor, const double *soc_at_start, double *current,
               double *voltage, double *soc) {
    branch b[MOST];
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
                from[c] = b[c].ampere;
                look(&b[c], ocv + c * points, points, b[c].soc + share * from[c]);
                weigh(&b[c], tau + 2 * c, step[k]);
                double source = b[c].ocv, ohm = factor[c] * r[3 * c] + wire[c];
                const double steep = b[c].rise > 0.0 ? b[c].rise : 0.0;
                ohm += steep * share;
                for (int j = 0; j < PAIRS; j++) {
                    const double pair = factor[c] * r[3 * c + 1 + j];
                    source += b[c].decay[j] * b[c].volt[j] + pair * b[c].before[j] * from[c];
                    ohm += pair * b[c].after[j];
                }
                b[c].source = source;
                b[c].conductance = 1.0 / ohm;
            }
            meet(b, cells, first_order ? total[k] : total[k - 1]);
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
            look(&b[c], ocv + c * points, points, b[c].soc);
            b[c].source = b[c].ocv + b[c].volt[0] + b[c].volt[1];
            b[c].conductance = 1.0 / (factor[c] * r[3 * c] + wire[c]);
        }
        voltage[k] = meet(b, cells, total[k]);
        for (int64_t c = 0; c < cells; c++) {
            current[k * cells + c] = b[c].ampere;
            soc[k * cells + c] = b[c].soc;
        }
    }
}
