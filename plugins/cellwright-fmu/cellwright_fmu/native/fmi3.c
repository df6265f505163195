/* FMI 3.0 for co-simulation around battery.h: instances, variables, modes, steps, states, words.
 *
 * The current is held over a communication step. Outputs are those at the present time and
 * inputs; they are computed when they are asked for. A step that cannot be computed leaves the
 * instance as it was, returns fmi3Error, and says why through the logger. */
#include "battery.h"
#include "fmi3Functions.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

enum {
    TIME, CURRENT, AMBIENT, INITIAL_SOC, LARGEST_STEP,
    VOLTAGE, SOC, LEAST_SOC, LARGEST_SOC, CELSIUS,
    CELL_CURRENT, CELL_VOLTAGE, CELL_SOC, CELL_CELSIUS, VARIABLES
};
typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED } mode;
/* What an instance holds between calls, one number after the other: these, SoC at the start of each
 * cell, the state of the battery. */
enum { AT_TIME, AT_CURRENT, AT_AMBIENT, AT_LARGEST_STEP, AT_MODE, AT_STARTED, FIXED };

typedef struct {
    char *name;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
    tables tables;
    battery *battery;
    size_t cells, numbers;
    double *held;      /* FIXED + cells + states */
    double *tried;     /* the same, of a step that may fail */
    double *at_start;  /* the same, as instantiated */
    double *outputs;   /* 4 × cells */
    reading now;
    int read;          /* whether `now` is of the present state and inputs */
} instance;

static fmi3Status say(instance *i, fmi3Status status, const char *words, ...) {
    char text[400];
    va_list more;
    va_start(more, words);
    vsnprintf(text, sizeof text, words, more);
    va_end(more);
    if (i && i->log)
        i->log(i->environment, status, status >= fmi3Error ? "error" : "warning", text);
    return status;
}

/* ---- tables ---- */

double *array_of(const tables *t, const char *name, size_t *count) {
    for (size_t k = 0; k < t->arrays; k++)
        if (strcmp(t->name[k], name) == 0) {
            if (count) *count = t->count[k];
            return t->values[k];
        }
    if (count) *count = 0;
    return NULL;
}

const double *of_size(const tables *t, const char *name, size_t wanted, char *why) {
    size_t count;
    const double *values = array_of(t, name, &count);
    if (values && count == wanted) return values;
    if (!*why)
        snprintf(why, MESSAGE, "table %s has %lu numbers, wanted %lu", name,
                 (unsigned long)count, (unsigned long)wanted);
    return NULL;
}

static void free_tables(tables *t) {
    free(t->name);
    free(t->count);
    free(t->values);
    free(t->memory);
    memset(t, 0, sizeof *t);
}

static int64_t whole(const unsigned char *bytes) {
    uint64_t value = 0;
    for (int k = 7; k >= 0; k--) value = value << 8 | bytes[k];
    return (int64_t)value;
}

/* The file: 16 bytes of name, the token, the number of arrays, of each name and count, the numbers;
 * all little-endian. Returns NULL, or what is wrong. */
