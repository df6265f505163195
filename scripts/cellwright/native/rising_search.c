/* The search for a penalised rising spline: see `rising_curve` in numerics/monotone.py, whose steps
 * and names these are. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "rising.h"

#define FINE 16 /* points in a cell where the stretch is turned round */
enum { STIFFEST, SOFTEST, LOCAL_ROUNDS, LOCAL_CELLS, STRETCH_CELLS, CHANGE_CELLS, SCALE_CELLS,
       STEPS, FIRST_STEPS, WORSE, RELATIVE_CHANGE, MOST_RANGE, ROUNDING, PILOT_BLOCKS };

typedef struct {
    int64_t count, cells;
    const double *x, *y, *weight, *setting;
} Readings;

/* All that a search works on. best, fit: fits; place: of the readings in cells. */
typedef struct {
    Readings readings;
    Problem problem;
    Stretch stretch;
    Fit best, fit;
    double first, span, variance, decade;
    double *place, *logs, *fine_x, *fine_place, *pad[6];
} Search;

static double last_stretched(const Stretch *stretch, double x) {
    int64_t near = stretch->count - 2;
    return stretched(stretch, x, 0, &near);
}

/* Abscissa in which flat and steep parts have their share of the cells. */
static int pilot_stretch(Search *s) {
    const Readings *r = &s->readings;
    int64_t blocks = r->count / 4 < (int64_t)r->setting[PILOT_BLOCKS]
                         ? r->count / 4 : (int64_t)r->setting[PILOT_BLOCKS];
    blocks = blocks < 3 ? 3 : blocks;
    double *x = s->pad[0], *y = s->pad[1], *rate = s->pad[2], *density = s->pad[3];
    double before = 0.0, highest = -INFINITY;
    const double range = r->x[r->count - 1] - r->x[0];
    int64_t kept = 0;
    for (int64_t b = 0; b < blocks; b++) {
        const int64_t begin = (int64_t)((double)b * ((double)r->count / (double)blocks));
        const int64_t end = b == blocks - 1
            ? r->count : (int64_t)((double)(b + 1) * ((double)r->count / (double)blocks));
        double rows = 0.0, sum_x = 0.0, sum_y = 0.0;
        for (int64_t k = begin; k < end; k++) {
            rows += r->weight[k];
            sum_x += r->weight[k] * r->x[k];
            sum_y += r->weight[k] * r->y[k];
        }
        highest = sum_y / rows > highest ? sum_y / rows : highest;
        const double mean = sum_x / rows;
        if (!b || mean - before > 1e-9 * range) {
            x[kept] = mean;
            y[kept++] = highest;
        }
        before = mean;
    }
    if (kept < 2)
        return -1;
    gradient(kept, x, y, rate);
    const double rise = fmax(y[kept - 1] - y[0], 1e-12);
    for (int64_t k = 0; k < kept; k++)
        density[k] = 1.0 / range + fmax(rate[k], 0.0) / rise;
    return accumulated(kept, x, density, 2.0, &s->stretch);
}

/* Logarithms of the steps between coefficients, from means over three cells. */
static void first_logs(Search *s) {
    const Readings *r = &s->readings;
    const int64_t groups = r->cells / 3 > 2 ? r->cells / 3 : 2;
    double *rows = s->pad[0], *mean = s->pad[1], *centre = s->pad[2], *at = s->pad[3];
    memset(rows, 0, (size_t)groups * sizeof *rows);
    memset(mean, 0, (size_t)groups * sizeof *mean);
    for (int64_t k = 0; k < r->count; k++) {
        int64_t number = (int64_t)(s->place[k] / (double)r->cells * (double)groups);
        number = number < 0 ? 0 : number > groups - 1 ? groups - 1 : number;
        rows[number] += r->weight[k];
        mean[number] += r->weight[k] * r->y[k];
    }
    int64_t filled = 0;
    double low = INFINITY, high = -INFINITY;
    for (int64_t g = 0; g < groups; g++)
        if (rows[g] > 0.0) {
            mean[filled] = mean[g] / rows[g];
            low = fmin(low, mean[filled]), high = fmax(high, mean[filled]);
            centre[filled++] = ((double)g + 0.5) * (double)r->cells / (double)groups;
        }
    const int64_t n = r->cells + 3;
    for (int64_t j = 0; j < n; j++)
        at[j] = (double)j - 1.0;
    interpolated(n, at, filled, centre, mean, s->pad[4]);
    for (int64_t j = 0; j < n - 1; j++)
        at[j] = log(fmax(s->pad[4][j + 1] - s->pad[4][j], 1e-3 * (high - low) / (double)r->cells));
    smoothed(n - 1, at, 3.0, s->logs);
}

