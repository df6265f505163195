# Health of cells over their lives.

# Cells of one type with charges for dQ/dV, by the first of them; where capacities of four of their
# check-ups are known, they calibrate the peaks.
PEAK_TYPES = {}
for cell, row in CELLS.items():
    if tests(cell, "ica", roles=["fit"]):
        window = row["lower_cutoff_volt"], row["upper_cutoff_volt"]
        type_of_cell = row["chemistry"], row["rated_capacity_ampere_hour"], *window
        PEAK_TYPES.setdefault(type_of_cell, []).append(cell)


def check_ups(cell, *kinds):
    """Cycles at which a cell has tests of these kinds that may be fitted."""
    return {row["cycle"] or 0 for row in tests(cell, *kinds, roles=["fit"])}


PEAK_TYPES = {
    cells[0]: cells
    for cells in PEAK_TYPES.values()
    if sum(len(check_ups(c, "ica") & check_ups(c, *CAPACITY_KINDS)) for c in cells) >= 4
}
FIRST_OF_TYPE = {cell: first for first, cells in PEAK_TYPES.items() for cell in cells}


def of_peak_type(stage, *kinds):
    """Artefacts of a stage of all cells of the type of a job's cell."""
    return lambda w: [path for cell in PEAK_TYPES[w.cell] for path in fitted(stage, cell, *kinds)]


rule peak_calibration:
    input:
        peaks=of_peak_type("ica", "ica"),
        curves=of_peak_type("ica_curve", "ica"),
        capacity=of_peak_type("capacity", *CAPACITY_KINDS),
    output:
        charges="results/peak_calibration/{cell}.parquet",
        information="results/peak_information/{cell}.parquet",
    log:
        "logs/peak_calibration/{cell}.log",
    wildcard_constraints:
        cell=either(PEAK_TYPES),
    params:
        tests=lambda w: facts_of_tests_of(PEAK_TYPES[w.cell]),
        rated_ampere_hour=lambda w: CELLS[w.cell]["rated_capacity_ampere_hour"],
        most_terms=config["health_from_peaks"]["most_terms"],
    message:
        "Capacity from peaks of dQ/dV, calibrated over the cells of the type of {wildcards.cell}."
    script:
        "../../scripts/health/peak_calibration.py"


rule health_from_peaks:
    input:
        calibration=lambda w: f"results/peak_calibration/{FIRST_OF_TYPE[w.cell]}.parquet",
    output:
        "results/health_from_peaks/{cell}.parquet",
    log:
        "logs/health_from_peaks/{cell}.log",
    wildcard_constraints:
        cell=either(FIRST_OF_TYPE),
    message:
        "State of health of {wildcards.cell} from peaks of dQ/dV."
    script:
        "../../scripts/health/health_from_peaks.py"