static const char *read_tables(FILE *file, tables *t) {
    unsigned char head[16 + TOKEN + 8], entry[NAME + 8];
    if (fread(head, 1, sizeof head, file) != sizeof head || memcmp(head, "cellwright-fmu/1", 16))
        return "is no file of this FMU";
    memcpy(t->token, head + 16, TOKEN);
    const int64_t arrays = whole(head + 16 + TOKEN);
    if (arrays < 1 || arrays > 100) return "holds an impossible number of tables";
    t->name = calloc((size_t)arrays, sizeof *t->name);
    t->count = calloc((size_t)arrays, sizeof *t->count);
    t->values = calloc((size_t)arrays, sizeof *t->values);
    if (!t->name || !t->count || !t->values) return "needs more memory than there is";
    size_t total = 0;
    for (t->arrays = 0; t->arrays < (size_t)arrays; t->arrays++) {
        if (fread(entry, 1, sizeof entry, file) != sizeof entry) return "ends too early";
        memcpy(t->name[t->arrays], entry, NAME - 1);
        const int64_t count = whole(entry + NAME);
        if (count < 0 || count > (int64_t)1 << 40) return "holds an impossible size";
        t->count[t->arrays] = (size_t)count;
        total += (size_t)count;
    }
    t->memory = malloc((total ? total : 1) * sizeof(double));
    if (!t->memory) return "needs more memory than there is";
    for (size_t k = 0; k < total; k++) {
        unsigned char bytes[8];
        if (fread(bytes, 1, 8, file) != 8) return "ends too early";
        const int64_t bits = whole(bytes);
        memcpy(t->memory + k, &bits, 8);
    }
    double *at = t->memory;
    for (size_t k = 0; k < t->arrays; at += t->count[k++]) t->values[k] = at;
    return fgetc(file) == EOF ? NULL : "holds more than it should";
}

/* ---- creation ---- */

static void release(instance *i) {
    if (!i) return;
    if (i->battery) battery_free(i->battery);
    free_tables(&i->tables);
    free(i->name);
    free(i->held);
    free(i->tried);
    free(i->at_start);
    free(i->outputs);
    free(i);
}

static instance *refused(instance *i, const char *words, const char *what, const char *why) {
    say(i, fmi3Error, words, what, why);
    release(i);
    return NULL;
}

static int lay_out(instance *i) {
    i->cells = battery_cells(i->battery);
    i->numbers = FIXED + i->cells + battery_states(i->battery);
    i->held = calloc(i->numbers, sizeof(double));
    i->tried = calloc(i->numbers, sizeof(double));
    i->at_start = calloc(i->numbers, sizeof(double));
    i->outputs = calloc(4 * i->cells, sizeof(double));
    if (!i->held || !i->tried || !i->at_start || !i->outputs) return 0;
    i->now.cell_current_ampere = i->outputs;
    i->now.cell_voltage_volt = i->outputs + i->cells;
    i->now.cell_soc = i->outputs + 2 * i->cells;
    i->now.cell_celsius = i->outputs + 3 * i->cells;
    size_t count;
    const double *start = array_of(&i->tables, "initial_soc", &count);
    const double *settings = array_of(&i->tables, "settings", NULL);
    if (!start || count != i->cells || !settings) return 0;
    memcpy(i->held + FIXED, start, count * sizeof(double));
    i->held[AT_AMBIENT] = settings[0];
    i->held[AT_LARGEST_STEP] = settings[1];
    memcpy(i->at_start, i->held, i->numbers * sizeof(double));
    return 1;
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3Boolean event_mode, fmi3Boolean early_return,
    const fmi3ValueReference intermediate[], size_t intermediates,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3IntermediateUpdateCallback update) {
    (void)visible, (void)logging, (void)event_mode, (void)early_return;
    (void)intermediate, (void)intermediates, (void)update;
    instance *i = calloc(1, sizeof *i);
    if (!i) return NULL;
    i->environment = environment;
    i->log = log;
    if (!name || !*name) return refused(i, "an instance needs a name%s%s", "", "");
    i->name = malloc(strlen(name) + 1);
    if (i->name) strcpy(i->name, name);
    if (!resources) return refused(i, "no path of the resources is given%s%s", "", "");
    const size_t length = strlen(resources);
    char *path = malloc(length + 16);
    if (!path || !i->name) {
        free(path);
        return refused(i, "no memory%s%s", "", "");
    }
    const int ended = length && (resources[length - 1] == '/' || resources[length - 1] == '\\');
    sprintf(path, "%s%sbattery.bin", resources, ended ? "" : "/");
    FILE *file = fopen(path, "rb");
    const char *wrong = file ? read_tables(file, &i->tables) : "cannot be opened";
    if (file) fclose(file);
    if (wrong) {
        say(i, fmi3Error, "%s %s", path, wrong);
        free(path);
        release(i);
        return NULL;
    }
    free(path);
    if (!token || strcmp(token, i->tables.token))
        return refused(i, "instantiation token is %s, wanted %s", token ? token : "none",
                       i->tables.token);
    char why[MESSAGE] = "";
    i->battery = battery_of(&i->tables, why);
    if (!i->battery) return refused(i, "%s%s", why, "");
    if (!lay_out(i)) return refused(i, "the tables of the FMU are not whole%s%s", "", "");
    return i;
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    if (log) log(environment, fmi3Error, "error", "this FMU is for co-simulation only");
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible,
    fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
    fmi3ClockUpdateCallback clock, fmi3LockPreemptionCallback lock,
    fmi3UnlockPreemptionCallback unlock) {
    (void)name, (void)token, (void)resources, (void)visible, (void)logging;
    (void)clock, (void)lock, (void)unlock;
    if (log) log(environment, fmi3Error, "error", "this FMU is for co-simulation only");
    return NULL;
}

