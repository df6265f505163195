/* State of charge and open-circuit voltage of the search's model: see effects/base.py. */
#include "cell.h"

static double within(double value, double low, double high) {
    return value < low ? low : value > high ? high : value;
}

/* SoC of records that lie one after the other, by counting: moved[k] is the charge since the row
 * before, over the capacity of the row (or, with capacity_moves 0, of all rows); where fresh[k] is
 * not zero a record begins at the next of `start`. */
void counted_soc(int64_t n, const double *moved, const double *capacity, int64_t capacity_moves,
                 const double *fresh, const double *start, double low, double high, double *soc) {
    double sum = 0.0, shift = 0.0;
    for (int64_t k = 0; k < n; k++) {
        sum += moved[k] / capacity[capacity_moves ? k : 0];
        if (fresh[k] != 0.0) shift = *start++ - sum;
        soc[k] = within(sum + shift, low, high);
    }
}

/* Of m values on an even grid over 0 to 1, the one at `soc`, straight between two of them and on
 * beyond the grid, as circuits/cell.py says. A soc that is no number takes the first. */
static double straight(int64_t m, const double *values, double soc, double *part) {
    const double spot = soc * (double)(m - 1);
    const int64_t i = point_below(spot, m);
    *part = (spot - (double)i) * (values[i + 1] - values[i]);
    return values[i];
}

/* OCV by its table (m,) and the table's error at its knots (k,), both over 0 to 1 of the SoC. */
void open_circuit(int64_t n, int64_t m, const double *table, int64_t k, const double *knots,
                  const double *soc, double *volt) {
    double more, error_more;
    for (int64_t row = 0; row < n; row++) {
        const double ocv = straight(m, table, soc[row], &more);
        const double error = straight(k, knots, within(soc[row], 0.0, 1.0), &error_more);
        volt[row] = ocv + more + error + error_more;
    }
}
