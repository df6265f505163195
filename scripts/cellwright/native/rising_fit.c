/* Gauss-Newton steps of a penalised rising spline at one strength: see numerics/monotone.py. */
#include <math.h>
#include <string.h>

#include "rising.h"

#define SMALL 0.06
static const double SIGN[ORDER + 1] = {-1.0, 3.0, -3.0, 1.0}; /* of the third difference */

/* Derivatives (n - 1 - ORDER, BANDS) of the penalised differences by the coefficients. */
void rising_differences(int64_t n, const double *steps, const double *stiffness, double *rows) {
    double share[SPLINES] = {0.0, 1.0 / steps[0], 1.0 / steps[1], 1.0 / steps[2]};
    for (int64_t i = 0; i < n - 1 - ORDER; i++, rows += BANDS) {
        memmove(share, share + 1, ORDER * sizeof *share);
        share[ORDER] = 1.0 / steps[i + ORDER];
        double before = 0.0;
        for (int k = 0; k <= ORDER; k++) {
            const double here = SIGN[k] * share[k] * stiffness[i];
            rows[k] = before - here;
            before = here;
        }
        rows[ORDER + 1] = before;
    }
}

/* The equations of one step, built, factorised and solved column by column: pivots and unit lower
 * factor (n, BANDS), solution in problem->solved; 0 where a pivot is not above zero.
 *
 * A column has its part of the readings' equations and of the penalised difference that begins at
 * it, and what the four columns before passed on. These sums stay in registers: p, q, r, s of the
 * next four columns, t of their right sides. */
static int solved(const Problem *problem, double strength, Fit *fit) {
    const int64_t n = problem->n;
    const double *normal = problem->normal, *c = fit->coefficients, *logs = fit->logs;
    const double raised = 1.0 + problem->limits[2];
    double *x = problem->solved, *factor = fit->factor;
    double p0 = 0, p1 = 0, p2 = 0, p3 = 0, q0 = 0, q1 = 0, q2 = 0, r0 = 0, r1 = 0, s0 = 0;
    double t1 = 0, t2 = 0, t3 = 0, t4 = 0;
    double h0, h1 = 1.0 / fit->steps[0], h2 = 1.0 / fit->steps[1], h3 = 1.0 / fit->steps[2];
    for (int64_t j = 0; j < n; j++, normal += BANDS, factor += BANDS) {
        double a0 = 0, a1 = 0, a2 = 0, a3 = 0, a4 = 0, aim = 0; /* of the difference */
        if (j < n - 1 - ORDER) {
            const double stiff = problem->stiffness[j];
            h0 = h1, h1 = h2, h2 = h3, h3 = 1.0 / fit->steps[j + 3];
            a0 = stiff * h0, a1 = stiff * (-h0 - 3.0 * h1), a2 = 3.0 * stiff * (h1 + h2);
            a3 = stiff * (-3.0 * h2 - h3), a4 = stiff * h3;
            const double bent = logs[j + 3] - 3.0 * logs[j + 2] + 3.0 * logs[j + 1] - logs[j];
            const double now =
                (a0 * c[j] + a1 * c[j + 1]) + (a2 * c[j + 2] + a3 * c[j + 3]) + a4 * c[j + 4];
            aim = strength * (now - bent * stiff);
        }
        const double w0 = strength * a0, w1 = strength * a1, w2 = strength * a2;
        const double w3 = strength * a3, w4 = strength * a4;
        const double pivot = raised * (normal[0] + w0 * a0) + p0;
        const double v1 = normal[1] + w0 * a1 + p1, v2 = normal[2] + w0 * a2 + p2;
        const double v3 = normal[3] + w0 * a3 + p3, v4 = w0 * a4;
        if (!(pivot > 0.0) || !isfinite(pivot))
            return 0;
        const double share = 1.0 / pivot, z = problem->right[j] + a0 * aim + t1;
        const double l1 = v1 * share, l2 = v2 * share, l3 = v3 * share, l4 = v4 * share;
        factor[0] = pivot, factor[1] = l1, factor[2] = l2, factor[3] = l3, factor[4] = l4;
        x[j] = z * share;
        p0 = q0 + raised * w1 * a1 - l1 * v1, p1 = q1 + w1 * a2 - l1 * v2;
        p2 = q2 + w1 * a3 - l1 * v3, p3 = w1 * a4 - l1 * v4;
        q0 = r0 + raised * w2 * a2 - l2 * v2, q1 = r1 + w2 * a3 - l2 * v3, q2 = w2 * a4 - l2 * v4;
        r0 = s0 + raised * w3 * a3 - l3 * v3, r1 = w3 * a4 - l3 * v4;
        s0 = raised * w4 * a4 - l4 * v4;
        t1 = t2 + a1 * aim - l1 * z, t2 = t3 + a2 * aim - l2 * z, t3 = t4 + a3 * aim - l3 * z;
        t4 = a4 * aim - l4 * z;
    }
    x[n] = x[n + 1] = x[n + 2] = x[n + 3] = 0.0;
    for (int64_t j = n - 1; j >= 0; j--) {
        factor -= BANDS;
        x[j] -= factor[4] * x[j + 4] + factor[3] * x[j + 3] + factor[2] * x[j + 2];
        x[j] -= factor[1] * x[j + 1];
    }
    return 1;
}

