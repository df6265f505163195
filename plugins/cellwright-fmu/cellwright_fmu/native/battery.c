/* A pack in any wiring, or a cell alone, as a battery that is stepped: pack.c does the work.
 *
 * Before a step the total jumps, in no time, to what is asked; in the step it flows unchanged. So a
 * row of steps is what `simulate_pack` gives for a current of edges (two samples at one time) with
 * its hold of first order, under which resistances may move within a step. */
#include "battery.h"
#include "pack.c"

#include <stdio.h>
#include <stdlib.h>

#define KELVIN 273.15
enum { SIZES = 16, HOLD = 12, KEPT = 13, EXTREMES = 14, SENSED = 15 };

struct battery {
    int64_t sizes[SIZES];
    size_t cells, temperatures, quantities, lags, memory, kept, room;
    int64_t *whole; /* the arrays of whole numbers below, one after the other */
    int64_t *address, *stride, *straight, *connection, *first, *member;
    double *inverse;                            /* (temperatures,) −1/T */
    const double *celsius, *capacity_ampere_hour, *near_end, *share, *contact, *link;
    const double *heat_capacity, *heat_resistance; /* (cells,), or NULL: the ambient's temperature */
    double *per_second, *here, *work, *now;     /* (cells,), (cells,), room, (3 × cells) */
    double tolerance, same_soc;
    char why[MESSAGE];
};

static int64_t *as_whole(const double *from, size_t count, int64_t **at) {
    int64_t *begin = *at;
    for (size_t k = 0; k < count; k++) begin[k] = (int64_t)from[k];
    *at += count;
    return begin;
}

/* Whether every look-up and every member lies within the tables. */
static int within_tables(const battery *b, size_t numbers, size_t groups, size_t members) {
    for (size_t q = 0; q < b->quantities; q++) {
        const int64_t last = b->address[q]
                             + (int64_t)(b->temperatures * b->cells - 1) * b->stride[q]
                             + b->sizes[2];
        if (b->address[q] < 0 || b->stride[q] < 0 || last > (int64_t)numbers) return 0;
    }
    for (size_t k = 0; k < groups; k++)
        if (b->first[k] >= b->first[k + 1] || b->first[k] < 0) return 0;
    for (size_t k = 0; k < members; k++)
        if (b->member[k] < 0 || b->member[k] >= (int64_t)(b->cells + groups)) return 0;
    return b->first[groups] == (int64_t)members;
}

