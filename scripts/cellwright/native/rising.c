/* Gauss-Newton steps of a penalised rising spline: see numerics/monotone.py. */
#include <math.h>
#include <stdint.h>

#define ORDER 3
#define BANDS (ORDER + 2)
static const double SIGN[ORDER + 1] = {-1.0, 3.0, -3.0, 1.0}; /* of the third difference */

/* Derivatives (BANDS, count) of the penalised differences by the coefficients, times stiffness. */
static void penalty_rows(int64_t count, const double *logs, const double *stiffness, double *rows) {
    for (int64_t i = 0; i < count; i++) {
        double before = 0.0;
        for (int k = 0; k < BANDS; k++) {
            const double share = k <= ORDER ? SIGN[k] * exp(-logs[i + k]) : 0.0;
            rows[k * count + i] = stiffness[i] * (before - share);
            before = share;
        }
    }
}

/* Lower banded Cholesky factor (BANDS, n) of normal + strength * rows' rows; 0 where none is. */
static int factorise(int64_t n, const double *normal, const double *rows, double strength,
                     double rounding, double *factor) {
    const int64_t count = n - 1 - ORDER;
    for (int64_t j = 0; j < BANDS * n; j++)
        factor[j] = normal[j];
    for (int k = 0; k < BANDS; k++)
        for (int d = 0; d < BANDS - k; d++)
            for (int64_t i = 0; i < count; i++)
                factor[d * n + k + i] += strength * rows[k * count + i] * rows[(k + d) * count + i];
    for (int64_t j = 0; j < n; j++) {
        double pivot = factor[j] * (1.0 + rounding);
        for (int m = 1; m < BANDS && m <= j; m++)
            pivot -= factor[m * n + j - m] * factor[m * n + j - m];
        if (!(pivot > 0.0) || !isfinite(pivot))
            return 0;
        pivot = sqrt(pivot);
        factor[j] = pivot;
        for (int d = 1; d < BANDS && j + d < n; d++) {
            double sum = factor[d * n + j];
            for (int m = 1; m < BANDS - d && m <= j; m++)
                sum -= factor[(d + m) * n + j - m] * factor[m * n + j - m];
            factor[d * n + j] = sum / pivot;
        }
    }
    return 1;
}

/* Solution of the factorised system in place of its right side. */
static void solve(int64_t n, const double *factor, double *x) {
    for (int64_t j = 0; j < n; j++) {
        for (int m = 1; m < BANDS && m <= j; m++)
            x[j] -= factor[m * n + j - m] * x[j - m];
        x[j] /= factor[j];
    }
    for (int64_t j = n - 1; j >= 0; j--) {
        for (int m = 1; m < BANDS && j + m < n; m++)
            x[j] -= factor[m * n + j] * x[j + m];
        x[j] /= factor[j];
    }
}

/* Coefficients that rise by exp(logs) and leave no mean residual; gives the first. */
static double risen(int64_t n, const double *sums, const double *right, const double *logs,
                    double *coefficients) {
    double rise = 0.0, residual = 0.0, whole = 0.0;
    for (int64_t j = 0; j < n; j++) {
        rise += j ? exp(logs[j - 1]) : 0.0;
        coefficients[j] = rise;
        residual += right[j] - sums[j] * rise;
        whole += sums[j];
    }
    const double base = residual / whole;
    for (int64_t j = 0; j < n; j++)
        coefficients[j] += base;
    return base;
}

/* At most `most` steps from `logs` (n - 1,), which they change; `limits`: relative change that ends
 * them, range of the logarithms, rounding. `work`: (8 n,). factor (BANDS, n) and *base are of the
 * last logarithms. Gives 0, or -1 where the equations have no solution. */
int64_t rising_fit(int64_t n, const double *normal, const double *right, const double *stiffness,
                   double strength, int64_t most, const double *limits, double *logs, double *work,
                   double *factor, double *base) {
    const int64_t count = n - 1 - ORDER;
    double *rows = work, *coefficients = work + 5 * n, *x = work + 6 * n, *sums = work + 7 * n;
    for (int64_t j = 0; j < n; j++)
        sums[j] = normal[j];
    for (int d = 1; d < BANDS; d++)
        for (int64_t j = 0; j + d < n; j++) {
            sums[j + d] += normal[d * n + j];
            sums[j] += normal[d * n + j];
        }
    *base = risen(n, sums, right, logs, coefficients);
    for (int64_t step = 0; step < most; step++) {
        penalty_rows(count, logs, stiffness, rows);
        if (!factorise(n, normal, rows, strength, limits[2], factor))
            return -1;
        for (int64_t j = 0; j < n; j++)
            x[j] = right[j];
        for (int64_t i = 0; i < count; i++) {
            double aim = 0.0, difference = 0.0;
            for (int k = 0; k < BANDS; k++)
                aim += rows[k * count + i] * coefficients[i + k];
            for (int k = 0; k <= ORDER; k++)
                difference += SIGN[k] * logs[i + k];
            aim = strength * (aim - difference * stiffness[i]);
            for (int k = 0; k < BANDS; k++)
                x[i + k] += rows[k * count + i] * aim;
        }
        solve(n, factor, x);
        double largest = 0.0, highest = -INFINITY;
        for (int64_t j = 0; j < n - 1; j++) {
            const double change = (x[j + 1] - x[j]) * exp(-logs[j]) - 1.0;
            largest = fabs(change) > largest ? fabs(change) : largest;
            logs[j] += change < 0 ? fmax(change, -1.0) : log1p(fmin(change, 3.0));
            highest = fmax(highest, logs[j]);
        }
        for (int64_t j = 0; j < n - 1; j++)
            logs[j] = fmax(logs[j], highest - limits[1]);
        *base = risen(n, sums, right, logs, coefficients);
        if (!isfinite(highest))
            return -1;
        if (largest < limits[0])
            break;
    }
    penalty_rows(count, logs, stiffness, rows);
    return factorise(n, normal, rows, strength, limits[2], factor) ? 0 : -1;
}

/* Band (BANDS, n) of the inverse of what `factor` is the Cholesky factor of, from its end on:
 * K. Takahashi, J. Fagan, M. Chin, Proc. 8th PICA Conference (1973) 63. */
void inverse_band(int64_t n, const double *factor, double *inverse) {
    for (int64_t j = n - 1; j >= 0; j--)
        for (int d = BANDS - 1; d >= 0; d--) {
            if (j + d >= n) {
                inverse[d * n + j] = 0.0;
                continue;
            }
            double sum = d ? 0.0 : 1.0 / factor[j];
            for (int m = 1; m < BANDS && j + m < n; m++) {
                const int64_t low = m < d ? j + m : j + d;
                const int apart = m < d ? d - m : m - d;
                sum -= factor[m * n + j] * inverse[apart * n + low];
            }
            inverse[d * n + j] = sum / factor[j];
        }
}