void fmi3FreeInstance(fmi3Instance given) { release(given); }

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance given, fmi3Boolean on, size_t n,
                               const fmi3String categories[]) {
    (void)on, (void)n, (void)categories;
    return given ? fmi3OK : fmi3Error;
}

/* ---- modes ---- */

static mode mode_of(const instance *i) { return (mode)i->held[AT_MODE]; }

static void set_mode(instance *i, mode to) { i->held[AT_MODE] = (double)to; }

static double *state_of(const instance *i, double *held) { return held + FIXED + i->cells; }

static fmi3Status wrong_mode(instance *i, const char *called) {
    static const char *const names[] = {"instantiated", "initialization", "step", "terminated"};
    return say(i, fmi3Error, "%s is not allowed in %s mode", called, names[mode_of(i)]);
}

/* Before the first step the state is that of rest at the SoC that is set. */
static void begin(instance *i) {
    battery_rest(i->battery, i->held + FIXED, i->held[AT_AMBIENT], i->held[AT_CURRENT],
                 state_of(i, i->held));
    i->read = 0;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance given, fmi3Boolean tolerance_defined,
                                       fmi3Float64 tolerance, fmi3Float64 start,
                                       fmi3Boolean stop_defined, fmi3Float64 stop) {
    (void)tolerance_defined, (void)tolerance;
    instance *i = given;
    if (!i) return fmi3Error;
    if (mode_of(i) != INSTANTIATED) return wrong_mode(i, "fmi3EnterInitializationMode");
    if (!isfinite(start) || (stop_defined && !(stop >= start)))
        return say(i, fmi3Error, "start %g s and stop %g s are no span of time", start, stop);
    i->held[AT_TIME] = start;
    set_mode(i, INITIALIZING);
    begin(i);
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance given) {
    instance *i = given;
    if (!i) return fmi3Error;
    if (mode_of(i) != INITIALIZING) return wrong_mode(i, "fmi3ExitInitializationMode");
    begin(i);
    set_mode(i, STEPPING);
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance given) {
    instance *i = given;
    return i && mode_of(i) == STEPPING ? fmi3OK : fmi3Error;
}

fmi3Status fmi3Terminate(fmi3Instance given) {
    instance *i = given;
    if (!i) return fmi3Error;
    if (mode_of(i) != STEPPING) return wrong_mode(i, "fmi3Terminate");
    set_mode(i, TERMINATED);
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance given) {
    instance *i = given;
    if (!i) return fmi3Error;
    memcpy(i->held, i->at_start, i->numbers * sizeof(double));
    i->read = 0;
    return fmi3OK;
}

/* ---- steps ---- */

