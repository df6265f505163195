"""The campaign of hidden effects: for the benchmark of the missing-effect search.

Every effect of the vocabulary at three strengths, healthy cells, effects outside the vocabulary,
two effects at once, cells by physics with an effect laid over them, and parallel groups.
"""

from itertools import product

import numpy as np

from virtual_lab.chamber import wobbling
from virtual_lab.hidden.group_specimen import HiddenGroup, branches, group_tasks
from virtual_lab.hidden.groups import GROUP_EFFECTS
from virtual_lab.hidden.outside import OUTSIDE
from virtual_lab.hidden.over_physics import HiddenPhysics
from virtual_lab.hidden.protocols import slow_task, tasks
from virtual_lab.hidden.setup import CHEMISTRY, RATING
from virtual_lab.hidden.specimen import HiddenCell
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE
from virtual_lab.plan import Cell, Plan, Test, seed_of

STRENGTHS_VOLT = (1e-3, 2.5e-3, 6e-3)
STRONG_VOLT = STRENGTHS_VOLT[1:]
INVISIBLE_CELLS = 2
REFERENCES = 3
# Effects that are told apart by dynamics, two of which may sit in one cell.
DYNAMIC = (
    "hysteresis_instant",
    "resistance_asymmetry",
    "resistance_soc",
    "slow_diffusion",
    "charge_transfer_nonlinearity",
    "resistance_temperature",
    "entropic_ocv",
    "self_heating",
    "current_offset",
    "time_skew",
)
# What can be laid over the voltage of a cell by physics without touching the cell.
OVER_PHYSICS = (
    "hysteresis_instant",
    "resistance_asymmetry",
    "resistance_soc",
    "slow_diffusion",
    "resistance_temperature",
    "current_offset",
    "time_skew",
)
PHYSICS_CHEMISTRY = "NMC811"  # a type of its own, so that it lends to and borrows from its like
FULL_WITHIN = 0.01
CELLS_PER_JOB = 10
WOBBLE_KELVIN, WOBBLE_SECOND = 0.4, 1200.0
CONFIG = "# No choice of this campaign differs from the documented defaults.\n"
ABOUT = """# What is hidden in this campaign

`missing_effect.json`: per cell or group its `kind` (reference, none, single, two, unknown), the
effects with their parameters (defined in scripts/virtual_lab/hidden/vocabulary.py) and the names
that count as right (`accept`). `visible_gap_millivolt`: what is left, as a root mean square over
the fit tests, when the resistances, time constants and initial states of the plain circuit have
been refitted, with the exact OCV; `gap_after_base_fit_millivolt`: the OCV, too, may move within
1.5 mV; `validation_gap_millivolt`: that fit on the validation drives. `visible`: more than 1.15
(fit) or 1.3 (validation) times the noise `floor_volt`; where it is false, "none" is right too.
A lead resistance and a gain of the current leave no gap: a cell with other parameters is the same.
The group's strength is what a branch current has of its own times that cell's ohmic resistance.
"""


def plan(*, seed, cells, healthy, unknown, two, physics, groups) -> Plan:
    """All tests; the options are numbers of cells, `cells` and `groups` per effect and strength."""
    specimens = [
        *_numbered("r", seed, "reference", [()] * REFERENCES, 0.0),
        *_numbered("n", seed, "none", [()] * healthy, 0.0),
        *_single(seed, cells),
        *_numbered("u", seed, "unknown", _outside(unknown), STRONG_VOLT[1]),
        *_numbered("t", seed, "two", _pairs(seed, two), STRONG_VOLT[1]),
    ]
    jobs = [specimens[k : k + CELLS_PER_JOB] for k in range(0, len(specimens), CELLS_PER_JOB)]
    tests = [t for k, job in enumerate(jobs) for one in job for t in _tests(one, f"cells_{k:03d}")]
    by_physics = _by_physics(seed, physics)
    tests += [t for one in by_physics for t in _tests(one, f"physics_{one.name}")]
    rows = [_row(one, CHEMISTRY) for one in specimens]
    rows += [_row(one, PHYSICS_CHEMISTRY) for one in by_physics]
    bundles = _groups(seed, groups)
    rows += [_row(one, CHEMISTRY) for group in bundles for one in branches(group)]
    tests += [t for group in bundles for t in _group_tests(group)]
    return Plan(tuple(rows), tuple(tests), {g.name: g for g in bundles}, CONFIG, ABOUT)


