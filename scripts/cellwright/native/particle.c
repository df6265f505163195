/* One particle with charge transfer at its surface, and its derivatives by all of its parameters,
 * carried forward row by row: see circuits/particle.py, whose twin says the same.
 *
 * Derivatives lie as the parameters do: start of the SoC, logarithm of the flux, ln rate at each
 * knot, its energy (these move the particle), then ln resistance at each knot, its energy and the
 * bend of that, ln capacitance, its energy, ln scale of the kinetics. Linear lags of the current have
 * ln time constant and its energy, two of each. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "cell.h"

#define MOST_SHELLS 32
#define MOST_PARAMETERS 64
#define MOST_LAGS 4
#define GAS_CONSTANT 8.314462618
#define FARADAY 96485.33212
#define ZERO_CELSIUS 273.15
#define NEARLY_NONE 1e-3 /* below which a series serves */
#define TRANSFER_PARTS 3
#define STAGE 0.29289321881345254 /* of a step of the diffusion: 1 - 1/sqrt(2) */

typedef double derivatives[MOST_PARAMETERS];

/* What a step needs to know of a particle; its numbers lie as circuits/particle.py lays them out. */
typedef struct {
    int64_t shells, lags, stops, near_empty, ohmic, relaxing, open, entropic, turning, points;
    const double *volume, *conductance; /* (shells,) */
    const double *per_turn; /* (stops,) of the hysteresis: how far the whole capacity moves each */
    double to_surface, longest, reference, bend_reference;
    const double *knots, *vector, *ocv;
} particle_of;

/* A course over SoC, linear between knots and flat beyond: the knot below, the share of the way to
 * the next one, the value and its slope. */
typedef struct {
    int64_t below;
    double share, value, slope;
} course;

INLINE course course_at(const double *values, const double *knots, int64_t count, double soc) {
    if (!(soc > knots[0])) return (course){0, 0.0, values[0], 0.0};
    if (soc >= knots[count - 1]) return (course){count - 2, 1.0, values[count - 1], 0.0};
    int64_t m = 0;
    while (soc >= knots[m + 1]) m++;
    const double share = (soc - knots[m]) / (knots[m + 1] - knots[m]);
    return (course){m, share, values[m] * (1.0 - share) + values[m + 1] * share,
                    (values[m + 1] - values[m]) / (knots[m + 1] - knots[m])};
}

/* A lag of the current at the end of a step in units of its time constant, exact for a current that
 * moves on a straight line: what is left of the begin, the state, its derivative by the ratio. */
typedef struct {
    double decay, state, by_ratio;
} lag_end;

INLINE lag_end lag_ended(double ratio, double begin, double first, double now) {
    double decay, before, after;
    lag_weights(ratio, 1, &decay, &before, &after);
    const double by_after = ratio < NEARLY_NONE
                                ? 0.5 - ratio / 3.0 + ratio * ratio / 8.0
                                : (1.0 - decay - ratio * decay) / (ratio * ratio);
    return (lag_end){decay, decay * begin + before * first + after * now,
                     (first - begin) * decay + (now - first) * by_after};
}

/* Overvoltage of charge transfer at the end of a step, what is left of that at its begin, and
 * derivatives by ln resistance at begin and end, ln capacitance, ln scale. */
typedef struct {
    double volt, decay, by_begin, by_end, by_log_farad, by_log_scale;
} transfer_end;

/* exp(u/s) under a constant current follows a Riccati equation, solved as it stands: in each part of
 * a step the current is the one by which a lag would end as on the straight line. */
