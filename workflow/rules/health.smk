# Health over a life: fade with knee and remaining cycles, ratings of check-ups, state of health.

FOLLOWED = dict.fromkeys(
    cell for cell in CELLS if len(tests(cell, "ica")) >= 2 or tests(cell, "ageing")
)


rule ica_life:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        cycles="results/stages/ageing_cycles/{cell}/{test}.parquet",
    output:
        peaks="results/stages/ica_life/{cell}/{test}.parquet",
        curves="results/stages/ica_life_curve/{cell}/{test}.parquet",
    log:
        "logs/ica_life/{cell}/{test}.log",
    params:
        prominence=config["ica"]["prominence"],
    message:
        "Incremental capacity of {wildcards.cell} in charges over the life of {wildcards.test}."
    script:
        "../../scripts/health/ica_life.py"


rule ica_tracks:
    input:
        check_ups=PLAN.own_artefacts("ica", "ica"),
        curves=PLAN.own_artefacts("ica_curve", "ica"),
        lives=PLAN.own_artefacts("ica_life", "ageing"),
    output:
        "results/stages/ica_tracks/{cell}.parquet",
    log:
        "logs/ica_tracks/{cell}.log",
    wildcard_constraints:
        cell=either(FOLLOWED),
    params:
        tests=facts_of_own_tests,
        chemistry=PLAN.column("chemistry"),
    message:
        "Peaks of incremental capacity of {wildcards.cell}, followed through its life."
    script:
        "../../scripts/health/ica_tracks.py"


# State of health: what slow curves of check-ups tell of lithium and active material lost.

SLOW_CURVE_KINDS = ("ocv", "ica")


def fresh_cells(cell):
    """The marked cell of the type that stands for the fresh state of a cell with one check-up."""
    marked = [c for c in references(cell) if PLAN.cycles(c, *SLOW_CURVE_KINDS)]
    return marked[:1] if len(PLAN.cycles(cell, *SLOW_CURVE_KINDS)) == 1 else []


def aged_by_rests(cell):
    """Whether two check-ups or more have a pulse test whose rests are an open-circuit voltage."""
    return len({row["cycle"] or 0 for row in resting(cell)}) >= 2


AGED_SLOWLY = dict.fromkeys(
    cell for cell in CELLS if len(PLAN.cycles(cell, *SLOW_CURVE_KINDS)) >= 2
)
DEGRADED = dict.fromkeys(
    cell for cell in CELLS if cell in AGED_SLOWLY or fresh_cells(cell) or aged_by_rests(cell)
)


def half_cells_of(cell):
    """What the sheet says of a cell's half cells, and its chemistry."""
    names = ("chemistry", "negative_half_cell", "positive_half_cell")
    return {name: CELLS[cell].get(name) for name in names}


def half_cell_contents(cell):
    """What the files of a cell's half cells hold; one that is not there the job refuses."""
    return contents_of(PLAN.half_cell_files(cell))


rule degradation_modes:
    input:
        own=PLAN.own_fitted("clean", *SLOW_CURVE_KINDS),
        fresh=PLAN.fitted_of(fresh_cells, "clean", *SLOW_CURVE_KINDS),
        rests=PLAN.own_rows("ocv_rest_points", resting),
        half_cells=own(lambda cell: [local(file) for file in half_cell_contents(cell)]),
    output:
        "results/stages/degradation_modes/{cell}.parquet",
    log:
        "logs/degradation_modes/{cell}.log",
    wildcard_constraints:
        cell=either(DEGRADED),
    params:
        cell=cell_facts,
        materials=own(half_cells_of),
        content=own(half_cell_contents),
        fresh=PLAN.facts_of_cells(fresh_cells),
    message:
        "Lithium and active material lost by {wildcards.cell}, from slow curves or rests."
    script:
        "../../scripts/health/degradation_modes.py"


rule plateau_losses:
    input:
        PLAN.own_fitted("clean", *SLOW_CURVE_KINDS),
    output:
        "results/stages/plateau_losses/{cell}.parquet",
    log:
        "logs/plateau_losses/{cell}.log",
    wildcard_constraints:
        cell=either(AGED_SLOWLY),
    params:
        cell=cell_facts,
    message:
        "Charge lost by each plateau of {wildcards.cell} between its check-ups."
    script:
        "../../scripts/health/plateau_losses.py"


# Cells of one type with charges for dQ/dV, by the first of them; where the capacities of four of
# their check-ups are known, or of cycles of an ageing record, they calibrate the peaks.
PEAK_TYPES = {}
for cell, row in CELLS.items():
    if tests(cell, "ica", "ageing", roles=["fit"]):
        window = row["lower_cutoff_volt"], row["upper_cutoff_volt"]
        type_of_cell = row["chemistry"], row["rated_capacity_ampere_hour"], *window
        PEAK_TYPES.setdefault(type_of_cell, []).append(cell)


