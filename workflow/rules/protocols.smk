# One test protocol, one rule: capacity, slow OCV, pulses, incremental capacity, impedance.


rule capacity:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        course=course_of,
        curves=PLAN.curves_for_stated_soc,
    output:
        "results/stages/capacity/{cell}/{test}.parquet",
    log:
        "logs/capacity/{cell}/{test}.log",
    wildcard_constraints:
        cell=only_these(row for row in CAMPAIGN.tests if row["kind"] != "ocv"),
    params:
        instrument=config["instrument"],
        cell=cell_facts,
        test=test_facts,
    message:
        "Capacity of {wildcards.cell} in {wildcards.test}, per direction and rate."
    script:
        "../../scripts/protocols/capacity.py"


rule ocv:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        course=course_of,
    output:
        curve="results/stages/ocv/{cell}/{test}.parquet",
        functions="results/stages/ocv_functions/{cell}/{test}.parquet",
        capacity="results/stages/capacity/{cell}/{test}.parquet",
    log:
        "logs/ocv/{cell}/{test}.log",
    wildcard_constraints:
        cell=only_these(row for row in CAMPAIGN.tests if row["kind"] == "ocv"),
    params:
        least_hour=config["ocv"]["least_hour"],
        instrument=config["instrument"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Open-circuit voltage and capacity of {wildcards.cell} from the slow test {wildcards.test}."
    script:
        "../../scripts/protocols/ocv.py"


rule ocv_rests:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        course=course_of,
        capacity=PLAN.own_fitted("capacity", *SIZE_KINDS),
    output:
        curve="results/stages/ocv_rests/{cell}/{test}.parquet",
        points="results/stages/ocv_rest_points/{cell}/{test}.parquet",
    log:
        "logs/ocv_rests/{cell}/{test}.log",
    params:
        test=test_facts,
        cell=cell_facts,
    message:
        "Open-circuit voltage of {wildcards.cell} from the rests of {wildcards.test}."
    script:
        "../../scripts/protocols/ocv_rests.py"


rule ocv_load:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
    output:
        "results/stages/ocv_load/{cell}/{test}.parquet",
    log:
        "logs/ocv_load/{cell}/{test}.log",
    params:
        test=test_facts,
        cell=cell_facts,
    message:
        "Voltage of {wildcards.cell} over SoC in the long load {wildcards.test}, for want of an OCV."
    script:
        "../../scripts/protocols/ocv_load.py"


# Pulses and the rests after them tell the resistance and its relaxation: one job where both are asked.
BOTH_KINDS = {*PULSE_KINDS} & {*RELAXATION_KINDS}


rule pulses:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
        repeats=repeats_of,
    output:
        resistance="results/stages/resistance/{cell}/{test}.parquet",
        rests="results/stages/relaxation/{cell}/{test}.parquet",
        curve="results/stages/relaxation_curve/{cell}/{test}.parquet",
    log:
        "logs/pulses/{cell}/{test}.log",
    wildcard_constraints:
        cell=only_these(row for row in CAMPAIGN.tests if row["kind"] in BOTH_KINDS),
    params:
        resistance=config["resistance"],
        instrument=config["instrument"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Resistance of {wildcards.cell} in the pulses of {wildcards.test}, depolarisation in its rests."
    script:
        "../../scripts/protocols/pulses.py"


rule resistance:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
        repeats=repeats_of,
    output:
        "results/stages/resistance/{cell}/{test}.parquet",
    log:
        "logs/resistance/{cell}/{test}.log",
    wildcard_constraints:
        cell=only_these(row for row in CAMPAIGN.tests if row["kind"] not in BOTH_KINDS),
    params:
        settings=config["resistance"],
        instrument=config["instrument"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Resistance of {wildcards.cell} {params.settings[delay_second]} s into each pulse of {wildcards.test}."
    script:
        "../../scripts/protocols/resistance.py"


rule relaxation:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
        repeats=repeats_of,
    output:
        rests="results/stages/relaxation/{cell}/{test}.parquet",
        curve="results/stages/relaxation_curve/{cell}/{test}.parquet",
    log:
        "logs/relaxation/{cell}/{test}.log",
    wildcard_constraints:
        cell=only_these(row for row in CAMPAIGN.tests if row["kind"] not in BOTH_KINDS),
    params:
        test=test_facts,
        cell=cell_facts,
    message:
        "Depolarisation of {wildcards.cell} in the rests of {wildcards.test}."
    script:
        "../../scripts/protocols/relaxation.py"


rule ica:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
    output:
        peaks="results/stages/ica/{cell}/{test}.parquet",
        curve="results/stages/ica_curve/{cell}/{test}.parquet",
    log:
        "logs/ica/{cell}/{test}.log",
    params:
        test=test_facts,
        cell=cell_facts,
    message:
        "Incremental capacity of {wildcards.cell} from the charge in {wildcards.test}."
    script:
        "../../scripts/protocols/ica.py"


rule ica_discharge:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
    output:
        peaks="results/stages/ica_discharge/{cell}/{test}.parquet",
        curve="results/stages/ica_discharge_curve/{cell}/{test}.parquet",
    log:
        "logs/ica_discharge/{cell}/{test}.log",
    params:
        test=test_facts,
    message:
        "Incremental capacity of {wildcards.cell} from the discharge in {wildcards.test}."
    script:
        "../../scripts/protocols/ica_discharge.py"


WITH_SPECTRA = [cell for cell in CELLS if tests(cell, "eis")]


rule spectrum:
    input:
        raw=raw_paths,
    output:
        "results/stages/spectrum/{cell}/{test}.parquet",
    log:
        "logs/spectrum/{cell}/{test}.log",
    params:
        content=raw_contents,
        reading=PLAN.reading,
        largest_megabyte=config["files"]["largest_megabyte"],
        longest_minute=config["files"]["longest_reading_minute"],
        test=test_facts,
    message:
        "Read the spectrum {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/protocols/spectrum.py"


rule spectra_together:
    input:
        PLAN.own_artefacts("spectrum", "eis"),
    output:
        "results/stages/eis_together/{cell}.parquet",
    log:
        "logs/spectra_together/{cell}.log",
    wildcard_constraints:
        cell=either(WITH_SPECTRA),
    params:
        settings=config["impedance"],
    message:
        "Choose the circuit of all spectra of {wildcards.cell} and follow its arcs."
    script:
        "../../scripts/protocols/spectra_together.py"


rule impedance:
    input:
        spectrum="results/stages/spectrum/{cell}/{test}.parquet",
        together="results/stages/eis_together/{cell}.parquet",
    output:
        fit="results/stages/eis/{cell}/{test}.parquet",
        curve="results/stages/eis_curve/{cell}/{test}.parquet",
        parameters="results/stages/eis_parameters/{cell}/{test}.parquet",
        candidates="results/stages/eis_candidates/{cell}/{test}.parquet",
        distribution="results/stages/drt/{cell}/{test}.parquet",
        processes="results/stages/drt_peaks/{cell}/{test}.parquet",
    log:
        "logs/impedance/{cell}/{test}.log",
    params:
        settings=config["impedance"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Fit the circuit of its cell to the spectrum {wildcards.cell} {wildcards.test}."
    script:
        "../../scripts/protocols/impedance.py"


beside_spectra = partial(PLAN.rows_beside, "eis", SERIES_KINDS)
THERMOMETERS = [cell for cell in CELLS if beside_spectra(cell)]


rule thermometer:
    input:
        spectra=PLAN.own_artefacts("eis", "eis"),
        series=PLAN.own_rows("clean", beside_spectra),
    output:
        "results/stages/thermometer/{cell}.parquet",
    log:
        "logs/thermometer/{cell}.log",
    wildcard_constraints:
        cell=either(THERMOMETERS),
    message:
        "Compare the temperature in the spectra of {wildcards.cell} with that of its other records."
    script:
        "../../scripts/protocols/thermometer.py"
