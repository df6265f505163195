# What all rules share: the campaign's sheets, which artefact exists for whom, the code's hash.

import sys
import time
from functools import partial
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

from cellwright.records.conditions import stated_or_reference
from runtime import job_environment, job_requests, rule_setup
from runtime import campaign_check, raw_files, run_end, settings, sheets, snakemake_state
from runtime.bias_plan import BiasPlan
from runtime.health_plan import SLOW_CURVE_KINDS, HealthPlan
from runtime.model_plan import ModelPlan
from runtime.plan import CAPACITY_KINDS, EFFECT_KINDS, PULSE_KINDS, SIZE_KINDS
from runtime.plan import Plan, gathered, of_cell, of_first_checkup, of_rows, of_test, own
from runtime.plan import paths_of, where
from runtime.record_plan import RecordPlan
from runtime.search_plan import SearchPlan
from runtime.wildcard_patterns import either, only_these
from snakemake_logger_plugin_progress import JOBS

# Functional mock-up units are made by a package beside the science.
job_environment.prepare(SCRIPTS, str(PIPELINE / "plugins" / "cellwright-fmu"))
snakemake_state.compare_parameters_without_pandas()
snakemake_state.keep_wildcard_constraints(workflow.storage_registry.default_storage_provider)
STARTED = time.time()
BEFORE = run_end.read(Path.cwd())
if workflow.is_main_process:
    snakemake_state.clear_stale_locks(Path.cwd())

# The `config:` of a module stands for config/config.yaml, which is then the using workflow's own.
AS_MODULE = not workflow.modifier.is_main_snakefile()
CAMPAIGN, MISSING = campaign_check.check(
    Path.cwd(), SCHEMAS, config, alone=AS_MODULE and workflow.modifier.skip_configfile
)
if workflow.is_main_process:
    sys.stderr.writelines(f"{line}\n" for line in campaign_check.in_words(MISSING))
config = CAMPAIGN.config
CHOICES = sheets.choices(config, SCHEMAS)
PLAN = Plan(CAMPAIGN)
CELLS, TESTS, TESTS_OF = PLAN.cells, PLAN.tests, PLAN.tests_of
BRANCHES, WIRED, LEAVES = PLAN.branches, PLAN.wired, PLAN.leaves
# What files of the user's hold, of those that jobs can read: another content makes anew what is
# read from it, also where the file that replaces another one has an older date.
LARGEST_MEGABYTE = dict.fromkeys(PLAN.files_of_cells())
LARGEST_MEGABYTE |= dict.fromkeys(PLAN.files_of_tests(), config["files"]["largest_megabyte"])
CONTENTS = raw_files.planned(LARGEST_MEGABYTE)


def written_to():
    """Files of the user's that hold something else by now than when the run was planned."""
    return raw_files.changed(CONTENTS, raw_files.planned(LARGEST_MEGABYTE))


def last_lines(*before):
    """The last lines of a run; of `verify`, what it found."""
    verified = {job.rule.name for job in workflow.dag.jobs} == {"verify"}
    log = Path("logs", "verify.log")
    if verified and log.is_file() and log.stat().st_mtime >= STARTED:
        return [log.read_text(encoding="utf-8")]
    return [*before, *run_end.lines(Path.cwd(), BEFORE, STARTED, written_to())]


def contents_of(files):
    """Inputs of a job among files of the user's, with what they hold; of others it says itself."""
    return {file: CONTENTS[file] for file in files if file in CONTENTS}


def local_files(contents):
    """Function of a job: the files of which `contents` gives for it what they hold.

    They stay where the laboratory wrote them, also where artefacts lie in object storage.
    """
    return lambda wildcards: [local(file) for file in contents(wildcards)]


TEST_FACTS = PLAN.facts_in_tables
tests, artefacts, fitted, everywhere = PLAN.rows, PLAN.artefacts, PLAN.fitted, PLAN.everywhere
chamber_temperatures = PLAN.chamber_temperatures
test_facts, cell_facts, facts_of = PLAN.test_facts, PLAN.cell_facts, PLAN.facts_of
facts_of_own_tests = PLAN.facts_of_own_tests
# Settings of a section that reach an analysis; the others decide which jobs there are.
of_analysis = partial(settings.of_analysis, config, settings.load(SCHEMAS, "config"))
# Kinds of test in which every rest after a load is fitted by exponentials.
RELAXATION_KINDS = ["relaxation", "hppc", "capacity", "ocv_temperature", "pulse_resistance"]
# Tests whose loads tell resistances, models and their errors: the same measurement in two of them
# counts once.
EVIDENCE_KINDS = sorted({*PULSE_KINDS, *RELAXATION_KINDS, "capacity", "drive"})
SERIES_KINDS = sorted({row["kind"] for row in CAMPAIGN.tests} - {"eis"})
