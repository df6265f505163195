"""Laws of the rules and the config: told in words, hashed code, every key known and documented."""

import ast
import re

import pytest
from tree import LABORATORY, ROOT, SCRIPTS, held_by_every, imports, modules, name, parsed

from runtime import job_requests, settings
from tools import settings_module

WORKFLOW = ROOT / "workflow"
FILES = sorted((WORKFLOW / "rules").glob("*.smk"))
TEXT = "\n".join(path.read_text(encoding="utf-8") for path in [*FILES, WORKFLOW / "Snakefile"])
# A rule ends where a line begins at the margin again.
BLOCKS = re.findall(r"^(?:rule|checkpoint) (\w+):\n((?:[ \t]+.*\n|\n)*)", TEXT + "\n", re.M)
RULES = [(rule, body) for rule, body in BLOCKS if rule != "all"]
CONFIG = settings.load(WORKFLOW / "schemas", "config")
MOST_FUNCTIONS_IN_RULES = 40
SHEET_NAMES = ("cells", "tests", "groups", "checkups")
SHEETS = [settings.load(WORKFLOW / "schemas", name) for name in SHEET_NAMES]


def scripts_in(body) -> list[str]:
    """Paths below scripts/ of what a rule runs."""
    return re.findall(r"scripts/(\w+/\w+\.py)", body)


@pytest.mark.parametrize(("rule", "body"), RULES, ids=[rule for rule, _ in RULES])
def test_a_rule_says_what_it_does_logs_and_runs_the_script_of_its_name(rule, body):
    for needed in ("message:", "log:"):
        assert needed in body, f"rule {rule} has no {needed}"
    smk = next(path for path in FILES if re.search(rf"^rule {rule}:", path.read_text(), re.M))
    assert scripts_in(body) == [f"{smk.stem}/{rule}.py"]
    assert (SCRIPTS / smk.stem / f"{rule}.py").is_file()


@held_by_every([SCRIPTS / script for _, body in RULES for script in scripts_in(body)])
def test_a_rules_script_decides_nothing(path):
    """It loads, calls the science and saves; functions belong into the science or the runtime."""
    made = [n for n in ast.walk(parsed(path)) if isinstance(n, ast.FunctionDef | ast.ClassDef)]
    assert not made, f"{made[0].name} belongs into the science"


def test_every_script_of_a_folder_of_rules_is_run():
    """Folders of scripts bear the name of a file of rules, and hold nothing else."""
    folders = [SCRIPTS / path.stem for path in FILES if (SCRIPTS / path.stem).is_dir()]
    found = {f"{p.parent.name}/{p.name}" for folder in folders for p in folder.glob("*.py")}
    assert found <= {script for _, body in RULES for script in scripts_in(body)}
    assert not list(SCRIPTS.glob("*.py")), "scripts lie in folders"


def test_no_rule_runs_a_command():
    assert not [rule for rule, body in RULES if re.search(r"^ +(shell|run):", body, re.M)]


def test_every_rule_asks_for_memory_and_time():
    costs = job_requests.read(WORKFLOW / "job_costs.csv")
    rules = {rule for rule, _ in RULES}
    told = "run lab/tools/job_costs.py, then fill the column part"
    assert not rules - set(costs), f"rules without measured costs: {rules - set(costs)}; {told}"
    assert not set(costs) - rules, f"job_costs.csv has what is no rule: {set(costs) - rules}"
    assert all(cost.longest_cpu_second > 0 and cost.peak_megabyte > 0 for cost in costs.values())


def test_sets_of_cells_are_made_where_they_can_be_tested():
    """By classes of scripts/runtime/*plan.py; in rules stay joins of paths, and figures' inputs."""
    assert len(re.findall(r"^\s*def |\blambda\b", TEXT, re.M)) <= MOST_FUNCTIONS_IN_RULES


def test_all_rules_were_found():
    assert len(BLOCKS) == len(re.findall(r"^(?:rule|checkpoint) ", TEXT, re.M))


def test_every_file_of_rules_is_part_of_the_workflow():
    included = re.findall(r'^include: "rules/(\w+\.smk)"', TEXT, re.M)
    assert sorted(included) == [path.name for path in FILES]


