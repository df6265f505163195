/* A pack of cells in any wiring, step by step: see packs/steps.py, whose numpy form says the same.
 *
 * Every cell keeps the interval of SoC that it is in, with the parameters there, and looks into the
 * tables only where it leaves it. Cells of resistors and RC pairs run through short, dense loops
 * (`line`, `follow`); all others, and steps that lead far, cell by cell (`respond`) by Newton. */
#include "pack_network.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

INLINE double table(const pack *p, int64_t q, int64_t t, int64_t cell, int64_t point) {
    const double *values = (const double *)(intptr_t)p->address[q];
    return values[(t * p->cells + cell) * p->stride[q] + point];
}

/* A quantity of a cell at a point of SoC and the cell's temperature. */
INLINE double at_point(const pack *p, int64_t q, int64_t cell, int64_t point) {
    if (p->temperatures == 1)
        return table(p, q, 0, cell, point);
    const double here = p->inverse_here[cell];
    int64_t t = 1;
    while (t < p->temperatures - 1 && here >= p->inverse[t])
        t++;
    const double weight = (here - p->inverse[t - 1]) / (p->inverse[t] - p->inverse[t - 1]);
    const double cold = table(p, q, t - 1, cell, point), hot = table(p, q, t, cell, point);
    const double low = log(fmax(cold, SMALLEST)), high = log(fmax(hot, SMALLEST));
    if (p->straight[q] || !(fabs(high - low) <= log(SAME_KIND)))
        return cold + weight * (hot - cold);
    return exp(low + weight * (high - low));
}

/* A quantity of a cell at a SoC; the first is the OCV, which alone goes on beyond 0 to 1. */
INLINE double quantity_at(const pack *p, int64_t q, int64_t cell, double soc) {
    const grid_place at = place_on_grid(soc, p->points);
    const double low = at_point(p, q, cell, at.below);
    return low + (at_point(p, q, cell, at.below + 1) - low) * (q ? at.inside : at.share);
}

static void enter(const pack *p, const states *s, int64_t cell, int64_t left) {
    s->left[cell] = (double)left;
    for (int64_t q = 0; q < p->quantities; q++) {
        const double low = at_point(p, q, cell, left);
        ROW(s->base, q)[cell] = low;
        ROW(s->rise, q)[cell] = at_point(p, q, cell, left + 1) - low;
    }
}

/* Weights of the lags: gain = 1 − decay, `after` of the input at the end; those of the input at
 * the begin are gain − after. */
static void weigh(const pack *p, const states *s, double step, int64_t first_order) {
    for (int64_t j = 0; j < p->lags; j++) {
        const double *tau = ROW(s->before, TAU(p) + j);
        double *gain = ROW(s->gain, j), *after = ROW(s->after, j);
        for (int64_t c = 0; c < p->cells; c++) {
            if (c && tau[c] == tau[c - 1]) {
                gain[c] = gain[c - 1];
                after[c] = after[c - 1];
                continue;
            }
            if (tau[c] > 0.0)
                lag_gains(step / tau[c], first_order, gain + c, after + c);
            else /* acts at once */
                gain[c] = after[c] = 1.0;
        }
    }
}

/* Cells from..to of resistors and RC pairs as sources behind resistances, about the currents that
 * the last ones lead to, or in a later pass about those that the pass before has found. */
INLINE void line(const pack *p, const states *s, int64_t from, int64_t to, double step, double ramp,
                 double rise, int64_t pass) {
    const double last = (double)(p->points - 1), on = step > 0.0 ? 1.0 : 0.0;
    int64_t moved = 0;
    EACH(int64_t c = from; c < to; c++) {
        s->guess[c] = pass ? s->through[c] : s->current[c] + p->share[c] * rise;
        const double mean = s->guess[c] - 0.5 * p->share[c] * ramp;
        s->place[c] = (s->soc[c] + step * p->per_second[c] * mean) * last - s->left[c];
        moved |= !((s->place[c] >= 0.0) & (s->place[c] < 1.0));
    }
    for (int64_t c = from; moved && c < to; c++)
        if (!(s->place[c] >= 0.0 && s->place[c] < 1.0)) {
            const double soc = (s->place[c] + s->left[c]) / last;
            enter(p, s, c, place_on_grid(soc, p->points).below);
            s->place[c] = soc * last - s->left[c];
        }
    EACH(int64_t c = from; c < to; c++) {
        const double above = s->place[c] > 0.0 ? s->place[c] : 0.0;
        const double held = above < 1.0 ? above : 1.0, rising = s->rise[c];
        const double steep = (rising > 0.0 ? rising : 0.0) * last * (step * p->per_second[c]);
        s->held[c] = held;
        s->source[c] = s->base[c] + rising * s->place[c] - steep * s->guess[c];
        s->resistance[c] = steep + ROW(s->base, R0(p))[c] + ROW(s->rise, R0(p))[c] * held;
    }
    for (int64_t j = 0; j < p->pairs; j++) {
        const double *base = ROW(s->base, PAIR(p) + j), *slope = ROW(s->rise, PAIR(p) + j);
        const double *gain = ROW(s->gain, j), *after = ROW(s->after, j), *u = ROW(s->memory, j);
        const double *old = ROW(s->before, PAIR(p) + j);
        double *next = ROW(s->next, j), *zr = ROW(s->zr, j), *now = ROW(s->now, PAIR(p) + j);
        EACH(int64_t c = from; c < to; c++) {
            now[c] = base[c] + slope[c] * s->held[c];
            const double begin = on * (gain[c] - after[c]) * old[c];
            next[c] = u[c] - on * gain[c] * u[c] - begin * (p->share[c] * ramp);
            zr[c] = begin + on * after[c] * now[c];
            s->source[c] += next[c];
            s->resistance[c] += zr[c];
        }
    }
}

