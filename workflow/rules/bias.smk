# Models of cells without pulses, from the reference cell of their type; and how well they do.


rule onset:
    input:
        series="results/stages/clean/{cell}/{test}.parquet",
        steps="results/stages/segment/{cell}/{test}.parquet",
        basis="results/stages/basis/{cell}.json",
    output:
        "results/stages/onset/{cell}/{test}.parquet",
    log:
        "logs/onset/{cell}/{test}.log",
    params:
        settings=config["resistance"],
        instrument=config["instrument"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Resistance of {wildcards.cell} at the onset of the loads in {wildcards.test}."
    script:
        "../../scripts/bias/onset.py"


rule bias_correction:
    input:
        basis="results/stages/basis/{cell}.json",
        peaks=PLAN.own_fitted("ica", "ica"),
        curves=PLAN.own_fitted("ica_curve", "ica"),
        onset=PLAN.own_fitted("onset", "capacity"),
        capacity=PLAN.own_fitted("capacity", "capacity"),
        peer_basis=paths_of(FITS.calibrating, "results/stages/basis/{}.json"),
        peer_models=paths_of(FITS.calibrating, "results/stages/identify/{}.json"),
        peer_peaks=PLAN.fitted_of(FITS.calibrating, "ica", "ica"),
        peer_curves=PLAN.fitted_of(FITS.calibrating, "ica_curve", "ica"),
        peer_onset=PLAN.fitted_of(FITS.calibrating, "onset", "capacity"),
        peer_capacity=PLAN.fitted_of(FITS.calibrating, "capacity", "capacity"),
    output:
        "results/stages/bias/{cell}.json",
    log:
        "logs/bias/{cell}.log",
    wildcard_constraints:
        cell=either(BIASED),
    params:
        references=own(FITS.excited_references),
    message:
        "Model of {wildcards.cell} from the reference cell and the differences between their tests."
    script:
        "../../scripts/bias/bias_correction.py"


LENT = BiasPlan(PLAN, FITS)
JUDGED = LENT.judged


rule bias_ways:
    input:
        unpack(LENT.inputs),
    output:
        "results/stages/bias_ways/{cell}.parquet",
    log:
        "logs/bias_ways/{cell}.log",
    wildcard_constraints:
        cell=either(JUDGED),
    params:
        references=LENT.references,
        cells=LENT.facts,
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Four ways to the model of each cell of the type of {wildcards.cell}, compared on its drives."
    script:
        "../../scripts/bias/bias_ways.py"


# The cell that a type's corrected models serve worst is searched for what its model lacks.
JUDGED_WORST = JUDGED if config["missing_effect"]["enabled"] else {}


rule bias_worst:
    input:
        unpack(LENT.inputs),
        ways="results/stages/bias_ways/{cell}.parquet",
        fitted=gathered(JUDGED.get, FITS.fit_series),  # what a search may fit as well
    output:
        "results/stages/bias_worst/{cell}.json",
    log:
        "logs/bias_worst/{cell}.log",
    wildcard_constraints:
        cell=either(JUDGED_WORST),
    params:
        references=LENT.references,
        cells=LENT.facts,
        settings=of_analysis("missing_effect"),
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "What the corrected model lacks of the worst cell of the type of {wildcards.cell}."
    script:
        "../../scripts/bias/bias_worst.py"
