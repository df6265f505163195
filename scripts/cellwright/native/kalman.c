/* Extended Kalman filter over a record: see filters/kalman.py, whose numpy twin says the same.
 *
 * `pass` is inlined once per common number of states in doubt, so that the compiler unrolls the
 * loops over the covariance; any other number takes the last copy. Only states in doubt have a
 * covariance: a lag that starts from rest is known for all time. */
#include <stdint.h>
#include <string.h>

#include "cell.h"

#if defined(__GNUC__) && !defined(__clang__)
/* Two doubles written apart and read back as one vector wait for the store: a third of the time. */
#pragma GCC optimize("no-tree-slp-vectorize", "no-tree-vectorize")
#endif

#define MOST 32
/* A place that a call gives back through memory is waited for, and so is what is copied as a whole
 * right after its parts were written. */
enum { OCV, TOTAL, SLOPE, ERROR, GAIN };

typedef struct {
    int64_t n, m, width, elements, lags, size, error, fast, standing, capacity, ohmic, first_order,
        adaptive, window, nodes, considered;
} sizes_t;

typedef struct {
    double first, spacing, ampere_hour, white, slow, second, least_walk, most_walk, ohmic_walk,
        half, walk, error_variance, span, linear, brief, fast, wide, per_spacing;
} reals_t;

typedef struct {
    const int64_t *shifts, *source, *by_charge, *element, *moves;
    const double *step, *charge, *passed, *current, *between, *voltage, *edge, *tables, *direct, *share,
        *drives;
} plant_t;

typedef struct {
    const double *low, *high;
    double part;
    int64_t cell;
} place_t;

/* fmax and fmin are calls, before which every register has to be saved. */
INLINE double larger(double a, double b) { return a > b ? a : b; }
INLINE double smaller(double a, double b) { return a < b ? a : b; }

INLINE place_t place(const sizes_t *s, const reals_t *r, const double *tables, double soc) {
    const double spot = (soc - r->first) * r->per_spacing;
    const int64_t i = point_below(spot, s->m);
    const double *row = tables + i * s->width;
    return (place_t){row, row + s->width, spot - (double)i, i};
}

INLINE double look(place_t at, int64_t column) {
    return at.low[column] + at.part * (at.high[column] - at.low[column]);
}

INLINE double drive(
    const sizes_t *s, const plant_t *p, int64_t e, int64_t k, double soc, place_t at) {
    if (p->source[e] < 0) {
        const double current = p->by_charge[e] ? p->between[k] : p->current[k];
        return current * look(at, GAIN + e);
    }
    const double cells = (double)(s->nodes - 1);
    const double spot = (soc > 0.0 ? (soc < 1.0 ? soc : 1.0) : 0.0) * cells;
    const int64_t i = point_below(spot, s->nodes);
    const double *course = p->drives + (p->source[e] * s->nodes + i) * s->n + k;
    return course[0] + (spot - (double)i) * (course[s->n] - course[0]);
}

/* Slope of the OCV over what is not known of the SoC, and what a chord misses in its middle. */
static double chord(const sizes_t *s, const reals_t *r, const double *tables, double soc,
                    double reach, double *curvature) {
    const double low = larger(soc - reach, smaller(soc, 0.0)), high = smaller(soc + reach, larger(soc, 1.0));
    const double a = look(place(s, r, tables, low), TOTAL);
    const double b = look(place(s, r, tables, (low + high) / 2.0), TOTAL);
    const double c = look(place(s, r, tables, high), TOTAL);
    *curvature = b - (a + c) / 2.0;
    return (c - a) / (high - low);
}

/* What a step's length decides, kept for the lengths that a record has: instruments that sample at
 * one rate have some hundred of them, and exponentials are most of what a lag costs. */
#define KEPT 256
typedef struct {
    double step, per_step, keep, kept, decay[MOST], before[MOST], after[MOST];
    int64_t cells[MOST];
} weights_t;

static inline weights_t *weights_of(weights_t *all, double step) {
    uint64_t bits;
    memcpy(&bits, &step, sizeof bits);
    return all + ((bits * 0x9E3779B97F4A7C15u) >> 56);
}