def _numbered(letter, seed, kind, effects, strength):
    return [
        HiddenCell(f"{letter}{k:04d}", seed, kind, names, strength)
        for k, names in enumerate(effects, 1)
    ]


def _single(seed, cells):
    visible = [e for e in EFFECTS if e not in INVISIBLE]
    wanted = list(product(visible, STRENGTHS_VOLT, range(cells)))
    wanted += list(product(INVISIBLE, STRONG_VOLT[:1], range(min(cells, INVISIBLE_CELLS))))
    return [
        HiddenCell(f"s{k:04d}", seed, "single", (effect,), strength)
        for k, (effect, strength, _) in enumerate(wanted, 1)
    ]


def _outside(count):
    names = list(OUTSIDE)
    return [(names[k % len(names)],) for k in range(count)]


def _pairs(seed, count):
    """Two different effects, drawn."""
    random = np.random.default_rng(seed_of("pairs", seed))
    return [tuple(random.choice(DYNAMIC, 2, replace=False).tolist()) for _ in range(count)]


def _by_physics(seed, count):
    """References, cells with an effect, and half as many healthy ones."""
    if not count:
        return []
    effects = [(OVER_PHYSICS[k % len(OVER_PHYSICS)],) for k in range(count)]
    kinds = [("reference", ())] * REFERENCES
    kinds += [("none", ())] * (count // 2) + [("single", names) for names in effects]
    return [
        HiddenPhysics(f"p{k:04d}", seed, kind, names, STRONG_VOLT[1] if names else 0.0)
        for k, (kind, names) in enumerate(kinds, 1)
    ]


def _groups(seed, count):
    if not count:
        return []
    wanted = list(product(GROUP_EFFECTS, STRONG_VOLT, range(count)))
    wanted += [(None, 0.0, k) for k in range(2 * count)]
    return [
        HiddenGroup(f"g{k:03d}", seed, effect, strength)
        for k, (effect, strength, _) in enumerate(wanted, 1)
    ]


def _row(one, chemistry):
    return Cell(one.name, chemistry, RATING, one, reference=one.kind == "reference")


def _tests(one, batch):
    wanted = [slow_task()] if one.kind == "reference" else []
    return [_test(one, task, batch) for task in [*wanted, *tasks()]]


def _test(one, task, batch):
    random = np.random.default_rng(seed_of(f"start of {one.name}/{task.test}", one.seed))
    return Test(
        one.name,
        task.test,
        task.kind,
        task.celsius,
        "parquet",
        one._replace(at_capacity_test=task.kind == "capacity"),
        steps=task.steps,
        chain=None,
        chamber=wobbling(
            task.celsius,
            amplitude_kelvin=WOBBLE_KELVIN,
            period_second=WOBBLE_SECOND,
            duration_second=sum(step.duration_second for step in task.steps),
            seed=seed_of(f"chamber of {one.name}/{task.test}", one.seed),
        ),
        current_sign="charge_positive",
        soc=1.0 if task.role == "validation" or task.kind in ("hppc", "drive") else None,
        initial_soc=1.0 - FULL_WITHIN * random.random(),
        role=task.role,
        batch=batch,
        seed_of_campaign=one.seed,
    )


def _group_tests(group):
    return [
        *[t for one in branches(group) for t in _tests(one, f"group_{group.name}")],
        *[_group_test(group, task) for task in group_tasks(len(group.names))],
    ]


def _group_test(group, task):
    return Test(
        group.name,
        task.test,
        "group",
        task.celsius,
        "parquet",
        group,
        steps=task.steps,
        chain=None,
        current_sign="charge_positive",
        soc=None,
        initial_soc=None,
        role=task.role,
        batch=f"group_{group.name}",
        seed_of_campaign=group.seed,
    )