static fmi3Status look(instance *i) {
    if (i->read) return fmi3OK;
    if (mode_of(i) == INSTANTIATED || mode_of(i) == INITIALIZING) begin(i);
    memcpy(i->tried, i->held, i->numbers * sizeof(double)); /* to look changes nothing */
    const char *why = battery_step(i->battery, 0.0, i->held[AT_CURRENT], i->held[AT_AMBIENT],
                                   state_of(i, i->tried), &i->now);
    if (why) return say(i, fmi3Error, "at %g s: %s", i->held[AT_TIME], why);
    i->read = 1;
    return fmi3OK;
}

static fmi3Status run(instance *i, double second) {
    const double pieces = ceil(second / i->held[AT_LARGEST_STEP] - 1e-9);
    if (!(pieces < 1e9)) return say(i, fmi3Error, "a step of %g s is too long", second);
    const int64_t n = pieces > 1.0 ? (int64_t)pieces : 1;
    memcpy(i->tried, i->held, i->numbers * sizeof(double));
    for (int64_t k = 0; k < n; k++) {
        const char *why = battery_step(i->battery, second / (double)n, i->held[AT_CURRENT],
                                       i->held[AT_AMBIENT], state_of(i, i->tried), &i->now);
        if (why) {
            i->read = 0;
            return say(i, fmi3Error, "in the step from %g s: %s", i->held[AT_TIME], why);
        }
    }
    memcpy(i->held, i->tried, i->numbers * sizeof(double));
    return fmi3OK;
}

/* Outside of 0 to 1 the SoC is where no test has been: said once. A thousandth is let pass, by which
 * a cell that starts full may be moved by its neighbours. */
static fmi3Status within(instance *i) {
    for (size_t c = 0; c < i->cells; c++)
        if (!(i->now.cell_soc[c] >= -0.001 && i->now.cell_soc[c] <= 1.001)) {
            if (i->held[AT_STARTED] < 2.0)
                say(i, fmi3Warning,
                    "SoC of cell %d is %.4f at %g s: outside 0 to 1 the model is not known",
                    (int)c + 1, i->now.cell_soc[c], i->held[AT_TIME]);
            i->held[AT_STARTED] = 2.0;
            return fmi3OK;
        }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance given, fmi3Float64 point, fmi3Float64 step,
                      fmi3Boolean no_set_state, fmi3Boolean *event, fmi3Boolean *terminate,
                      fmi3Boolean *early, fmi3Float64 *last) {
    (void)no_set_state;
    instance *i = given;
    if (!i) return fmi3Error;
    if (event) *event = fmi3False;
    if (terminate) *terminate = fmi3False;
    if (early) *early = fmi3False;
    if (last) *last = i->held[AT_TIME];
    if (mode_of(i) != STEPPING) return wrong_mode(i, "fmi3DoStep");
    if (!(step > 0.0) || !isfinite(step))
        return say(i, fmi3Error, "communication step is %g s, wanted one above zero", step);
    if (!(fabs(point - i->held[AT_TIME]) <= 1e-6 * step + 1e-12 * fabs(point)))
        return say(i, fmi3Error, "step from %.9g s, but the time is %.9g s", point,
                   i->held[AT_TIME]);
    if (run(i, step) != fmi3OK) return fmi3Error;
    i->held[AT_TIME] = point + step;
    i->read = 0;
    if (last) *last = i->held[AT_TIME];
    if (look(i) != fmi3OK) return fmi3Error;
    return within(i);
}

/* ---- variables ---- */

static size_t size_of(const instance *i, fmi3ValueReference r) {
    return r == INITIAL_SOC || r >= CELL_CURRENT ? i->cells : 1;
}

static double extreme(const double *values, size_t n, int largest) {
    double best = values[0];
    for (size_t k = 1; k < n; k++)
        if (largest ? values[k] > best : values[k] < best) best = values[k];
    return best;
}

static double mean(const double *values, size_t n) {
    double sum = 0.0;
    for (size_t k = 0; k < n; k++) sum += values[k];
    return sum / (double)n;
}

