"""The zoo's cells by physics: effects inside porous-electrode cells, beside healthy references.

python -m virtual_lab.zoo.physics_cells FOLDER '{"seed": 0}'        all cells, one after the other
python lab/tools/make_campaign.py zoo_physics FOLDER '{}' p003  one cell; without it the sheets
"""

import json
import sys
from functools import cache, lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from virtual_lab import physics, protocols
from virtual_lab.behaviour import Behaviour, Rating
from virtual_lab.campaigns import Cell, Plan, Test, making, seed_of
from virtual_lab.chamber import Chamber, wobbling
from virtual_lab.instruments.chain import Chain
from virtual_lab.protocols import Step
from virtual_lab.specimens import CURVE_SOC, curve_rows
from virtual_lab.zoo import physics_strength
from virtual_lab.zoo.physics_forms import FORMS, MORE_CONTACT, Moment, Setup

REFERENCES = 3
FULL_WITHIN = 0.005
WOBBLE_KELVIN, WOBBLE_SECOND = 0.3, 1800.0
SPREAD = 0.025  # of resistances, kinetics, diffusivities and cooling, as a logarithm
LOST = 0.015  # largest loss of lithium or material of a healthy cell
COLD_CELSIUS = 15.0
SWITCH_SECOND = 1.0  # in which a contact opens or closes
CHECKUPS = ("capacity", "ocv")
CHAIN = Chain(
    voltage_noise_volt=1e-3,
    voltage_slow_noise_volt=0.3e-3,
    voltage_resolution_volt=0.3e-3,
    current_noise_ampere=2e-3,
    current_resolution_ampere=1e-3,
    temperature_noise_celsius=0.1,
    rest_is_open=False,
    clock="jittery",
)
TYPES = {
    # The LG M50, and a cell of LFP and graphite for power.
    "NMC": physics.Cell(0, 0, 0, 0.004, 1.0, 5.0, None, "", entropy=1.0),
    "LFP": physics.Cell(
        0, 0, 0, 0.004, 1.0, 2.5, None, "", "LFP", Rating(2.5, 2.0, 3.6), entropy=1.0
    ),
}
# Forms by type, in the order in which they are taken when fewer are asked for; DFN: with the whole
# electrode in place of single particles.
ORDER = {
    "NMC": (
        *("slow_kinetics", "two_node_heat", "slow_negative_particles", "shunt_offset"),
        *("open_contact", "steep_kinetics", "kinetics_over_soc", "lost_lithium", "wrong_sheet"),
        *("positive_hysteresis", "ageing", "leak", "late_voltage"),
    ),
    "LFP": (
        *("steep_kinetics", "leak", "late_voltage", "slow_positive_particles", "ageing"),
        *("two_node_heat", "lost_positive", "positive_hysteresis", "wrong_thermometer"),
        *("kinetics_over_soc", "slow_kinetics", "shunt_offset", "open_contact"),
    ),
}
VOLUMES = {"SPMe": (15, 25), "DFN": (10, 16)}
DFN = {("NMC", "slow_kinetics"), ("NMC", "slow_negative_particles")}
CONFIG = "# No choice of this campaign differs from the documented defaults.\n"
ABOUT = """# What is hidden in these cells by physics

`missing_effect.json`: a row a cell. `kind`: reference, none, single (an effect), unknown (an effect
that the vocabulary has no name for), sheet (a sheet or thermometer that is wrong). `form`: how the
cell differs (lab/virtual_lab/zoo/physics_forms.py), `accept`: names that explain the same data.
Strengths [mV] compare the cell with the same cell without the effect under the same load: each is
fitted by a plain circuit (R0, two RC pairs, a start of each drive, the healthy cell's own OCV),
and the root mean square difference of the two residuals is told, on the drives for the fit
(`visible_gap_millivolt`) and on those that judge (`validation_gap_millivolt`), above 10 % SoC.
`base_volt`: what the circuit leaves of the cell without the effect on the drives that judge;
`beside_references_volt`: the same less the mean of the references' residuals.
`visible`: gap, noise and what is left without the effect beside the references are together (as
root of the sum of squares) more than 1.3 (drives that judge) or 1.15 times (drives for the fit) of
the latter two. `visible_alone`: the same without the references. `unproven`: visible on the drives
for the fit alone.
"""