/* Coefficients that rise by the steps and leave no mean residual. */
static void risen(const Problem *problem, Fit *fit) {
    double rise = 0.0, residual = 0.0, whole = 0.0;
    for (int64_t j = 0; j < problem->n; j++) {
        rise += j ? fit->steps[j - 1] : 0.0;
        fit->coefficients[j] = rise;
        residual += problem->right[j] - problem->sums[j] * rise;
        whole += problem->sums[j];
    }
    const double base = residual / whole;
    for (int64_t j = 0; j < problem->n; j++)
        fit->coefficients[j] += base;
}

/* exp(x) and log(1 + x) of a small |x| < 0.06 by their series, to double precision. */
static double small_exp(double x) {
    return 1.0 + x * (1.0 + x / 2 * (1.0 + x / 3 * (1.0 + x / 4 * (1.0 + x / 5 * (1.0 + x / 6 *
           (1.0 + x / 7 * (1.0 + x / 8 * (1.0 + x / 9))))))));
}

static double small_log1p(double x) {
    const double z = x / (2.0 + x), square = z * z;
    return 2.0 * z * (1.0 + square * (1.0 / 3 + square * (1.0 / 5 + square * (1.0 / 7 + square *
           (1.0 / 9 + square / 11)))));
}

/* The steps between coefficients and their logarithms after one step; its largest relative change.
 * At once a step falls at most to a third and grows at most fourfold: it stays above 0. */
static double moved(const Problem *problem, Fit *fit) {
    const double *x = problem->solved;
    double *logs = fit->logs, *steps = fit->steps, largest = 0.0, highest = -INFINITY;
    for (int64_t j = 0; j < problem->n - 1; j++) {
        const double change = (x[j + 1] - x[j]) / steps[j] - 1.0;
        largest = fabs(change) > largest ? fabs(change) : largest;
        if (change < 0.0) {
            const double fall = change > -1.0 ? change : -1.0;
            logs[j] += fall;
            steps[j] *= fall > -SMALL ? small_exp(fall) : exp(fall);
        } else {
            const double growth = change < 3.0 ? change : 3.0;
            logs[j] += growth < SMALL ? small_log1p(growth) : log1p(growth);
            steps[j] *= 1.0 + growth;
        }
        highest = logs[j] > highest ? logs[j] : highest;
    }
    for (int64_t j = 0; j < problem->n - 1; j++)
        if (logs[j] < highest - problem->limits[1]) {
            logs[j] = highest - problem->limits[1];
            steps[j] = exp(logs[j]);
        }
    return isfinite(highest) ? largest : NAN;
}