static void copy_out(const instance *i, fmi3ValueReference r, double *to) {
    const reading *now = &i->now;
    const double *from = NULL;
    switch (r) {
    case TIME: *to = i->held[AT_TIME]; return;
    case CURRENT: *to = i->held[AT_CURRENT]; return;
    case AMBIENT: *to = i->held[AT_AMBIENT]; return;
    case LARGEST_STEP: *to = i->held[AT_LARGEST_STEP]; return;
    case VOLTAGE: *to = now->voltage_volt; return;
    case SOC: *to = mean(now->cell_soc, i->cells); return;
    case LEAST_SOC: *to = extreme(now->cell_soc, i->cells, 0); return;
    case LARGEST_SOC: *to = extreme(now->cell_soc, i->cells, 1); return;
    case CELSIUS: *to = extreme(now->cell_celsius, i->cells, 1); return;
    case INITIAL_SOC: from = i->held + FIXED; break;
    case CELL_CURRENT: from = now->cell_current_ampere; break;
    case CELL_VOLTAGE: from = now->cell_voltage_volt; break;
    case CELL_SOC: from = now->cell_soc; break;
    default: from = now->cell_celsius;
    }
    memcpy(to, from, i->cells * sizeof(double));
}

/* Whether the references are known and their values as many as given. */
static fmi3Status asked(instance *i, const fmi3ValueReference refs[], size_t n, size_t values) {
    size_t total = 0;
    for (size_t k = 0; k < n; k++) {
        if (refs[k] >= VARIABLES)
            return say(i, fmi3Error, "no variable has the value reference %u", (unsigned)refs[k]);
        total += size_of(i, refs[k]);
    }
    if (total == values) return fmi3OK;
    return say(i, fmi3Error, "%lu values, wanted %lu", (unsigned long)values, (unsigned long)total);
}

fmi3Status fmi3GetFloat64(fmi3Instance given, const fmi3ValueReference refs[], size_t n,
                          fmi3Float64 values[], size_t count) {
    instance *i = given;
    if (!i || asked(i, refs, n, count) != fmi3OK) return fmi3Error;
    for (size_t k = 0; k < n; k++) {
        if (refs[k] >= VOLTAGE && look(i) != fmi3OK) return fmi3Error;
        copy_out(i, refs[k], values);
        values += size_of(i, refs[k]);
    }
    return fmi3OK;
}

static fmi3Status set_start(instance *i, const double *values) {
    if (mode_of(i) != INSTANTIATED && mode_of(i) != INITIALIZING)
        return say(i, fmi3Error, "initial_soc is set before the first step only");
    for (size_t c = 0; c < i->cells; c++)
        if (!(values[c] >= 0.0 && values[c] <= 1.0))
            return say(i, fmi3Error, "initial_soc of cell %d is %g, wanted 0 to 1", (int)c + 1,
                       values[c]);
    memcpy(i->held + FIXED, values, i->cells * sizeof(double));
    return fmi3OK;
}

