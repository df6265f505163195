/* A cell as one particle with charge transfer, as a battery that is stepped: particle.c does the
 * work. As in battery.c a current jumps before a step and flows unchanged in it. */
#include "battery.h"
#include "particle.c"

#include <stdio.h>
#include <stdlib.h>

enum { SIZES = 10, FIRST = 3, COURSES = 6, OF_SPHERE = 4, AFTER = 3 };

struct battery {
    particle_of particle;
    size_t temperatures;
    int64_t sizes[SIZES];
    const double *celsius, *missing, *stretch; /* (temperatures,): how the OCV lies on the SoC */
    const double *heat_capacity, *heat_resistance; /* NULL: the ambient's temperature */
    double coulomb;
    char why[MESSAGE];
};

static int take(battery *b, const tables *t, char *why) {
    const double *sizes = of_size(t, "sizes", SIZES, why);
    if (!sizes) return 0;
    size_t knots = 0;
    for (int k = 0; k < SIZES; k++) {
        if (!(sizes[k] >= 0.0 && sizes[k] < 1e4)) return 0;
        b->sizes[k] = (int64_t)sizes[k];
        if (k < FIRST || k >= FIRST + COURSES) continue;
        if (b->sizes[k] < 2) return 0; /* a course has two knots at least */
        knots += (size_t)b->sizes[k];
    }
    const int64_t *z = b->sizes, *course = z + FIRST, lags = z[1], points = course[COURSES];
    if (z[0] < 2 || z[0] > MOST_SHELLS || lags > MOST_LAGS || points < 2) return 0;
    array_of(t, "temperature_celsius", &b->temperatures);
    if (!b->temperatures) return 0;
    const int64_t numbers = 2 * course[0] + 6 + course[1] + 2 + lags * (course[2] + 4)
                            + course[3] + course[4] + course[5] + 2 * (int64_t)b->temperatures;
    const size_t ahead = 2 * (size_t)z[0] + (size_t)z[2];
    const double *sphere = of_size(t, "sphere", ahead + OF_SPHERE, why);
    const double *at = of_size(t, "knots", knots, why);
    const double *vector = of_size(t, "vector", (size_t)numbers, why);
    const double *ocv = of_size(t, "ocv_volt", (size_t)points, why);
    const double *size = of_size(t, "capacity_ampere_hour", 1, why);
    b->celsius = of_size(t, "temperature_celsius", b->temperatures, why);
    if (*why) return 0;
    if (array_of(t, "heat_capacity_joule_per_kelvin", NULL)) {
        b->heat_capacity = of_size(t, "heat_capacity_joule_per_kelvin", 1, why);
        b->heat_resistance = of_size(t, "resistance_kelvin_per_watt", 1, why);
    }
    if (*why || !(sphere[ahead + 1] >= 1.0)) return 0; /* its longest step */
    b->particle = particle_from(b->sizes, sphere, at, vector, ocv);
    b->missing = vector + numbers - 2 * (int64_t)b->temperatures;
    b->stretch = b->missing + b->temperatures;
    b->coulomb = 3600.0 * *size;
    return b->coulomb > 0.0 && isfinite(b->coulomb);
}

battery *battery_of(const tables *t, char why[MESSAGE]) {
    battery *b = calloc(1, sizeof *b);
    *why = '\0';
    if (b && take(b, t, why)) return b;
    if (!*why) snprintf(why, MESSAGE, "the tables of the FMU do not belong together");
    battery_free(b);
    return NULL;
}

void battery_free(battery *b) { free(b); }

size_t battery_cells(const battery *b) {
    (void)b;
    return 1;
}

/* The state: that of the particle, the counted SoC, the stretch of its scale, the temperature. */
static size_t states_of(const battery *b) {
    return (size_t)(2 * b->particle.shells + 2 + b->particle.lags + b->particle.stops);
}

size_t battery_states(const battery *b) { return states_of(b) + AFTER; }

/* A number of each temperature at one between, linear in 1/T and flat beyond. */
static double over_temperature(const battery *b, const double *values, double celsius) {
    size_t above = 0;
    while (above < b->temperatures && b->celsius[above] < celsius) above++;
    if (above == 0 || above == b->temperatures) return values[above ? above - 1 : 0];
    const double low = -1.0 / (b->celsius[above - 1] + ZERO_CELSIUS);
    const double high = -1.0 / (b->celsius[above] + ZERO_CELSIUS);
    const double share = (-1.0 / (celsius + ZERO_CELSIUS) - low) / (high - low);
    return values[above - 1] + share * (values[above] - values[above - 1]);
}

void battery_rest(const battery *b, const double *soc, double celsius, double ampere,
                  double *state) {
    (void)ampere;
    const double stretch = over_temperature(b, b->stretch, celsius);
    const double missing = over_temperature(b, b->missing, celsius);
    double *const after = state + states_of(b);
    memset(state, 0, battery_states(b) * sizeof(double));
    for (int64_t i = 0; i < b->particle.shells; i++)
        state[i] = 1.0 - missing - (1.0 - *soc) * (1.0 + stretch);
    after[0] = *soc;
    after[1] = stretch;
    after[2] = celsius;
}

/* Half of the heat I·(V − OCV), the OCV of the whole charge: what evens out warms the cell too. */
static double half_heat(const battery *b, double ampere, double volt, const double *state) {
    double mean = 0.0;
    for (int64_t i = 0; i < b->particle.shells; i++) mean += 3.0 * b->particle.volume[i] * state[i];
    const double celsius = state[states_of(b) + 2];
    return 0.5 * ampere * (volt - particle_ocv(&b->particle, mean, celsius, 0.0));
}

const char *battery_step(battery *b, double second, double ampere, double ambient_celsius,
                         double *state, reading *r) {
    double *const after = state + states_of(b), heat = 0.0;
    const double flux = (1.0 + after[1]) / (3.0 * b->coulomb);
    if (!b->heat_capacity) after[2] = ambient_celsius;
    double volt = particle_volt(&b->particle, flux, ampere, after[2], state);
    if (second > 0.0) {
        heat = half_heat(b, ampere, volt, state);
        particle_moved(&b->particle, flux, b->coulomb, second, ampere, after[2], state);
        after[0] += ampere * second / b->coulomb;
        volt = particle_volt(&b->particle, flux, ampere, after[2], state);
    }
    if (second > 0.0 && b->heat_capacity) {
        heat += half_heat(b, ampere, volt, state);
        const double ohm = *b->heat_resistance;
        const double gain = -expm1(-second / (ohm * *b->heat_capacity));
        after[2] += gain * (ambient_celsius + ohm * heat - after[2]);
    }
    r->voltage_volt = *r->cell_voltage_volt = volt;
    *r->cell_current_ampere = ampere;
    *r->cell_soc = after[0];
    *r->cell_celsius = after[2];
    if (isfinite(volt)) return NULL;
    snprintf(b->why, MESSAGE, "the voltage is not finite at %g A", ampere);
    return b->why;
}