/* Objective and minus twice the logarithm of the restricted likelihood. */
static void judged(const Problem *problem, double strength, Fit *fit) {
    const int64_t n = problem->n;
    const double *c = fit->coefficients;
    double square = problem->square, penalty = 0.0, whole = 0.0, logs = 0.0;
    for (int64_t j = 0; j < n; j++) {
        const double *band = problem->normal + BANDS * j;
        double product = 0.5 * band[0] * c[j];
        for (int d = 1; d < SPLINES && j + d < n; d++)
            product += band[d] * c[j + d];
        square += 2.0 * c[j] * (product - problem->right[j]);
        logs += j ? fit->logs[j - 1] : 0.0;
    }
    for (int64_t i = 0; i < n - 1 - ORDER; i++) {
        const double *l = fit->logs + i;
        const double bent = problem->stiffness[i] * (l[3] - 3.0 * l[2] + 3.0 * l[1] - l[0]);
        penalty += bent * bent;
    }
    double mantissa = 1.0; /* of the product of the pivots */
    for (int64_t j = 0; j < n; j++) {
        int exponent;
        mantissa = frexp(mantissa * fit->factor[BANDS * j], &exponent);
        whole += exponent;
    }
    whole = whole * 0.69314718055994530942 + log(mantissa);
    fit->objective = fmax(square + strength * penalty, 1e-24 * problem->square);
    fit->evidence = (double)(problem->readings - ORDER) * log(fit->objective) + whole + 2.0 * logs;
    fit->evidence -= (double)(n - 1 - ORDER) * log(strength);
}

/* Fit at one strength by at most `most` steps from logarithms (n - 1,) of the steps between
 * coefficients; 0, or -1 where the equations have no solution. */
int rising_fit(const Problem *problem, double decade, const double *logs, int64_t most, Fit *fit) {
    const double strength =
        1e-9 * pow(10.0, decade) * fmax(problem->square, 1e-30) / (double)problem->readings;
    fit->decade = decade;
    for (int64_t j = 0; j < problem->n - 1; j++) {
        fit->logs[j] = logs[j];
        fit->steps[j] = exp(logs[j]);
    }
    risen(problem, fit);
    for (int64_t step = 0; step < most; step++) {
        if (!solved(problem, strength, fit))
            return -1;
        const double change = moved(problem, fit);
        risen(problem, fit);
        if (isnan(change))
            return -1;
        if (change < problem->limits[0])
            break;
    }
    if (!solved(problem, strength, fit))
        return -1;
    judged(problem, strength, fit);
    return 0;
}

/* Bands (n, BANDS) of the inverse, from its end on: K. Takahashi, J. Fagan, M. Chin, Proc. 8th PICA
 * Conference (1973) 63. */
void rising_inverse(int64_t n, const double *factor, double *inverse) {
    memset(inverse, 0, (size_t)(BANDS * n) * sizeof *inverse);
    for (int64_t j = n - 1; j >= 0; j--)
        for (int d = BANDS - 1; d >= 0; d--) {
            if (j + d >= n)
                continue;
            double sum = d ? 0.0 : 1.0 / factor[BANDS * j];
            for (int m = 1; m < BANDS && j + m < n; m++) {
                const int64_t low = m < d ? j + m : j + d;
                sum -= factor[BANDS * j + m] * inverse[BANDS * low + (m < d ? d - m : m - d)];
            }
            inverse[BANDS * j + d] = sum;
        }
}

/* Standard deviations (m,) of functions of `width` neighbouring coefficients, the first of which is
 * first[k], by weights (width, m) and the inverse (BANDS, n). */
void band_deviations(int64_t m, const int64_t *first, int64_t width, const double *weights,
                     int64_t n, const double *inverse, double variance, double *deviation) {
    for (int64_t k = 0; k < m; k++) {
        double square = 0.0;
        for (int64_t a = 0; a < width; a++)
            for (int64_t b = a; b < width; b++)
                square += (a == b ? 1.0 : 2.0) * weights[a * m + k] * weights[b * m + k] *
                          inverse[(b - a) * n + first[k] + a];
        deviation[k] = sqrt(variance * (square > 0.0 ? square : 0.0));
    }
}
