# What all rules share: the campaign's sheets, which artefact exists for whom, the code's hash.

import re
import sys
import time
from functools import cache
from pathlib import Path

from snakemake.exceptions import WorkflowError

# Where the pipeline lies, which is not where a workflow lies that uses it as a module.
PIPELINE = Path(workflow.current_basedir.get_path_or_uri(secret_free=True)).resolve().parents[1]
SCRIPTS = str(PIPELINE / "scripts")
SCHEMAS = PIPELINE / "workflow" / "schemas"
if not Path(SCRIPTS, "runtime").is_dir():
    raise WorkflowError(
        f"Cellwright runs from a clone on this disk: found no scripts/runtime in {PIPELINE}, "
        "wanted the path of workflow/Snakefile in a clone as `snakefile:` of the module"
    )
if workflow.modifier.path_modifier.prefix or workflow.modifier.path_modifier.modifies_prefixes:
    raise WorkflowError(
        "Cellwright as a module: found `prefix:` or `replace_prefix:`, wanted neither; sheets, raw "
        "files and results of a campaign lie in one folder, and each campaign is a run of its own "
        "(`snakemake --directory CAMPAIGN`)"
    )
sys.path.insert(0, SCRIPTS)

from cellwright.health.electrodes import names as half_cell_names
from cellwright.packs import wiring
from cellwright.records.conditions import SAME_CHECKUP_CYCLES, in_first_checkup
from runtime import contract, job_environment, job_requests, object_storage
from runtime import settings, sheets, snakemake_state
from runtime.provenance import codes_of

# Rules that judge the pipeline against known truth use the laboratory's scorer; functional mock-up
# units are made by a package beside the science.
job_environment.prepare(
    SCRIPTS, str(PIPELINE / "lab"), str(PIPELINE / "plugins" / "cellwright-fmu")
)
snakemake_state.compare_parameters_without_pandas()
object_storage.keep_wildcard_constraints(workflow.storage_registry.default_storage_provider)
STARTED = time.time()
if workflow.is_main_process:
    snakemake_state.clear_stale_locks(Path.cwd())

# The `config:` of a module stands for config/config.yaml, which is then the using workflow's own.
AS_MODULE = not workflow.modifier.is_main_snakefile()
CAMPAIGN = sheets.read(
    Path.cwd(), SCHEMAS, config, alone=AS_MODULE and workflow.modifier.skip_configfile
)
config = CAMPAIGN.config
CHOICES = sheets.choices(config, SCHEMAS)
CELLS = {row["cell"]: row for row in CAMPAIGN.cells}
TESTS = {(row["cell"], row["test"]): row for row in CAMPAIGN.tests}
TESTS_OF = {owner: [] for owner in [*CELLS, *(row["group"] for row in CAMPAIGN.groups)]}
for row in CAMPAIGN.tests:
    TESTS_OF[row["cell"]].append(row)
# Members of each group in their order; its rows with those of the groups in it; its cells, in the
# order in which cell voltages and temperatures of its records stand.
BRANCHES = {}
for row in sorted(CAMPAIGN.groups, key=lambda row: row["position"]):
    BRANCHES.setdefault(row["group"], []).append(row)
WIRED = {group: wiring.rows_below(group, CAMPAIGN.groups) for group in BRANCHES}
LEAVES = {g: wiring.cells_of(wiring.wiring_of(g, rows)) for g, rows in WIRED.items()}


def owner(wildcards):
    """The cell or group that a job is about."""
    return wildcards.get("cell") or wildcards.group


def test_facts(wildcards):
    """Of the sheet's row of a test what analyses need: a note edited later re-runs none of them."""
    row = TESTS[owner(wildcards), wildcards.test]
    names = ["kind", "ambient_temperature_celsius", "cycle", "soc", "role"]
    return {name: row[name] for name in names}


def cell_facts(wildcards):
    """Of the sheet's row of a cell what analyses need; of a group, that of its first cell."""
    return facts_of(owner(wildcards))


def facts_of(name):
    """The same by the name of the cell or group."""
    row = CELLS.get(name) or CELLS[LEAVES[name][0]]
    names = ["cell", "rated_capacity_ampere_hour", "lower_cutoff_volt", "upper_cutoff_volt"]
    names.append("state_of_health")
    return {name: row[name] for name in names}


def tests(name, *kinds, roles=("fit", "validation", "split")):
    """Rows of the sheet: tests of a cell or group of these kinds and roles."""
    return [row for row in TESTS_OF[name] if row["kind"] in kinds and row["role"] in roles]


def artefacts(stage, name, *kinds, roles=("fit", "validation", "split")):
    """Paths of one stage's artefacts for the tests of a cell or group."""
    rows = tests(name, *kinds, roles=roles)
    return [f"results/{stage}/{name}/{row['test']}.parquet" for row in rows]


def fitted(stage, name, *kinds):
    """As `artefacts`, without the tests that must take no part in any fit or choice."""
    return artefacts(stage, name, *kinds, roles=["fit"])


def everywhere(stage, *kinds, **roles):
    """Paths of one stage's artefacts for all cells and groups."""
    return [path for name in TESTS_OF for path in artefacts(stage, name, *kinds, **roles)]


def cells_where(condition):
    """Cells of which this is so, as keys in the order of the sheet: asked for of cell after cell."""
    return {cell: None for cell in CELLS if condition(cell)}