/* Index of each row of the covariance: the SoC, the lags in doubt, then what is tracked beside. */
typedef struct {
    int64_t many, error, fast, standing, capacity, ohmic;
} rows_t;

INLINE void pass(
    const int plain, const int64_t many, const int64_t unsure, const int64_t lags,
    const int64_t elements, const int64_t error, const int64_t fast, const int64_t standing,
    const int64_t capacity, const int64_t ohmic, const int64_t *doubted, const sizes_t *s,
    const reals_t *r, const plant_t *p, int64_t filled, double *ring, const double *start,
    double *out) {
    /* x, P, u, K, C and relaxed by rows of the covariance; y: all lags, those in doubt as well */
    double x[MOST], y[MOST], P[MOST][MOST] = {{0}}, u[MOST], K[MOST] = {0}, C[MOST] = {0};
    double relaxed[MOST], volt_share[MOST], soc_share[MOST];
    weights_t all[KEPT];
    for (int64_t w = 0; w < KEPT; w++) all[w].step = -1.0;
    int shifted = 0;
    for (int64_t j = 0; j < lags; j++) {
        const int64_t shifts = p->shifts[p->element[j]];
        y[j] = start[1 + j];
        volt_share[j] = shifts ? 0.0 : p->share[j];
        soc_share[j] = shifts ? p->share[j] : 0.0;
        shifted = shifted || shifts;
    }
    for (int64_t e = 0; e < elements; e++)
        shifted = shifted || (p->shifts[e] && p->direct[e] != 0.0);
#define STATE(a) ((a) == 0 ? 0 : (a) <= unsure ? 1 + doubted[(a) - 1] : (a) - unsure + lags)
    for (int64_t a = 0; a < many; a++) {
        x[a] = start[STATE(a)];
        relaxed[a] = 1.0;
        for (int64_t b = 0; b < many; b++) P[a][b] = start[s->size + STATE(a) * s->size + STATE(b)];
    }
#undef STATE
    /* Of the squared innovations the last one stays apart: all else of what the next step weighs is
     * known before it, and only a sum is left to wait for. */
    double square_sum = 0.0, last_square = 0.0, known_sum = 0.0, own_sum = 0.0, walk = r->walk, slow = r->error_variance;
    for (int64_t i = 0; i < filled; i++) {
        square_sum += ring[3 * i];
        known_sum += ring[3 * i + 1];
        own_sum += ring[3 * i + 2];
    }
    int64_t spot = filled % s->window;
    double linear = r->linear, surface = 0.0, wide = r->wide;
    const double per_ampere_hour = 1.0 / r->ampere_hour, per_window = 1.0 / (double)s->window;
    const double half_squared = r->half * r->half;

    for (int64_t k = 1; k < s->n; k++) {
        /* predict: the SoC */
        const double step = p->step[k], charge = p->charge[k] * per_ampere_hour, earlier = x[0];
        weights_t *const w = weights_of(all, step);
        if (w->step != step) {
            w->step = step;
            w->per_step = 1.0 / step;
            w->keep = error >= 0 ? exp(-step / r->second) : 1.0;
            w->kept = fast >= 0 ? exp(-step / r->brief) : 1.0;
            for (int64_t j = 0; j < lags; j++) w->cells[j] = -1;
        }
        const double keep = w->keep, kept = w->kept;
        if (capacity >= 0) {
            x[0] += charge * x[capacity];
            const double own = P[capacity][capacity], shared = P[0][capacity];
            for (int64_t a = 1; a < many; a++) {
                P[0][a] += charge * P[capacity][a];
                P[a][0] = P[0][a];
            }
            P[0][0] += charge * (2.0 * shared + charge * own);
        } else {
            x[0] += charge;
        }
        P[0][0] += walk * step;
        const double soc = x[0];
        const place_t at = place(s, r, p->tables, soc);
        /* where the Jacobian is taken follows the charge, and a correction only slowly */
        place_t there = at;
        if (error >= 0) {
            linear += soc - earlier;
            linear += (1.0 - keep) * (soc - linear);
            wide += (1.0 - keep) * (P[0][0] - wide);
            const double reach = 3.0 * wide > half_squared ? sqrt(3.0 * wide) : r->half;
            linear = larger(smaller(linear, soc + reach), soc - reach);
            there = place(s, r, p->tables, linear);
        } else {
            linear = soc;
            wide = P[0][0];
        }
        /* the drive of each element at this sample, and at the one before, at the SoC of now */
        double value[MOST], was[MOST];
        if (plain) {
            value[0] = p->current[k] * look(at, GAIN);
        } else {
            for (int64_t e = 0; e < elements; e++) {
                value[e] = drive(s, p, e, k, soc, at);
                was[e] = p->by_charge[e] ? 0.0 : drive(s, p, e, k - 1, soc, at);
            }
        }

        /* predict: the lags, by weights that are made anew where step or constant are new */
        for (int64_t j = 0; j < lags; j++) {
            const int64_t e = p->element[j], charged = !plain && p->by_charge[e];
            int64_t cell = 0;
            if (!plain && p->moves[j]) cell = place(s, r, p->tables, soc + r->spacing / 2.0).cell;
            if (charged || cell != w->cells[j]) {
                const double constant = p->tables[cell * s->width + GAIN + elements + j];
                lag_weights((charged ? p->passed[k] : step) / constant, s->first_order && !charged,
                            &w->decay[j], &w->before[j], &w->after[j]);
                if (charged) {
                    /* The drive is that of the step's own charge: all of it counts as its end. */
                    w->after[j] = w->before[j];
                    w->before[j] = 0.0;
                }
                w->cells[j] = cell;
            }
            if (plain) {
                const double push = w->before[j] * p->current[k - 1] + w->after[j] * p->current[k];
                y[j] = w->decay[j] * y[j] + look(at, GAIN + e) * push;
            } else {
                y[j] = w->decay[j] * y[j] + (w->before[j] * was[e] + w->after[j] * value[e]);
            }
        }
        for (int64_t a = 1; a <= unsure; a++) relaxed[a] = w->decay[plain ? a - 1 : doubted[a - 1]];
        if (error >= 0) {
            x[error] *= keep;
            relaxed[error] = keep;
        }
        if (fast >= 0) {
            x[fast] *= kept;
            relaxed[fast] = kept;
        }
        if (standing >= 0) {
            const double held = exp(-p->passed[k] * per_ampere_hour / r->span);
            x[standing] *= held;
            relaxed[standing] = held;
        }
        for (int64_t a = 1; a < many; a++) {
            P[0][a] *= relaxed[a];
            for (int64_t b = a; b < many; b++) P[a][b] *= relaxed[a] * relaxed[b];
        }
        if (error >= 0) P[error][error] += (1.0 - keep * keep) * slow;
        if (fast >= 0) P[fast][fast] += (1.0 - kept * kept) * r->fast;
        if (standing >= 0) P[standing][standing] += 1.0 - relaxed[standing] * relaxed[standing];
        if (ohmic >= 0) P[ohmic][ohmic] += r->ohmic_walk * step;
        for (int64_t a = 0; a < many; a++)
            for (int64_t b = 0; b < a; b++) P[a][b] = P[b][a];

        /* predicted voltage and its Jacobian */
        double curvature = 0.0, direct = 0.0, offset = 0.0, over = 0.0;
        if (plain) {
            direct = ohmic >= 0 ? x[ohmic] * value[0] : value[0];
            over = y[0];
            for (int64_t j = 1; j < lags; j++) over += y[j];
            for (int64_t j = 1; j <= lags; j++) C[j] = 1.0;
        } else {
            for (int64_t e = 0; e < elements; e++) {
                if (p->direct[e] == 0.0) continue;
                const double scale = p->direct[e] * (e == 0 && ohmic >= 0 ? x[ohmic] : 1.0);
                offset += p->shifts[e] ? scale * value[e] : 0.0;
                direct += p->shifts[e] ? 0.0 : scale * value[e];
            }
            for (int64_t j = 0; j < lags; j++) over += volt_share[j] * y[j];
            if (shifted) {
                for (int64_t j = 0; j < lags; j++) offset += soc_share[j] * y[j];
                surface = error >= 0 ? surface + (1.0 - keep) * (offset - surface) : offset;
                if (surface != 0.0) there = place(s, r, p->tables, linear + surface);
            }
        }
        /* the voltage is that of the surface, and so is its slope, but not at every turn of the load */
        double slope = look(there, SLOPE);
        if (3.0 * wide > half_squared)
            slope = chord(s, r, p->tables, linear + surface, sqrt(3.0 * wide), &curvature);
        C[0] = slope;
        if (!plain)
            for (int64_t a = 1; a <= unsure; a++) {
                const int64_t j = doubted[a - 1];
                C[a] = volt_share[j] + soc_share[j] * slope;
            }
        double volt = (look(at, TOTAL) + direct) + over;
        if (!plain && offset != 0.0)
            volt += look(place(s, r, p->tables, soc + offset), OCV) - look(at, OCV);
        if (error >= 0) {
            volt += x[error];
            C[error] = 1.0;
        }
        if (fast >= 0) {
            volt += x[fast];
            C[fast] = 1.0;
        }
        const double stated = look(there, ERROR);
        if (standing >= 0) {
            volt += stated * x[standing];
            C[standing] = stated;
        }
        if (capacity >= 0) C[capacity] = 0.0;
        if (ohmic >= 0) C[ohmic] = (plain ? 1.0 : p->direct[0]) * value[0];

        /* what is seen, and the noise that it speaks for */
        const double e = p->voltage[k] - volt;
        /* u = P·Cᵀ; C·P·Cᵀ from P itself, so that neither waits for the other */
        double inner = 0.0, cross = 0.0;
        for (int64_t a = 1; a < many; a++) cross += P[0][a] * C[a];
        for (int64_t a = 1; a < many; a++) {
            double sum = P[a][1] * C[1];
            for (int64_t b = 2; b < many; b++) sum += P[a][b] * C[b];
            u[a] = P[a][0] * C[0] + sum;
            inner += sum * C[a];
        }
        u[0] = P[0][0] * C[0] + cross;
        const double known = C[0] * (u[0] + cross) + inner;
        double floor = r->white, white, own = 0.0;
        const double least = (standing >= 0 ? 0.0 : stated * stated) + r->slow;
        if (error >= 0) {
            const double unaided = e + x[error];
            own = unaided * unaided - (known - 2.0 * u[error] + P[error][error]) - p->edge[k];
        } else {
            floor += least;
        }
        white = floor;
        slow = least;
        const double empty = (double)(s->window - filled);
        if (s->adaptive) {
            const double before = square_sum - known_sum + empty * floor;
            white = larger(floor, (before + last_square) * per_window);
            if (error >= 0)
                slow = larger(least, (own_sum + empty * (least + white)) * per_window - white);
        }
        const double variance = white + (known + (curvature * curvature + p->edge[k]));
        /* Q = K·H·Kᵀ without its two divisions by the variance, for which the next step would wait */
        const double mean_square = (square_sum + last_square + empty * variance) * per_window;
        const double learnt = u[0] * u[0] * mean_square * w->per_step;
        const double inverse = 1.0 / variance;

        /* update, in Joseph's form with its products taken apart, P − K·uᵀ − u·Kᵀ + K·S·Kᵀ: an error
         * of the gain enters squared */
        for (int64_t a = 0; a < many; a++) K[a] = u[a] * inverse;
        if (s->considered && capacity >= 0) K[capacity] = 0.0;
        for (int64_t a = 0; a < many; a++) {
            const double left = u[a] - K[a] * variance;
            if (a == 0 || a > unsure) x[a] += K[a] * e;
            else y[plain ? a - 1 : doubted[a - 1]] += K[a] * e;
            for (int64_t b = a; b < many; b++)
                P[a][b] = P[b][a] = (P[a][b] - K[a] * u[b]) - left * K[b];
        }
        if (s->adaptive && step > 0.0)
            walk = smaller(larger(learnt * (inverse * inverse), r->least_walk), r->most_walk);
        if (s->adaptive) {
            double *slot = ring + 3 * spot;
            const double square = e * e, seen = known + p->edge[k];
            square_sum = square_sum + last_square - slot[0];
            last_square = square;
            known_sum += seen - slot[1];
            own_sum += own - slot[2];
            slot[0] = square;
            slot[1] = seen;
            slot[2] = own;
            filled += filled < s->window;
            spot = spot + 1 == s->window ? 0 : spot + 1;
        }
        double *row = out + 8 * k;
        row[0] = x[0];
        row[1] = P[0][0];
        row[2] = e;
        row[3] = variance;
        row[4] = capacity >= 0 ? x[capacity] : 1.0;
        row[5] = capacity >= 0 ? P[capacity][capacity] : 0.0;
        row[6] = ohmic >= 0 ? x[ohmic] : 1.0;
        row[7] = ohmic >= 0 ? P[ohmic][ohmic] : 0.0;
    }
}

