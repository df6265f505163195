"""Campaigns of behavioural cells with effects of other forms; healthy cells, wrong sheets, meters.

python -m virtual_lab.zoo.forms FOLDER --seed 1 --healthy 40 --other 4 --simple 2
"""

import argparse
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from virtual_lab import instruments
from virtual_lab.campaigns import as_table, seed_of
from virtual_lab.zoo import effects, march, metering, strength, tests_of_cells
from virtual_lab.zoo.cell import Specimen, healthy
from virtual_lab.zoo.made import Effect, Made, truth_row
from virtual_lab.zoo.planned import SIZES, Wanted, plan

CHEMISTRIES = ("NMC", "NMC", "LFP", "NCA")
AT_ONCE = 150  # cells that are simulated together
TRIES, NEAR = 4, 0.08
SMALLEST_STEP, LARGEST_STEP = 0.1, 8.0


def make(folder, *, seed: int, cells: Sequence[str] = (), **sizes: int) -> None:
    """Write a campaign with its truth: config/, raw/, truth/missing_effect.json.

    Parameters
    ----------
    folder : where; made if it is not there.
    seed : of everything that is drawn.
    cells : names of the plan's cells to be made; none: all.
    sizes : as in SIZES: numbers of healthy cells and of cells with two effects; numbers per form of
        other and simple forms, of forms outside the vocabulary, of wrong sheets and meters, and of
        effects that the records that judge do not show.

    Raises
    ------
    TypeError : a size that is not in SIZES. ValueError : a cell that the plan has not.
    """
    if unknown := sorted(sizes.keys() - SIZES.keys()):
        raise TypeError(f"no size {', '.join(unknown)}; there are {', '.join(SIZES)}")
    planned = plan(seed=seed, **(SIZES | sizes))
    if unknown := sorted(set(cells) - planned.keys()):
        raise ValueError(f"no cell {', '.join(unknown)} in a campaign of {len(planned)} cells")
    names = [name for name in planned if not cells or name in cells]
    rows = {"cells": [], "tests": [], "truth": []}
    for first in range(0, len(names), AT_ONCE):
        some = {name: planned[name] for name in names[first : first + AT_ONCE]}
        _make_some(Path(folder), some, seed, rows)
    config = Path(folder) / "config"
    for sheet in ("cells", "tests"):
        _write(config / f"{sheet}.tsv", as_table(rows[sheet], separator="\t").encode())
    _write(config / "config.yaml", b"# No choice differs from the documented defaults.\n")
    truth = json.dumps(rows["truth"], indent=1, allow_nan=False) + "\n"
    _write(Path(folder) / "truth" / "missing_effect.json", truth.encode())


def _make_some(folder, some, seed, rows):
    """Cells that are simulated together: files, and rows of sheets and truth."""
    begun = [drawn(name, wanted, seed) for name, wanted in some.items()]
    healthy_cells = [made.plain for made in begun]
    without = _lefts(begun, _compared(begun, seed, healthy_cells), healthy_cells, names=True)
    made = _sized(begun, without, seed)
    specimens = [one.specimen for one in made]
    tracks = _compared(made, seed, specimens)
    together = _lefts(made, tracks, specimens)
    rows["cells"] += [_cell_row(one) for one in made]
    alone = [_alone(made, number, without, together, seed) for number in range(2)]
    for k, one in enumerate(made):
        gaps = [parts[k] for parts in alone if parts[k] is not None]
        rows["truth"].append(truth_row(one, without[k], together[k], gaps))
    _write_tests(folder, made, tracks, seed, rows["tests"])


def drawn(name: str, wanted: Wanted, seed: int) -> Made:
    """A healthy specimen and first sizes of its effects, from the cell's own seed."""
    random = np.random.default_rng(seed_of(f"other forms {name}", seed))
    plain = healthy(random, str(random.choice(CHEMISTRIES)))
    found = []
    for form_name in wanted.forms:
        form = effects.FORMS[form_name]
        sign = float(random.choice([-1.0, 1.0])) if form.either_sign else 1.0
        found.append(Effect(form_name, sign * form.first, form.draw(random)))
    return Made(name, wanted, plain, tuple(found))


COMPARED = ("hppc", "drive")  # kinds of test on which gaps are measured


def _tests(made: Made):
    return tests_of_cells.tests(made.wanted.layout, held=made.plain.held)


