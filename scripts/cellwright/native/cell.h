/* What the kernels that step a cell share: circuits/cell.py and numerics/lags.py in C. */
#ifndef CELL_H
#define CELL_H
#include <math.h>
#include <stdint.h>

#define INLINE static inline __attribute__((always_inline))

/* Point of an even grid below a place that is counted in its intervals; beyond the ends that of the
 * outermost interval, and the first for a place that is no number. */
INLINE int64_t point_below(double spot, int64_t points) {
    const double last = (double)(points - 2);
    return spot > 0.0 ? (int64_t)(spot < last ? spot : last) : 0;
}

/* A SoC on an even grid from 0 to 1: the point below it, the share of the way on to the next one,
 * which the OCV takes beyond the ends too, and that share held within them, as all else takes it. */
typedef struct {
    int64_t below;
    double share, inside;
} grid_place;

INLINE grid_place place_on_grid(double soc, int64_t points) {
    const double spot = soc * (double)(points - 1);
    const int64_t below = point_below(spot, points);
    const double share = spot - (double)below, above = share > 0.0 ? share : 0.0;
    return (grid_place){below, share, above < 1.0 ? above : 1.0};
}

/* OCV of a table at a SoC, straight on beyond its ends, and its slope over SoC. */
INLINE void ocv_and_slope(const double *table, int64_t points, double soc, double *ocv,
                               double *slope) {
    const grid_place at = place_on_grid(soc, points);
    const double rise = table[at.below + 1] - table[at.below];
    *ocv = table[at.below] + at.share * rise;
    *slope = rise * (double)(points - 1);
}

/* What a first-order lag takes over in a step in units of its time constant: 1 - decay, and the
 * share of it that is of the input at the end. ramp is 1 where the input moves on a straight line,
 * 0 where it keeps its value until the step ends. */
INLINE void lag_gains(double ratio, int64_t ramp, double *gain, double *after) {
    *gain = -expm1(-ratio);
    *after = ramp ? 1.0 - (ratio > 0.0 ? *gain / ratio : 1.0) : 0.0;
}

/* The same as weights u[k+1] = decay·u[k] + before·x[k] + after·x[k+1]. */
INLINE void lag_weights(double ratio, int64_t ramp, double *decay, double *before,
                             double *after) {
    double gain;
    lag_gains(ratio, ramp, &gain, after);
    *decay = 1.0 - gain;
    *before = gain - *after;
}
#endif
