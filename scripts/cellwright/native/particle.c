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
#define LARGEST 40.0 /* overvoltage in units of the scale, beyond which sinh is of no use */
#define ROUNDS 80
#define LEAST_STIFFNESS 0.2
#define NEARLY_NONE 1e-3 /* below which a series serves */

/* Interval of a value among knots and the share of the way on; flat beyond the ends. */
INLINE int64_t interval_of(const double *knots, int64_t count, double value, double *share,
                           int64_t *inside) {
    *inside = value > knots[0] && value < knots[count - 1];
    if (!(value > knots[0])) {
        *share = 0.0;
        return 0;
    }
    if (value >= knots[count - 1]) {
        *share = 1.0;
        return count - 2;
    }
    int64_t below = 0;
    while (value >= knots[below + 1]) below++;
    *share = (value - knots[below]) / (knots[below + 1] - knots[below]);
    return below;
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

/* x / sinh(x), the resistance of the kinetics over that at rest, and the derivative of its ln. */
INLINE double chord_of(double x, double *by_x) {
    const double size = fabs(x);
    if (size < NEARLY_NONE) {
        *by_x = -x / 3.0;
        return 1.0 - x * x / 6.0;
    }
    const double held = fmin(size, LARGEST), sinh_x = sinh(held);
    *by_x = (1.0 / held - cosh(held) / sinh_x) * (x < 0.0 ? -1.0 : 1.0);
    return held / sinh_x;
}

void particle(int64_t rows, const double *step, const double *current, const double *counted,
               const double *celsius, int64_t shells, const double *volume,
              const double *conductance, double to_surface, double longest, double reference,
              double bend_reference, int64_t rates, const double *rate_knots, int64_t transfers,
              const double *transfer_knots, const double *at, int64_t lags, const double *lag_at,
              int64_t wanted, double *surface, double *over, double *lagged, double *surface_by,
              double *over_by, double *lagged_by) {
    const double *ln_rate = at + 2, *ln_transfer = ln_rate + rates + 1;
    const double rate_energy = ln_rate[rates], flux = at[1];
    const double *kinetics = ln_transfer + transfers; /* energy, bend, ln C, energy, ln scale */
    const int64_t moving = wanted ? rates + 3 : 0, all = wanted ? moving + transfers + 5 : 0;
    double z[MOST_SHELLS], rate[MOST_SHELLS], below[MOST_SHELLS], middle[MOST_SHELLS];
    double above[MOST_SHELLS], right[MOST_SHELLS], factor[MOST_SHELLS];
    double z_by[MOST_SHELLS][MOST_PARAMETERS] = {{0.0}}, rate_by[MOST_SHELLS][MOST_PARAMETERS];
    double surface_now_by[MOST_PARAMETERS] = {0.0}, u_by[MOST_PARAMETERS] = {0.0};
    double ln_r_by[MOST_PARAMETERS];
    double w[MOST_LAGS] = {0.0}, w_by[MOST_LAGS][2] = {{0.0}};
    const int64_t last = shells - 1;
    double u = 0.0, surface_now = at[0], share;
    int64_t inside;

    for (int64_t i = 0; i < shells; i++) {
        z[i] = at[0];
        z_by[i][0] = 1.0;
    }
    surface_now_by[0] = 1.0;
    for (int64_t k = 0; k < rows; k++) {
        const double kelvin = celsius[k] + ZERO_CELSIUS, warmth = 1.0 / kelvin - 1.0 / reference;
        const double bent = warmth * warmth / bend_reference;
        const double whole = k ? step[k] : 0.0;
        if (whole > 0.0) {
            const int64_t parts = whole > longest ? (int64_t)ceil(whole / longest) : 1;
            const double h = whole / (double)parts, flow = counted[k] * flux;
            for (int64_t part = 0; part < parts; part++) {
                for (int64_t i = 0; i < shells; i++) {
                    const int64_t m = interval_of(rate_knots, rates, z[i], &share, &inside);
                    const double slope = inside ? (ln_rate[m + 1] - ln_rate[m]) /
                                                      (rate_knots[m + 1] - rate_knots[m])
                                                : 0.0;
                    rate[i] = exp(ln_rate[m] * (1.0 - share) + ln_rate[m + 1] * share -
                                  rate_energy * warmth / GAS_CONSTANT);
                    for (int64_t p = 0; p < moving; p++)
                        rate_by[i][p] = rate[i] * slope * z_by[i][p];
                    if (moving) {
                        rate_by[i][2 + m] += rate[i] * (1.0 - share);
                        rate_by[i][3 + m] += rate[i] * share;
                        rate_by[i][2 + rates] -= rate[i] * warmth / GAS_CONSTANT;
                    }
                    below[i] = above[i] = 0.0;
                    middle[i] = volume[i] / h;
                    right[i] = volume[i] / h * z[i];
                    for (int64_t p = 0; p < moving; p++) z_by[i][p] *= volume[i] / h;
                }
                double passed[MOST_SHELLS], by_inner[MOST_SHELLS], by_outer[MOST_SHELLS];
                for (int64_t i = 0; i < last; i++) {
                    const double sum = rate[i] + rate[i + 1];
                    passed[i] = 2.0 * rate[i] * rate[i + 1] / sum * conductance[i];
                    by_inner[i] = 2.0 * conductance[i] * rate[i + 1] * rate[i + 1] / (sum * sum);
                    by_outer[i] = 2.0 * conductance[i] * rate[i] * rate[i] / (sum * sum);
                    above[i] -= passed[i];
                    middle[i] += passed[i];
                    below[i + 1] -= passed[i];
                    middle[i + 1] += passed[i];
                }
                right[last] += flow;
                for (int64_t i = 1; i < shells; i++) {
                    factor[i] = below[i] / middle[i - 1];
                    middle[i] -= factor[i] * above[i - 1];
                    right[i] -= factor[i] * right[i - 1];
                }
                z[last] = right[last] / middle[last];
                for (int64_t i = last - 1; i >= 0; i--)
                    z[i] = (right[i] - above[i] * z[i + 1]) / middle[i];
                if (moving) {
                    for (int64_t i = 0; i < last; i++) {
                        const double rise = z[i + 1] - z[i];
                        for (int64_t p = 0; p < moving; p++) {
                            const double change = rise * (by_inner[i] * rate_by[i][p] +
                                                          by_outer[i] * rate_by[i + 1][p]);
                            z_by[i][p] += change;
                            z_by[i + 1][p] -= change;
                        }
                    }
                    z_by[last][1] += flow;
                    for (int64_t i = 1; i < shells; i++)
                        for (int64_t p = 0; p < moving; p++)
                            z_by[i][p] -= factor[i] * z_by[i - 1][p];
                    for (int64_t p = 0; p < moving; p++) z_by[last][p] /= middle[last];
                    for (int64_t i = last - 1; i >= 0; i--)
                        for (int64_t p = 0; p < moving; p++)
                            z_by[i][p] = (z_by[i][p] - above[i] * z_by[i + 1][p]) / middle[i];
                }
                const double lead = flow / rate[last] * to_surface;
                surface_now = z[last] + lead;
                for (int64_t p = 0; p < moving; p++)
                    surface_now_by[p] = z_by[last][p] - lead / rate[last] * rate_by[last][p];
                surface_now_by[1] += lead;
            }
            const int64_t m = interval_of(transfer_knots, transfers, surface_now, &share, &inside);
            const double slope = inside ? (ln_transfer[m + 1] - ln_transfer[m]) /
                                              (transfer_knots[m + 1] - transfer_knots[m])
                                        : 0.0;
            const double ohm = exp(ln_transfer[m] * (1.0 - share) + ln_transfer[m + 1] * share +
                                   (kinetics[0] * warmth + kinetics[1] * bent) / GAS_CONSTANT);
            const double farad = exp(kinetics[2] + kinetics[3] * warmth / GAS_CONSTANT);
            const double scale = exp(kinetics[4]) * GAS_CONSTANT * kelvin / FARADAY;
            for (int64_t p = 0; p < all; p++)
                ln_r_by[p] = p < moving ? slope * surface_now_by[p] : 0.0;
            if (all) {
                double *own = ln_r_by + moving;
                own[m] += 1.0 - share;
                own[m + 1] += share;
                own[transfers] += warmth / GAS_CONSTANT;
                own[transfers + 1] += bent / GAS_CONSTANT;
            }
            const double first = current[k - 1], now = current[k];
            for (int64_t i = 0; i < lags; i++) {
                const double tau = exp(lag_at[2 * i] + lag_at[2 * i + 1] * warmth / GAS_CONSTANT);
                const double ratio = whole / tau;
                const lag_end end = lag_ended(ratio, w[i], first, now);
                const double by_log = -ratio * end.by_ratio;
                w_by[i][0] = end.decay * w_by[i][0] + by_log;
                w_by[i][1] = end.decay * w_by[i][1] + by_log * warmth / GAS_CONSTANT;
                w[i] = end.state;
            }
            /* Charge transfer lags with the resistance that it has at the end of the step. */
            double v = u, by_chord = 0.0, by_ohm = 0.0, by_log_farad = 0.0, stiffness = 1.0;
            lag_end end = {1.0, 0.0, 0.0};
            for (int64_t round = 0; round < ROUNDS; round++) {
                const double here = ohm * chord_of(v / scale, &by_chord);
                const double ratio = whole / (farad * here);
                end = lag_ended(ratio, u / here, first, now);
                by_log_farad = -ratio * here * end.by_ratio;
                by_ohm = here * end.state - end.decay * u + by_log_farad;
                stiffness = 1.0 - by_ohm * by_chord / scale;
                double move = (here * end.state - v) / fmax(stiffness, LEAST_STIFFNESS);
                move = fmin(fmax(move, -2.0 * scale), 2.0 * scale);
                v += move;
                if (fabs(move) < 1e-12) break;
            }
            for (int64_t p = 0; p < all; p++)
                u_by[p] = (end.decay * u_by[p] + by_ohm * ln_r_by[p]) / stiffness;
            if (all) {
                double *own = u_by + moving + transfers;
                own[2] += by_log_farad / stiffness;
                own[3] += by_log_farad / stiffness * warmth / GAS_CONSTANT;
                own[4] -= by_ohm * by_chord * v / scale / stiffness;
            }
            u = v;
        }
        surface[k] = surface_now;
        over[k] = u;
        memcpy(lagged + k * lags, w, (size_t)lags * sizeof(double));
        if (wanted) {
            memcpy(surface_by + k * moving, surface_now_by, (size_t)moving * sizeof(double));
            memcpy(lagged_by + k * 2 * lags, w_by, (size_t)(2 * lags) * sizeof(double));
            memcpy(over_by + k * all, u_by, (size_t)all * sizeof(double));
        }
    }
}

/* ---- one step, from any state: what a functional mock-up unit takes ---- */

/* What a step needs to know of a particle; its numbers lie as circuits/particle.py lays them out. */
typedef struct {
    int64_t shells, lags, stops, near_empty, ohmic, relaxing, open, entropic, turning, points;
    const double *volume, *conductance; /* (shells,) */
    const double *per_turn; /* (stops,) of the hysteresis: how far the whole capacity moves each */
    double to_surface, longest, reference, bend_reference;
    const double *knots, *vector, *ocv;
} particle_of;

/* A particle of its sizes, sphere (volume and conductance of the shells, moves of the stops, way to
 * the surface, longest step, reference of temperatures and of bends), knots, numbers and OCV. */
INLINE particle_of particle_from(const int64_t *sizes, const double *sphere, const double *knots,
                                 const double *vector, const double *ocv) {
    const double *turns = sphere + 2 * sizes[0], *rest = turns + sizes[2];
    return (particle_of){sizes[0], sizes[1], sizes[2], sizes[3], sizes[4], sizes[5], sizes[6],
                         sizes[7], sizes[8], sizes[9], sphere, sphere + sizes[0], turns, rest[0],
                         rest[1], rest[2], rest[3], knots, vector, ocv};
}

/* A course over SoC, linear between knots and flat beyond. */
INLINE double course_at(const double *values, const double *knots, int64_t count, double soc) {
    double share;
    int64_t inside;
    const int64_t m = interval_of(knots, count, soc, &share, &inside);
    return values[m] * (1.0 - share) + values[m + 1] * share;
}

/* A resistance of logarithms over SoC, after which its energy and the bend of that lie. */
INLINE double ohm_at(const double *values, const double *knots, int64_t count, double soc,
                     double warmth, double bent) {
    const double energy = values[count] * warmth + values[count + 1] * bent;
    return exp(course_at(values, knots, count, soc) + energy / GAS_CONSTANT);
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
    const double per_kelvin = course_at(entropy, entropic, p->entropic, soc);
    const double half_gap =
        course_at(entropy + p->entropic, entropic + p->entropic, p->turning, soc);
    double volt, slope;
    ocv_and_slope(p->ocv, p->points, soc, &volt, &slope);
    return volt + course_at(shift, open, p->open, soc) + direction * half_gap +
           (celsius - (p->reference - ZERO_CELSIUS)) * per_kelvin;
}

/* Voltage of a state under a current. State: SoC of the shells and of the surface, overvoltage of
 * charge transfer [V], lags [A], stops of the hysteresis. */
static double particle_volt(const particle_of *p, double current, double celsius,
                            const double *state) {
    const double warmth = 1.0 / (celsius + ZERO_CELSIUS) - 1.0 / p->reference;
    const double bent = warmth * warmth / p->bend_reference, surface = state[p->shells];
    const double *knots = p->knots + p->near_empty, *lag = lags_of(p);
    double direction = 0.0;
    for (int64_t i = 0; i < p->stops; i++)
        direction += state[p->shells + 2 + p->lags + i] / (double)p->stops;
    double volt = particle_ocv(p, surface, celsius, direction) + state[p->shells + 1];
    volt += current * ohm_at(ohmic_of(p), knots, p->ohmic, surface, warmth, bent);
    knots += p->ohmic;
    for (int64_t i = 0; i < p->lags; i++, lag += p->relaxing + 4)
        volt += state[p->shells + 2 + i] *
                ohm_at(lag, knots, p->relaxing, surface, warmth, bent);
    return volt;
}

/* SoC of the shells and of the surface after one implicit step of the diffusion. */
static void particle_diffused(const particle_of *p, double second, double flow, double warmth,
                              double *z) {
    const int64_t last = p->shells - 1;
    const double energy = p->vector[p->near_empty];
    double rate[MOST_SHELLS], below[MOST_SHELLS], middle[MOST_SHELLS], above[MOST_SHELLS];
    for (int64_t i = 0; i <= last; i++) {
        rate[i] = exp(course_at(p->vector, p->knots, p->near_empty, z[i]) -
                      energy * warmth / GAS_CONSTANT);
        below[i] = above[i] = 0.0;
        middle[i] = p->volume[i] / second;
        z[i] *= p->volume[i] / second;
    }
    for (int64_t i = 0; i < last; i++) {
        const double passed =
            2.0 * rate[i] * rate[i + 1] / (rate[i] + rate[i + 1]) * p->conductance[i];
        above[i] -= passed;
        middle[i] += passed;
        below[i + 1] -= passed;
        middle[i + 1] += passed;
    }
    z[last] += flow;
    for (int64_t i = 1; i <= last; i++) {
        const double factor = below[i] / middle[i - 1];
        middle[i] -= factor * above[i - 1];
        z[i] -= factor * z[i - 1];
    }
    z[last] /= middle[last];
    for (int64_t i = last - 1; i >= 0; i--) z[i] = (z[i] - above[i] * z[i + 1]) / middle[i];
    z[p->shells] = z[last] + flow / rate[last] * p->to_surface;
}

/* A step as `particle` takes it, of a current that is held; coulomb: charge of the capacity [A s]. */
static void particle_moved(const particle_of *p, double flux, double coulomb, double whole,
                           double current, double celsius, double *state) {
    const double kelvin = celsius + ZERO_CELSIUS, warmth = 1.0 / kelvin - 1.0 / p->reference;
    const double bent = warmth * warmth / p->bend_reference;
    const double *transfer = p->vector + p->near_empty + 1, *own = transfer + p->near_empty;
    const double *lag = lags_of(p) + p->relaxing + 2;
    const int64_t parts = whole > p->longest ? (int64_t)ceil(whole / p->longest) : 1;
    for (int64_t part = 0; part < parts; part++)
        particle_diffused(p, whole / (double)parts, current * flux, warmth, state);
    const double ohm =
        ohm_at(transfer, p->knots, p->near_empty, state[p->shells], warmth, bent);
    const double farad = exp(own[2] + own[3] * warmth / GAS_CONSTANT);
    const double scale = exp(own[4]) * GAS_CONSTANT * kelvin / FARADAY;
    const double u = state[p->shells + 1];
    double v = u, by_chord;
    for (int64_t round = 0; round < ROUNDS; round++) {
        const double here = ohm * chord_of(v / scale, &by_chord);
        const double ratio = whole / (farad * here);
        const lag_end end = lag_ended(ratio, u / here, current, current);
        const double by_ohm = here * end.state - end.decay * u - ratio * here * end.by_ratio;
        const double stiffness = fmax(1.0 - by_ohm * by_chord / scale, LEAST_STIFFNESS);
        const double move = (here * end.state - v) / stiffness;
        v += fmin(fmax(move, -2.0 * scale), 2.0 * scale);
        if (fabs(move) < 1e-12) break;
    }
    state[p->shells + 1] = v;
    for (int64_t i = 0; i < p->lags; i++, lag += p->relaxing + 4) {
        const double ratio = whole / exp(lag[0] + lag[1] * warmth / GAS_CONSTANT);
        double *w = state + p->shells + 2 + i;
        *w = lag_ended(ratio, *w, current, current).state;
    }
    double *stops = state + p->shells + 2 + p->lags;
    for (int64_t i = 0; i < p->stops; i++)
        stops[i] = fmin(fmax(stops[i] + p->per_turn[i] * current * whole / coulomb, -1.0), 1.0);
}