/* What `line` prepared, once the currents are known; whether a SoC is far from the guessed one. */
INLINE int64_t follow(const pack *p, const states *s, int64_t from, int64_t to, double step,
                      double ramp) {
    int64_t far = 0;
    EACH(int64_t c = from; c < to; c++) {
        const double charge = step * p->per_second[c];
        far |= !(fabs(charge * (s->through[c] - s->guess[c])) <= p->same_soc);
        s->soc_next[c] = s->soc[c] + charge * (s->through[c] - 0.5 * p->share[c] * ramp);
    }
    for (int64_t j = 0; j < p->pairs; j++) {
        double *next = ROW(s->next, j);
        const double *zr = ROW(s->zr, j);
        EACH(int64_t c = from; c < to; c++)
            next[c] += zr[c] * s->through[c];
    }
    return far;
}

/* OCV and its slope where diffusion takes it at the surface's SoC. */
INLINE void surface(const pack *p, const states *s, int64_t c, double ahead, double *volt,
                    double *slope) {
    const grid_place at = place_on_grid(ahead, p->points);
    const double low = at_point(p, 0, c, at.below), rise = at_point(p, 0, c, at.below + 1) - low;
    *volt = low + rise * at.share + ROW(s->now, 1)[c] - quantity_at(p, 1, c, ahead);
    *slope = rise * (double)(p->points - 1);
}

/* Voltage and slope of a cell if its current ends at `current`, into volt and slope; its memory and
 * parameters then into next, now and soc_next. */
