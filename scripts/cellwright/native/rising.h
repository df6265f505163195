/* Parts of a penalised rising spline that its C files share: see numerics/monotone.py. */
#ifndef RISING_H
#define RISING_H
#include <stdint.h>

#define ORDER 3 /* of the differences that are penalised */
#define BANDS (ORDER + 2)
#define SPLINES 4 /* cubic B-splines that are not zero at a place */

/* Cumulative stretch of the abscissa: a polynomial of degree four in each interval, (count - 1, 5)
 * from the highest power, over `count` breakpoints. */
typedef struct {
    int64_t count;
    double *x, *power;
} Stretch;

/* Normal equations of the readings: bands (n, BANDS), right side and sums of the rows (n,), sum of
 * squares; stiffness of each penalised difference. Limits: relative change that ends the steps,
 * range of the logarithms, rounding. */
typedef struct {
    int64_t n, readings;
    double *normal, *right, *sums, *stiffness, square, level;
    const double *limits;
    double *rows, *bands, *solved;
} Problem;

/* Fit at one strength of the penalty; `factor` (n, BANDS): pivots and unit lower factor. */
typedef struct {
    double decade, evidence, objective;
    double *logs, *steps, *coefficients, *factor;
} Fit;

int rising_fit(const Problem *problem, double decade, const double *logs, int64_t most, Fit *fit);
void rising_inverse(int64_t n, const double *factor, double *inverse);
void rising_differences(int64_t n, const double *steps, const double *stiffness, double *rows);

void smoothed(int64_t n, const double *values, double width, double *smooth);
void gradient(int64_t n, const double *x, const double *y, double *rate);
void interpolated(int64_t m, const double *at, int64_t n, const double *x, const double *y,
                  double *found);
int accumulated(int64_t n, const double *x, const double *density, double width, Stretch *stretch);

/* Value or derivative of a stretch; *near is the interval of the place asked for before. */
static inline double stretched(const Stretch *stretch, double x, int derivative, int64_t *near) {
    int64_t k = *near;
    while (k < stretch->count - 2 && x >= stretch->x[k + 1])
        k++;
    while (k > 0 && x < stretch->x[k])
        k--;
    *near = k;
    const double *c = stretch->power + 5 * k, t = x - stretch->x[k];
    if (derivative == 0)
        return (((c[0] * t + c[1]) * t + c[2]) * t + c[3]) * t + c[4];
    if (derivative == 1)
        return ((4.0 * c[0] * t + 3.0 * c[1]) * t + 2.0 * c[2]) * t + c[3];
    return (12.0 * c[0] * t + 6.0 * c[1]) * t + 2.0 * c[2];
}

/* Weights of the four uniform cubic B-splines at a share t of their cell, or of a derivative. */
static inline void b_splines(double t, int derivative, double *weights) {
    const double s = 1.0 - t;
    if (derivative == 0) {
        weights[0] = s * s * s / 6.0, weights[1] = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
        weights[2] = (1.0 + 3.0 * t * (1.0 + t - t * t)) / 6.0, weights[3] = t * t * t / 6.0;
    } else if (derivative == 1) {
        weights[0] = -0.5 * s * s, weights[1] = (9.0 * t * t - 12.0 * t) / 6.0;
        weights[2] = (3.0 + 6.0 * t - 9.0 * t * t) / 6.0, weights[3] = 0.5 * t * t;
    } else {
        weights[0] = s, weights[1] = 3.0 * t - 2.0;
        weights[2] = 1.0 - 3.0 * t, weights[3] = t;
    }
}
#endif