class Task(NamedTuple):
    """A test of the campaign; `role` as in the sheet."""

    test: str
    kind: str
    celsius: float
    steps: list[Step]
    role: str

    @property
    def is_drive(self) -> bool:
        return self.kind == "drive"


PROOF_CELSIUS = (25.0, 10.0, 40.0)
FIT_SEED, PROOF_SEED = 41, 67
RATED_TAKEN = 1.15  # more than a cell holds: each drive ends at the cut-off
FIT_SECOND, PROOF_SECOND = 5000, 4400


@cache
def tasks(rating: Rating) -> tuple[Task, ...]:
    """All tests of a cell, in the order in which they are made."""
    full = protocols.capacity(
        rating, repeats=1, c_rate=1 / 3, until_c_rate=1 / 50, period_second=20.0
    )
    slow = protocols.slow_ocv(rating, c_rate=1 / 20, period_second=60.0)
    pulses = protocols.hybrid_pulses_below_full(rating, rating.capacity_ampere_hour)
    charge = RATED_TAKEN * rating.capacity_ampere_hour
    fit, proof = (
        protocols.dynamic_load(
            rating, style=style, seed=seed, ampere_hour=charge, duration_second=second
        )
        for style, seed, second in (
            ("soft", FIT_SEED, FIT_SECOND),
            ("harsh", PROOF_SEED, PROOF_SECOND),
        )
    )
    return (
        Task("slow_25C", "ocv", 25.0, slow, "fit"),
        Task("capacity_25C", "capacity", 25.0, full, "fit"),
        Task("hppc_25C", "hppc", 25.0, pulses, "fit"),
        *(Task(f"drive_{t:.0f}C", "drive", t, fit, "fit") for t in PROOF_CELSIUS),
        *(Task(f"proof_{t:.0f}C", "drive", t, proof, "validation") for t in PROOF_CELSIUS),
    )


class ZooCell(NamedTuple):
    """A cell of a type with at most one form of FORMS in it.

    `kind` is that of the truth. `proof_celsius`: temperatures at which it has drives that judge.
    `test`: which test it is in, where it is run.
    """

    name: str
    seed: int
    type: str
    kind: str
    form: str = ""
    proof_celsius: tuple[float, ...] = PROOF_CELSIUS
    more_contact: float = 1.0
    test: str = ""

    @property
    def rating(self) -> Rating:
        """Data sheet."""
        return TYPES[self.type].rating

    @property
    def tasks(self) -> tuple[Task, ...]:
        """Tests that the cell goes through."""
        every = tasks(self.rating)
        return tuple(t for t in every if t.role == "fit" or t.celsius in self.proof_celsius)

    @property
    def size(self) -> float:
        """Size of the form in the cell; 0 without one."""
        if not self.form:
            return 0.0
        random = np.random.default_rng(seed_of(f"size {self.name}", self.seed))
        form = FORMS[self.form]
        size = float(f"{random.uniform(form.low, form.high):.4g}")
        return -size if form.either_sign and random.random() < 0.5 else size

    @property
    def names(self) -> list[str]:
        """Names that count as right. An offset that adds to the charge is no leak."""
        names = FORMS[self.form].names if self.form else ()
        either = self.form != "shunt_offset" or self.size > 0
        return [name for name in names if either or name != "leakage"]

    def setup(self, task: Task, *, healthy: bool = False) -> Setup:
        """The cell and its channel in a test; `healthy`: without what is hidden in it."""
        cell = _healthy(self.name, self.seed, self.type, self.more_contact)
        equations = "DFN" if (self.type, self.form) in DFN else "SPMe"
        plain = Setup(cell._replace(equations=equations, volumes=VOLUMES[equations]), CHAIN)
        if healthy or not self.form:
            return plain
        place = [one.test for one in self.tasks].index(task.test)
        moment = Moment(
            checkup=task.kind in CHECKUPS,
            share=place / (len(self.tasks) - 1),
            cold=task.celsius <= COLD_CELSIUS,
            seed=seed_of(f"moments of {self.name}/{task.test}", self.seed),
            duration_second=sum(step.duration_second for step in task.steps),
        )
        return FORMS[self.form].act(plain, self.size, moment)

    def chamber(self, task: Task, warmer_kelvin: float) -> Chamber:
        """Temperature around the cell in a test."""
        return wobbling(
            task.celsius + warmer_kelvin,
            amplitude_kelvin=WOBBLE_KELVIN,
            period_second=WOBBLE_SECOND,
            duration_second=sum(step.duration_second for step in task.steps),
            seed=seed_of(f"chamber of {self.name}/{task.test}", self.seed),
        )

    def initial_soc(self, task: Task) -> float:
        """State of charge [1] at the start of a test."""
        random = np.random.default_rng(seed_of(f"start of {self.name}/{task.test}", self.seed))
        return 1.0 - FULL_WITHIN * float(random.random())

    @property
    def chain(self) -> Chain:
        """The channel in the test that it is in."""
        return self.setup(self._task).chain

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the full cell in the test that it is in."""
        return _full_ampere_hour(self.setup(self._task).cell)

    @property
    def _task(self) -> Task:
        return next((one for one in self.tasks if one.test == self.test), self.tasks[0])

    def run(self, steps, *, chamber, initial_soc=1.0) -> list[Behaviour]:
        """Take the cell through the test that it is in; its steps and chamber are the test's."""
        return self.behaviours(self._task)

    def behaviours(self, task: Task, *, healthy: bool = False) -> list[Behaviour]:
        """What happens in a test; `healthy`: without what is hidden in the cell."""
        setup = self.setup(task, healthy=healthy)
        own = self._replace(test=task.test, form="")
        return _simulated(own, setup._replace(chain=CHAIN))

    def facts(self, name: str) -> dict[str, list[dict]]:
        """What is hidden in the cell and what a plain circuit leaves of it, and its OCV."""
        from virtual_lab.physics import porous

        volt = porous.rested_volt(self.setup(self.tasks[0], healthy=True).cell, CURVE_SOC)
        return {
            "missing_effect": [physics_strength.row(self)],
            physics_strength.RESIDUALS: physics_strength.residual_rows(self),
            "ocv": curve_rows(name, 25.0, volt),
        }