/* Places of the readings in cells of the stretch, and the normal equations there. */
static void placed(Search *s) {
    const Readings *r = &s->readings;
    int64_t near = 0;
    s->first = stretched(&s->stretch, r->x[0], 0, &near);
    s->span = last_stretched(&s->stretch, r->x[r->count - 1]) - s->first;
    near = 0;
    for (int64_t k = 0; k < r->count; k++) {
        const double share = stretched(&s->stretch, r->x[k], 0, &near) - s->first;
        const double at = share / s->span * (double)r->cells;
        s->place[k] = at < 0.0 ? 0.0 : at > (double)r->cells ? (double)r->cells : at;
    }
    Problem *p = &s->problem;
    memset(p->normal, 0, (size_t)(BANDS * p->n) * sizeof(double));
    memset(p->right, 0, (size_t)p->n * sizeof(double));
    memset(p->sums, 0, (size_t)p->n * sizeof(double));
    p->square = 0.0;
    for (int64_t k = 0; k < r->count; k++) {
        int64_t cell = (int64_t)s->place[k];
        cell = cell > r->cells - 1 ? r->cells - 1 : cell;
        double splines[SPLINES];
        b_splines(s->place[k] - (double)cell, 0, splines);
        const double y = r->y[k] - p->level;
        p->square += r->weight[k] * y * y;
        for (int a = 0; a < SPLINES; a++) {
            const double weighted = r->weight[k] * splines[a];
            p->right[cell + a] += weighted * y;
            for (int d = 0; d < SPLINES - a; d++)
                p->normal[BANDS * (cell + a) + d] += weighted * splines[a + d];
        }
    }
    for (int64_t j = 0; j < p->n; j++)
        for (int d = 0; d < SPLINES && j + d < p->n; d++) {
            p->sums[j] += p->normal[BANDS * j + d];
            p->sums[j + d] += d ? p->normal[BANDS * j + d] : 0.0;
        }
}

static void taken(Search *s) {
    const Fit other = s->best;
    s->best = s->fit;
    s->fit = other;
}

/* Most likely fit, in steps of a decade from the stiffest penalty. */
static int from_stiffest(Search *s) {
    const double *setting = s->readings.setting;
    double evidence = INFINITY;
    int worse = 0, begun = 0;
    for (double decade = setting[STIFFEST]; decade > setting[SOFTEST]; decade -= 1.0) {
        const int64_t most = (int64_t)setting[begun ? STEPS : FIRST_STEPS];
        if (rising_fit(&s->problem, decade, s->logs, most, &s->fit))
            return -1;
        memcpy(s->logs, s->fit.logs, (size_t)(s->problem.n - 1) * sizeof(double));
        if (!begun || s->fit.evidence < evidence) {
            taken(s);
            evidence = s->best.evidence;
            worse = 0;
        } else if (++worse == (int)setting[WORSE])
            break;
        begun = 1;
    }
    return 0;
}

/* Most likely fit, in steps of half a decade from a penalty near the right one. */
static int nearby(Search *s, double decade) {
    const double *setting = s->readings.setting;
    if (rising_fit(&s->problem, decade, s->logs, (int64_t)setting[FIRST_STEPS], &s->best))
        return -1;
    for (int side = -1; side <= 1; side += 2) {
        const double begun = s->best.decade;
        for (;;) {
            const double next = s->best.decade + 0.5 * side;
            if (rising_fit(&s->problem, next, s->best.logs, (int64_t)setting[STEPS], &s->fit))
                return -1;
            if (!(s->fit.evidence < s->best.evidence) ||
                !(fabs(s->fit.decade - decade) < setting[WORSE] + 1.0))
                break;
            taken(s);
        }
        if (s->best.decade != begun)
            break;
    }
    return 0;
}

/* Abscissa between the ends of the readings, and its places in cells: 16 points a cell. */
static void turned(Search *s) {
    const Readings *r = &s->readings;
    const double begin = r->x[0], end = r->x[r->count - 1];
    const int64_t points = FINE * r->cells + 1;
    int64_t near = 0;
    const double step = (end - begin) / (double)(points - 1);
    for (int64_t k = 0; k < points; k++) {
        const double x = k == points - 1 ? end : begin + (double)k * step;
        s->fine_x[k] = x;
        s->fine_place[k] =
            (stretched(&s->stretch, x, 0, &near) - s->first) / s->span * (double)r->cells;
    }
}

