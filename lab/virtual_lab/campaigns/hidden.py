"""The campaign of hidden effects: for the benchmark of the missing-effect search.

Every effect of the vocabulary at three strengths, healthy cells, effects outside the vocabulary,
two effects at once, cells by physics with an effect added to their voltage, and parallel groups.
"""

from itertools import product

import numpy as np

from virtual_lab.campaigns import Cell, Plan, Test, seed_of
from virtual_lab.chamber import wobbling
from virtual_lab.hidden.groups import GROUP_EFFECTS, HiddenGroup, branches, group_tasks
from virtual_lab.hidden.setup import CHEMISTRY, RATING, slow_task, tasks
from virtual_lab.hidden.specimens import HiddenCell, HiddenPhysics
from virtual_lab.hidden.vocabulary import EFFECTS, INVISIBLE, OUTSIDE

STRENGTHS_VOLT = (1e-3, 2.5e-3, 6e-3)
STRONG_VOLT = STRENGTHS_VOLT[1:]
INVISIBLE_CELLS = 2
REFERENCES = 3
# Effects that can be told apart by dynamics; two of them may be in one cell.
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
# Effects that can be added to the voltage of a cell by physics.
OVER_PHYSICS = (
    "hysteresis_instant",
    "resistance_asymmetry",
    "resistance_soc",
    "slow_diffusion",
    "resistance_temperature",
    "current_offset",
    "time_skew",
)
PHYSICS_CHEMISTRY = "NMC811"  # a type of its own: healthy cells are compared within a type
FULL_WITHIN = 0.01
CELLS_PER_JOB = 10
WOBBLE_KELVIN, WOBBLE_SECOND = 0.4, 1200.0
CONFIG = "# No choice of this campaign differs from the documented defaults.\n"
ABOUT = """# What is hidden in this campaign

`missing_effect.json`: per cell or group its `kind` (reference, none, single, two, unknown), the
effects with their parameters (defined in lab/virtual_lab/hidden/vocabulary.py) and the names
that count as right (`accept`). `visible_gap_millivolt`: what is left, as a root mean square over
the fit tests, when the resistances, time constants and initial states of the plain circuit have
been refitted, with the exact OCV; `gap_after_base_fit_millivolt`: the OCV, too, may move within
1.5 mV; `validation_gap_millivolt`: that fit on the validation drives. `visible`: more than 1.15
(fit) or 1.3 (validation) times the noise `floor_volt`; where it is false, "none" is right too.
A tie is judged by voltages alone: a current that is logged at rest may tell an offset from a leak.
A lead resistance and a gain of the current leave no gap: a cell with other parameters is the same.
A group's strength is what a branch current has of its own times that cell's ohmic resistance, and
its `floor_volt` the ammeter's noise told in the same way.
"""


def plan(*, seed, cells, healthy, unknown, two, physics, groups) -> Plan:
    """The plan; options are numbers of cells, `cells` and `groups` per effect and strength."""
    outside = list(OUTSIDE)
    wanted = [
        *[("reference", (), 0.0)] * REFERENCES,
        *[("none", (), 0.0)] * healthy,
        *_single(cells),
        *[("unknown", (outside[k % len(outside)],), STRONG_VOLT[1]) for k in range(unknown)],
        *[("two", names, STRONG_VOLT[1]) for names in _pairs(seed, two)],
    ]
    behavioural = [HiddenCell(name, seed, *what) for name, what in _shuffled("h", wanted, seed)]
    overlaid = _shuffled("p", _by_physics(physics), seed)
    physical = [HiddenPhysics(name, seed, *what) for name, what in overlaid]
    parallel = [
        HiddenGroup(name, seed, *what) for name, what in _shuffled("g", _groups(groups), seed)
    ]
    jobs = [behavioural[k : k + CELLS_PER_JOB] for k in range(0, len(behavioural), CELLS_PER_JOB)]
    tests = [t for k, job in enumerate(jobs) for one in job for t in _tests(one, f"cells_{k:03d}")]
    tests += [t for one in physical for t in _tests(one, f"physics_{one.name}")]
    tests += [t for group in parallel for t in _group_tests(group)]
    rows = [_row(one, CHEMISTRY) for one in behavioural]
    rows += [_row(one, PHYSICS_CHEMISTRY) for one in physical]
    rows += [_row(one, CHEMISTRY) for group in parallel for one in branches(group)]
    return Plan(tuple(rows), tuple(tests), {g.name: g for g in parallel}, CONFIG, ABOUT)


def _shuffled(letter, wanted, seed):
    """Names for the wanted cells, in an order that does not show what they have."""
    order = np.random.default_rng(seed_of(f"names {letter}", seed)).permutation(len(wanted))
    return [(f"{letter}{k:04d}", wanted[place]) for k, place in enumerate(order, 1)]


def _single(cells):
    """Cells with one effect, at every strength; of effects that leave no gap only a few."""
    visible = [effect for effect in EFFECTS if effect not in INVISIBLE]
    wanted = list(product(visible, STRENGTHS_VOLT, range(cells)))
    wanted += list(product(INVISIBLE, STRONG_VOLT[:1], range(min(cells, INVISIBLE_CELLS))))
    return [("single", (effect,), strength) for effect, strength, _ in wanted]


def _pairs(seed, count):
    """Pairs of different effects, drawn."""
    random = np.random.default_rng(seed_of("pairs", seed))
    return [tuple(random.choice(DYNAMIC, 2, replace=False).tolist()) for _ in range(count)]


def _by_physics(count):
    """Cells by physics: references, cells with an effect, and half as many healthy ones."""
    if not count:
        return []
    effects = [(OVER_PHYSICS[k % len(OVER_PHYSICS)],) for k in range(count)]
    healthy = [("reference", (), 0.0)] * REFERENCES + [("none", (), 0.0)] * (count // 2)
    return [*healthy, *[("single", names, STRONG_VOLT[1]) for names in effects]]


def _groups(count):
    wanted = [
        (effect, strength)
        for effect, strength, _ in product(GROUP_EFFECTS, STRONG_VOLT, range(count))
    ]
    return [*wanted, *[(None, 0.0)] * (2 * count)]


def _row(one, chemistry):
    return Cell(one.name, chemistry, RATING, one, reference=one.kind == "reference")


def _tests(one, batch):
    wanted = [slow_task()] if one.kind == "reference" else []
    return [test_of(one, task, batch) for task in [*wanted, *tasks()]]


def test_of(one, task, batch) -> Test:
    """One test of a cell with hidden effects: a chamber that wobbles, a start not quite full."""
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
