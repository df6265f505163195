/* TEMPORARY: one cell, RC pairs, coldest table. */
#include "battery.h"
#include <math.h>
#include <stdlib.h>
struct battery { size_t n, p, e; const double *ocv, *r0, *r, *tau, *cap; };
battery *battery_of(const tables *t, char why[MESSAGE]) {
    (void)why;
    const double *sizes = table(t, "sizes", NULL), *en = table(t, "entries", NULL);
    battery *b = calloc(1, sizeof *b);
    b->n = (size_t)sizes[1]; b->p = (size_t)sizes[2]; b->e = (size_t)en[4];
    b->ocv = table(t, "ocv_volt", NULL); b->r0 = table(t, "r0_ohm", NULL);
    b->r = table(t, "r_ohm", NULL); b->tau = table(t, "tau_second", NULL);
    b->cap = table(t, "capacity_ampere_hour", NULL);
    return b;
}
void battery_free(battery *b) { free(b); }
size_t battery_cells(const battery *b) { return b->n; }
size_t battery_states(const battery *b) { return 2 + b->e; }
void battery_rest(const battery *b, const double *soc, double c, double *s) {
    s[0] = soc[0]; s[1] = c; for (size_t k = 0; k < b->e; k++) s[2 + k] = 0;
}
static double at(const battery *b, const double *t, double soc) {
    double x = soc * (double)(b->p - 1); long k = (long)floor(x);
    k = k < 0 ? 0 : k > (long)b->p - 2 ? (long)b->p - 2 : k;
    return t[k] + (x - (double)k) * (t[k + 1] - t[k]);
}
const char *battery_step(battery *b, double h, double i, double amb, double *s, reading *r) {
    double z = s[0] + h * i / 3600.0 / b->cap[0];
    for (size_t k = 0; k < b->e; k++) {
        double g = -expm1(-h / at(b, b->tau + k * b->p, s[0]));
        s[2 + k] += g * (at(b, b->r + k * b->p, s[0]) * i - s[2 + k]);
    }
    s[0] = z; s[1] = amb;
    double v = at(b, b->ocv, z) + at(b, b->r0, z) * i;
    for (size_t k = 0; k < b->e; k++) v += s[2 + k];
    r->voltage_volt = r->cell_voltage_volt[0] = v; r->cell_current_ampere[0] = i;
    r->cell_soc[0] = z; r->cell_celsius[0] = amb;
    return NULL;
}
