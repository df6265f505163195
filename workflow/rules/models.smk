# Equivalent circuits: what a cell's SoC refers to, identification, validation.


def type_of(cell):
    """Cells of one type share chemistry and rating; what is not stated is of no type."""
    row = CELLS[cell]
    return row["chemistry"], row["rated_capacity_ampere_hour"]


# Cells of each stated type, and those of them that are marked as reference.
OF_TYPE, MARKED_OF_TYPE = {}, {}
for cell in dict.fromkeys(cell for cell in CELLS if None not in type_of(cell)):
    OF_TYPE.setdefault(type_of(cell), []).append(cell)
    if CELLS[cell]["reference"] == "yes":
        MARKED_OF_TYPE.setdefault(type_of(cell), []).append(cell)


def references(cell):
    """Other cells of the type that are marked as reference."""
    return [c for c in MARKED_OF_TYPE.get(type_of(cell), []) if c != cell]


def peers(cell):
    """Other cells of the type, from which a cell may borrow: the marked ones, else all."""
    return references(cell) or [c for c in OF_TYPE.get(type_of(cell), []) if c != cell]


def curve_lenders(cell):
    """Peers whose OCV a cell may borrow, should it have none, or none that can be used.

    Where no peer is marked as reference, a cell with a slow test of its own asks nobody: a
    campaign of a thousand such cells would else make a million dependencies.
    """
    asked = references(cell) or not tests(cell, "ocv", roles=["fit"])
    return [c for c in peers(cell) if tests(c, "ocv", roles=["fit"])] if asked else []


# Kinds of test of which a logged temperature may tell how a cell warms.
WARMING_KINDS = ("capacity", "hppc", "ica")
FIT_KINDS = config["models"]["fit_kinds"]


def fit_tests(cell):
    """HPPC tests and drives that may be fitted (`fit`, or the odd blocks of `split`)."""
    kinds = [kind for kind in ("hppc", "drive") if kind in FIT_KINDS]
    return [row for kind in kinds for row in tests(cell, kind, roles=FIT_ROLES[kind])]


def fit_series(cell):
    """What a model is fitted to; capacity tests join the pulses, whose loads are short."""
    rows = fit_tests(cell) or long_loads(cell)
    if "capacity" in FIT_KINDS and any(row["kind"] == "hppc" for row in rows):
        rows = rows + tests(cell, "capacity", roles=["fit"])
    return of_rows("clean", cell, rows)


def long_loads(cell, *kinds):
    """Capacity tests of a cell's first check-up (and tests of other `kinds`) that may be fitted."""
    rows = tests(cell, "capacity", *kinds, roles=["fit"])
    young = in_first_checkup([row["cycle"] for row in rows])
    return [row for row, is_young in zip(rows, young) if is_young]


def several_loads(cell):
    """Whether long loads may tell a model: beside a slow test or a lent curve, or two of them."""
    slow = tests(cell, "ocv", roles=["fit"]) or curve_lenders(cell)
    fits = "capacity" in FIT_KINDS and long_loads(cell)
    return bool(fits and (slow or len(long_loads(cell, "ica")) > 1))


def calibrating(cell):
    """Cells of the type that have a model of their own pulses or drives."""
    return [c for c in OF_TYPE.get(type_of(cell), []) if c != cell and c in EXCITED]


# A cell's model comes from its own pulses or drives, else from the table that the sheet gives of it,
# else from its type's reference, else from its own long loads, else from its group.
EXCITED = dict.fromkeys(filter(fit_tests, CELLS))
GIVEN = dict.fromkeys(
    cell for cell in CELLS if cell not in EXCITED and CELLS[cell].get("model_table")
)
BIASED = dict.fromkeys(
    cell
    for cell in CELLS
    if cell not in EXCITED | GIVEN and tests(cell, "ica", "drive", "capacity") and calibrating(cell)
)
LOADED = dict.fromkeys(
    cell for cell in CELLS if cell not in EXCITED | GIVEN | BIASED and several_loads(cell)
)
IDENTIFIED = EXCITED | LOADED
# Of a plain group of cells in parallel alone: in series nothing tells one cell's charge by itself.
PARALLEL = {
    group: rows
    for group, rows in BRANCHES.items()
    if rows[0]["connection"] == "parallel" and [row["cell"] for row in rows] == list(LEAVES[group])
}
GROUPED = {
    row["cell"]: group
    for group, rows in PARALLEL.items()
    for row in rows
    if row["cell"] not in IDENTIFIED | GIVEN | BIASED and tests(group, "group", roles=["fit"])
}
MODELLED = IDENTIFIED | GIVEN | BIASED | GROUPED
UNMODELLED = dict.fromkeys(cell for cell in CELLS if cell not in MODELLED)
SCORED = {cell: tests(cell, *SERIES_KINDS, roles=["validation", "split"]) for cell in MODELLED}