void kalman(const int64_t *sizes, const int64_t *shifts, const int64_t *source,
            const int64_t *by_charge, const int64_t *element, const int64_t *moves,
            const int64_t *filled, const double *reals, const double *step, const double *charge,
            const double *passed, const double *current, const double *between,
            const double *voltage, const double *edge, const double *tables, const double *direct,
            const double *share, const double *drives, double *ring, const double *start, double *out) {
    sizes_t s;
    reals_t r;
    memcpy(&s, sizes, sizeof s);
    memcpy(&r, reals, sizeof r - sizeof r.per_spacing);
    const plant_t p = {shifts,  source,  by_charge, element, moves,  step,  charge, passed,
                       current, between, voltage,   edge,    tables, direct, share, drives};
    r.per_spacing = 1.0 / r.spacing;
    /* plain: a resistor and RC pairs whose time constants stay: nothing else to ask for each step */
    int plain = s.capacity < 0 && s.elements == s.lags + 1 && direct[0] == 1.0;
    for (int64_t e = 0; e < s.elements; e++)
        plain = plain && source[e] < 0 && !by_charge[e] && !shifts[e] && (e == 0 || direct[e] == 0.0);
    for (int64_t j = 0; j < s.lags; j++)
        plain = plain && !moves[j] && element[j] == j + 1 && share[j] == 1.0;
    int64_t doubted[MOST], unsure = 0;
    for (int64_t j = 0; j < s.lags; j++)
        if (plain || start[s.size + (1 + j) * (s.size + 1)] > 0.0) doubted[unsure++] = j;
    /* a state that is tracked stands as far behind the last lag as its row behind the last in doubt */
#define ROW(state) ((state) < 0 ? -1 : (state) - s.lags + unsure)
    const rows_t rows = {s.size - s.lags + unsure, ROW(s.error), ROW(s.fast), ROW(s.standing),
                         ROW(s.capacity), ROW(s.ohmic)};
#undef ROW
#define COPY(plain_, many_, unsure_, lags_, elements_, error_, fast_, standing_, capacity_, ohmic_) \
    if (plain == (plain_) && rows.many == (many_) && unsure == (unsure_) &&                        \
        rows.error == (error_) && rows.fast == (fast_) && rows.standing == (standing_) &&          \
        rows.capacity == (capacity_) && rows.ohmic == (ohmic_)) {                                  \
        pass(plain_, many_, unsure_, lags_, elements_, error_, fast_, standing_, capacity_,        \
             ohmic_, doubted, &s, &r, &p, *filled, ring, start, out);                              \
        return;                                                                                    \
    }
    COPY(1, 2, 1, 1, 2, -1, -1, -1, -1, -1)
    COPY(1, 3, 2, 2, 3, -1, -1, -1, -1, -1)
    COPY(1, 6, 1, 1, 2, 2, 3, 4, -1, 5)
    COPY(1, 7, 2, 2, 3, 3, 4, 5, -1, 6)
    COPY(0, 5, 0, s.lags, s.elements, 1, 2, 3, -1, 4)
    COPY(0, 6, 0, s.lags, s.elements, 1, 2, 3, 4, 5)
    COPY(0, 6, 1, s.lags, s.elements, 2, 3, 4, -1, 5)
    COPY(0, 7, 1, s.lags, s.elements, 2, 3, 4, 5, 6)
#undef COPY
    pass(0, rows.many, unsure, s.lags, s.elements, rows.error, rows.fast, rows.standing,
         rows.capacity, rows.ohmic, doubted, &s, &r, &p, *filled, ring, start, out);
}
