# Pack models as documents, and functional mock-up units (FMI) of cells and packs.


# Packs all of whose cells have a model.
PACK_MODELS = [group for group, cells in LEAVES.items() if all(cell in MODELLED for cell in cells)]


def scored_stage(group):
    """The stage whose rows say how well a group was simulated through its tests."""
    if group in NESTED:
        return "nested_pack"
    return "series_pack_cells" if group in SERIES else "pack"


rule pack_model:
    input:
        models=paths_of(LEAVES.get, "results/models/{}.json"),
        capacities=PLAN.fitted_of(LEAVES.get, "capacity", "capacity"),
        validation=gathered(LEAVES.get, FITS.scores_of),
        tests=lambda w: artefacts(scored_stage(w.group), w.group, "group"),
        thermal=thermal_of_group,
    output:
        model="results/pack_models/{group}.json",
        lookup="results/pack_models/{group}/lookup.csv",
    log:
        "logs/pack_model/{group}.log",
    wildcard_constraints:
        group=either(PACK_MODELS),
    params:
        rows=own(WIRED.get),
    message:
        "Model of pack {wildcards.group} as one document, with the errors that its tests show."
    script:
        "../../scripts/pack_export/pack_model.py"


rule cell_fmu:
    input:
        model="results/models/{cell}.json",
        capacities=PLAN.own_fitted("capacity", "capacity"),
        validation=own(FITS.scores_of),
    output:
        "results/models/{cell}.fmu",
    log:
        "logs/cell_fmu/{cell}.log",
    wildcard_constraints:
        cell=either(MODELLED),
    message:
        "Cell {wildcards.cell} as a functional mock-up unit (FMI 3.0, co-simulation)."
    script:
        "../../scripts/pack_export/cell_fmu.py"


rule pack_fmu:
    input:
        "results/pack_models/{group}.json",
    output:
        "results/pack_models/{group}.fmu",
    log:
        "logs/pack_fmu/{group}.log",
    wildcard_constraints:
        group=either(PACK_MODELS),
    message:
        "Pack {wildcards.group} as a functional mock-up unit (FMI 3.0, co-simulation)."
    script:
        "../../scripts/pack_export/pack_fmu.py"


# Asked for by name (`snakemake fmu`): units are made of finished models, for other simulators.
rule fmu:
    input:
        [f"results/models/{cell}.fmu" for cell in MODELLED],
        [f"results/pack_models/{group}.fmu" for group in PACK_MODELS],
    output:
        "results/models/fmu_units.csv",
    log:
        "logs/fmu.log",
    message:
        "All cells and packs as functional mock-up units: {output}."
    script:
        "../../scripts/pack_export/fmu.py"