def tracked(made: list[Made], seed: int, number: int, specimens: list[Specimen]) -> march.Track:
    """One test of cells that hold their slow charge alike.

    Parameters
    ----------
    made : cells. seed : of the campaign. number : of the test. specimens : of the cells.
    """
    tests = [_tests(one)[number] for one in made]
    cells = [_cell_in(specimen, tests[0].kind) for specimen in specimens]
    starts = [s.start_soc[number] - _faulty(number) * s.meter.start_soc for s in specimens]
    last = len(_tests(made[0])) - 1
    fleet = march.fleet_of(cells, aged=number / last)
    celsius = np.array([test.celsius for test in tests])
    clock = seed_of(f"clock of test {number}", seed)
    return march.track(list(tests[0].steps), fleet, np.array(starts), celsius, seed=clock)


def _faulty(number):
    """Whether a test is the one that faults of a single file concern."""
    return number == tests_of_cells.FIRST_DRIVE + metering.FAULTY_DRIVE - 1


def _cell_in(specimen, kind):
    """The cell during a test: older at the capacity and slow test, whose OCV errs."""
    earlier = specimen.earlier or specimen.cell
    if kind == "ocv":
        return earlier._replace(ocv=earlier.ocv + specimen.slow_volt)
    return earlier if kind == "capacity" else specimen.cell


def _compared(made, seed, specimens) -> dict[int, march.Track]:
    """Tracks of the tests on which gaps are measured, by the number of the test."""
    numbers = [k for k, test in enumerate(_tests(made[0])) if test.kind in COMPARED]
    return {number: tracked(made, seed, number, specimens) for number in numbers}


def _lefts(made, tracks, specimens, *, names=False):
    """What a plain circuit leaves of the noise-free records of each cell."""
    found = []
    for k, (one, specimen) in enumerate(zip(made, specimens, strict=True)):
        records = [_record(one, number, track, k, specimen) for number, track in tracks.items()]
        starts = [one.plain.start_soc[number] for number in tracks]
        found.append(strength.left(records, _known(one), starts, names=names))
    return found


def _record(made, number, track, k, specimen):
    test = _tests(made)[number]
    columns = metering.shown(track, k, specimen.meter, faulty=_faulty(number))
    return strength.Record(columns, test.celsius, test.role == "validation")


def _known(made):
    """The cell as its capacity and slow test tell it."""
    return made.plain._replace(
        cell=_cell_in(made.specimen, "capacity")._replace(ocv=made.plain.cell.ocv)
    )


def _gap(made, with_it, without):
    """Strength of what was added [V]: on the records that judge, else on the fitted ones."""
    slow = any(effect.form.over_hours for effect in made.effects)
    if slow or made.wanted.layout == "unproven":
        pair = with_it.fit_volt, without.fit_volt
    else:
        pair = with_it.validation_volt, without.validation_volt
    return float(np.sqrt(max(pair[0] ** 2 - pair[1] ** 2, 0.0)))


def _sized(made, without, seed):
    """The cells with effects as strong as wanted, each effect by itself."""
    places = [(k, n) for k, one in enumerate(made) for n in range(len(one.effects))]
    places = [(k, n) for k, n in places if not made[k].effects[n].form.fixed]
    sizes = {place: made[place[0]].effects[place[1]].size for place in places}
    before = {}
    for _ in range(TRIES if places else 0):
        alone = [
            made[k]._replace(effects=(made[k].effects[n]._replace(size=sizes[k, n]),))
            for k, n in places
        ]
        specimens = [_without_fault(one).specimen for one in alone]
        lefts = _lefts(alone, _compared(alone, seed, specimens), specimens)
        gaps = {
            place: _gap(one, left, without[place[0]])
            for place, one, left in zip(places, alone, lefts, strict=True)
        }
        wanted = {place: made[place[0]].wanted.strength_volt for place in places}
        new = {
            p: _next_size(
                made[p[0]].effects[p[1]].form, sizes[p], gaps[p], wanted[p], before.get(p)
            )
            for p in places
        }
        before = {p: (sizes[p], gaps[p]) for p in places}
        places_left = [p for p in places if new[p] != sizes[p]]
        sizes |= new
        if not places_left:
            break
    return [
        one._replace(
            effects=tuple(
                effect._replace(size=sizes.get((k, n), effect.size))
                for n, effect in enumerate(one.effects)
            )
        )
        for k, one in enumerate(made)
    ]


