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
        peer_basis=paths_of(calibrating, "results/stages/basis/{}.json"),
        peer_models=paths_of(calibrating, "results/stages/identify/{}.json"),
        peer_peaks=PLAN.fitted_of(calibrating, "ica", "ica"),
        peer_curves=PLAN.fitted_of(calibrating, "ica_curve", "ica"),
        peer_onset=PLAN.fitted_of(calibrating, "onset", "capacity"),
        peer_capacity=PLAN.fitted_of(calibrating, "capacity", "capacity"),
    output:
        "results/stages/bias/{cell}.json",
    log:
        "logs/bias/{cell}.log",
    wildcard_constraints:
        cell=either(BIASED),
    params:
        references=lambda w: [c for c in references(w.cell) if c in EXCITED],
    message:
        "Model of {wildcards.cell} from the reference cell and the differences between their tests."
    script:
        "../../scripts/bias/bias_correction.py"


MOST_JUDGED = 60  # cells of a type


def judged(cells):
    """Cells of a type whose models are compared: spread over the sheet, marked ones first."""
    shows = [c for c in cells if c in EXCITED and tests(c, "capacity", "ica", roles=["fit"])]
    marked = [cell for cell in shows if CELLS[cell]["reference"] == "yes"]
    rest = [cell for cell in shows if cell not in marked and SCORED[cell]]
    most = max(MOST_JUDGED - len(marked), 1)
    return [*marked, *rest[:: -(-len(rest) // most) or 1]]


# Cells of one type with models of their own, of which some have tests that no fit has seen; by the
# first of them.
JUDGED = [judged(cells) for cells in OF_TYPE.values()]
JUDGED = {cells[0]: cells for cells in JUDGED if len(cells) > 1 and any(map(SCORED.get, cells))}


def judged_inputs(wildcards):
    """What the cells of a type show, their models, and the tests that those are scored on."""
    cells = JUDGED[wildcards.cell]
    shown = {"peaks": "ica", "curves": "ica_curve", "onset": "onset", "capacity": "capacity"}
    kinds = {"peaks": "ica", "curves": "ica", "onset": "capacity", "capacity": "capacity"}
    return {
        f"peer_{name}": [path for cell in cells for path in fitted(stage, cell, kinds[name])]
        for name, stage in shown.items()
    } | {
        "peer_basis": [f"results/stages/basis/{cell}.json" for cell in cells],
        "peer_models": [f"results/stages/identify/{cell}.json" for cell in cells],
        "own": [f"results/models/{cell}.json" for cell in cells],
        "series": [path for cell in cells for path in of_rows("clean", cell, SCORED[cell])],
    }


def judged_references(wildcards):
    """Marked cells among those of a type that are compared."""
    return [cell for cell in JUDGED[wildcards.cell] if CELLS[cell]["reference"] == "yes"]


def judged_facts(wildcards):
    """Facts of those cells, by name."""
    return {cell: facts_of(cell) for cell in JUDGED[wildcards.cell]}


rule bias_ways:
    input:
        unpack(judged_inputs),
    output:
        "results/stages/bias_ways/{cell}.parquet",
    log:
        "logs/bias_ways/{cell}.log",
    wildcard_constraints:
        cell=either(JUDGED),
    params:
        references=judged_references,
        cells=judged_facts,
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Four ways to the model of each cell of the type of {wildcards.cell}, compared on its drives."
    script:
        "../../scripts/bias/bias_ways.py"


# The cell that a type's corrected models serve worst is searched for what its model lacks.
JUDGED_WORST = JUDGED if config["missing_effect"]["enabled"] else {}


rule bias_worst:
    input:
        unpack(judged_inputs),
        ways="results/stages/bias_ways/{cell}.parquet",
        fitted=gathered(JUDGED.get, fit_series),  # what a search may fit as well
    output:
        "results/stages/bias_worst/{cell}.json",
    log:
        "logs/bias_worst/{cell}.log",
    wildcard_constraints:
        cell=either(JUDGED_WORST),
    params:
        references=judged_references,
        cells=judged_facts,
        settings=of_analysis("missing_effect"),
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "What the corrected model lacks of the worst cell of the type of {wildcards.cell}."
    script:
        "../../scripts/bias/bias_worst.py"
