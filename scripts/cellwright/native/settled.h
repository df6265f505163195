/* For recursions that decay to nothing: numbers near the smallest that a double holds, at which they
 * would stay, slow a processor down tenfold, and all that is computed from them. Asked once in a
 * block of rows: a state that at least half of is left in each row, which alone would stay there,
 * does not fall so far within one. */
#ifndef SETTLED_H
#define SETTLED_H

enum { BLOCK = 128 };

static inline double settled(double state) {
    return state < 1e-150 && state > -1e-150 ? 0.0 : state;
}
#endif