/* Slope dy/dx, and d2y/dx2 where asked for, of the best fit at places that do not fall. */
static void slopes(const Search *s, int64_t m, const double *place, const double *x, double *slope,
                   double *bend) {
    const int64_t cells = s->readings.cells;
    const double scale = (double)cells / s->span;
    int64_t near = 0;
    for (int64_t k = 0; k < m; k++) {
        int64_t cell = (int64_t)place[k];
        cell = cell > cells - 1 ? cells - 1 : cell;
        const double *c = s->best.coefficients + cell, t = place[k] - (double)cell;
        double w[SPLINES], v[SPLINES];
        b_splines(t, 1, w);
        const double rate = stretched(&s->stretch, x[k], 1, &near) * scale;
        const double first = w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3];
        slope[k] = first * rate;
        if (!bend)
            continue;
        b_splines(t, 2, v);
        const double second = v[0] * c[0] + v[1] * c[1] + v[2] * c[2] + v[3] * c[3];
        bend[k] = second * rate * rate + first * stretched(&s->stretch, x[k], 2, &near) * scale;
    }
}

/* Rate of change of the logarithmic slope, as its envelope: `_change` in monotone.py. */
static void changed(const Search *s, int64_t m, const double *x, double *rate, double *change) {
    const double *setting = s->readings.setting;
    double *square = s->pad[3], *bent = s->pad[4], *smooth = s->pad[5];
    gradient(m, x, rate, bent);
    for (int64_t k = 0; k < m; k++) {
        square[k] = rate[k] * rate[k];
        bent[k] *= bent[k];
    }
    smoothed(m, square, setting[SCALE_CELLS], rate);
    smoothed(m, bent, setting[SCALE_CELLS], smooth);
    for (int64_t k = 0; k < m; k++)
        square[k] += rate[k] / fmax(smooth[k], 1e-300) * bent[k];
    smoothed(m, square, setting[CHANGE_CELLS], change);
    for (int64_t k = 0; k < m; k++)
        change[k] = sqrt(change[k]);
}

/* Density (cells + 1,) of a stretch in which every change of the logarithmic slope of the best fit
 * has its share of the cells too, at abscissas x. */
static void densities(Search *s, double *x, double *density) {
    const Readings *r = &s->readings;
    const int64_t cells = r->cells, m = cells + 1;
    double *place = s->pad[0], *slope = s->pad[2], varied = 0.0;
    turned(s);
    for (int64_t k = 0; k < m; k++)
        place[k] = (double)k;
    interpolated(m, place, FINE * cells + 1, s->fine_place, s->fine_x, x);
    slopes(s, m, place, x, slope, s->logs);
    for (int64_t k = 0; k < m; k++)
        s->logs[k] /= slope[k];
    changed(s, m, x, s->logs, density);
    for (int64_t k = 1; k < m; k++)
        varied += (density[k] + density[k - 1]) / 2.0 * (x[k] - x[k - 1]);
    const double *c = s->best.coefficients, *last = c + cells;
    const double rise = (last[0] + 4.0 * last[1] + last[2] - c[0] - 4.0 * c[1] - c[2]) / 6.0;
    const double range = r->x[r->count - 1] - r->x[0];
    for (int64_t k = 0; k < m; k++)
        density[k] = 1.0 / range + slope[k] / rise + density[k] / fmax(varied, 1e-12);
}

/* Logarithms of the steps between coefficients over the new stretch, for the curve over the old. */
static void carried_over(Search *s, const Search *old) {
    const int64_t cells = s->readings.cells, m = cells + 2;
    double *place = s->pad[3], *x = s->pad[4], *slope = s->pad[5];
    int64_t near = 0, past = 0;
    turned(s);
    for (int64_t j = 0; j < m; j++)
        place[j] = fmin(fmax((double)j - 0.5, 0.0), (double)cells);
    interpolated(m, place, FINE * cells + 1, s->fine_place, s->fine_x, x);
    for (int64_t j = 0; j < m; j++) {
        const double at = (stretched(&old->stretch, x[j], 0, &past) - old->first) / old->span;
        place[j] = fmin(fmax(at * (double)cells, 0.0), (double)cells);
    }
    slopes(old, m, place, x, slope, NULL);
    for (int64_t j = 0; j < m; j++) {
        const double rate = stretched(&s->stretch, x[j], 1, &near);
        s->logs[j] = log(slope[j] / rate * s->span / (double)cells);
    }
}