def calibrate(cells):
    """Whether enough capacities of these cells are known beside charges for dQ/dV."""
    known = [PLAN.cycles(cell, "ica") & PLAN.cycles(cell, *CAPACITY_KINDS) for cell in cells]
    return sum(map(len, known)) >= 4 or any(tests(c, "ageing", roles=["fit"]) for c in cells)


PEAK_TYPES = {cells[0]: cells for cells in PEAK_TYPES.values() if calibrate(cells)}
FIRST_OF_TYPE = {cell: first for first, cells in PEAK_TYPES.items() for cell in cells}


PEAK_STAGES = ("peak_calibration", "peak_information")


def tracks_of_type(wildcards):
    """Tracked peaks of those cells of a type that have several charges."""
    cells = [cell for cell in PEAK_TYPES[wildcards.cell] if cell in FOLLOWED]
    return [f"results/stages/ica_tracks/{cell}.parquet" for cell in cells]


rule peak_calibration:
    input:
        tracks=tracks_of_type,
        peaks=PLAN.fitted_of(PEAK_TYPES.get, "ica", "ica"),
        curves=PLAN.fitted_of(PEAK_TYPES.get, "ica_curve", "ica"),
        life_curves=PLAN.fitted_of(PEAK_TYPES.get, "ica_life_curve", "ageing"),
        capacity=PLAN.fitted_of(PEAK_TYPES.get, "capacity", *CAPACITY_KINDS),
        cycles=PLAN.fitted_of(PEAK_TYPES.get, "ageing_cycles", "ageing"),
    output:
        charges="results/stages/peak_calibration/{cell}.parquet",
        information="results/stages/peak_information/{cell}.parquet",
    log:
        "logs/peak_calibration/{cell}.log",
    wildcard_constraints:
        cell=either(PEAK_TYPES),
    params:
        tests=PLAN.facts_of_tests_of_cells(PEAK_TYPES.get),
        rated_ampere_hour=PLAN.column("rated_capacity_ampere_hour"),
    message:
        "Capacity from peaks of dQ/dV, calibrated over the cells of the type of {wildcards.cell}."
    script:
        "../../scripts/health/peak_calibration.py"


rule health_from_peaks:
    input:
        calibration=lambda w: f"results/stages/peak_calibration/{FIRST_OF_TYPE[w.cell]}.parquet",
    output:
        "results/stages/health_from_peaks/{cell}.parquet",
    log:
        "logs/health_from_peaks/{cell}.log",
    wildcard_constraints:
        cell=either(FIRST_OF_TYPE),
    message:
        "State of health of {wildcards.cell} from peaks of dQ/dV."
    script:
        "../../scripts/health/health_from_peaks.py"


CYCLED = dict.fromkeys(cell for cell in CELLS if tests(cell, "ageing"))
# Cycled between check-ups without a record; of fewer than eight no law is told.
CHECKED_OFTEN = dict.fromkeys(
    cell for cell in CELLS if cell not in CYCLED and len(PLAN.cycles(cell, *SLOW_KINDS)) >= 8
)
AGED = CYCLED | CHECKED_OFTEN
CHECKED = dict.fromkeys(
    cell for cell in CELLS if tests(cell, *SLOW_KINDS, *PULSE_KINDS, roles=["fit"])
)
SIZED = dict.fromkeys(cell for cell in CELLS if tests(cell, *SLOW_KINDS, roles=["fit"]))
STATED = dict.fromkeys(cell for cell in CELLS if cell in CHECKED and CELLS[cell]["state_of_health"])
HEALTHY = dict.fromkeys(cell for cell in CELLS if cell in AGED or cell in SIZED or cell in STATED)
# Further methods of the state of health: stage, and the cells that have it.
HEALTH_METHODS = {
    "modes": ("degradation_modes", DEGRADED),
    "peaks": ("health_from_peaks", FIRST_OF_TYPE),
}


def inputs_of_health(wildcards):
    """What the state of health of a cell is gathered from."""
    cell, stages = wildcards.cell, {}
    if cell in AGED:
        stages |= {"life": "life", "course": "fade_course"}
    if cell in CHECKED:
        stages["check_ups"] = "checkups"
    stages |= {name: stage for name, (stage, cells) in HEALTH_METHODS.items() if cell in cells}
    return of_cell(cell, **stages)


