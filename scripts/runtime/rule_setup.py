"""What every rule of this pipeline gets once all rules are read: its hashes, its resources."""

from pathlib import Path

from runtime import contract, job_requests
from runtime.provenance import codes_of


def lay_on(workflow, scripts, costs):
    """Give each rule whose script lies in `scripts` its hashes and what its jobs ask for.

    Rules of a workflow that uses this one as a module stay as they are.

    Parameters
    ----------
    workflow : Snakemake's workflow, all of whose rules have been read
    scripts : folder of this pipeline's scripts
    costs : dict of `job_requests.Cost` by rule, from `job_requests.read`
    """
    ours = {rule: script for rule in workflow.rules if (script := script_of(rule, scripts))}
    codes = codes_of(ours.values())
    for rule, script in ours.items():
        # A using workflow may rename a rule; in the provenance it keeps its own name.
        name = script.rpartition("/")[2]
        renamed = {} if rule.name == name else {"rule": name}
        # Beside its own parameters these decide whether a rule runs again: the hash of its script
        # and of all that this imports, and that of the contract of its files.
        expected = contract.fingerprint(*map(str, rule.output))
        rule.set_params(code=codes[script], contract=expected, **renamed)
        if name in costs:
            _set_requests(workflow, rule, costs[name])


def script_of(rule, scripts) -> str | None:
    """The script of a rule of this pipeline, as `protocols/ocv`; None for all other rules."""
    # Rules without a script ask for files only, and so do those of a using workflow.
    if not rule.script:
        return None
    path = Path(str(rule.basedir.get_path_or_uri(secret_free=True)), rule.script).resolve()
    # Scripts of a using workflow may bear the same names; only where they lie tells them apart.
    inside = path.is_relative_to(scripts)
    return path.relative_to(scripts).with_suffix("").as_posix() if inside else None


def _set_requests(workflow, rule, cost):
    """Memory, time and group of a rule's jobs; what the user sets by --set-resources stays.

    Executors on this machine know no groups.
    """
    # What the user asks for is on the rule already, and ours would replace it.
    set_by_user = workflow.resource_settings.overwrite_resources.get(rule.name, {})
    for name, amount in job_requests.requests(cost).items():
        if name not in set_by_user:
            rule.resources[name] = amount
    rule.group = job_requests.group_of(cost, rule.wildcard_names)