/* The stretch by slope of the best fit, and that fit over it as a start. */
static int restretched(Search *s) {
    const Readings *r = &s->readings;
    const int64_t points = FINE * r->cells + 1;
    double *x = s->pad[1], *density = s->place;
    densities(s, x, density);
    Search old = *s; /* with a copy of its stretch */
    old.stretch.x = s->fine_x + points, old.stretch.power = s->fine_place + points;
    memcpy(old.stretch.x, s->stretch.x, (size_t)s->stretch.count * sizeof(double));
    memcpy(old.stretch.power, s->stretch.power, (size_t)(5 * s->stretch.count) * sizeof(double));
    if (accumulated(r->cells + 1, x, density, r->setting[STRETCH_CELLS], &s->stretch))
        return -1;
    int64_t near = 0;
    s->first = stretched(&s->stretch, r->x[0], 0, &near);
    s->span = last_stretched(&s->stretch, r->x[r->count - 1]) - s->first;
    carried_over(s, &old);
    return 0;
}

/* Root of the weight of each penalised difference: one over its expected square near there. */
static void stiffened(Search *s) {
    Problem *p = &s->problem;
    const int64_t n = p->n, m = n - 1 - ORDER;
    double *square = s->pad[0], *expected = s->pad[1], mean = 0.0;
    double *inverse = p->bands;
    for (int64_t i = 0; i < m; i++)
        p->stiffness[i] = 1.0;
    rising_differences(n, s->best.steps, p->stiffness, p->rows);
    rising_inverse(n, s->best.factor, inverse);
    for (int64_t i = 0; i < m; i++) {
        const double *row = p->rows + BANDS * i, *l = s->best.logs + i;
        double sum = 0.0;
        for (int a = 0; a < BANDS; a++)
            for (int b = a; b < BANDS; b++)
                sum += (a == b ? 1.0 : 2.0) * row[a] * row[b] * inverse[BANDS * (i + a) + b - a];
        const double bent = l[3] - 3.0 * l[2] + 3.0 * l[1] - l[0];
        square[i] = bent * bent + s->variance * fmax(sum, 0.0);
    }
    smoothed(m, square, s->readings.setting[LOCAL_CELLS], expected);
    for (int64_t i = 0; i < m; i++)
        mean += expected[i] = log(expected[i]);
    mean /= (double)m;
    for (int64_t i = 0; i < m; i++)
        p->stiffness[i] = exp(0.5 * (mean - expected[i]));
}

/* One search over the cells of the stretch; the logarithms to begin from are in s->logs. */
static int searched(Search *s, int first) {
    if (first ? from_stiffest(s) : nearby(s, s->decade))
        return -1;
    s->decade = s->best.decade;
    s->variance = s->best.objective / (double)(s->readings.count - ORDER);
    return 0;
}

static int found(Search *s) {
    if (pilot_stretch(s))
        return -1;
    for (int64_t i = 0; i < s->problem.n - 1 - ORDER; i++)
        s->problem.stiffness[i] = 1.0;
    placed(s);
    first_logs(s);
    if (searched(s, 1) || restretched(s))
        return -1;
    placed(s);
    if (searched(s, 0))
        return -1;
    for (int round = 0; round < (int)s->readings.setting[LOCAL_ROUNDS]; round++) {
        stiffened(s);
        memcpy(s->logs, s->best.logs, (size_t)(s->problem.n - 1) * sizeof(double));
        if (searched(s, 0))
            return -1;
    }
    return 0;
}

static double *carved(double **room, int64_t size) {
    double *begin = *room;
    *room += size;
    return begin;
}

static void laid_out(Search *s, double *room) {
    const int64_t n = s->problem.n, points = FINE * s->readings.cells + 1;
    const int64_t count = s->readings.count;
    const int64_t longest = n + 8 > (int64_t)s->readings.setting[PILOT_BLOCKS] + 8
                                ? n + 8 : (int64_t)s->readings.setting[PILOT_BLOCKS] + 8;
    Problem *p = &s->problem;
    p->normal = carved(&room, BANDS * n), p->right = carved(&room, n), p->sums = carved(&room, n);
    p->stiffness = carved(&room, n), p->rows = carved(&room, BANDS * n);
    p->bands = carved(&room, BANDS * n), p->solved = carved(&room, n + BANDS);
    Fit *fits[2] = {&s->best, &s->fit};
    for (int k = 0; k < 2; k++) {
        fits[k]->logs = carved(&room, n), fits[k]->steps = carved(&room, n);
        fits[k]->coefficients = carved(&room, n), fits[k]->factor = carved(&room, BANDS * n);
    }
    s->place = carved(&room, count + longest), s->logs = carved(&room, longest);
    s->fine_x = carved(&room, points + longest);
    s->fine_place = carved(&room, points + 5 * longest);
    for (int k = 0; k < 6; k++)
        s->pad[k] = carved(&room, longest);
    s->stretch.x = carved(&room, longest), s->stretch.power = carved(&room, 5 * longest);
}