static fmi3Status set_one(instance *i, fmi3ValueReference r, const double *values) {
    const double value = *values;
    if (r == INITIAL_SOC) return set_start(i, values);
    if (r == CURRENT && isfinite(value)) {
        i->held[AT_CURRENT] = value;
    } else if (r == AMBIENT && value > -100.0 && value < 200.0) {
        i->held[AT_AMBIENT] = value;
    } else if (r == LARGEST_STEP && value > 0.0 && isfinite(value)) {
        i->held[AT_LARGEST_STEP] = value;
    } else if (r == CURRENT) {
        return say(i, fmi3Error, "current_ampere is %g, wanted a finite number", value);
    } else if (r == AMBIENT) {
        return say(i, fmi3Error, "ambient_temperature_celsius is %g, wanted -100 to 200", value);
    } else if (r == LARGEST_STEP) {
        return say(i, fmi3Error, "largest_step_second is %g, wanted a number above zero", value);
    } else {
        return say(i, fmi3Error, "the variable of value reference %u cannot be set", (unsigned)r);
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance given, const fmi3ValueReference refs[], size_t n,
                          const fmi3Float64 values[], size_t count) {
    instance *i = given;
    if (!i || asked(i, refs, n, count) != fmi3OK) return fmi3Error;
    for (size_t k = 0; k < n; k++) {
        if (set_one(i, refs[k], values) != fmi3OK) return fmi3Error;
        values += size_of(i, refs[k]);
    }
    i->read = 0;
    return fmi3OK;
}

/* ---- state ---- */

typedef struct {
    size_t numbers;
    double held[];
} snapshot;

static snapshot *kept(instance *i, snapshot *before) {
    snapshot *s = before ? before : malloc(sizeof *s + i->numbers * sizeof(double));
    if (s) s->numbers = i->numbers;
    return s;
}

fmi3Status fmi3GetFMUState(fmi3Instance given, fmi3FMUState *state) {
    instance *i = given;
    if (!i || !state) return fmi3Error;
    snapshot *s = kept(i, *state);
    if (!s) return say(i, fmi3Error, "no memory for a state");
    memcpy(s->held, i->held, i->numbers * sizeof(double));
    *state = s;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance given, fmi3FMUState state) {
    instance *i = given;
    const snapshot *s = state;
    if (!i || !s || s->numbers != i->numbers) return say(i, fmi3Error, "a state of another FMU");
    memcpy(i->held, s->held, i->numbers * sizeof(double));
    i->read = 0;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance given, fmi3FMUState *state) {
    (void)given;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return fmi3OK;
}

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance given, fmi3FMUState state, size_t *size) {
    instance *i = given;
    if (!i || !state || !size) return fmi3Error;
    *size = i->numbers * sizeof(double);
    return fmi3OK;
}

fmi3Status fmi3SerializeFMUState(fmi3Instance given, fmi3FMUState state, fmi3Byte bytes[],
                                 size_t size) {
    instance *i = given;
    const snapshot *s = state;
    if (!i || !s || size != i->numbers * sizeof(double))
        return say(i, fmi3Error, "a serialized state has another size");
    memcpy(bytes, s->held, size);
    return fmi3OK;
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance given, const fmi3Byte bytes[], size_t size,
                                   fmi3FMUState *state) {
    instance *i = given;
    if (!i || !state || size != i->numbers * sizeof(double))
        return say(i, fmi3Error, "a serialized state has another size");
    snapshot *s = kept(i, *state);
    if (!s) return say(i, fmi3Error, "no memory for a state");
    memcpy(s->held, bytes, size);
    *state = s;
    return fmi3OK;
}

/* ---- what this FMU has not ---- */

static fmi3Status none(fmi3Instance given, const char *what) {
    return say(given, fmi3Error, "%s is not part of this FMU", what);
}

#define NO_VALUES(Type)                                                                          \
    fmi3Status fmi3Get##Type(fmi3Instance i, const fmi3ValueReference r[], size_t n,             \
                             fmi3##Type v[], size_t m) {                                         \
        (void)r, (void)v, (void)m;                                                               \
        return n ? none(i, "a variable of type " #Type) : fmi3OK;                                \
    }                                                                                            \
    fmi3Status fmi3Set##Type(fmi3Instance i, const fmi3ValueReference r[], size_t n,             \
                             const fmi3##Type v[], size_t m) {                                   \
        (void)r, (void)v, (void)m;                                                               \
        return n ? none(i, "a variable of type " #Type) : fmi3OK;                                \
    }
NO_VALUES(Float32)
NO_VALUES(Int8)
NO_VALUES(UInt8)
NO_VALUES(Int16)
NO_VALUES(UInt16)
NO_VALUES(Int32)
NO_VALUES(UInt32)
NO_VALUES(Int64)
NO_VALUES(UInt64)
NO_VALUES(Boolean)
NO_VALUES(String)

