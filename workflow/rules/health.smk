# Health over a life: fade with knee and remaining cycles, ratings of check-ups, state of health.

AGEING = HealthPlan(PLAN, FITS)
FOLLOWED, AGED_SLOWLY, DEGRADED = AGEING.followed, AGEING.aged_slowly, AGEING.degraded
PEAK_TYPES, FIRST_OF_TYPE = AGEING.peak_types, AGEING.first_of_type
CYCLED, AGED, CHECKED, HEALTHY = AGEING.cycled, AGEING.aged, AGEING.checked, AGEING.healthy
FLEETS, ARMS = AGEING.fleets, AGEING.arms
PEAK_STAGES = ("peak_calibration", "peak_information")


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


def half_cell_contents(cell):
    """What the files of a cell's half cells hold; one that is not there the job refuses."""
    return contents_of(PLAN.half_cell_files(cell))


rule degradation_modes:
    input:
        own=PLAN.own_fitted("clean", *SLOW_CURVE_KINDS),
        fresh=PLAN.fitted_of(AGEING.fresh_cells, "clean", *SLOW_CURVE_KINDS),
        rests=PLAN.own_rows("ocv_rest_points", FITS.resting),
        half_cells=local_files(own(half_cell_contents)),
    output:
        "results/stages/degradation_modes/{cell}.parquet",
    log:
        "logs/degradation_modes/{cell}.log",
    wildcard_constraints:
        cell=either(DEGRADED),
    params:
        cell=cell_facts,
        materials=own(AGEING.half_cells_of),
        content=own(half_cell_contents),
        fresh=PLAN.facts_of_cells(AGEING.fresh_cells),
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


rule peak_calibration:
    input:
        tracks=AGEING.followed_of_type,
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
        calibration=AGEING.calibration_of,
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
        cell=either(AGEING.checked_often),
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


# Tests of which two rests may tell the capacity: all but those that the open-circuit voltage is
# from, and lives, whose half cycles are counted one by one.
BETWEEN_KINDS = sorted({*SERIES_KINDS} - {"ocv", "ocv_temperature", "ageing"})


def between_rests(cell):
    """Tests of a cell of which two rests may tell its capacity."""
    return tests(cell, *BETWEEN_KINDS)


RESTED = dict.fromkeys(filter(between_rests, CELLS))


rule between_rests:
    input:
        basis="results/stages/basis/{cell}.json",
        series=PLAN.own_rows("clean", between_rests),
        steps=PLAN.own_rows("segment", between_rests),
    output:
        "results/stages/capacity_between_rests/{cell}.parquet",
    log:
        "logs/between_rests/{cell}.log",
    wildcard_constraints:
        cell=either(RESTED),
    params:
        instrument=config["instrument"],
    message:
        "Capacity of {wildcards.cell} between two rests, by its open-circuit voltage."
    script:
        "../../scripts/health/between_rests.py"


rule check_ups:
    input:
        capacities=own(AGEING.rated_capacities),
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
        sheet=PLAN.stated_check_ups,
    message:
        "Ratings of {wildcards.cell} at each check-up, and their change since new."
    script:
        "../../scripts/health/check_ups.py"


rule health:
    input:
        unpack(AGEING.inputs_of_health),
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
        protocols=AGEING.protocol_of,
    message:
        "Ageing protocols of each type of cells compared."
    script:
        "../../scripts/health/protocols_compared.py"