/* Rising curve through readings (count,). coefficients (n,), cholesky and inverse (BANDS, n) and
 * the stretch's breakpoints (n + 256,) and powers (n + 256, 5) are written; scalars: variance,
 * first, span, decade. Gives the number of breakpoints, or -1 where there is no solution. */
int64_t rising_curve(int64_t count, const double *x, const double *y, const double *weight,
                     int64_t cells, const double *setting, double *coefficients, double *cholesky,
                     double *inverse, double *breakpoints, double *power, double *scalars) {
    Search s = {.readings = {count, cells, x, y, weight, setting}};
    const int64_t n = cells + 3, longest = n + (int64_t)setting[PILOT_BLOCKS] + 8;
    s.problem.n = n, s.problem.readings = count, s.problem.limits = setting + RELATIVE_CHANGE;
    const size_t size = (size_t)(40 * n + count + 2 * FINE * cells + 24 * longest);
    double *room = malloc(size * sizeof *room), whole = 0.0, sum = 0.0;
    if (!room)
        return -1;
    laid_out(&s, room);
    for (int64_t k = 0; k < count; k++) {
        whole += weight[k];
        sum += weight[k] * y[k];
    }
    s.problem.level = sum / whole;
    const int failed = found(&s);
    if (!failed) {
        rising_inverse(n, s.best.factor, s.problem.bands);
        for (int64_t j = 0; j < n; j++) {
            coefficients[j] = s.best.coefficients[j] + s.problem.level;
            const double pivot = sqrt(s.best.factor[BANDS * j]);
            for (int d = 0; d < BANDS; d++) {
                cholesky[d * n + j] = d ? s.best.factor[BANDS * j + d] * pivot : pivot;
                inverse[d * n + j] = s.problem.bands[BANDS * j + d];
            }
        }
        memcpy(breakpoints, s.stretch.x, (size_t)s.stretch.count * sizeof(double));
        memcpy(power, s.stretch.power, (size_t)(5 * (s.stretch.count - 1)) * sizeof(double));
        scalars[0] = s.variance, scalars[1] = s.first, scalars[2] = s.span, scalars[3] = s.decade;
    }
    free(room);
    return failed ? -1 : s.stretch.count;
}

/* Abscissa, value, slope and second derivative (4, m) of a fitted curve at places (m,) in cells
 * that do not fall. `range`: of the readings; breakpoints (number,), power (number - 1, 5). Gives
 * 0, or -1 without memory. */
int64_t rising_course(int64_t m, const double *place, int64_t cells, const double *coefficients,
                      int64_t number, double *breakpoints, double *power, const double *range,
                      double first, double span, double *course) {
    Search s = {.readings = {.count = 2, .cells = cells, .x = range}};
    s.stretch = (Stretch){number, breakpoints, power};
    s.first = first, s.span = span;
    double *room = malloc((size_t)(2 * (FINE * cells + 1) + cells + 3) * sizeof *room);
    if (!room)
        return -1;
    s.fine_x = room, s.fine_place = room + FINE * cells + 1;
    s.best.coefficients = s.fine_place + FINE * cells + 1;
    memcpy(s.best.coefficients, coefficients, (size_t)(cells + 3) * sizeof *room);
    turned(&s);
    interpolated(m, place, FINE * cells + 1, s.fine_place, s.fine_x, course);
    slopes(&s, m, place, course, course + 2 * m, course + 3 * m);
    for (int64_t k = 0; k < m; k++) {
        int64_t cell = (int64_t)place[k];
        cell = cell > cells - 1 ? cells - 1 : cell;
        double w[SPLINES];
        b_splines(place[k] - (double)cell, 0, w);
        const double *c = coefficients + cell;
        course[m + k] = w[0] * c[0] + w[1] * c[1] + w[2] * c[2] + w[3] * c[3];
    }
    free(room);
    return 0;
}