@lru_cache(maxsize=64)
def _healthy(name, seed, type_name, more_contact) -> physics.Cell:
    """A healthy cell of a type; its parameters differ a little from cell to cell."""
    random = np.random.default_rng(seed_of(f"cell {name}", seed))
    kinetics, contact, negative, positive, cooling = np.exp(SPREAD * random.normal(size=5)).tolist()
    lli, lam_negative, lam_positive = (LOST * random.random(3)).tolist()
    plain = TYPES[type_name]
    return plain._replace(
        lli=lli,
        lam_negative=lam_negative,
        lam_positive=lam_positive,
        kinetics=kinetics,
        contact_resistance_ohm=plain.contact_resistance_ohm * contact * more_contact,
        inside=physics.Inside(
            diffusivity_negative=negative, diffusivity_positive=positive, cooling=cooling
        ),
    )


def _full_ampere_hour(cell):
    from virtual_lab.physics import porous

    return porous.full_charge_ampere_hour(cell)


@lru_cache(maxsize=64)
def _simulated(zoo_cell, setup) -> list[Behaviour]:
    """Behaviours of a setup in the test, the chamber and from the start of a zoo cell."""
    from virtual_lab.physics import march

    task, leak = zoo_cell._task, setup.leak_ampere
    behaviours = march.run(
        [_behind_a_leak(step, leak) for step in task.steps],
        setup.cell,
        chamber=zoo_cell.chamber(task, setup.warmer_kelvin),
        initial_soc=zoo_cell.initial_soc(task),
        series=_series(setup),
    )
    return [_with_leak(one, leak) for one in behaviours] if leak else behaviours


def _series(setup):
    """Times [s] and resistances [ohm] of a contact that opens and closes; empty without one."""
    if not setup.open_second:
        return ()
    ends = np.array(setup.open_second)
    second = np.column_stack([ends[:, 0], ends[:, 0] + SWITCH_SECOND, ends[:, 1]])
    second = np.column_stack([second, ends[:, 1] + SWITCH_SECOND]).ravel()
    return second, np.tile([0.0, setup.open_ohm, setup.open_ohm, 0.0], len(ends))


