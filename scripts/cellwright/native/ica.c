/* The rows of a charge told apart by their voltage, or averaged in blocks, in one pass: see
 * protocols/ica/levels.py and blocks.py.
 *
 * A converter knows few levels, so a small table of hashes finds the level of a row, and no row
 * need be sorted. */
#include <stdint.h>
#include <string.h>

#define SLOTS 65536 /* a power of two, twice the levels that there is room for */
#define LANES 4 /* sums at a time */

/* Number of the level of a voltage, a new one where it is not known yet; -1 without room. */
static inline int32_t level_of(double voltage, int32_t *slots, int64_t room, double *level,
                               int64_t *levels) {
    uint64_t bits;
    memcpy(&bits, &voltage, sizeof bits);
    uint64_t slot = (bits * UINT64_C(0x9E3779B97F4A7C15)) >> 48;
    while (slots[slot] >= 0) {
        if (!memcmp(&level[slots[slot]], &bits, sizeof bits))
            return slots[slot];
        slot = (slot + 1) % SLOTS;
    }
    if (*levels == room)
        return -1;
    level[*levels] = voltage;
    slots[slot] = (int32_t)*levels;
    return (int32_t)(*levels)++;
}

/* Levels in the order of their first row; rows and charge of each, (2, room), all zero at first:
 * every second row counts apart, so that it need not wait for the sum of the row before.
 * Gives the number of levels, or -1 for more than `room`. */
int64_t tally(int64_t n, const double *voltage, const double *charge, int64_t room, double *level,
              double *rows, double *sum) {
    int32_t slots[SLOTS];
    memset(slots, 0xff, sizeof slots);
    int64_t levels = 0;
    for (int64_t k = 0; k < n; k++) {
        const double here = voltage[k] + 0.0; /* minus zero is zero */
        const int32_t found = level_of(here, slots, room, level, &levels);
        if (found < 0)
            return -1;
        rows[(k & 1) * room + found] += 1.0;
        sum[(k & 1) * room + found] += charge[k];
    }
    return levels;
}

/* Rows of a block whose voltage is above and below that of the row before, and whether the charge
 * falls anywhere; branches are avoided so that several rows are compared at once. */
static void compared(const double *voltage, const double *charge, int64_t rows, int64_t *up,
                     int64_t *down, int64_t *falling) {
    int64_t rise = 0, fall = 0, back = 0;
    for (int64_t k = 0; k < rows; k++) {
        rise += voltage[k] > voltage[k - 1];
        fall += voltage[k] < voltage[k - 1];
        back += charge[k] < charge[k - 1];
    }
    *up += rise, *down += fall, *falling = back;
}

static double sum_of(const double *values, int64_t rows) {
    double sums[LANES] = {0.0};
    int64_t k = 0;
    for (; k + LANES <= rows; k += LANES)
        for (int lane = 0; lane < LANES; lane++)
            sums[lane] += values[k + lane];
    for (; k < rows; k++)
        sums[0] += values[k];
    return (sums[0] + sums[1]) + (sums[2] + sums[3]);
}

/* Mean voltage and mean charge of blocks of `size` rows; the charge counts as the highest so far.
 * steps: rows whose voltage is above, and below, that of the row before. */
void charge_blocks(int64_t n, const double *voltage, const double *charge, int64_t size,
                   double *mean_voltage, double *mean_charge, int64_t *steps) {
    double highest = charge[0];
    steps[0] = steps[1] = 0;
    for (int64_t begin = 0, block = 0; begin < n; begin += size, block++) {
        const int64_t rows = begin + size < n ? size : n - begin, skip = begin == 0;
        int64_t falling;
        compared(voltage + begin + skip, charge + begin + skip, rows - skip, steps, steps + 1,
                 &falling);
        double sum = 0.0;
        if (falling || charge[begin] < highest)
            for (int64_t k = begin; k < begin + rows; k++) {
                highest = charge[k] > highest ? charge[k] : highest;
                sum += highest;
            }
        else {
            sum = sum_of(charge + begin, rows);
            highest = charge[begin + rows - 1];
        }
        mean_charge[block] = sum / (double)rows;
        mean_voltage[block] = sum_of(voltage + begin, rows) / (double)rows;
    }
}