def chamber_temperatures(cell, *kinds):
    """Stated temperatures of a cell's tests of these kinds that may be fitted [°C]."""
    rows = tests(cell, *kinds, roles=["fit"])
    return {row["ambient_temperature_celsius"] for row in rows} - {None}


def either(names):
    """Wildcard constraint: one of these names, or nothing at all.

    Names share their common beginnings in the pattern, and letters with the same endings one class,
    since Snakemake tries a constraint on almost every file: with all names in a row the time of one
    trial would grow with the number of cells.
    """
    return one_of(frozenset(names)) if names else "(?!)"


@cache
def one_of(names):
    """Pattern of these names; an empty name makes the others optional."""
    endings, letters = {}, {}
    for name in filter(None, names):
        endings.setdefault(name[0], set()).add(name[1:])
    for letter, rest in sorted(endings.items()):
        letters.setdefault(one_of(frozenset(rest)), []).append(re.escape(letter))
    parts = [
        f"{of[0]}{rest}" if len(of) == 1 else f"[{''.join(of)}]{rest}"
        for rest, of in letters.items()
    ]
    grouped = parts[0] if len(parts) == 1 and "" not in names else f"(?:{'|'.join(parts)})"
    if not parts:
        return ""
    return f"{grouped}?" if "" in names else grouped


def only_these(rows):
    """Wildcard constraint of `cell`: a name in a path that ends in one of its tests in `rows`."""
    names, alike = {}, {}
    for row in rows:
        names.setdefault(row["cell"], []).append(row["test"])
    for name, tests_of_name in names.items():
        alike.setdefault(either(tests_of_name), []).append(name)
    return "|".join(f"(?:{either(alike[of])})(?=/(?:{of})\\.)" for of in alike) or "(?!)"


def script_of(rule):
    """The script of a rule of this pipeline, as `protocols/ocv`; None for all other rules."""
    path = rule.script and Path(str(rule.basedir.get_path_or_uri(secret_free=True)), rule.script)
    inside = path and path.resolve().is_relative_to(SCRIPTS)
    return path.resolve().relative_to(SCRIPTS).with_suffix("").as_posix() if inside else None


def own_parameters(rule, codes):
    """Parameters of a rule that decide, beside its own, whether it runs again.

    `code` is the hash of its script and of all that this imports, out of `codes`; `contract` that
    of what its files are held against, which their folders and suffixes tell. A rule that the using workflow renamed keeps its own name in the
    provenance of what it makes, so that the same inputs give the same bytes.
    """
    script = script_of(rule)
    own_name = script.rpartition("/")[2]
    renamed = {"rule": own_name} if rule.name != own_name else {}
    held_against = contract.fingerprint(*map(str, rule.output))
    return {"code": codes[script], "contract": held_against, **renamed}


JOB_COSTS = job_requests.read(PIPELINE / "workflow" / "job_costs.csv")


def ask_for_resources(own_rule):
    """Lay on a rule the memory and time that its jobs ask a cluster for, and their group.

    What the user sets by --set-resources stays. Executors on this machine know no groups.
    """
    cost = JOB_COSTS.get(script_of(own_rule).rpartition("/")[2])
    if cost is None:
        return
    set_by_user = workflow.resource_settings.overwrite_resources.get(own_rule.name, {})
    for name, amount in job_requests.requests(cost).items():
        if name not in set_by_user:
            own_rule.resources[name] = amount
    own_rule.group = job_requests.group_of(cost, own_rule.wildcard_names)


SECTIONS = settings.load(SCHEMAS, "config")["properties"]


def of_analysis(section):
    """Settings of a section that reach an analysis; the others decide which jobs there are."""
    keys = SECTIONS[section]["properties"]
    return {name: config[section][name] for name, spec in keys.items() if not spec.get("plans")}


CAPACITY_KINDS = ("capacity", "ocv")
# Tests that tell what SoC refers to: charges for dQ/dV too, where they are slow.
SIZE_KINDS = (*CAPACITY_KINDS, "ica")
PULSE_KINDS = ("hppc", "pulse_resistance")
RELAXATION_KINDS = config["relaxation"]["kinds"]
# Tests whose loads tell resistances, models and their errors: the same measurement in two of them
# counts once.
EVIDENCE_KINDS = sorted({*PULSE_KINDS, *RELAXATION_KINDS, "capacity", "drive"})
SERIES_KINDS = sorted({row["kind"] for row in CAMPAIGN.tests} - {"eis"})
# Of each test what tables say beside its results.
TEST_FACTS = {
    f"{name}/{test}": {key: row[key] for key in ["cycle", "ambient_temperature_celsius", "soc"]}
    for (name, test), row in TESTS.items()
}


def facts_of_tests_of(names):
    """Of each test of these cells what tables say beside its results."""
    keys = [f"{row['cell']}/{row['test']}" for name in names for row in TESTS_OF[name]]
    return {key: TEST_FACTS[key] for key in keys}


def facts_of_own_tests(wildcards):
    """The same of the tests of a job's cell."""
    return facts_of_tests_of([wildcards.cell])


# Snakemake's default limit of 100 jobs a second limits nothing here, and costs: each look for jobs
# sets a timer that causes another look a second later, and so on, so that looks add up with the jobs
# done. Who asks for another limit gets it.
onstart:
    limit = workflow.scheduler.job_rate_limiter
    if limit and (limit.max_jobs, limit.timespan) == (100, 1):
        workflow.scheduler.job_rate_limiter = None