static void respond(const pack *p, const states *s, int64_t c, double step, double ramp,
                    double current, double *volt, double *slope) {
    const double on = step > 0.0 ? 1.0 : 0.0, charge = step * p->per_second[c];
    const double begin = current - p->share[c] * ramp, mean = 0.5 * (begin + current);
    const double soc = s->soc[c] + charge * mean;
    const grid_place at = place_on_grid(soc, p->points);
    if ((double)at.below != s->left[c])
        enter(p, s, c, at.below);
    for (int64_t q = 0; q < p->quantities; q++)
        ROW(s->now, q)[c] =
            ROW(s->base, q)[c] + ROW(s->rise, q)[c] * (q ? at.inside : at.share);
    double r0 = ROW(s->now, R0(p))[c], sum = 0.0, rises = 0.0, lead = 0.0, lead_rises = 0.0;
    const int64_t kinetic = p->pairs, way = kinetic + p->kinetics, lead_from = way + p->ways;
    for (int64_t j = 0; j < p->lags; j++) {
        const double gain = ROW(s->gain, j)[c], tau = ROW(s->before, TAU(p) + j)[c];
        const double new_share = tau > 0.0 ? on * ROW(s->after, j)[c] : 1.0;
        const double all = tau > 0.0 ? on * gain : 1.0, old_share = all - new_share;
        const double u = ROW(s->memory, j)[c];
        double was, is, was_rise, is_rise;
        if (j >= kinetic && j < way) {
            const int64_t k = j - kinetic;
            const double r = ROW(s->before, KINETIC(p) + k)[c], v = ROW(s->before, SCALE(p) + k)[c];
            const double rn = ROW(s->now, KINETIC(p) + k)[c], vn = ROW(s->now, SCALE(p) + k)[c];
            was = old_share != 0.0 ? v * asinh(r * begin / v) : 0.0;
            was_rise = r / sqrt(1.0 + (r * begin / v) * (r * begin / v));
            is = vn * asinh(rn * current / vn);
            is_rise = rn / sqrt(1.0 + (rn * current / vn) * (rn * current / vn));
        } else {
            const int64_t up = CHARGING(p) + j - way, down = DISCHARGING(p) + j - way;
            const int64_t one_way = j < kinetic ? PAIR(p) + j : GAIN(p) + j - lead_from;
            const int64_t two_way = j >= way && j < lead_from;
            was_rise = ROW(s->before, two_way ? (begin > 0.0 ? up : down) : one_way)[c];
            is_rise = ROW(s->now, two_way ? (current > 0.0 ? up : down) : one_way)[c];
            was = was_rise * begin;
            is = is_rise * current;
        }
        const double next = u - all * u + old_share * was + new_share * is;
        const double rise = old_share * was_rise + new_share * is_rise;
        ROW(s->next, j)[c] = next;
        if (j < lead_from) {
            sum += next;
            rises += rise;
        } else {
            lead += next;
            lead_rises += rise;
        }
    }
    for (int64_t j = 0; j < p->hystereses; j++) {
        const double m = ROW(s->before, GOAL(p) + j)[c];
        const double size = 3600.0 * ROW(s->before, CHARGE(p) + j)[c];
        const double h = ROW(s->memory, p->lags + j)[c];
        const double sign = (mean > 0.0) - (mean < 0.0), decay = exp(-fabs(mean) * step / size);
        const double towards = mean == 0.0 ? fabs(m) + fabs(h) : sign * (m * sign - h);
        ROW(s->next, p->lags + j)[c] = m * sign + decay * (h - m * sign);
        sum += ROW(s->next, p->lags + j)[c];
        rises += (towards > 0.0 ? towards : 0.0) * decay * step / size;
    }
    double ocv = ROW(s->now, 0)[c], steep = ROW(s->rise, 0)[c] * (double)(p->points - 1);
    if (p->surfaces)
        surface(p, s, c, soc + lead, &ocv, &steep);
    s->soc_next[c] = soc;
    *volt = ocv + r0 * current + sum;
    *slope = (steep > 0.0 ? steep : 0.0) * (charge + lead_rises) + r0 + rises;
}

/* Whether the current of the step turned: where a cell with hysteresis goes on from rest. */
INLINE int64_t turns(const pack *p, const states *s, int64_t c, double ramp) {
    const double half = 0.5 * p->share[c] * ramp;
    return (s->guess[c] - half) * (s->through[c] - half) < 0.0;
}

/* Cells' equations and Kirchhoff's laws together, from the currents of `guess`. */
static int64_t newton(const pack *p, const states *s, double step, double ramp, int64_t mode,
                      double value, double *fault) {
    double *volt = s->place, *slope = s->slope, worst = 0.0;
    int64_t culprit = 0, resistless = 0, still = step == 0.0;
    for (int64_t c = 0; c < p->cells; c++) {
        respond(p, s, c, step, ramp, s->guess[c], volt + c, slope + c);
        still &= s->guess[c] == 0.0;
        resistless |= slope[c] == 0.0;
    }
    for (int64_t c = 0; still && resistless && c < p->cells; c++) {
        s->source[c] = volt[c];
        s->resistance[c] = 1.0;
        s->through[c] = 0.0;
    }
    if (still && resistless) {
        reduce(p, s, &culprit);
        memset(s->through + p->cells, 0, (size_t)p->groups * sizeof(double));
        return SOLVED;
    }
    for (int64_t pass = 0; pass < MOST_PASSES; pass++) {
        for (int64_t c = 0; c < p->cells; c++) {
            s->source[c] = volt[c] - slope[c] * s->guess[c];
            s->resistance[c] = slope[c];
        }
        const int64_t group = reduce(p, s, &culprit);
        if (group >= 0) {
            fault[0] = (double)group;
            fault[1] = (double)culprit;
            return NO_RESISTANCE;
        }
        if (asked(p, s, mode, value) != SOLVED)
            return NO_POWER;
        divide(p, s);
        double begin = 0.0, end = 0.0;
        worst = 0.0;
        for (int64_t c = 0; c < p->cells; c++) {
            const double way = s->through[c] - s->guess[c], on_line = volt[c] + slope[c] * way;
            double found, rise;
            respond(p, s, c, step, ramp, s->through[c], &found, &rise);
            begin += slope[c] * way * way;
            end += way * (found - on_line);
            if (!(fabs(found - on_line) <= worst)) {
                worst = fabs(found - on_line);
                fault[0] = (double)c;
                fault[1] = worst;
            }
            volt[c] = found;
            slope[c] = rise;
        }
        if (worst <= p->tolerance)
            return SOLVED;
        int64_t turned = 0;
        for (int64_t c = 0; p->hystereses && pass < MOST_TURNS && c < p->cells; c++)
            turned |= turns(p, s, c, ramp);
        const double part = turned || end <= 0.5 * begin ? 1.0 : begin / (begin + end);
        for (int64_t c = 0; c < p->cells; c++) {
            const int64_t bends = turned && turns(p, s, c, ramp);
            s->guess[c] = bends         ? 0.5 * p->share[c] * ramp
                          : part == 1.0 ? s->through[c]
                                        : s->guess[c] + part * (s->through[c] - s->guess[c]);
            if (turned || part != 1.0)
                respond(p, s, c, step, ramp, s->guess[c], volt + c, slope + c);
        }
    }
    return NOT_SOLVED;
}