def test_every_key_has_type_default_and_meaning():
    for key, spec in settings.keys(CONFIG):
        assert spec.get("description"), f"{key} has no description"
        assert "type" in spec, f"{key} has no type"
        if spec["type"] == "object":
            closed = spec.get("additionalProperties") is False or "propertyNames" in spec
            assert closed, f"{key} lets unknown keys pass"
        else:
            assert "default" in spec, f"{key} has no default"


def test_every_default_is_allowed():
    assert settings.faults_of(settings.defaults(CONFIG), CONFIG) == []


def test_keys_that_carry_a_unit_say_it():
    endings = {"volt": "V", "second": "s", "celsius": "°C", "ohm": "Ω", "ampere": "A"}
    columns = [pair for sheet in SHEETS for pair in sheet["properties"].items()]
    for key, spec in [*settings.keys(CONFIG), *columns]:
        unit = endings.get(key.rsplit("_", 1)[-1])
        if unit and "_per_" not in key:
            assert spec.get("unit") == unit, f"{key} says unit {spec.get('unit')}, not {unit}"


def test_the_search_takes_every_setting_of_its_sections():
    """A key that no gate or tolerance bears would be chosen and never used."""
    from cellwright.effects.finding import options_of

    section = CONFIG["properties"]["missing_effect"]
    chosen = dict.fromkeys(settings_module.of_science(section), 7.0)
    options = options_of(None, 120.0, chosen)
    assert [*options["gates"], *options["tolerance"]].count(7.0) == len(chosen)


@pytest.mark.parametrize("file", settings_module.files())
def test_typed_settings_are_what_the_schema_says(file):
    written = (settings_module.FOLDER / file).read_text(encoding="utf-8")
    assert written == settings_module.files()[file], "run `scripts/tools/settings_module.py`"


def test_every_section_of_the_science_has_typed_settings_with_its_defaults():
    """A library user has the defaults of a campaign; a section is not forgotten by the tool."""
    from cellwright import settings as typed

    chosen = settings.defaults(CONFIG)
    named = {name for _, names in settings_module.FILES.values() for name in names}
    workflow = {"title", "publication", "strict"}
    assert named == set(CONFIG["properties"]) - workflow
    for section in named:
        value = getattr(typed, settings_module.class_name(section))()
        keys = settings_module.of_science(CONFIG["properties"][section])
        plain = {name: as_config(getattr(value, name)) for name in value._fields}
        assert plain == {name: chosen[section][name] for name in keys}


def as_config(value):
    if hasattr(value, "_asdict"):
        return value._asdict()
    return list(value) if isinstance(value, tuple) else value


def test_rules_and_schema_know_the_same_sections():
    used = set(re.findall(r'(?:config\[|of_analysis\()"(\w+)"[\])]', TEXT))
    known = set(CONFIG["properties"])
    filled = {name for name, spec in CONFIG["properties"].items() if spec.get("properties") != {}}
    assert not used - known, f"rules use config keys that no schema has: {sorted(used - known)}"
    assert not filled - used, f"no rule uses the config keys {sorted(filled - used)}"


def test_every_column_has_type_and_meaning():
    for sheet in SHEETS:
        for column, spec in sheet["properties"].items():
            assert spec.get("type"), f"{sheet['title']} {column} has no type"
            assert spec.get("description"), f"{sheet['title']} {column} has no description"


def test_a_caption_has_one_title_and_one_sentence_on_how_to_read_it():
    """YAML lets a key stand twice: a merge once gave one figure the caption of another."""
    text = (WORKFLOW / "report" / "captions.yaml").read_text(encoding="utf-8")
    blocks = re.split(r"^(?=\w)", text, flags=re.MULTILINE)[1:]
    assert len(blocks) > 30
    assert [b for b in blocks if not re.fullmatch(r"\w+:\n  title: .+\n  read: .+\n", b)] == []


@held_by_every([m for m in modules(SCRIPTS) if m.parent.name != "documentation"])
def test_nothing_of_a_users_run_stands_on_the_laboratory(path):
    """What makes cells of known truth, and what examines the product, is no part of it."""
    apart = {folder.name for folder in LABORATORY.iterdir() if folder.is_dir()} - {"tools"}
    found = {imported for imported in imports(path) if imported.split(".")[0] in apart}
    assert not found, f"{name(path)} imports {sorted(found)}"


def test_no_rule_of_a_users_run_stands_on_the_laboratory():
    assert not re.findall(r".*\blab\b.*|.*\b(?:real_cells|virtual_lab)\b.*", TEXT)
