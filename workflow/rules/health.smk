# How a cell ages: peaks of dQ/dV followed through its life.

FOLLOWED = cells_where(lambda cell: len(tests(cell, "ica")) >= 2 or tests(cell, "ageing"))


rule ica_life:
    input:
        series="results/clean/{cell}/{test}.parquet",
        steps="results/segment/{cell}/{test}.parquet",
        cycles="results/ageing_cycles/{cell}/{test}.parquet",
    output:
        peaks="results/ica_life/{cell}/{test}.parquet",
        curves="results/ica_life_curve/{cell}/{test}.parquet",
    log:
        "logs/ica_life/{cell}/{test}.log",
    params:
        settings=config["ica"],
        most=config["ica_tracks"]["most_charges"],
    message:
        "Incremental capacity of {wildcards.cell}, up to {params.most} charges of {wildcards.test}."
    script:
        "../../scripts/health/ica_life.py"


rule ica_tracks:
    input:
        check_ups=lambda w: artefacts("ica", w.cell, "ica"),
        curves=lambda w: artefacts("ica_curve", w.cell, "ica"),
        lives=lambda w: artefacts("ica_life", w.cell, "ageing"),
    output:
        "results/ica_tracks/{cell}.parquet",
    log:
        "logs/ica_tracks/{cell}.log",
    wildcard_constraints:
        cell=either(FOLLOWED),
    params:
        settings=config["ica_tracks"],
        tests=facts_of_own_tests,
        chemistry=lambda w: CELLS[w.cell]["chemistry"],
    message:
        "Peaks of incremental capacity of {wildcards.cell}, followed through its life."
    script:
        "../../scripts/health/ica_tracks.py"