def _behind_a_leak(step, leak_ampere):
    """A step as the cell sees it: the leak is taken from what the cycler gives."""
    ends = step.until_ampere and step.until_ampere - leak_ampere
    if not leak_ampere or step.kind == "hold":
        return step._replace(until_ampere=ends)
    less = np.array([0.0, leak_ampere]) if step.kind == "profile" else leak_ampere
    return step._replace(value=step.value - less, until_ampere=ends)


def _with_leak(behaviour, leak_ampere):
    """A behaviour with the current that the cycler gives, not the one that reaches the cell."""
    inner, charge = behaviour.current, behaviour.charge

    def counted(second):
        return charge(second) + leak_ampere * np.asarray(second) / 3600

    return behaviour._replace(
        current=lambda second: inner(second) + leak_ampere,
        charge=None if charge is None else counted,
    )


def plan(*, seed: int, forms: int, healthy: int) -> Plan:
    """The plan: of each type three references, healthy cells, and the first so many forms.

    Parameters
    ----------
    seed : of cells, sizes and noise. forms, healthy : numbers of cells of each type.
    """
    cells = _cells(seed, forms, healthy)
    rows = tuple(
        Cell(one.name, one.type, one.rating, one, reference=one.kind == "reference")
        for one in cells
    )
    tests = tuple(_test(one, task) for one in cells for task in one.tasks)
    return Plan(rows, tests, {}, CONFIG, ABOUT, compared=physics_strength.compared)


def _cells(seed, forms, healthy):
    """All cells, named in an order that does not show what they have."""
    wanted = []
    for type_name, order in ORDER.items():
        taken = [order[k % len(order)] for k in range(forms)]
        wanted += [(type_name, "reference", "")] * REFERENCES
        wanted += [(type_name, "none", "")] * healthy
        wanted += [(type_name, FORMS[form].kind, form) for form in taken]
    places = np.random.default_rng(seed_of("zoo by physics", seed)).permutation(len(wanted))
    cells, made = [], 0
    for number, place in enumerate(places, 1):
        type_name, kind, form = wanted[place]
        one = ZooCell(f"p{number:03d}", seed, type_name, kind, form)
        if kind != "reference":
            made += 1
            # Every third cell is judged at 25 °C only.
            one = one._replace(proof_celsius=PROOF_CELSIUS[: 1 if made % 3 == 0 else 3])
        cells.append(one)
    return _with_more_contact(cells)


def _with_more_contact(cells):
    """The first healthy cell of each type has more resistance in its contact."""
    first = {one.type: one.name for one in reversed(cells) if one.kind == "none"}
    return [
        one._replace(more_contact=MORE_CONTACT) if one.name == first.get(one.type) else one
        for one in cells
    ]


def _test(one, task):
    return Test(
        one.name,
        task.test,
        task.kind,
        task.celsius,
        "parquet",
        one._replace(test=task.test),
        steps=task.steps,
        chain=None,
        chamber=one.chamber(task, one.setup(task).warmer_kelvin),
        current_sign="charge_positive",
        soc=1.0 if task.kind in ("hppc", "drive") else None,
        initial_soc=one.initial_soc(task),
        role=task.role,
        batch=one.name,
        seed_of_campaign=one.seed,
    )


def make(folder, *, seed: int = 0, forms: int = 13, healthy: int = 3, cells=None) -> None:
    """Write the campaign into a folder, one cell after the other.

    Parameters
    ----------
    folder : of the campaign. seed, forms, healthy : see `plan`.
    cells : names of those to simulate, None for all. The sheets are written when all are there.
    """
    planned = plan(seed=seed, forms=forms, healthy=healthy)
    for batch in cells or planned.batches():
        making.make_batch(planned, batch, Path(folder))
    parts = Path(folder) / making.PARTS
    if all((parts / f"{batch}.json").exists() for batch in planned.batches()):
        making.make_sheets(planned, Path(folder))


if __name__ == "__main__":
    folder, *options = sys.argv[1:]
    make(folder, **json.loads(options[0] if options else "{}"))