def scored_at_its_age(cell):
    """Tests of the age of a cell's model that took no part in its fit."""
    later = [float(cycle) for cycle in CHECKUPS.get(cell, [])]
    return [row for row in SCORED[cell] if not near_in_cycles(row, later)]


def scores_of(cell):
    """What they say of the model."""
    return of_rows("validation", cell, scored_at_its_age(cell))


def left_out_series(cell):
    """Whole tests that judge a member with effects, where those were searched for."""
    rows = [row for row in scored_at_its_age(cell) if row["role"] == "validation"]
    return of_rows("clean", cell, rows) if cell in SEARCHED else []


def resting(name):
    """Pulse tests whose rests give an OCV curve: of check-ups without a slow test."""
    slow = [row["cycle"] or 0 for row in tests(name, "ocv")]
    aged = [row["cycle"] or 0 for row in tests(name, "capacity", roles=["fit"])] if slow else [0]
    return [
        row
        for row in tests(name, "hppc", roles=["fit"])
        if not near_in_cycles(row, slow) and (not slow or near_in_cycles(row, aged))
    ]


def other_curves(cell):
    """OCV curves beside the slow ones: of rests; of long loads, where nothing else tells a curve."""
    told = cell not in IDENTIFIED or tests(cell, "ocv", roles=["fit"]) or resting(cell)
    rows = [] if told or curve_lenders(cell) else long_loads(cell, "ica")
    return [*of_rows("ocv_rests", cell, resting(cell)), *of_rows("ocv_load", cell, rows)]


def aged_capacity_tests(cell):
    """Capacity tests of a cell, where they lie at several ages."""
    rows = tests(cell, "capacity", roles=["fit"])
    young = [min((row["cycle"] or 0 for row in rows), default=0)]
    return [] if all(near_in_cycles(row, young) for row in rows) else rows


SHIFTED = dict.fromkeys(filter(aged_capacity_tests, CELLS))


rule ocv_shift:
    input:
        series=PLAN.own_rows("clean", aged_capacity_tests),
        steps=PLAN.own_rows("segment", aged_capacity_tests),
    output:
        "results/stages/ocv_shift/{cell}.parquet",
    log:
        "logs/ocv_shift/{cell}.log",
    wildcard_constraints:
        cell=either(SHIFTED),
    message:
        "Shift of the open-circuit voltage of {wildcards.cell} since its first check-up."
    script:
        "../../scripts/models/ocv_shift.py"


rule basis:
    input:
        rests=own(other_curves),
        shifts=where(SHIFTED, "results/stages/ocv_shift/{}.parquet"),
        capacity=PLAN.own_fitted("capacity", *SIZE_KINDS),
        ocv=PLAN.own_fitted("ocv", "ocv"),
        lent_ocv=PLAN.fitted_of(curve_lenders, "ocv", "ocv"),
        lent_capacity=PLAN.fitted_of(curve_lenders, "capacity", *CAPACITY_KINDS),
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
        series=own(fit_series),
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


# Cells with tests in which a cell warms by loads both ways, or by pulses.
WARMED = dict.fromkeys(
    cell
    for cell in CELLS
    if cell in IDENTIFIED | BIASED and tests(cell, *WARMING_KINDS, roles=["fit"])
)


def warming_series(wildcards):
    """Tests that tell how a cell warms, and those that score it."""
    told = tests(wildcards.cell, *WARMING_KINDS, roles=["fit"])
    scored = tests(wildcards.cell, "drive", roles=["validation"])
    return of_rows("clean", wildcards.cell, [*told, *scored])


rule thermal:
    input:
        model="results/models/{cell}.json",
        series=warming_series,
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
        table=lambda w: [local(file) for file in table_of_model(w)],
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


def source_of_model(wildcards):
    """The artefact of a cell's model: its own tests, a table, its IC peaks, or its group."""
    if wildcards.cell in IDENTIFIED:
        return f"results/stages/identify/{wildcards.cell}.json"
    if wildcards.cell in GIVEN:
        return f"results/stages/given_model/{wildcards.cell}.json"
    if wildcards.cell in BIASED:
        return f"results/stages/bias/{wildcards.cell}.json"
    return f"results/stages/branches/{GROUPED[wildcards.cell]}.json"


def effects_of(wildcards):
    """The effects found in a cell, where they were searched for."""
    found = f"results/missing_effect/{wildcards.cell}/model.json"
    return [found] if wildcards.cell in SEARCHED else []


