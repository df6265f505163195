/* The rows of a charge told apart by their voltage, in one pass: see protocols/ica/levels.py.
 *
 * A converter knows few levels, so a small table of hashes finds the level of a row, and no row
 * need be sorted. */
#include <stdint.h>
#include <string.h>

#define SLOTS 65536 /* a power of two, twice the levels that there is room for */

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
 * Gives the number of levels, or -1 for more than `room`; *bend is the sum of the squared second
 * differences of the voltage. */
int64_t tally(int64_t n, const double *voltage, const double *charge, int64_t room, double *level,
              double *rows, double *sum, double *bend) {
    int32_t slots[SLOTS];
    memset(slots, 0xff, sizeof slots);
    int64_t levels = 0;
    double squares = 0.0, last = voltage[0], rise = 0.0;
    for (int64_t k = 0; k < n; k++) {
        const double here = voltage[k] + 0.0; /* minus zero is zero */
        const int32_t found = level_of(here, slots, room, level, &levels);
        if (found < 0)
            return -1;
        rows[(k & 1) * room + found] += 1.0;
        sum[(k & 1) * room + found] += charge[k];
        const double second = k > 1 ? here - last - rise : 0.0;
        squares += second * second;
        rise = here - last;
        last = here;
    }
    *bend = squares;
    return levels;
}
