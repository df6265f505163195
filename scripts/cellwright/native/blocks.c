/* How well a linear fit predicts each block of its rows left out of it, from products of columns. */
#include <stdint.h>

/* Change of the factors of the free columns, the first of those used, once the rows of a part with
   products G are left out: x = (W - G)^-1 (-G a), by elimination in the upper triangle.
   whole W (free, free); left (free, free) is worked on. */
static void change_without(int64_t columns, int64_t count, int64_t free, const int64_t *used,
                           const double *factors, const double *whole, const double *part,
                           double *left, double *change)
{
    for (int64_t i = 0; i < free; i++) {
        const double *row = part + used[i] * columns;
        double mixed = 0.0;
        for (int64_t k = 0; k < count; k++) mixed += row[used[k]] * factors[k];
        change[i] = -mixed;
        for (int64_t k = i; k < free; k++) left[i * free + k] = whole[i * free + k] - row[used[k]];
    }
    for (int64_t i = 0; i < free; i++) {
        const double *pivot = left + i * free;
        for (int64_t j = i + 1; j < free; j++) {
            const double share = pivot[j] / pivot[i];
            double *row = left + j * free;
            for (int64_t k = j; k < free; k++) row[k] -= share * pivot[k];
            change[j] -= share * change[i];
        }
    }
    for (int64_t i = free - 1; i >= 0; i--) {
        for (int64_t k = i + 1; k < free; k++) change[i] -= left[i * free + k] * change[k];
        change[i] /= left[i * free + i];
    }
}

/* a' G a over the columns used. */
static double square_of(int64_t columns, int64_t count, const int64_t *used, const double *products,
                        const double *factors)
{
    double sum = 0.0;
    for (int64_t i = 0; i < count; i++) {
        const double *row = products + used[i] * columns;
        double mixed = 0.0;
        for (int64_t k = 0; k < i; k++) mixed += row[used[k]] * factors[k];
        sum += factors[i] * (2.0 * mixed + row[used[i]] * factors[i]);
    }
    return sum;
}

/* squares[b] = a' G[b] a with the factors of a fit without the part that holds the block, -1: with
   all. products (blocks, columns, columns) and of_parts (parts, columns, columns), symmetric; the
   blocks of a part need not lie side by side. moved (parts, count) and made (parts), zeros, keep
   the factors of each part; left (free, free) is worked on. */
void squares_left_out(int64_t blocks, int64_t columns, int64_t count, int64_t free,
                      const double *products, const int64_t *used, const double *factors,
                      const double *whole, const double *of_parts, const int64_t *part,
                      double *moved, int64_t *made, double *left, double *squares)
{
    for (int64_t b = 0; b < blocks; b++) {
        const double *of_block = products + b * columns * columns, *mine = factors;
        if (part[b] >= 0) {
            double *of_part = moved + part[b] * count;
            if (!made[part[b]]) {
                change_without(columns, count, free, used, factors, whole,
                               of_parts + part[b] * columns * columns, left, of_part);
                for (int64_t k = 0; k < count; k++)
                    of_part[k] = factors[k] - (k < free ? of_part[k] : 0.0);
                made[part[b]] = 1;
            }
            mine = of_part;
        }
        squares[b] = square_of(columns, count, used, of_block, mine);
    }
}