def _next_size(form, size, gap_volt, wanted_volt, before):
    """The next size to be tried, along log gap over log size; the same where it is near enough."""
    ratio = wanted_volt / max(gap_volt, 1e-6)
    full = abs(size) >= form.most and ratio > 1
    if abs(ratio - 1) < NEAR or full:
        return size
    slope = 1.0
    if before and before[0] != size and before[1] > 0 and gap_volt > 0:
        slope = np.log(gap_volt / before[1]) / np.log(size / before[0])
    factor = np.clip(ratio ** (1 / np.clip(slope, 0.4, 2.5)), SMALLEST_STEP, LARGEST_STEP)
    return float(np.sign(size) * min(abs(size) * factor, form.most))


def _without_fault(made):
    return made._replace(wanted=made.wanted._replace(fault=""))


def _alone(made, number, without, together, seed):
    """Of each cell's effect of this number alone: what is left, what names explain of it."""
    told = [None] * len(made)
    having = [k for k, one in enumerate(made) if len(one.effects) > number]
    lonely = [k for k in having if len(made[k].effects) == 1 and not made[k].wanted.fault]
    lefts = {k: together[k] for k in lonely}
    others = [k for k in having if k not in lefts]
    if others:
        alone = [
            _without_fault(made[k])._replace(effects=(made[k].effects[number],)) for k in others
        ]
        specimens = [one.specimen for one in alone]
        found = _lefts(alone, _compared(alone, seed, specimens), specimens)
        lefts |= dict(zip(others, found, strict=True))
    for k, left in lefts.items():
        told[k] = (left, _explained(left, without[k]))
    return told


def _explained(left, without):
    if left.rows.size != without.rows.size:  # a record met its cut-off
        return {}
    return strength.explained(left.rows - without.rows, without.tangent, without.signatures)


def _cell_row(made):
    rating = made.plain.cell.rating
    share = made.specimen.meter.rating_share
    return {
        "cell": made.name,
        "chemistry": made.plain.cell.chemistry,
        "rated_capacity_ampere_hour": round(rating.capacity_ampere_hour * (1 + share), 3),
        "lower_cutoff_volt": rating.lower_cutoff_volt,
        "upper_cutoff_volt": rating.upper_cutoff_volt,
        "reference": None,
        "note": None,
    }


def _write_tests(folder, made, tracks, seed, rows):
    """Files of all tests, and their rows of tests.tsv, cell by cell."""
    found = {one.name: [] for one in made}
    groups = [
        (number, group) for number in range(len(_tests(made[0]))) for group in _alike(made, number)
    ]
    for number, group in groups:
        known = tracks.get(number)
        track = known or tracked(group, seed, number, [one.specimen for one in group])
        for k, one in enumerate(group):
            found[one.name].append(_written(folder, one, number, track, k, seed))
    rows += [row for own in found.values() for row in own]


def _alike(made, number):
    """Cells that go through the same steps: those of the slow test end in two ways."""
    if _tests(made[0])[number].kind != "ocv":
        return [made]
    held = [[one for one in made if one.plain.held == which] for which in (True, False)]
    return [group for group in held if group]


def _written(folder, made, number, track, k, seed):
    """Row of tests.tsv of one test whose file was written."""
    test, meter = _tests(made)[number], made.specimen.meter
    columns = metering.shown(track, k, meter, faulty=_faulty(number))
    columns = metering.noisy(
        columns,
        meter,
        celsius=test.celsius,
        surface=made.has_sensor,
        seed=seed_of(f"noise of {made.name}/{number}", seed),
    )
    content = instruments.WRITERS["parquet"](columns)
    # A name by its number: that of the layout's temperature may be wrong in the sheet.
    name = f"{test.kind}_{number}"
    file = f"raw/{made.name}/{name}.bdf.parquet"
    _write(folder / file, content)
    return {
        "cell": made.name,
        "test": name,
        "kind": test.kind,
        "file": file,
        "ambient_temperature_celsius": test.celsius + _faulty(number) * meter.sheet_kelvin,
        "current_sign": "charge_positive",
        "soc": 1.0 if test.kind in COMPARED else None,
        "role": test.role,
        "sha256": hashlib.sha256(content).hexdigest(),
    }


def _write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def main() -> None:
    """Make a campaign as the command line asks for."""
    parser = argparse.ArgumentParser(prog="virtual_lab.zoo.forms", description=__doc__)
    parser.add_argument("folder")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--cells", default="", help="names, joined by commas; all if not given")
    for name, size in SIZES.items():
        parser.add_argument(f"--{name}", type=int, default=size)
    asked = parser.parse_args()
    sizes = {name: getattr(asked, name) for name in SIZES}
    make(asked.folder, seed=asked.seed, cells=[c for c in asked.cells.split(",") if c], **sizes)


if __name__ == "__main__":
    main()