rule fade_of_check_ups:
    input:
        check_ups="results/stages/checkups/{cell}.parquet",
    output:
        laws="results/stages/fade/{cell}.parquet",
        course="results/stages/fade_course/{cell}.parquet",
        life="results/stages/life/{cell}.parquet",
    log:
        "logs/fade_of_check_ups/{cell}.log",
    wildcard_constraints:
        cell=either(CHECKED_OFTEN),
    params:
        settings=config["health"],
        cell=cell_facts,
    message:
        "Fade of {wildcards.cell} over its check-ups: law, knee, remaining cycles."
    script:
        "../../scripts/health/fade_of_check_ups.py"


rule fade:
    input:
        cycles=PLAN.own_artefacts("ageing_cycles", "ageing"),
        summaries=PLAN.own_artefacts("ageing_temperature", "ageing"),
        compensated=PLAN.own_artefacts("ageing_temperature_cycles", "ageing"),
    output:
        laws="results/stages/fade/{cell}.parquet",
        course="results/stages/fade_course/{cell}.parquet",
        life="results/stages/life/{cell}.parquet",
    log:
        "logs/fade/{cell}.log",
    wildcard_constraints:
        cell=either(CYCLED),
    params:
        settings=config["health"],
        cell=cell_facts,
    message:
        "Fade of {wildcards.cell}: law, knee, remaining cycles."
    script:
        "../../scripts/health/fade.py"


def rated_capacities(cell):
    """Capacities of a cell's check-ups: of charges for dQ/dV where no test is for the capacity."""
    return fitted("capacity", cell, *CAPACITY_KINDS) or fitted("capacity", cell, "ica")


rule check_ups:
    input:
        capacities=own(rated_capacities),
        resistances=PLAN.own_fitted("resistance", *PULSE_KINDS),
        courses=where(CYCLED, "results/stages/fade_course/{}.parquet"),
    output:
        rows="results/stages/checkups/{cell}.parquet",
        growth="results/stages/resistance_growth/{cell}.parquet",
    log:
        "logs/check_ups/{cell}.log",
    wildcard_constraints:
        cell=either(CHECKED),
    params:
        tests=facts_of_own_tests,
        cell=cell_facts,
        sheet=lambda w: [row for row in CAMPAIGN.check_ups if row["cell"] == w.cell],
    message:
        "Ratings of {wildcards.cell} at each check-up, and their change since new."
    script:
        "../../scripts/health/check_ups.py"


rule health:
    input:
        unpack(inputs_of_health),
    output:
        "results/stages/health/{cell}.parquet",
    log:
        "logs/health/{cell}.log",
    wildcard_constraints:
        cell=either(HEALTHY),
    message:
        "State of health of {wildcards.cell} by each method."
    script:
        "../../scripts/health/health.py"


def types_of(cells):
    """Cells of each type, by its name; of those, the ones in `cells`."""
    named = {
        f"{chemistry or 'chemistry not stated'}, {rating:g} Ah" if rating else str(chemistry): names
        for (chemistry, rating), names in OF_TYPE.items()
    }
    parts = {name: [cell for cell in names if cell in cells] for name, names in named.items()}
    return {name: part for name, part in parts.items() if len(part) > 1}


FLEETS = types_of(CHECKED)
PROTOCOL_OF = {cell: CELLS[cell]["ageing_protocol"] for cell in AGED}
ARMS = types_of({cell for cell, protocol in PROTOCOL_OF.items() if protocol})


rule fleet_health:
    input:
        check_ups=[
            f"results/stages/checkups/{cell}.parquet"
            for cells in FLEETS.values()
            for cell in cells
        ],
        resistances=[
            f"results/stages/resistance_growth/{cell}.parquet"
            for cells in FLEETS.values()
            for cell in cells
        ],
    output:
        cells="results/tables/fleet_health.csv",
        lines="results/tables/fleet_health_lines.csv",
    log:
        "logs/fleet_health.log",
    params:
        types=FLEETS,
    message:
        "Resistance against capacity over the cells of each type."
    script:
        "../../scripts/health/fleet_health.py"


rule protocols_compared:
    input:
        courses=[
            f"results/stages/fade_course/{cell}.parquet"
            for cells in ARMS.values()
            for cell in cells
        ],
        lives=[f"results/stages/life/{cell}.parquet" for cells in ARMS.values() for cell in cells],
    output:
        "results/tables/protocols.csv",
    log:
        "logs/protocols_compared.log",
    params:
        types=ARMS,
        protocols=PROTOCOL_OF,
    message:
        "Ageing protocols of each type of cells compared."
    script:
        "../../scripts/health/protocols_compared.py"