#define REFS const fmi3ValueReference r[], size_t n
#define NOT_HERE(name, ...)                                                                      \
    fmi3Status fmi3##name(fmi3Instance i, __VA_ARGS__) { return none(i, "fmi3" #name); }
#pragma GCC diagnostic ignored "-Wunused-parameter"
NOT_HERE(GetBinary, REFS, size_t s[], fmi3Binary v[], size_t m)
NOT_HERE(SetBinary, REFS, const size_t s[], const fmi3Binary v[], size_t m)
NOT_HERE(GetClock, REFS, fmi3Clock v[])
NOT_HERE(SetClock, REFS, const fmi3Clock v[])
NOT_HERE(GetNumberOfVariableDependencies, fmi3ValueReference r, size_t *n)
NOT_HERE(GetVariableDependencies, fmi3ValueReference r, size_t a[], fmi3ValueReference b[],
         size_t c[], fmi3DependencyKind k[], size_t n)
NOT_HERE(GetDirectionalDerivative, REFS, const fmi3ValueReference k[], size_t m,
         const fmi3Float64 seed[], size_t s, fmi3Float64 v[], size_t t)
NOT_HERE(GetAdjointDerivative, REFS, const fmi3ValueReference k[], size_t m,
         const fmi3Float64 seed[], size_t s, fmi3Float64 v[], size_t t)
NOT_HERE(GetIntervalDecimal, REFS, fmi3Float64 v[], fmi3IntervalQualifier q[])
NOT_HERE(GetIntervalFraction, REFS, fmi3UInt64 c[], fmi3UInt64 s[], fmi3IntervalQualifier q[])
NOT_HERE(GetShiftDecimal, REFS, fmi3Float64 v[])
NOT_HERE(GetShiftFraction, REFS, fmi3UInt64 c[], fmi3UInt64 s[])
NOT_HERE(SetIntervalDecimal, REFS, const fmi3Float64 v[])
NOT_HERE(SetIntervalFraction, REFS, const fmi3UInt64 c[], const fmi3UInt64 s[])
NOT_HERE(SetShiftDecimal, REFS, const fmi3Float64 v[])
NOT_HERE(SetShiftFraction, REFS, const fmi3UInt64 c[], const fmi3UInt64 s[])
NOT_HERE(UpdateDiscreteStates, fmi3Boolean *a, fmi3Boolean *b, fmi3Boolean *c, fmi3Boolean *d,
         fmi3Boolean *e, fmi3Float64 *t)
NOT_HERE(CompletedIntegratorStep, fmi3Boolean a, fmi3Boolean *b, fmi3Boolean *c)
NOT_HERE(SetTime, fmi3Float64 t)
NOT_HERE(SetContinuousStates, const fmi3Float64 x[], size_t n)
NOT_HERE(GetContinuousStateDerivatives, fmi3Float64 x[], size_t n)
NOT_HERE(GetEventIndicators, fmi3Float64 x[], size_t n)
NOT_HERE(GetContinuousStates, fmi3Float64 x[], size_t n)
NOT_HERE(GetNominalsOfContinuousStates, fmi3Float64 x[], size_t n)
NOT_HERE(GetNumberOfEventIndicators, size_t *n)
NOT_HERE(GetNumberOfContinuousStates, size_t *n)
NOT_HERE(GetOutputDerivatives, REFS, const fmi3Int32 o[], fmi3Float64 v[], size_t m)
NOT_HERE(ActivateModelPartition, fmi3ValueReference r, fmi3Float64 t)

fmi3Status fmi3EnterEventMode(fmi3Instance i) { return none(i, "event mode"); }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance i) { return none(i, "event mode"); }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance i) { return none(i, "model exchange"); }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance i) { return none(i, "configuration mode"); }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance i) { return none(i, "configuration mode"); }
