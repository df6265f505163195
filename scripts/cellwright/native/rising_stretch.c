/* The stretched abscissa of a rising spline: see numerics/monotone.py. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rising.h"

/* Values under a Gaussian of a width in rows; the ends continue as constants. */
void smoothed(int64_t n, const double *values, double width, double *smooth) {
    const int64_t reach = (int64_t)(3.0 * width);
    double kernel[64], whole = 0.0;
    for (int64_t k = -reach; k <= reach; k++)
        whole += kernel[k + reach] = exp(-0.5 * ((double)k / width) * ((double)k / width));
    memset(smooth, 0, (size_t)n * sizeof *smooth);
    for (int64_t k = -reach; k <= reach; k++) {
        const double weight = kernel[k + reach] / whole;
        const int64_t first = k < 0 ? (-k < n ? -k : n) : 0;
        const int64_t end = k > 0 ? (n - k > first ? n - k : first) : n;
        for (int64_t j = 0; j < first; j++)
            smooth[j] += weight * values[0];
        for (int64_t j = first; j < end; j++)
            smooth[j] += weight * values[j + k];
        for (int64_t j = end; j < n; j++)
            smooth[j] += weight * values[n - 1];
    }
}

/* Slope of y over uneven x, of second order inside, as numpy.gradient. */
void gradient(int64_t n, const double *x, const double *y, double *rate) {
    for (int64_t k = 1; k < n - 1; k++) {
        const double before = x[k] - x[k - 1], after = x[k + 1] - x[k];
        rate[k] = -after / (before * (before + after)) * y[k - 1] +
                  (after - before) / (before * after) * y[k] +
                  before / (after * (before + after)) * y[k + 1];
    }
    rate[0] = (y[1] - y[0]) / (x[1] - x[0]);
    rate[n - 1] = (y[n - 1] - y[n - 2]) / (x[n - 1] - x[n - 2]);
}

/* y at places `at` that do not fall, on straight lines between points; constant beyond the ends. */
void interpolated(int64_t m, const double *at, int64_t n, const double *x, const double *y,
                  double *found) {
    int64_t k = 0;
    for (int64_t i = 0; i < m; i++) {
        while (k < n - 2 && at[i] >= x[k + 1])
            k++;
        if (at[i] <= x[0])
            found[i] = y[0];
        else if (at[i] >= x[n - 1])
            found[i] = y[n - 1];
        else
            found[i] = (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (at[i] - x[k]) + y[k];
    }
}

/* Slopes at the points of a natural cubic spline. `work`: (2 n,). */
static void natural_slopes(int64_t n, const double *x, const double *y, double *work,
                           double *slope) {
    double *upper = work, *right = work + n;
    for (int64_t k = 0; k < n; k++) {
        const double before = k ? x[k] - x[k - 1] : 0.0, after = k < n - 1 ? x[k + 1] - x[k] : 0.0;
        const double left = k ? (y[k] - y[k - 1]) / before : 0.0;
        const double next = k < n - 1 ? (y[k + 1] - y[k]) / after : 0.0;
        const int end = k == 0 || k == n - 1;
        const double low = k == n - 1 ? before : after, high = k == 0 ? after : before;
        const double pivot = 2.0 * (before + after) - (k ? low * upper[k - 1] : 0.0);
        const double aim = end ? 3.0 * (before * left + after * next)
                               : 3.0 * (after * left + before * next);
        upper[k] = high / pivot;
        right[k] = (aim - (k ? low * right[k - 1] : 0.0)) / pivot;
    }
    slope[n - 1] = right[n - 1];
    for (int64_t k = n - 2; k >= 0; k--)
        slope[k] = right[k] - upper[k] * slope[k + 1];
}

/* Slope at an end that keeps the shape: F. Fritsch, R. Carlson, SIAM J. Numer. Anal. 17 (1980)
 * 238. */
static double end_slope(double near, double far, double rise, double next) {
    const double slope = ((2.0 * near + far) * rise - near * next) / (near + far);
    if (slope * rise <= 0.0)
        return 0.0;
    return rise * next <= 0.0 && fabs(slope) > 3.0 * fabs(rise) ? 3.0 * rise : slope;
}

/* Slopes at the points that let the curve swing nowhere: F. Fritsch, J. Butland, SIAM J. Sci. Stat.
 * Comput. 5 (1984) 300. */
static void shape_slopes(int64_t n, const double *x, const double *y, double *slope) {
    if (n == 2) {
        slope[0] = slope[1] = (y[1] - y[0]) / (x[1] - x[0]);
        return;
    }
    for (int64_t k = 1; k < n - 1; k++) {
        const double before = x[k] - x[k - 1], after = x[k + 1] - x[k];
        const double left = (y[k] - y[k - 1]) / before, right = (y[k + 1] - y[k]) / after;
        const double first = 2.0 * after + before, second = after + 2.0 * before;
        slope[k] = left * right > 0.0 ? (first + second) / (first / left + second / right) : 0.0;
    }
    slope[0] = end_slope(x[1] - x[0], x[2] - x[1], (y[1] - y[0]) / (x[1] - x[0]),
                         (y[2] - y[1]) / (x[2] - x[1]));
    const double last = x[n - 1] - x[n - 2], other = x[n - 2] - x[n - 3];
    slope[n - 1] = end_slope(last, other, (y[n - 1] - y[n - 2]) / last,
                             (y[n - 2] - y[n - 3]) / other);
}

/* Integral of the cubic polynomials between points; 0 where one falls to zero at a quarter. */
static int integrated(int64_t n, const double *x, const double *y, const double *slope,
                      Stretch *stretch) {
    double whole = 0.0;
    int positive = 1;
    for (int64_t k = 0; k < n - 1; k++) {
        const double h = x[k + 1] - x[k], rate = (y[k + 1] - y[k]) / h;
        const double t = (slope[k] + slope[k + 1] - 2.0 * rate) / h;
        double *c = stretch->power + 5 * k;
        c[0] = t / h / 4.0, c[1] = ((rate - slope[k]) / h - t) / 3.0, c[2] = slope[k] / 2.0;
        c[3] = y[k], c[4] = whole;
        whole = (((c[0] * h + c[1]) * h + c[2]) * h + c[3]) * h + c[4];
        for (int part = 1; part < 4; part++) {
            const double s = 0.25 * part * h;
            positive &= ((4.0 * c[0] * s + 3.0 * c[1]) * s + 2.0 * c[2]) * s + c[3] > 0.0;
        }
    }
    return positive;
}

/* Twice differentiable integral of a density over x, smoothed over `width` rows; -1 for fewer than
 * two points or no room. Of few readings far apart a smoother spline may swing below zero. */
int accumulated(int64_t n, const double *x, const double *density, double width, Stretch *stretch) {
    double *work = n < 2 ? NULL : malloc((size_t)(5 * n) * sizeof *work);
    if (!work)
        return -1;
    double *logs = work, *smooth = work + n, *slope = work + 2 * n;
    for (int64_t k = 0; k < n; k++)
        logs[k] = log(density[k]);
    smoothed(n, logs, width, smooth);
    for (int64_t k = 0; k < n; k++)
        smooth[k] = exp(smooth[k]);
    stretch->count = n;
    memmove(stretch->x, x, (size_t)n * sizeof *x);
    natural_slopes(n, x, smooth, work + 3 * n, slope);
    if (!integrated(n, x, smooth, slope, stretch)) {
        shape_slopes(n, x, smooth, slope);
        integrated(n, x, smooth, slope, stretch);
    }
    free(work);
    return 0;
}
