# Pack models as documents, and functional mock-up units (FMI) of cells and packs.


def rows_of_pack(group):
    """Rows of groups.tsv of a group and of all groups in it."""
    inner = [row["cell"] for row in BRANCHES[group] if row["cell"] in BRANCHES]
    return [*BRANCHES[group], *[row for name in inner for row in rows_of_pack(name)]]


def cells_of_pack(group):
    """Cells of a group and of all groups in it."""
    return [row["cell"] for row in rows_of_pack(group) if row["cell"] not in BRANCHES]


PACK_MODELS = [group for group in BRANCHES if all(c in MODELLED for c in cells_of_pack(group))]


rule pack_model:
    input:
        models=lambda w: [f"results/models/{cell}.json" for cell in cells_of_pack(w.group)],
        capacities=lambda w: [
            path for cell in cells_of_pack(w.group) for path in fitted("capacity", cell, "capacity")
        ],
        validation=lambda w: [
            f"results/validation/{cell}/{row['test']}.parquet"
            for cell in cells_of_pack(w.group)
            for row in SCORED[cell]
        ],
        tests=lambda w: artefacts("pack", w.group, "group"),
    output:
        model="results/pack_models/{group}.json",
        lookup="results/pack_models/{group}/lookup.csv",
    log:
        "logs/pack_model/{group}.log",
    wildcard_constraints:
        group=either(PACK_MODELS),
    params:
        rows=lambda w: rows_of_pack(w.group),
    message:
        "Model of pack {wildcards.group} as one document, with the errors that its tests show."
    script:
        "../../scripts/pack_export/pack_model.py"