/* One step. In `line` the parameters of the last sample are `before`, those of this one `now`. */
INLINE int64_t advance(const pack *p, states *s, double step, double ramp, double rise,
                       int64_t mode, double value, double *fault) {
    int64_t outcome = -1;
    if (p->linear && !(step == 0.0 && p->bare)) {
        int64_t culprit = 0, far = 1;
        for (int64_t pass = 0; pass < LINEAR_PASSES && far; pass++) {
            for (int64_t c = 0; c < p->cells; c += BLOCK)
                line(p, s, c, c + BLOCK < p->cells ? c + BLOCK : p->cells, step, ramp, rise, pass);
            if (reduce(p, s, &culprit) >= 0 || asked(p, s, mode, value) != SOLVED)
                break;
            divide(p, s);
            far = 0;
            for (int64_t c = 0; c < p->cells; c += BLOCK)
                far |= follow(p, s, c, c + BLOCK < p->cells ? c + BLOCK : p->cells, step, ramp);
        }
        outcome = far ? -1 : SOLVED;
    } else
        for (int64_t c = 0; c < p->cells; c++)
            s->guess[c] = s->current[c] + p->share[c] * rise;
    if (outcome < 0) {
        outcome = newton(p, s, step, ramp, mode, value, fault);
        if (outcome != SOLVED)
            return outcome;
    } else if (p->moving)
        for (int64_t q = TAU(p); q < p->quantities; q++)
            EACH(int64_t c = 0; c < p->cells; c++)
                ROW(s->now, q)[c] = ROW(s->base, q)[c] + ROW(s->rise, q)[c] * s->held[c];
    double *kept = s->current;
    s->current = s->through;
    s->through = kept;
    kept = s->memory;
    s->memory = s->next;
    s->next = kept;
    kept = s->soc;
    s->soc = s->soc_next;
    s->soc_next = kept;
    kept = s->before;
    s->before = s->now;
    s->now = kept;
    return SOLVED;
}

/* Lowest and highest voltage of a cell and which, lowest and highest SoC, and current. */
INLINE void extremes(const pack *p, const states *s, const double *volt, double *out) {
    int64_t low = 0, high = 0;
    double soc[2] = {s->soc[0], s->soc[0]}, current[2] = {s->current[0], s->current[0]};
    for (int64_t c = 1; c < p->cells; c++) {
        low = volt[c] < volt[low] ? c : low;
        high = volt[c] > volt[high] ? c : high;
        soc[0] = s->soc[c] < soc[0] ? s->soc[c] : soc[0];
        soc[1] = s->soc[c] > soc[1] ? s->soc[c] : soc[1];
        current[0] = s->current[c] < current[0] ? s->current[c] : current[0];
        current[1] = s->current[c] > current[1] ? s->current[c] : current[1];
    }
    const double row[8] = {volt[low], (double)low, volt[high],  (double)high,
                           soc[0],    soc[1],      current[0], current[1]};
    memcpy(out, row, sizeof row);
}

/* A pack through n steps. sizes: cells, groups, points, temperatures, pairs, kinetics, hystereses,
 * surfaces, ways, linear, moving, bare, hold (1: first order, 0: zero order), rows to keep
 * (every how many, 0: none), extremes (1) or none, sensed element. Per quantity: address of its
 * table, doubles from cell to cell, 1 where it is linear in 1/T and not its logarithm. work: first
 * rows of (cells,) (soc, memory, quantities of the last sample), to begin with and at the end, then
 * room. flow: (cells,) currents, to begin with and at the end. out: current, voltage, soc (kept rows, cells), of the pack (n), extremes
 * (n, 8), currents of the pack (n), the last. Returns −1, or the step that was not solved, with the
 * reason and two numbers about it in fault. */