static int take(battery *b, const tables *t, char *why) {
    const double *sizes = of_size(t, "sizes", SIZES, why);
    if (!sizes) return 0;
    for (int k = 0; k < SIZES; k++) {
        b->sizes[k] = (int64_t)sizes[k];
        if (b->sizes[k] < 0 || sizes[k] > 1e7) return 0;
    }
    b->sizes[EXTREMES] = 0;
    b->sizes[HOLD] = b->sizes[KEPT] = 1;
    const int64_t *z = b->sizes;
    const size_t cells = (size_t)z[0], groups = (size_t)z[1], kinds = (size_t)z[3];
    if (!cells || !groups || z[2] < 2 || !kinds || z[SENSED] >= z[0] + z[1]) return 0;
    b->cells = cells;
    b->temperatures = kinds;
    b->lags = (size_t)lags_of(z);
    b->memory = b->lags + (size_t)z[6];
    b->quantities = (size_t)quantities_of(z);
    b->kept = (1 + b->memory + b->quantities) * cells;
    size_t members, numbers;
    const double *member = array_of(t, "member", &members);
    const double *values = array_of(t, "tables", &numbers);
    const double *place = of_size(t, "quantities", 3 * b->quantities, why);
    const double *connection = of_size(t, "connection", groups, why);
    const double *first = of_size(t, "first", groups + 1, why);
    b->celsius = of_size(t, "temperature_celsius", kinds, why);
    b->capacity_ampere_hour = of_size(t, "capacity_ampere_hour", cells, why);
    b->near_end = of_size(t, "near_end_soc", cells, why);
    b->share = of_size(t, "share", cells, why);
    b->contact = of_size(t, "contact_ohm", members, why);
    b->link = of_size(t, "link_ohm", members, why);
    const double *tolerances = of_size(t, "tolerances", 2, why);
    const double *room = of_size(t, "room", 1, why);
    if (*why || !member || !values) return 0;
    if (array_of(t, "heat_capacity_joule_per_kelvin", NULL)) {
        b->heat_capacity = of_size(t, "heat_capacity_joule_per_kelvin", cells, why);
        b->heat_resistance = of_size(t, "resistance_kelvin_per_watt", cells, why);
    }
    if (*why) return 0;
    b->tolerance = tolerances[0];
    b->same_soc = tolerances[1];
    b->whole = malloc((3 * b->quantities + 2 * groups + 1 + members) * sizeof(int64_t));
    const size_t least = 4 * (b->quantities + b->memory) * cells + 6 * members;
    if (!(*room >= (double)least && *room < 1e9)) return 0;
    b->room = (size_t)*room;
    b->work = calloc(b->room, sizeof(double));
    b->inverse = malloc((kinds + 2 * cells + 3 * cells) * sizeof(double));
    if (!b->whole || !b->work || !b->inverse) return 0;
    b->per_second = b->inverse + kinds;
    b->here = b->per_second + cells;
    b->now = b->here + cells;
    int64_t *at = b->whole;
    b->address = as_whole(place, b->quantities, &at);
    b->stride = as_whole(place + b->quantities, b->quantities, &at);
    b->straight = as_whole(place + 2 * b->quantities, b->quantities, &at);
    b->connection = as_whole(connection, groups, &at);
    b->first = as_whole(first, groups + 1, &at);
    b->member = as_whole(member, members, &at);
    if (!within_tables(b, numbers, groups, members)) return 0;
    for (size_t q = 0; q < b->quantities; q++)
        b->address[q] = (int64_t)(intptr_t)(values + b->address[q]);
    for (size_t k = 0; k < kinds; k++) b->inverse[k] = -1.0 / (b->celsius[k] + KELVIN);
    for (size_t c = 0; c < cells; c++) {
        b->per_second[c] = 1.0 / (3600.0 * b->capacity_ampere_hour[c]);
        if (!(b->per_second[c] > 0.0 && isfinite(b->per_second[c]))) return 0;
    }
    return 1;
}

battery *battery_of(const tables *t, char why[MESSAGE]) {
    battery *b = calloc(1, sizeof *b);
    *why = '\0';
    if (b && take(b, t, why)) return b;
    if (!*why) snprintf(why, MESSAGE, "the tables of the FMU do not belong together");
    battery_free(b);
    return NULL;
}

void battery_free(battery *b) {
    if (!b) return;
    free(b->whole);
    free(b->work);
    free(b->inverse);
    free(b);
}

size_t battery_cells(const battery *b) { return b->cells; }

/* The state: what pack.c keeps (SoC, memory, quantities), currents, temperatures, the total. */
size_t battery_states(const battery *b) { return b->kept + 2 * b->cells + 1; }

static void set_temperatures(const battery *b, const double *celsius) {
    const double low = b->celsius[0], high = b->celsius[b->temperatures - 1];
    for (size_t c = 0; c < b->cells; c++) {
        const double held = celsius[c] < low ? low : celsius[c] > high ? high : celsius[c];
        b->here[c] = -1.0 / (held + KELVIN);
    }
}

/* What the look-up functions of pack.c need to know. */
static pack tables_only(const battery *b) {
    pack p = {0};
    p.cells = (int64_t)b->cells;
    p.points = b->sizes[2];
    p.temperatures = b->sizes[3];
    p.address = b->address;
    p.stride = b->stride;
    p.straight = b->straight;
    p.inverse = b->inverse;
    p.inverse_here = b->here;
    return p;
}

void battery_rest(const battery *b, const double *soc, double celsius, double ampere,
                  double *state) {
    const size_t n = b->cells;
    memset(state, 0, battery_states(b) * sizeof(double));
    memcpy(state, soc, n * sizeof(double));
    for (size_t c = 0; c < n; c++) state[b->kept + n + c] = celsius;
    set_temperatures(b, state + b->kept + n);
    double *memory = state + n, *quantities = memory + b->memory * n;
    const pack p = tables_only(b);
    for (size_t q = 0; q < b->quantities; q++)
        for (size_t c = 0; c < n; c++)
            quantities[q * n + c] = quantity_at(&p, (int64_t)q, (int64_t)c, soc[c]);
    const size_t goal = b->quantities - b->lags - 2 * (size_t)b->sizes[6];
    for (size_t c = 0; c < n; c++) {
        const double near = b->near_end[c];
        double led = ampere > 0.0 ? 1.0 : ampere < 0.0 ? -1.0 : 0.0;
        if (led == 0.0) led = (double)((soc[c] > 1.0 - near) - (soc[c] < near));
        for (size_t j = 0; near > 0.0 && j < (size_t)b->sizes[6]; j++)
            memory[(b->lags + j) * n + c] = led * quantities[(goal + j) * n + c];
    }
}

