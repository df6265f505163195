/* A pack of cells as it is handed to pack.c, and its wiring at one moment: every group as a source
 * behind a resistance, up to the whole, and currents down again (see packs/network.py). */
#ifndef PACK_NETWORK_H
#define PACK_NETWORK_H

#include <math.h>
#include <stdint.h>

#include "cell.h"

#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif

/* The arrays of a loop are not the same: its cells may be worked off at once. */
#define EACH _Pragma("GCC ivdep") for

enum { SERIES, STAR, LADDER, OPPOSITE };
enum { CURRENT, VOLTAGE, POWER };
enum { SOLVED, NO_RESISTANCE, NOT_SOLVED, NO_POWER };
#define BLOCK 256 /* cells whose rows stay near the processor */
#define MOST_PASSES 60
#define LINEAR_PASSES 4
#define MOST_TURNS 30
#define SMALLEST 1e-9
#define SAME_KIND 1e4 /* see packs/steps.py */

/* What does not change in a run. Quantities lie in the order ocv, shift, r0, r of pairs, r and scale
 * of kinetics, r to charge and to discharge of ways, gains of the surface, goals and charges of
 * hysteresis, time constants of pairs, kinetics, ways and surface; of absent ones nothing. */
typedef struct {
    int64_t cells, groups, points, temperatures, pairs, kinetics, hystereses, surfaces, ways;
    int64_t quantities, lags, linear, moving, bare;
    const int64_t *address, *stride, *straight;
    const double *inverse, *inverse_here, *per_second, *share; /* per_second: SoC per ampere and second */
    const int64_t *connection, *first, *member;
    const double *contact, *link;
    double tolerance, same_soc;
} pack;

/* Lags and quantities of a cell, by the array `sizes` of pack_steps. */
INLINE int64_t lags_of(const int64_t *z) { return z[4] + z[5] + z[8] + z[7]; }
INLINE int64_t quantities_of(const int64_t *z) {
    return 3 + 2 * z[4] + 3 * z[5] + 3 * z[8] + 2 * z[7] + 2 * z[6];
}

/* Rows of (cells,): states, what is looked up, weights of the lags over the step, and the step. */
typedef struct {
    double *soc, *current, *memory;    /* memory: pairs, kinetics, ways, surfaces, hystereses */
    double *before;                    /* quantities at the last sample */
    double *left, *base, *rise, *now;  /* interval, quantities at its left end, over it, now */
    double *gain, *after;              /* (lags,) */
    double *next, *guess, *place, *soc_next, *volt, *slope, *held, *zr;
    double *source, *resistance, *through; /* (elements,) */
    double *conductance, *onward;          /* (members,), (3, members) */
} states;

#define ROW(block, k) ((block) + (k) * p->cells)
#define R0(p) (2)
#define PAIR(p) (3)
#define KINETIC(p) (PAIR(p) + (p)->pairs)
#define SCALE(p) (KINETIC(p) + (p)->kinetics)
#define CHARGING(p) (SCALE(p) + (p)->kinetics)
#define DISCHARGING(p) (CHARGING(p) + (p)->ways)
#define GAIN(p) (DISCHARGING(p) + (p)->ways)
#define GOAL(p) (GAIN(p) + (p)->surfaces)
#define CHARGE(p) (GOAL(p) + (p)->hystereses)
#define TAU(p) (CHARGE(p) + (p)->hystereses)

/* The one voltage at which currents add up to the total, as a source behind a resistance. Voltages
 * are taken from that of the first member, so that a large group's currents add up to rounding;
 * four sums at once, for speed. */
INLINE int64_t star(int64_t count, const double *e, const double *z, const double *contact,
                    double *g, double *source, double *resistance) {
    const double from = e[0];
    double inflow[4] = {0}, conductance[4] = {0};
    int64_t lacking = 0;
    EACH(int64_t k = 0; k < count; k++) {
        const double own = z[k] + contact[k];
        lacking |= !(own > 0.0);
        g[k] = 1.0 / own;
    }
    const int64_t fours = count - count % 4;
    for (int64_t k = 0; k < fours; k += 4)
        for (int64_t i = 0; i < 4; i++) {
            inflow[i] += g[k + i] * (e[k + i] - from);
            conductance[i] += g[k + i];
        }
    for (int64_t k = fours; k < count; k++) {
        inflow[0] += g[k] * (e[k] - from);
        conductance[0] += g[k];
    }
    *resistance = 1.0 / ((conductance[0] + conductance[1]) + (conductance[2] + conductance[3]));
    *source = from + ((inflow[0] + inflow[1]) + (inflow[2] + inflow[3])) * *resistance;
    return lacking;
}

/* A ladder from its far end: see `_ladder` of packs/network.py. The resistance of the part from a
 * member on is kept as a fraction num/den, so that no division waits for the one before it. */
