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

double stretched(const Stretch *stretch, double x, int derivative, int64_t *near);
void smoothed(int64_t n, const double *values, double width, double *smooth);
void gradient(int64_t n, const double *x, const double *y, double *rate);
void interpolated(int64_t m, const double *at, int64_t n, const double *x, const double *y,
                  double *found);
int accumulated(int64_t n, const double *x, const double *density, double width, Stretch *stretch);
void b_splines(double t, int derivative, double *weights);
#endif