/* One step of pack.c at these temperatures; NULL, or why it is not solved. */
static const char *one(battery *b, double second, double ampere, double *state, double *volt) {
    static const double by_current = CURRENT;
    double fault[3] = {0}, total = 0.0, extremes_of_none = 0.0;
    double *const flow = state + b->kept, *const last = flow + 2 * b->cells;
    memset(b->work, 0, b->room * sizeof(double));
    memcpy(b->work, state, b->kept * sizeof(double));
    set_temperatures(b, flow + b->cells);
    const int64_t stopped = pack_steps(
        1, &second, &by_current, &ampere, *last, b->sizes, b->address, b->stride, b->straight,
        b->inverse, b->here, b->per_second, b->share, b->connection, b->first, b->member,
        b->contact, b->link, b->tolerance, b->same_soc, b->work, flow, b->now,
        b->now + b->cells, b->now + 2 * b->cells, volt, &extremes_of_none, &total, fault);
    if (stopped >= 0 && (int)fault[0] == NO_RESISTANCE)
        snprintf(b->why, MESSAGE, "member %d of group %d has no resistance at this moment",
                 (int)fault[2] + 1, (int)fault[1] + 1);
    else if (stopped >= 0)
        snprintf(b->why, MESSAGE, "cell %d is still %.2g V from its equations, in %g s at %g A",
                 (int)fault[1] + 1, fault[2], second, ampere);
    if (stopped >= 0) return b->why;
    memcpy(state, b->work, b->kept * sizeof(double));
    *last = total;
    if (isfinite(*volt)) return NULL;
    snprintf(b->why, MESSAGE, "the voltage is not finite at %g A", ampere);
    return b->why;
}

/* Adds half of the heat I·(V − OCV) that flows now. */
static void add_half(const battery *b, double *heat) {
    const pack p = tables_only(b);
    const double *current = b->now, *volt = b->now + b->cells, *soc = b->now + 2 * b->cells;
    for (size_t c = 0; c < b->cells; c++)
        heat[c] += 0.5 * current[c] * (volt[c] - quantity_at(&p, 0, c, soc[c]));
}

/* Temperatures after a step with the mean heat of its begin and end, exact for a held ambient. */
static void warm(const battery *b, double second, double ambient, const double *heat,
                 double *celsius) {
    for (size_t c = 0; c < b->cells; c++) {
        const double r = b->heat_resistance[c], gain = -expm1(-second / (r * b->heat_capacity[c]));
        celsius[c] += gain * (ambient + r * heat[c] - celsius[c]);
    }
}

const char *battery_step(battery *b, double second, double ampere, double ambient_celsius,
                         double *state, reading *r) {
    const size_t n = b->cells;
    double *const celsius = state + b->kept + n, *const heat = r->cell_celsius; /* written last */
    for (size_t c = 0; !b->heat_capacity && c < n; c++) celsius[c] = ambient_celsius;
    memset(heat, 0, n * sizeof(double));
    const char *why = one(b, 0.0, ampere, state, &r->voltage_volt);
    if (!why && b->heat_capacity) add_half(b, heat);
    if (!why && second > 0.0) why = one(b, second, ampere, state, &r->voltage_volt);
    if (why) return why;
    if (b->heat_capacity) {
        add_half(b, heat);
        warm(b, second, ambient_celsius, heat, celsius);
    }
    memcpy(r->cell_current_ampere, b->now, n * sizeof(double));
    memcpy(r->cell_voltage_volt, b->now + n, n * sizeof(double));
    memcpy(r->cell_soc, b->now + 2 * n, n * sizeof(double));
    memcpy(r->cell_celsius, celsius, n * sizeof(double));
    return NULL;
}