INLINE transfer_end transferred(double begin, double second, double first, double now,
                                double log_begin, double log_end, double farad, double scale) {
    const double h = second / TRANSFER_PARTS, step = (now - first) / TRANSFER_PARTS;
    const double grow = exp((log_end - log_begin) / (2.0 * TRANSFER_PARTS));
    double ohm = exp(log_begin) * grow, y = exp(begin / scale);
    transfer_end end = {0.0, 1.0, 0.0, 0.0, 0.0, -begin / scale};
    for (int64_t part = 0; part < TRANSFER_PARTS; part++, ohm *= grow * grow) {
        const double later = first + step * (double)(part + 1), b = ohm * later / scale;
        const double base = h / (ohm * farad), quick = 1.0 + b * b, ratio = base * sqrt(quick);
        const double gained = -expm1(-ratio);
        double share = 0.5 + ratio / 12.0, by_share = 1.0 / 12.0;
        if (ratio > NEARLY_NONE) {
            share = 1.0 / gained - 1.0 / ratio;
            by_share = 1.0 / (ratio * ratio) - (1.0 - gained) / (gained * gained);
        }
        const double a = ohm * (later + step * (share - 1.0)) / scale, size = fabs(a);
        const double q = sqrt(1.0 + a * a), passed = -expm1(-q * base);
        const double t = passed / (2.0 - passed), rest = 2.0 * (1.0 - passed) / (2.0 - passed);
        const double g = t / q, large = 1.0 + size * g;
        const double small = (1.0 / (q + size) + rest * size) / q; /* 1 - size g, of no difference */
        const double up = (a < 0.0 ? small : large) + g / y, down = (a < 0.0 ? large : small) + g * y;
        const double flat = rest * (2.0 - rest), decay = flat / (up * down);
        const double far = a - 0.5 * (y - 1.0 / y); /* from where it would settle */
        const double of_g = a / (q * q) * (0.5 * flat * base - g);
        const double own = (t / q + a * a * 0.5 * base * flat) / (q * q);
        const double by_a = (own + of_g / y) / up + (own - of_g * y) / down;
        const double by_base = decay * far * base, by_turn = by_a * ohm / scale * step * by_share;
        const double by_log_ohm = a * by_a - by_base - by_turn * ratio / quick;
        const double at = (2.0 * (double)part + 1.0) / (2.0 * TRANSFER_PARTS);
        y *= up / down;
        end.decay *= decay;
        end.by_begin = decay * end.by_begin + (1.0 - at) * by_log_ohm;
        end.by_end = decay * end.by_end + at * by_log_ohm;
        end.by_log_farad = decay * end.by_log_farad - by_base - by_turn * ratio;
        end.by_log_scale = decay * end.by_log_scale - a * by_a - by_turn * ratio * b * b / quick;
    }
    end.volt = scale * log(y);
    end.by_log_scale = end.volt + scale * end.by_log_scale;
    end.by_begin *= scale;
    end.by_end *= scale;
    end.by_log_farad *= scale;
    return end;
}

/* SoC of the shells (shells,) after an implicit step of second order, and its derivatives. `before`:
 * the SoC a step ago, then the length of that step; the rates are those half a step ahead. */
INLINE void diffused(const particle_of *p, double second, double flow, double warmth, double *z,
                     double *before, int64_t moving, derivatives *z_by, derivatives *before_by) {
    const int64_t shells = p->shells, last = shells - 1, rates = p->near_empty;
    const double ahead = before[shells] > 0.0 ? 0.5 * fmin(second / before[shells], 1.0) : 0.0;
    double rate[MOST_SHELLS], passed[MOST_SHELLS], weight[MOST_SHELLS], middle[MOST_SHELLS];
    double factor[MOST_SHELLS], inverse[MOST_SHELLS];
    derivatives rate_by[MOST_SHELLS], passed_by[MOST_SHELLS];
    for (int64_t i = 0; i < shells; i++) {
        const double soc = z[i] + ahead * (z[i] - before[i]);
        const course at = course_at(p->vector, p->knots, rates, soc);
        rate[i] = exp(at.value - p->vector[rates] * warmth / GAS_CONSTANT);
        for (int64_t k = 0; k < moving; k++) {
            const double soc_by = z_by[i][k] + ahead * (z_by[i][k] - before_by[i][k]);
            rate_by[i][k] = rate[i] * at.slope * soc_by;
            before_by[i][k] = z_by[i][k];
        }
        if (moving) {
            rate_by[i][2 + at.below] += rate[i] * (1.0 - at.share);
            rate_by[i][3 + at.below] += rate[i] * at.share;
            rate_by[i][2 + rates] -= rate[i] * warmth / GAS_CONSTANT;
        }
        before[i] = z[i];
        middle[i] = weight[i] = p->volume[i] / (STAGE * second);
    }
    before[shells] = second;
    for (int64_t i = 0; i < last; i++) {
        const double sum = rate[i] + rate[i + 1], twice = 2.0 * p->conductance[i] / sum;
        const double inner = twice * rate[i + 1] * rate[i + 1] / sum;
        const double outer = twice * rate[i] * rate[i] / sum;
        passed[i] = twice * rate[i] * rate[i + 1];
        for (int64_t k = 0; k < moving; k++)
            passed_by[i][k] = inner * rate_by[i][k] + outer * rate_by[i + 1][k];
        middle[i] += passed[i];
        middle[i + 1] += passed[i];
    }
    for (int64_t i = 0; i < shells; i++) {
        inverse[i] = 1.0 / middle[i];
        if (i == last) break;
        factor[i] = passed[i] * inverse[i];
        middle[i + 1] -= factor[i] * passed[i];
    }
    for (int64_t stage = 0; stage < 2; stage++) {
        for (int64_t i = 0; i < shells; i++) {
            const double kept = stage ? -sqrt(2.0) * weight[i] : 0.0, now = weight[i] - kept;
            z[i] = now * z[i] + kept * before[i];
            for (int64_t k = 0; k < moving; k++)
                z_by[i][k] = now * z_by[i][k] + kept * before_by[i][k];
        }
        z[last] += flow;
        for (int64_t i = 0; i < last; i++) z[i + 1] += factor[i] * z[i];
        z[last] *= inverse[last];
        for (int64_t i = last - 1; i >= 0; i--) z[i] = z[i] * inverse[i] + factor[i] * z[i + 1];
        if (!moving) continue;
        for (int64_t i = 0; i < last; i++) {
            const double rise = z[i + 1] - z[i];
            for (int64_t k = 0; k < moving; k++) {
                const double change = rise * passed_by[i][k];
                z_by[i][k] += change;
                z_by[i + 1][k] += factor[i] * z_by[i][k] - change;
            }
        }
        z_by[last][1] += flow;
        for (int64_t k = 0; k < moving; k++) z_by[last][k] *= inverse[last];
        for (int64_t i = last - 1; i >= 0; i--)
            for (int64_t k = 0; k < moving; k++)
                z_by[i][k] = z_by[i][k] * inverse[i] + factor[i] * z_by[i + 1][k];
    }
}