def choice_series(wildcards):
    """What decides which member a model uses: the tests that it was fitted to."""
    cell = wildcards.cell
    searched = tests(cell, *EFFECT_KINDS, roles=["fit", "split"]) if cell in SEARCHED else []
    also = of_rows("clean", cell, searched)
    return list(dict.fromkeys([*fit_series(cell), *also])) if cell in IDENTIFIED else []


def law_of(wildcards):
    """What chose the law over temperature of a cell, where temperatures were left out."""
    found = f"results/stages/compensation/{wildcards.cell}.parquet"
    return [found] if wildcards.cell in COMPENSATED else []


rule member:
    input:
        source=source_of_model,
        basis=where(IDENTIFIED, "results/stages/basis/{}.json"),
        law=law_of,
        effects=effects_of,
        series=choice_series,
        left_out=own(left_out_series),
    output:
        model="results/stages/member/{cell}.json",
        choice="results/stages/member_choice/{cell}.parquet",
    log:
        "logs/member/{cell}.log",
    wildcard_constraints:
        cell=either(MODELLED),
    params:
        cell=cell_facts,
        split_rest_second=config["models"]["split_rest_second"],
    message:
        "Which member of the family serves {wildcards.cell}."
    script:
        "../../scripts/models/member.py"


def own_effects_of(wildcards):
    """The effects that the chosen member of a cell lacks, where they were searched for."""
    found = f"results/missing_effect/{wildcards.cell}/own/model.json"
    return [found] if wildcards.cell in SEARCHED_OWN else []


rule model:
    input:
        member="results/stages/member/{cell}.json",
        choice="results/stages/member_choice/{cell}.parquet",
        effects=own_effects_of,
        left_out=own(left_out_series),
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
        tests=lambda w: [
            {name: row[name] for name in ("test", "kind", "role")} for row in TESTS_OF[w.cell]
        ],
        fit_kinds=FIT_KINDS,
        lent_curve=lambda w: bool(curve_lenders(w.cell)),
    message:
        "Why {wildcards.cell} has no model."
    script:
        "../../scripts/models/no_model.py"


EXPORTED = {
    kind: [f"results/models/{cell}/{kind}" for cell in MODELLED]
    for kind in ("pybamm_thevenin.json", "lookup.csv", "over_temperature.csv")
}


def later_checkups(cell):
    """Cycles of the later check-ups that have an HPPC test and one that tells the capacity."""
    sized = PLAN.cycles(cell, *CAPACITY_KINDS)
    aged = [
        row["cycle"]
        for row in fit_tests(cell)
        if row["kind"] == "hppc" and near_in_cycles(row, sized)
    ]
    young = {"cycle": min(sized, default=0)}
    return sorted({f"{cycle:g}" for cycle in aged if not near_in_cycles(young, [cycle or 0])})


CHECKUPS = {cell: cycles for cell in IDENTIFIED if (cycles := later_checkups(cell))}


def checkup_series(wildcards):
    """Tests of one later check-up that its model is fitted to."""
    rows = [
        row
        for row in [*fit_tests(wildcards.cell), *tests(wildcards.cell, "capacity", roles=["fit"])]
        if near_in_cycles(row, [float(wildcards.checkup)])
    ]
    return of_rows("clean", wildcards.cell, rows)


rule model_of_checkup:
    input:
        basis="results/stages/basis/{cell}.json",
        series=checkup_series,
    output:
        model="results/stages/models_of_checkups/{cell}/{checkup}.json",
        parameters="results/stages/parameters_of_checkups/{cell}/{checkup}.parquet",
    log:
        "logs/model_of_checkup/{cell}/{checkup}.log",
    wildcard_constraints:
        cell=either(CHECKUPS),
    params:
        members=config["models"]["members"],
        split_rest_second=config["models"]["split_rest_second"],
        cell=cell_facts,
    message:
        "Model of {wildcards.cell} at its check-up at cycle {wildcards.checkup}."
    script:
        "../../scripts/models/model_of_checkup.py"


def model_at_age(wildcards):
    """The model of a cell at the age of a test: that of its check-up where there is one."""
    row, cell = TESTS[wildcards.cell, wildcards.test], wildcards.cell
    aged = [cycle for cycle in CHECKUPS.get(cell, []) if near_in_cycles(row, [float(cycle)])]
    of_checkup = [f"results/stages/models_of_checkups/{cell}/{cycle}.json" for cycle in aged[:1]]
    return of_checkup or f"results/models/{cell}.json"


rule export:
    input:
        model="results/models/{cell}.json",
        validation=own(scores_of),
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
        model=model_at_age,
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
