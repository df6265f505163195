/* A battery that is stepped in time: a cell, or a pack of cells. fmi3.c gives it the FMI's face. */
#ifndef BATTERY_H
#define BATTERY_H

#include <stddef.h>

enum { TOKEN = 64, MESSAGE = 200, NAME = 32 };

/* Named tables of the file resources/battery.bin, which the pipeline writes. */
typedef struct {
    char token[TOKEN + 1];
    size_t arrays;
    char (*name)[NAME];
    size_t *count;
    double **values;
    double *memory;
} tables;

/* Numbers of a table and, where asked, how many; NULL where there is none of this name. */
double *array_of(const tables *t, const char *name, size_t *count);

/* What the outside sees at one moment. `cell_` arrays have one number a cell. */
typedef struct {
    double voltage_volt;
    double *cell_current_ampere, *cell_voltage_volt, *cell_soc, *cell_celsius;
} reading;

/* Numbers of a table; NULL, and why, where there are others than wanted. */
const double *of_size(const tables *t, const char *name, size_t wanted, char *why);

typedef struct battery battery;

/* A battery of these tables; NULL, and why not, where they do not belong together. */
battery *battery_of(const tables *t, char why[MESSAGE]);
void battery_free(battery *b);
size_t battery_cells(const battery *b);
/* How many numbers its state takes. */
size_t battery_states(const battery *b);
/* State at rest at these SoC (one a cell) and this temperature of the surroundings, before a current
 * of this direction. */
void battery_rest(const battery *b, const double *soc, double celsius, double ampere,
                  double *state);
/* The state after `second` at a held current, positive on charge; zero seconds leave what the cells
 * remember. The reading is that at the end. Returns NULL, or why it cannot be computed. */
const char *battery_step(battery *b, double second, double ampere, double ambient_celsius,
                         double *state, reading *r);

#endif