/* SoC of the surface under a flow into it, and its derivatives. */
INLINE double surface_under(const particle_of *p, double flow, double warmth, const double *z,
                            int64_t moving, derivatives *z_by, double *by) {
    const int64_t last = p->shells - 1, rates = p->near_empty;
    const course at = course_at(p->vector, p->knots, rates, z[last]);
    const double rate = exp(at.value - p->vector[rates] * warmth / GAS_CONSTANT);
    const double lead = flow / rate * p->to_surface;
    for (int64_t k = 0; k < moving; k++) by[k] = (1.0 - lead * at.slope) * z_by[last][k];
    if (moving) {
        by[1] += lead;
        by[2 + at.below] -= lead * (1.0 - at.share);
        by[3 + at.below] -= lead * at.share;
        by[2 + rates] += lead * warmth / GAS_CONSTANT;
    }
    return z[last] + lead;
}

void particle(int64_t rows, const double *step, const double *current, const double *counted,
               const double *celsius, int64_t shells, const double *volume,
              const double *conductance, double to_surface, double longest, double reference,
              double bend_reference, int64_t rates, const double *knots, const double *at,
              int64_t lags, const double *lag_at, int64_t wanted, double *surface, double *over,
              double *lagged, double *surface_by, double *over_by, double *lagged_by) {
    const particle_of p = {.shells = shells, .near_empty = rates, .volume = volume,
                           .conductance = conductance, .to_surface = to_surface, .knots = knots,
                           .vector = at + 2};
    const double *ln_transfer = p.vector + rates + 1, flux = at[1];
    const double *kinetics = ln_transfer + rates; /* energy, bend, ln C, energy, ln scale */
    const int64_t moving = wanted ? rates + 3 : 0, all = wanted ? moving + rates + 5 : 0;
    double z[MOST_SHELLS], before[MOST_SHELLS + 1] = {0.0};
    derivatives z_by[MOST_SHELLS] = {{0.0}}, before_by[MOST_SHELLS] = {{0.0}};
    derivatives u_by = {0.0}, log_by = {0.0}, log_before_by, soc_by;
    double w[MOST_LAGS] = {0.0}, w_by[MOST_LAGS][2] = {{0.0}};
    double u = 0.0, log_ohm = 0.0;

    for (int64_t i = 0; i < shells; i++) {
        z[i] = at[0];
        z_by[i][0] = 1.0;
    }
    for (int64_t k = 0; k < rows; k++) {
        const double kelvin = celsius[k] + ZERO_CELSIUS, warmth = 1.0 / kelvin - 1.0 / reference;
        const double bent = warmth * warmth / bend_reference, now = current[k];
        const double whole = k ? step[k] : 0.0, first = k ? current[k - 1] : now;
        const double parts = ceil(whole / longest);
        for (double part = 0.0; part < parts; part += 1.0)
            diffused(&p, whole / parts, counted[k] * flux, warmth, z, before, moving, z_by,
                     before_by);
        surface[k] = surface_under(&p, now * flux, warmth, z, moving, z_by, soc_by);
        const course c = course_at(ln_transfer, knots, rates, surface[k]);
        const double log_before = log_ohm;
        log_ohm = c.value + (kinetics[0] * warmth + kinetics[1] * bent) / GAS_CONSTANT;
        memcpy(log_before_by, log_by, sizeof log_by);
        for (int64_t i = 0; i < all; i++) log_by[i] = i < moving ? c.slope * soc_by[i] : 0.0;
        if (all) {
            double *own = log_by + moving;
            own[c.below] += 1.0 - c.share;
            own[c.below + 1] += c.share;
            own[rates] += warmth / GAS_CONSTANT;
            own[rates + 1] += bent / GAS_CONSTANT;
        }
        if (whole > 0.0) {
            for (int64_t i = 0; i < lags; i++) {
                const double tau = exp(lag_at[2 * i] + lag_at[2 * i + 1] * warmth / GAS_CONSTANT);
                const double ratio = whole / tau;
                const lag_end end = lag_ended(ratio, w[i], first, now);
                const double by_log = -ratio * end.by_ratio;
                w_by[i][0] = end.decay * w_by[i][0] + by_log;
                w_by[i][1] = end.decay * w_by[i][1] + by_log * warmth / GAS_CONSTANT;
                w[i] = end.state;
            }
            const double farad = exp(kinetics[2] + kinetics[3] * warmth / GAS_CONSTANT);
            const double scale = exp(kinetics[4]) * GAS_CONSTANT * kelvin / FARADAY;
            const transfer_end end =
                transferred(u, whole, first, now, log_before, log_ohm, farad, scale);
            for (int64_t i = 0; i < all; i++)
                u_by[i] = end.decay * u_by[i] + end.by_begin * log_before_by[i] +
                          end.by_end * log_by[i];
            if (all) {
                double *own = u_by + moving + rates;
                own[2] += end.by_log_farad;
                own[3] += end.by_log_farad * warmth / GAS_CONSTANT;
                own[4] += end.by_log_scale;
            }
            u = end.volt;
        }
        over[k] = u;
        memcpy(lagged + k * lags, w, (size_t)lags * sizeof(double));
        if (wanted) {
            memcpy(surface_by + k * moving, soc_by, (size_t)moving * sizeof(double));
            memcpy(lagged_by + k * 2 * lags, w_by, (size_t)(2 * lags) * sizeof(double));
            memcpy(over_by + k * all, u_by, (size_t)all * sizeof(double));
        }
    }
}

