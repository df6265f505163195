/* What the kernels that step a cell share, as circuits/cell.py and numerics/lags.py say it. */
#ifndef CELL_H
#define CELL_H
#include <math.h>
#include <stdint.h>

#define CELL_INLINE static inline __attribute__((always_inline))

/* Point of an even grid below a place that is counted in its intervals; beyond the ends that of the
 * outermost interval, and the first for a place that is no number. */
CELL_INLINE int64_t point_below(double spot, int64_t points) {
    const double last = (double)(points - 2);
    return spot > 0.0 ? (int64_t)(spot < last ? spot : last) : 0;
}

/* Weights u[k+1] = decay·u[k] + before·x[k] + after·x[k+1] of a first-order lag over a step in units
 * of its time constant. ramp is 1 where its input moves on a straight line, 0 where it keeps its
 * value until the step ends. */
CELL_INLINE void lag_weights(double ratio, int64_t ramp, double *decay, double *before,
                             double *after) {
    const double gain = -expm1(-ratio), mean = ratio > 0.0 ? gain / ratio : 1.0;
    *decay = 1.0 - gain;
    *before = ramp ? mean + gain - 1.0 : gain;
    *after = ramp ? 1.0 - mean : 0.0;
}
#endif
