# What temperature takes: capacity, peaks of dQ/dV, fast charge, capacities over ageing cycles.

COLD = dict.fromkeys(cell for cell in CELLS if len(chamber_temperatures(cell, *SIZE_KINDS)) >= 2)
COLD_PEAKS = dict.fromkeys(cell for cell in CELLS if len(chamber_temperatures(cell, "ica")) >= 2)
COLD_FAST = dict.fromkeys(
    cell for cell in CELLS if len(chamber_temperatures(cell, "fast_charge")) >= 3
)
LOSS_LAWS = [
    *[f"results/stages/capacity_loss_laws/{cell}.parquet" for cell in COLD],
    *[f"results/stages/fast_charge_laws/{cell}.parquet" for cell in COLD_FAST],
    *everywhere("ageing_temperature_laws", "ageing"),
]


def fresh_peaks(cell):
    """Charges for dQ/dV of a cell's earliest check-up, temperature known: age is not temperature."""
    rows = tests(cell, "ica", roles=["fit"])
    known = [row for row in rows if row["ambient_temperature_celsius"] is not None]
    return of_first_checkup(known)


rule capacity_loss:
    input:
        PLAN.own_fitted("capacity", *SIZE_KINDS),
    output:
        losses="results/stages/capacity_loss/{cell}.parquet",
        laws="results/stages/capacity_loss_laws/{cell}.parquet",
    log:
        "logs/capacity_loss/{cell}.log",
    wildcard_constraints:
        cell=either(COLD),
    params:
        tests=facts_of_own_tests,
    message:
        "Capacity of {wildcards.cell} lost to temperature and rate: true and false."
    script:
        "../../scripts/loss/capacity_loss.py"


rule ica_temperature:
    input:
        curves=PLAN.own_rows("ica_curve", fresh_peaks),
        peaks=PLAN.own_rows("ica", fresh_peaks),
    output:
        matches="results/stages/ica_temperature/{cell}.parquet",
        peaks="results/stages/ica_temperature_peaks/{cell}.parquet",
        curves="results/stages/ica_temperature_curve/{cell}.parquet",
    log:
        "logs/ica_temperature/{cell}.log",
    wildcard_constraints:
        cell=either(COLD_PEAKS),
    params:
        tests=lambda w: {
            row["test"]: row["ambient_temperature_celsius"] for row in fresh_peaks(w.cell)
        },
    message:
        "Peaks of incremental capacity of {wildcards.cell}, matched across temperatures."
    script:
        "../../scripts/loss/ica_temperature.py"


rule fast_charge:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
    output:
        "results/stages/fast_charge/{cell}/{test}.parquet",
    log:
        "logs/fast_charge/{cell}/{test}.log",
    params:
        settings=config["fast_charge"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Fast charge of {wildcards.cell} in {wildcards.test}: charge accepted in {params.settings[minutes]} min."
    script:
        "../../scripts/loss/fast_charge.py"


rule fast_charge_law:
    input:
        PLAN.own_fitted("fast_charge", "fast_charge"),
    output:
        laws="results/stages/fast_charge_laws/{cell}.parquet",
        points="results/stages/fast_charge_points/{cell}.parquet",
    log:
        "logs/fast_charge_laws/{cell}.log",
    wildcard_constraints:
        cell=either(COLD_FAST),
    params:
        tests=facts_of_own_tests,
    message:
        "Fast charge of {wildcards.cell} over temperature."
    script:
        "../../scripts/loss/fast_charge_law.py"


rule ageing:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        course=course_of,
    output:
        cycles="results/stages/ageing_cycles/{cell}/{test}.parquet",
        summary="results/stages/ageing_temperature/{cell}/{test}.parquet",
        laws="results/stages/ageing_temperature_laws/{cell}/{test}.parquet",
        compensated="results/stages/ageing_temperature_cycles/{cell}/{test}.parquet",
        periodogram="results/stages/ageing_temperature_periods/{cell}/{test}.parquet",
    log:
        "logs/ageing/{cell}/{test}.log",
    params:
        instrument=config["instrument"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Cycles of {wildcards.cell} in {wildcards.test}: fade, temperature and daily cycle."
    script:
        "../../scripts/loss/ageing.py"