/* ---- one step, from any state: what a functional mock-up unit takes ---- */

/* A particle of its sizes, sphere (volume and conductance of the shells, moves of the stops, way to
 * the surface, longest step, reference of temperatures and of bends), knots, numbers and OCV. */
INLINE particle_of particle_from(const int64_t *sizes, const double *sphere, const double *knots,
                                 const double *vector, const double *ocv) {
    const double *turns = sphere + 2 * sizes[0], *rest = turns + sizes[2];
    return (particle_of){sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5], sizes[6],
                         sizes[7], sizes[8], sizes[9], sphere, sphere + sizes[0], turns, rest[0],
                         rest[1], rest[2], rest[3], knots, vector, ocv};
}

/* Logarithm of a resistance over SoC, after which its energy and the bend of that lie. */
INLINE double log_ohm_at(const double *values, const double *knots, int64_t count, double soc,
                         double warmth, double bent) {
    const double energy = values[count] * warmth + values[count + 1] * bent;
    return course_at(values, knots, count, soc).value + energy / GAS_CONSTANT;
}

/* Where its ohmic resistance, its lags and the shift of its OCV lie among its numbers. */
INLINE const double *ohmic_of(const particle_of *p) { return p->vector + 2 * p->near_empty + 6; }
INLINE const double *lags_of(const particle_of *p) { return ohmic_of(p) + p->ohmic + 2; }
INLINE const double *shift_of(const particle_of *p) {
    return lags_of(p) + p->lags * (p->relaxing + 4);
}

