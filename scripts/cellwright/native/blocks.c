/* Squares of linear combinations of columns, block by block, from the products of the columns. */
#include <stdint.h>

/* squares[b] = v[b]' G[b] v[b] over `used` of the columns of G (blocks, columns, columns),
   symmetric; factors (blocks, used count). */
void block_squares(int64_t blocks, int64_t columns, int64_t count, const double *products,
                   const int64_t *used, const double *factors, double *squares)
{
    for (int64_t b = 0; b < blocks; b++) {
        const double *of_block = products + b * columns * columns, *v = factors + b * count;
        double sum = 0.0;
        for (int64_t i = 0; i < count; i++) {
            const double *row = of_block + used[i] * columns;
            double mixed = 0.0;
            for (int64_t k = 0; k < i; k++) mixed += row[used[k]] * v[k];
            sum += v[i] * (2.0 * mixed + row[used[i]] * v[i]);
        }
        squares[b] = sum;
    }
}
