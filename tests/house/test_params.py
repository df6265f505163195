"""A rule's parameters hold the settings that its script uses, and no other.

So a setting re-runs the jobs that use it. Which settings a step of the public interface uses says
its code: a section that it takes as a whole, or keys in its signature.
"""

import ast
import re
from functools import cache

import pytest
from test_workflow import CONFIG, RULES
from tree import SCIENCE, SCRIPTS, parsed

from cellwright import MODULE_OF
from runtime import time_limit
from tools import settings_module

SECTIONS = {
    settings_module.class_name(name): name
    for _, names in settings_module.FILES.values()
    for name in names
}


def whole(section) -> set[str]:
    """Dotted keys of a section that reach an analysis."""
    return {f"{section}.{key}" for key in settings_module.of_science(CONFIG["properties"][section])}


@cache
def handed(body) -> set[str]:
    """Keys that a rule's parameters take from the config."""
    params = re.search(r"^    params:\n((?:        .*\n)+)", body, re.M)
    text = params[1] if params else ""
    single = re.findall(r'config\["(\w+)"\]\["(\w+)"\]', text)
    sections = re.findall(r'config\["(\w+)"\](?!\[)|of_analysis\("(\w+)"\)', text)
    found = {f"{section}.{key}" for section, key in single}
    typed = [one or other for one, other in sections if (one or other) in SECTIONS.values()]
    return found.union(*(whole(section) for section in typed))


@cache
def used(script) -> set[str]:
    """Keys that the steps use which a script calls as `cw.<step>(…)`, and of its limit of time."""
    nodes = ast.walk(parsed(SCRIPTS / f"{script}.py"))
    called = {ast.unparse(node.func) for node in nodes if isinstance(node, ast.Call)}
    steps = (name.removeprefix("cw.") for name in called if name.startswith("cw."))
    limit = {time_limit.SETTING} if "time_limit.within" in called else set()
    return limit.union(*(of_step(step) for step in steps))


def of_step(step) -> set[str]:
    """Keys that a step of the interface uses, by its code."""
    path = SCIENCE.parent / f"{MODULE_OF[step].replace('.', '/')}.py"
    tree = parsed(path)
    held = {  # MODELS = Models(), of which single keys are defaults
        node.targets[0].id: SECTIONS[node.value.func.id]
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.value)[:-2] in SECTIONS
    }
    function = next(n for n in tree.body if isinstance(n, ast.FunctionDef) and n.name == step)
    found = set()
    for default in filter(None, function.args.kw_defaults):
        if isinstance(default, ast.Attribute) and ast.unparse(default.value) in held:
            found.add(f"{held[default.value.id]}.{default.attr}")
    names = {function, *(n for n in tree.body if calls(function, n))}
    for node in (node for one in names for node in ast.walk(one)):
        if isinstance(node, ast.Call) and ast.unparse(node.func) == "inputs.settings_of":
            found |= whole(SECTIONS[ast.unparse(node.args[0])])
    return found


def calls(function, other) -> bool:
    """Whether a function calls another one of its module."""
    names = {n.id for n in ast.walk(function) if isinstance(n, ast.Name)}
    return isinstance(other, ast.FunctionDef) and other.name in names


CHECKED = [
    (rule, re.search(r"scripts/([\w/]+)\.py", body)[1], body)
    for rule, body in RULES
    # Figures say themselves what they use.
    if not rule.startswith("figure")
]


@pytest.mark.parametrize(("rule", "script", "body"), CHECKED, ids=[rule for rule, *_ in CHECKED])
def test_a_rule_hands_over_the_settings_that_its_script_uses(rule, script, body):
    assert handed(body) == used(script)


@pytest.mark.parametrize("section", ["clean", "ocv", "models", "temperature", "soc"])
def test_a_setting_is_in_the_parameters_of_the_rules_that_use_it_only(section):
    """Each key reaches at least one rule, and no rule whose script does not ask for it."""
    for key in whole(section):
        having = {rule for rule, _, body in CHECKED if key in handed(body)}
        asking = {rule for rule, script, _ in CHECKED if key in used(script)}
        assert having == asking
        assert having, f"no rule uses {key}"


def test_settings_are_told_apart():
    """What the test above stands on: keys differ between rules of one section."""
    scripts = {rule: used(script) for rule, script, _ in CHECKED}
    assert scripts["compensation"] == {"models.split_rest_second"}
    assert scripts["identify"] == {"models.split_rest_second", "models.members"}
    instrument = {"instrument.current_accuracy_share", "instrument.clock_error_share"}
    assert scripts["ocv"] == {"ocv.least_hour"} | instrument
    assert scripts["ocv_rests"] == set()
    assert "missing_effect.enabled" not in scripts["effect_search"]
    assert "missing_effect.material_volt" in scripts["effect_search"]
    assert scripts["capacity"] == instrument