/* Open-circuit voltage at a SoC, a temperature and a state of the hysteresis, -1 to 1. */
static double particle_ocv(const particle_of *p, double soc, double celsius, double direction) {
    const double *open = p->knots + p->near_empty + p->ohmic + p->relaxing, *shift = shift_of(p);
    const double *entropic = open + p->open, *entropy = shift + p->open;
    const double per_kelvin = course_at(entropy, entropic, p->entropic, soc).value;
    const double half_gap =
        course_at(entropy + p->entropic, entropic + p->entropic, p->turning, soc).value;
    double volt, slope;
    ocv_and_slope(p->ocv, p->points, soc, &volt, &slope);
    return volt + course_at(shift, open, p->open, soc).value + direction * half_gap +
           (celsius - (p->reference - ZERO_CELSIUS)) * per_kelvin;
}

/* Voltage of a state under a current; flux: flow into the surface under one ampere. State: SoC of the
 * shells, overvoltage of charge transfer [V], lags [A], stops of the hysteresis, SoC of the shells a
 * step ago and how long that was. */
static double particle_volt(const particle_of *p, double flux, double current, double celsius,
                            const double *state) {
    const double warmth = 1.0 / (celsius + ZERO_CELSIUS) - 1.0 / p->reference;
    const double bent = warmth * warmth / p->bend_reference;
    const double surface = surface_under(p, current * flux, warmth, state, 0, NULL, NULL);
    const double *knots = p->knots + p->near_empty, *lag = lags_of(p), *own = state + p->shells;
    double direction = 0.0;
    for (int64_t i = 0; i < p->stops; i++) direction += own[1 + p->lags + i] / (double)p->stops;
    double volt = particle_ocv(p, surface, celsius, direction) + own[0];
    volt += current * exp(log_ohm_at(ohmic_of(p), knots, p->ohmic, surface, warmth, bent));
    knots += p->ohmic;
    for (int64_t i = 0; i < p->lags; i++, lag += p->relaxing + 4)
        volt += own[1 + i] * exp(log_ohm_at(lag, knots, p->relaxing, surface, warmth, bent));
    return volt;
}

/* A step as `particle` takes it, of a current that is held; coulomb: charge of the capacity [A s]. */
static void particle_moved(const particle_of *p, double flux, double coulomb, double whole,
                           double current, double celsius, double *state) {
    const double kelvin = celsius + ZERO_CELSIUS, warmth = 1.0 / kelvin - 1.0 / p->reference;
    const double bent = warmth * warmth / p->bend_reference, flow = current * flux;
    const double *transfer = p->vector + p->near_empty + 1, *kinetics = transfer + p->near_empty;
    const double *lag = lags_of(p) + p->relaxing + 2;
    double *own = state + p->shells, *stops = own + 1 + p->lags, *before = stops + p->stops;
    const double parts = ceil(whole / p->longest);
    double log_ohm[2];
    for (int64_t end = 0; end < 2; end++) {
        for (double part = 0.0; end && part < parts; part += 1.0)
            diffused(p, whole / parts, flow, warmth, state, before, 0, NULL, NULL);
        const double surface = surface_under(p, flow, warmth, state, 0, NULL, NULL);
        log_ohm[end] = log_ohm_at(transfer, p->knots, p->near_empty, surface, warmth, bent);
    }
    const double farad = exp(kinetics[2] + kinetics[3] * warmth / GAS_CONSTANT);
    const double scale = exp(kinetics[4]) * GAS_CONSTANT * kelvin / FARADAY;
    own[0] = transferred(own[0], whole, current, current, log_ohm[0], log_ohm[1], farad, scale).volt;
    for (int64_t i = 0; i < p->lags; i++, lag += p->relaxing + 4) {
        const double ratio = whole / exp(lag[0] + lag[1] * warmth / GAS_CONSTANT);
        own[1 + i] = lag_ended(ratio, own[1 + i], current, current).state;
    }
    for (int64_t i = 0; i < p->stops; i++)
        stops[i] = fmin(fmax(stops[i] + p->per_turn[i] * current * whole / coulomb, -1.0), 1.0);
}