INLINE int64_t ladder(int64_t count, const double *e, const double *z, const double *contact,
                      const double *link, int64_t opposite, double *onward, int64_t stride,
                      double *source, double *resistance) {
    double a = e[count - 1], num = z[count - 1] + contact[count - 1], den = 1.0;
    double d = 0.0, s0 = 0.0, s1 = 0.0, s2 = 0.0;
    int64_t lacking = !(num > 0.0);
    for (int64_t k = count - 1; k > 0; k--) {
        const double own = z[k - 1] + contact[k - 1], behind = num + link[k] * den;
        const double sum = own * den + behind, inverse = 1.0 / sum;
        lacking |= !(own > 0.0);
        const double to_a = den * inverse * (e[k - 1] - a), inward = own * den * inverse;
        a += behind * inverse * (e[k - 1] - a);
        onward[k] = to_a;
        onward[stride + k] = inward;
        if (opposite) {
            const double half = 0.5 * link[k];
            d -= half;
            s1 -= half;
            s2 += half;
            onward[2 * stride + k] = -den * inverse * d;
            s0 += s1 * to_a;
            s2 += s1 * onward[2 * stride + k];
            s1 *= inward;
            d *= inward;
        }
        num = own * behind;
        den = sum;
        if (k % 16 == 0) {
            num /= den;
            den = 1.0;
        }
    }
    *source = a + s0;
    *resistance = num / den + d + s1 + s2;
    return lacking;
}

/* All groups as sources behind resistances; the group whose member has no resistance, or −1. */
INLINE int64_t reduce(const pack *p, const states *s, int64_t *culprit) {
    for (int64_t node = 0; node < p->groups; node++) {
        const int64_t at = p->first[node], count = p->first[node + 1] - at;
        const int64_t *ids = p->member + at;
        const int64_t dense = ids[count - 1] - ids[0] == count - 1;
        double *source = s->source + p->cells + node, *resistance = s->resistance + p->cells + node;
        double *g = s->conductance + at, *onward = s->onward + at;
        const double *e = s->source + ids[0], *z = s->resistance + ids[0];
        double volts = 0.0, ohms = 0.0;
        int64_t lacking;
        if (!dense) { /* gathered behind the members' conductances */
            double *gathered = s->conductance + p->first[p->groups] + 2 * at;
            for (int64_t k = 0; k < count; k++) {
                gathered[k] = s->source[ids[k]];
                gathered[count + k] = s->resistance[ids[k]];
            }
            e = gathered;
            z = gathered + count;
        }
        if (p->connection[node] == SERIES || count == 1) {
            for (int64_t k = 0; k < count; k++) {
                volts += e[k];
                ohms += z[k] + p->contact[at + k];
            }
            *source = volts;
            *resistance = ohms;
            continue;
        }
        if (p->connection[node] == STAR)
            lacking = star(count, e, z, p->contact + at, g, source, resistance);
        else
            lacking = ladder(count, e, z, p->contact + at, p->link + at,
                             p->connection[node] == OPPOSITE, onward, p->first[p->groups], source,
                             resistance);
        for (int64_t k = 0; lacking && k < count; k++)
            if (!(z[k] + p->contact[at + k] > 0.0)) {
                *culprit = k;
                return node;
            }
    }
    return -1;
}

/* Currents of all elements from that of the pack, the last. */
INLINE void divide(const pack *p, const states *s) {
    for (int64_t node = p->groups - 1; node >= 0; node--) {
        const int64_t at = p->first[node], count = p->first[node + 1] - at;
        const int64_t *ids = p->member + at, dense = ids[count - 1] - ids[0] == count - 1;
        const int64_t stride = p->first[p->groups];
        const double through = s->through[p->cells + node];
        const double *onward = s->onward + at, *g = s->conductance + at;
        double *current = s->through + ids[0];
        if (p->connection[node] == SERIES || count == 1) {
            for (int64_t k = 0; k < count; k++)
                s->through[ids[k]] = through;
        } else if (p->connection[node] == STAR) {
            const double from = s->source[ids[0]], ohm = s->resistance[p->cells + node];
            const double rise = s->source[p->cells + node] - from + ohm * through;
            const double *e = s->source + ids[0];
            if (dense)
                EACH(int64_t k = 0; k < count; k++)
                    current[k] = g[k] * (rise - (e[k] - from));
            else
                for (int64_t k = 0; k < count; k++)
                    s->through[ids[k]] = g[k] * (rise - (s->source[ids[k]] - from));
        } else {
            const double *inward = onward + stride, *of_all = inward + stride;
            const double whole = p->connection[node] == OPPOSITE ? through : 0.0;
            double reaching = through;
            for (int64_t k = 1; k < count; k++) {
                const double on = (whole != 0.0 ? onward[k] + of_all[k] * whole : onward[k])
                                  + inward[k] * reaching;
                s->through[ids[k - 1]] = reaching - on;
                reaching = on;
            }
            s->through[ids[count - 1]] = reaching;
        }
    }
}

/* Total current that is asked of the pack, by what is given of it. */
INLINE int64_t asked(const pack *p, const states *s, int64_t mode, double value) {
    const int64_t whole = p->cells + p->groups - 1;
    const double e = s->source[whole], z = s->resistance[whole];
    if (mode == CURRENT)
        s->through[whole] = value;
    else if (mode == VOLTAGE)
        s->through[whole] = (value - e) / z;
    else {
        const double root = e * e + 4.0 * z * value;
        if (!(root >= 0.0))
            return NO_POWER;
        s->through[whole] = 2.0 * value / (e + sqrt(root));
    }
    return SOLVED;
}

#endif
