# Equivalent circuits: what a cell's SoC refers to, identification, validation.

# Which cells have a model, and from what; what of them is searched for a missing effect.
FITS = ModelPlan(PLAN, scored_kinds=SERIES_KINDS)
SEARCHES = SearchPlan(PLAN, FITS, config["missing_effect"])
OF_TYPE, references = FITS.of_type, FITS.references
EXCITED, GIVEN, BIASED, GROUPED = FITS.excited, FITS.given, FITS.biased, FITS.grouped
IDENTIFIED, MODELLED, UNMODELLED = FITS.identified, FITS.modelled, FITS.unmodelled
PARALLEL, SCORED, WARMED, CHECKUPS = FITS.parallel, FITS.scored, FITS.warmed, FITS.checkups
SEARCHED, SEARCHED_OWN = SEARCHES.searched, SEARCHES.searched_own


rule ocv_shift:
    input:
        series=PLAN.own_rows("clean", FITS.aged_capacity_tests),
        steps=PLAN.own_rows("segment", FITS.aged_capacity_tests),
    output:
        "results/stages/ocv_shift/{cell}.parquet",
    log:
        "logs/ocv_shift/{cell}.log",
    wildcard_constraints:
        cell=either(FITS.shifted),
    message:
        "Shift of the open-circuit voltage of {wildcards.cell} since its first check-up."
    script:
        "../../scripts/models/ocv_shift.py"


rule basis:
    input:
        rests=own(FITS.other_curves),
        shifts=where(FITS.shifted, "results/stages/ocv_shift/{}.parquet"),
        capacity=PLAN.own_fitted("capacity", *SIZE_KINDS),
        ocv=PLAN.own_fitted("ocv", "ocv"),
        lent_ocv=PLAN.fitted_of(FITS.curve_lenders, "ocv", "ocv"),
        lent_capacity=PLAN.fitted_of(FITS.curve_lenders, "capacity", *CAPACITY_KINDS),
    output:
        "results/stages/basis/{cell}.json",
    log:
        "logs/basis/{cell}.log",
    params:
        cell=cell_facts,
        references=own(references),
    message:
        "What the SoC of {wildcards.cell} refers to: capacity and OCV curves."
    script:
        "../../scripts/models/basis.py"


rule identify:
    input:
        basis="results/stages/basis/{cell}.json",
        series=own(FITS.fit_series),
    output:
        "results/stages/identify/{cell}.json",
    log:
        "logs/identify/{cell}.log",
    wildcard_constraints:
        cell=either(IDENTIFIED),
    params:
        members=config["models"]["members"],
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Identify the equivalent circuits of {wildcards.cell} ({params.members})."
    script:
        "../../scripts/models/identify.py"


rule thermal:
    input:
        model="results/models/{cell}.json",
        series=PLAN.own_rows("clean", FITS.warming_tests),
    output:
        constants="results/stages/thermal/{cell}.json",
        tests="results/stages/thermal_tests/{cell}.parquet",
    log:
        "logs/thermal/{cell}.log",
    wildcard_constraints:
        cell=either(WARMED),
    params:
        cell=cell_facts,
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Heat capacity and thermal resistance of {wildcards.cell}."
    script:
        "../../scripts/models/thermal.py"


def table_of_model(wildcards):
    """What the file of a cell's model table holds; where it is not there the job says so."""
    return contents_of([CELLS[wildcards.cell]["model_table"]])


rule given_model:
    input:
        table=local_files(table_of_model),
    output:
        "results/stages/given_model/{cell}.json",
    log:
        "logs/given_model/{cell}.log",
    wildcard_constraints:
        cell=either(GIVEN),
    params:
        content=table_of_model,
        table=PLAN.column("model_table"),
        capacity_ampere_hour=PLAN.column("model_capacity_ampere_hour"),
    message:
        "Model of {wildcards.cell} from the table that the sheet gives."
    script:
        "../../scripts/models/given_model.py"


def left_out_temperatures(wildcards):
    """How far a cell's model reaches over temperature, where temperatures were left out."""
    found = f"results/stages/compensation/{wildcards.cell}.parquet"
    return [found] if wildcards.cell in COMPENSATED else []


rule model:
    input:
        source=FITS.source_of_model,
        basis=where(IDENTIFIED, "results/stages/basis/{}.json"),
        temperatures=left_out_temperatures,
        effects=where(SEARCHED, "results/missing_effect/{}/model.json"),
        series=own(SEARCHES.choice_series),
        left_out=own(SEARCHES.left_out_series),
    output:
        model="results/models/{cell}.json",
        parameters="results/stages/parameters/{cell}.parquet",
        choice="results/stages/choice/{cell}.parquet",
    log:
        "logs/model/{cell}.log",
    wildcard_constraints:
        cell=either(MODELLED),
    params:
        cell=cell_facts,
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Model of {wildcards.cell} as the rest of the pipeline uses it."
    script:
        "../../scripts/models/model.py"


rule no_model:
    output:
        "results/models/{cell}.json",
    log:
        "logs/no_model/{cell}.log",
    wildcard_constraints:
        cell=either(UNMODELLED),
    params:
        tests=PLAN.columns_of_tests("test", "kind", "role"),
        lent_curve=own(FITS.is_lent_a_curve),
    message:
        "Why {wildcards.cell} has no model."
    script:
        "../../scripts/models/no_model.py"


EXPORTED = {
    kind: [f"results/models/{cell}/{kind}" for cell in MODELLED]
    for kind in ("pybamm_thevenin.json", "lookup.csv", "over_temperature.csv")
}


rule model_of_checkup:
    input:
        basis="results/stages/basis/{cell}.json",
        series=FITS.series_of_checkup,
    output:
        model="results/stages/models_of_checkups/{cell}/{checkup}.json",
        parameters="results/stages/parameters_of_checkups/{cell}/{checkup}.parquet",
    log:
        "logs/model_of_checkup/{cell}/{checkup}.log",
    wildcard_constraints:
        cell=either(CHECKUPS),
    params:
        members=[name for name in config["models"]["members"] if name != "P"],
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Model of {wildcards.cell} at its check-up at cycle {wildcards.checkup}."
    script:
        "../../scripts/models/model_of_checkup.py"


rule export:
    input:
        model="results/models/{cell}.json",
        validation=own(FITS.scores_of),
    output:
        pybamm="results/models/{cell}/pybamm_thevenin.json",
        lookup="results/models/{cell}/lookup.csv",
        temperature="results/models/{cell}/over_temperature.csv",
    log:
        "logs/export/{cell}.log",
    wildcard_constraints:
        cell=either(MODELLED),
    message:
        "Model of {wildcards.cell} for other tools: PyBaMM and a look-up table."
    script:
        "../../scripts/models/export.py"


rule prediction:
    input:
        model=FITS.model_at_age,
        series="results/stages/clean/{cell}/{test}.parquet",
        repeats=repeats_of,
    output:
        scores="results/stages/validation/{cell}/{test}.parquet",
        simulation="results/stages/simulation/{cell}/{test}.parquet",
        soc="results/stages/soc/{cell}/{test}.parquet",
        soc_series="results/stages/soc_series/{cell}/{test}.parquet",
    log:
        "logs/prediction/{cell}/{test}.log",
    wildcard_constraints:
        cell=either(MODELLED),
    params:
        soc=config["soc"],
        split_rest_second=config["models"]["split_rest_second"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Voltage of {wildcards.cell} in {wildcards.test} by its model, SoC by filters, and their errors."
    script:
        "../../scripts/models/prediction.py"