WIDE int64_t pack_steps(int64_t n, const double *step, const double *mode, const double *value,
                        double total, const int64_t *sizes, const int64_t *address,
                        const int64_t *stride, const int64_t *straight, const double *inverse,
                        const double *inverse_here, const double *per_second,
                        const double *share, const int64_t *connection, const int64_t *first,
                        const int64_t *member, const double *contact, const double *link,
                        double tolerance, double same_soc, double *work, double *flow, double *current,
                        double *cell_volt, double *soc, double *volt, double *out,
                        double *totals, double *fault) {
    const int64_t *z = sizes, lags = lags_of(z), quantities = quantities_of(z);
    const pack whole = {z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7], z[8], quantities, lags,
                        z[9], z[10], z[11], address, stride, straight, inverse, inverse_here,
                        per_second, share, connection, first, member, contact, link,
                        tolerance, same_soc}, *p = &whole;
    const int64_t memory = lags + z[6], cells = z[0], root = cells + z[1] - 1, hold = z[12];
    double *at = work;
    double **rows[20];
    states here, *s = &here;
    int64_t heights[20], k = 0;
#define TAKE(name, height) rows[k] = &s->name, heights[k++] = (height)
    TAKE(soc, 1); TAKE(memory, memory); TAKE(before, quantities);
    TAKE(now, quantities); TAKE(left, 1); TAKE(base, quantities); TAKE(rise, quantities);
    TAKE(gain, lags); TAKE(after, lags); TAKE(next, memory); TAKE(guess, 1); TAKE(place, 1);
    TAKE(soc_next, 1); TAKE(volt, 1); TAKE(slope, 1); TAKE(held, 1); TAKE(zr, z[4]);
    for (int64_t i = 0; i < k; i++) {
        *rows[i] = at;
        at += heights[i] * cells;
    }
    s->source = at;
    s->resistance = s->source + root + 1;
    s->current = s->resistance + root + 1;
    s->through = s->current + root + 1;
    s->onward = s->through + root + 1;
    s->conductance = s->onward + 3 * first[z[1]];
    double *const kept[3] = {s->soc, s->memory, s->before};
    memcpy(s->current, flow, (size_t)cells * sizeof(double));
    memcpy(s->now, s->before, (size_t)(quantities * cells) * sizeof(double));
    for (int64_t c = 0; c < cells; c++)
        enter(p, s, c, place_on_grid(s->soc[c], p->points).below);
    double weighed = -1.0;
    int64_t row = 0, outcome = SOLVED;
    for (int64_t i = 0; i < n && outcome == SOLVED; i++) {
        double left = step[i];
        /* With zero order the total so far flows through the step, and changes at its end. */
        for (int64_t part = hold || left == 0.0; part < 2 && outcome == SOLVED; part++) {
            const int64_t asks = part ? (int64_t)mode[i] : CURRENT;
            const double goal = part ? value[i] : total;
            const double rise = asks == CURRENT ? goal - total : 0.0;
            if (left > 0.0 && (left != weighed || p->moving))
                weigh(p, s, weighed = left, hold);
            outcome = advance(p, s, left, hold ? rise : 0.0, rise, asks, goal, fault + 1);
            total = s->current[root];
            left = 0.0;
        }
        if (outcome != SOLVED) {
            fault[0] = (double)outcome;
            n = i;
            break;
        }
        totals[i] = total;
        volt[i] = s->source[z[15]] + s->resistance[z[15]] * s->current[z[15]];
        const int64_t keeps = z[13] && i % z[13] == 0;
        double *volts = keeps ? cell_volt + row * cells : s->volt;
        for (int64_t c = 0; (keeps || z[14]) && c < cells; c++)
            volts[c] = s->source[c] + s->resistance[c] * s->current[c];
        if (z[14])
            extremes(p, s, volts, out + 8 * i);
        if (keeps) {
            memcpy(current + row * cells, s->current, (size_t)cells * sizeof(double));
            memcpy(soc + row * cells, s->soc, (size_t)cells * sizeof(double));
            row++;
        }
    }
    memcpy(flow, s->current, (size_t)cells * sizeof(double));
    /* What was swapped step by step goes to where it is looked for. */
    if (s->soc != kept[0])
        memcpy(kept[0], s->soc, (size_t)cells * sizeof(double));
    if (s->memory != kept[1])
        memcpy(kept[1], s->memory, (size_t)(memory * cells) * sizeof(double));
    if (s->before != kept[2])
        memcpy(kept[2], s->before, (size_t)(quantities * cells) * sizeof(double));
    return outcome == SOLVED ? -1 : n;
}
