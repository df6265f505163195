# Models of cells without pulses, from the reference cell of their type; and how well they do.


def of_peers(stage, *kinds):
    """Input function: one stage's artefacts of the cells that a cell may borrow its model from."""
    return lambda w: [p for c in calibrating(w.cell) for p in fitted(stage, c, *kinds)]


rule onset:
    input:
        series="results/clean/{cell}/{test}.parquet",
        steps="results/segment/{cell}/{test}.parquet",
        basis="results/basis/{cell}.json",
    output:
        "results/onset/{cell}/{test}.parquet",
    log:
        "logs/onset/{cell}/{test}.log",
    params:
        settings=config["resistance"],
        test=test_facts,
        cell=cell_facts,
    message:
        "Resistance of {wildcards.cell} at the onset of the loads in {wildcards.test}."
    script:
        "../../scripts/bias/onset.py"


rule bias_correction:
    input:
        basis="results/basis/{cell}.json",
        peaks=lambda w: fitted("ica", w.cell, "ica"),
        curves=lambda w: fitted("ica_curve", w.cell, "ica"),
        onset=lambda w: fitted("onset", w.cell, "capacity"),
        capacity=lambda w: fitted("capacity", w.cell, "capacity"),
        peer_basis=lambda w: [f"results/basis/{c}.json" for c in calibrating(w.cell)],
        peer_models=lambda w: [f"results/identify/{c}.json" for c in calibrating(w.cell)],
        peer_peaks=of_peers("ica", "ica"),
        peer_curves=of_peers("ica_curve", "ica"),
        peer_onset=of_peers("onset", "capacity"),
        peer_capacity=of_peers("capacity", "capacity"),
    output:
        "results/bias/{cell}.json",
    log:
        "logs/bias/{cell}.log",
    wildcard_constraints:
        cell=either(BIASED),
    params:
        references=lambda w: [c for c in references(w.cell) if c in IDENTIFIED],
    message:
        "Model of {wildcards.cell} from the reference cell and the differences between their tests."
    script:
        "../../scripts/bias/bias_correction.py"


MOST_JUDGED = 60  # cells of a type


def judged(cells):
    """Cells of a type whose models are compared: spread over the sheet, marked ones first."""
    shows = [c for c in cells if c in IDENTIFIED and tests(c, "capacity", "ica", roles=["fit"])]
    marked = [cell for cell in shows if CELLS[cell]["reference"] == "yes"]
    rest = [cell for cell in shows if cell not in marked and SCORED[cell]]
    most = max(MOST_JUDGED - len(marked), 1)
    return [*marked, *rest[:: -(-len(rest) // most) or 1]]


# Cells of one type with models of their own, of which some have tests that no fit has seen; by the
# first of them.
JUDGED = [judged(cells) for cells in OF_TYPE.values()]
JUDGED = {cells[0]: cells for cells in JUDGED if len(cells) > 1 and any(map(SCORED.get, cells))}


def of_judged(stage, *kinds):
    """Input function: one stage's artefacts of the cells of a type that are compared."""
    return lambda w: [p for c in JUDGED[w.cell] for p in fitted(stage, c, *kinds)]


rule bias_ways:
    input:
        peer_basis=lambda w: [f"results/basis/{c}.json" for c in JUDGED[w.cell]],
        peer_models=lambda w: [f"results/identify/{c}.json" for c in JUDGED[w.cell]],
        peer_peaks=of_judged("ica", "ica"),
        peer_curves=of_judged("ica_curve", "ica"),
        peer_onset=of_judged("onset", "capacity"),
        peer_capacity=of_judged("capacity", "capacity"),
        own=lambda w: [f"results/models/{c}.json" for c in JUDGED[w.cell]],
        series=lambda w: [
            f"results/clean/{c}/{row['test']}.parquet" for c in JUDGED[w.cell] for row in SCORED[c]
        ],
    output:
        "results/bias_ways/{cell}.parquet",
    log:
        "logs/bias_ways/{cell}.log",
    wildcard_constraints:
        cell=either(JUDGED),
    params:
        references=lambda w: [c for c in JUDGED[w.cell] if CELLS[c]["reference"] == "yes"],
        cells=lambda w: {c: facts_of(c) for c in JUDGED[w.cell]},
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Four ways to the model of each cell of the type of {wildcards.cell}, compared on its drives."
    script:
        "../../scripts/bias/bias_ways.py"
