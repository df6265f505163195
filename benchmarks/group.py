"""A thousand cells on busbars, and as their chosen members; ten thousand cells for an hour."""

import cell
import numpy as np
from timing import Entry, Goal, Topic, where_importable

from cellwright.numerics.lags import lag_weights
from cellwright.packs import kernel
from cellwright.packs.cells import pack_cells, rc_cells
from cellwright.packs.kernel import Keep
from cellwright.packs.simulate import simulate_pack
from cellwright.packs.wiring import Wiring

CELLS, STEPS = 1000, 200
CONTACT, BAR = 1e-4, 5e-8  # [ohm] of each cell; of each bar from one cell to the next
MANY, HOUR = 10_000, 3600


def star():
    """Topic: 1,000 cells on one bar, 200 steps of a second."""
    return _topic("Cells in parallel", "on one bar", 0.0, 6e-9)


def ladder():
    """Topic: the same along two bars with resistance between the cells."""
    return _topic("Cells along a ladder", "along two bars, leads at one end", BAR, 15e-9)


def chosen():
    """Topic: the same with kinetics and hysteresis, solved by Newton's method."""
    cells, time, load = chosen_cells(CELLS), np.arange(float(STEPS)), CELLS * cell.drive(STEPS)
    wiring = wired(CELLS, 0.0)
    true = simulate_pack(time, load, cells, wiring, initial_soc=0.8, tolerance_volt=1e-12)
    entries = [_ours(cells, wiring, time, load, runs=5), _numpy(cells, wiring, time, load, runs=1)]
    judge = _judge(load, true)
    return Topic(
        "Cells in parallel, with kinetics and hysteresis",
        f"{CELLS:,} unequal cells on one bar, each with two RC pairs, kinetics with a lag and "
        f"hysteresis over charge, {STEPS} steps of 1 s, Newton's method to 1 nV",
        "sum of the branch currents less the total; difference to a tolerance of 1 pV",
        [entry._replace(accuracy=judge) for entry in entries],
        [("liionpack, sparse solve", "their step is linear: no arcsinh, no hysteresis")],
        CELLS * STEPS,
        "cell and step",
    )


def hour():
    """Topic: 10,000 cells for an hour, the pack's voltage and the extremes of the cells kept."""
    cells, time = plain_cells(MANY), np.arange(float(HOUR))
    load = MANY * cell.drive(HOUR)

    def entry(name, link, keep):
        wiring = wired(MANY, link)
        setting = {"initial_soc": 0.8, "keep": keep}
        run = lambda: simulate_pack(time, load, cells, wiring, **setting)  # noqa: E731
        return Entry(name, run, lambda _found: "–", runs=3)

    return Topic(
        "Ten thousand cells for an hour",
        f"{MANY:,} unequal cells, one RC pair each, {HOUR:,} steps of 1 s",
        "nothing to compare",
        [
            entry("**Cellwright**, star, the pack's voltage kept", 0.0, Keep(0)),
            entry("**Cellwright**, star, extremes kept as well", 0.0, Keep(0, extremes=True)),
            entry("**Cellwright**, star, every minute kept of each cell", 0.0, Keep(60)),
            entry("**Cellwright**, ladder, the pack's voltage kept", BAR, Keep(0)),
        ],
        [],
        1,
        "run",
        (Goal("**Cellwright**, star, the pack's voltage kept", 0.6),),
    )


def wired(count, bar):
    """`count` cells in parallel on bars of so much resistance from one to the next."""
    names = tuple(f"cell {k + 1}" for k in range(count))
    return Wiring("pack", "parallel", names, (CONTACT,) * count, (0.0,) + (2 * bar,) * (count - 1))


def plain_cells(count):
    """Unequal cells of one RC pair with parameters over SoC."""
    rng = np.random.default_rng(9)
    scale = rng.uniform(0.9, 1.1, (count, 1))
    return rc_cells(
        ocv_volt=np.tile(cell.OCV, (count, 1)),
        r0_ohm=scale * cell.R0,
        r_ohm=scale[:, :, None] * cell.R[:1],
        tau_second=np.full((count, 1, len(cell.GRID)), cell.TAU[1]),
        capacity_ampere_hour=rng.uniform(2.8, 3.2, count),
    )


def chosen_cells(count):
    """Unequal cells of two RC pairs, kinetics and hysteresis."""
    model, knots = cell.model(), len(cell.GRID)
    more = [
        {"kind": "kinetic", "r_ohm": 0.02, "tau_second": 1.0, "scale_volt": 0.05},
        {"kind": "hysteresis", "m_volt": 0.01, "charge_ampere_hour": 0.1},
    ]
    condition = model["members"][0]["conditions"][0]
    condition["branches"] += [
        {name: value if name == "kind" else [value] * knots for name, value in branch.items()}
        for branch in more
    ]
    one, rng = pack_cells([model], points=101), np.random.default_rng(9)
    scale = rng.uniform(0.9, 1.1, (1, count, 1, 1))
    tables = {
        name: np.ascontiguousarray(np.repeat(table, count, axis=1))
        for name, table in one._asdict().items()
        if np.ndim(table) == 4
    }
    tables |= {name: tables[name] * scale for name in ("r0_ohm", "r_ohm", "kinetic_r_ohm")}
    names = tuple(f"cell {k + 1}" for k in range(count))
    more = {"names": names, "members": one.members * count, "near_end_soc": np.zeros(count)}
    return one._replace(capacity_ampere_hour=rng.uniform(2.8, 3.2, count), **tables, **more)


def _topic(title, where, bar, goal):
    cells, wiring = plain_cells(CELLS), wired(CELLS, bar)
    time, load = np.arange(float(STEPS)), CELLS * cell.drive(STEPS)
    makers = {
        "**Cellwright**": lambda: _ours(cells, wiring, time, load),
        "kept": lambda: _voltage_alone(cells, wiring, time, load),
        "numpy": lambda: _numpy(cells, wiring, time, load),
        "scipy": lambda: _sparse(cells, wiring, time, load, bar),
        "liionpack": lambda: _liionpack(cells, wiring, time, load, bar),
    }
    entries, skipped = where_importable({"liionpack": ("liionpack",)}, makers)
    judge = _judge(load, simulate_pack(time, load, cells, wiring, initial_soc=0.8))
    return Topic(
        title,
        f"{CELLS:,} unequal cells {where}, one RC pair each with parameters over SoC, "
        f"{STEPS} steps of 1 s; every current, voltage and SoC is kept. Where a step leads a cell "
        "further than 0.01 % of SoC from where it was expected, ours solves it again; the sparse "
        "solver and liionpack take each step once",
        "sum of the branch currents less the total; difference of the cells' voltages to ours",
        [entry._replace(accuracy=judge) for entry in entries],
        skipped,
        CELLS * STEPS,
        "cell and step",
        (Goal("**Cellwright**", goal),),
    )


def _judge(load, true):
    def judge(found):
        if not found[0].size:
            return "–"
        kirchhoff = np.max(np.abs(found[0].sum(axis=1) - load))
        return f"{kirchhoff:.1g} A, {np.max(np.abs(found[1] - true.cell_voltage_volt)):.1g} V"

    return judge


def _ours(cells, wiring, time, load, runs=11):
    run = lambda: simulate_pack(time, load, cells, wiring, initial_soc=0.8)  # noqa: E731
    return Entry("**Cellwright**", run, None, runs=runs)


def _voltage_alone(cells, wiring, time, load):
    setting = {"initial_soc": 0.8, "keep": Keep(0)}
    run = lambda: simulate_pack(time, load, cells, wiring, **setting)  # noqa: E731
    return Entry("**Cellwright**, the pack's voltage kept alone", run, None, runs=11)


def _numpy(cells, wiring, time, load, runs=5):
    """Our own numpy form: one step after the other, all cells at once."""

    def run():
        kept, kernel.function = kernel.function, lambda *_types, **_result: None
        try:
            return simulate_pack(time, load, cells, wiring, initial_soc=0.8)
        finally:
            kernel.function = kept

    return Entry("numpy, all cells of a step at once", run, None, runs=runs)


def _sparse(cells, wiring, time, load, bar):
    """Each step as a network: Kirchhoff's equations to a sparse solver."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.linalg import spsolve

    count, n = CELLS, np.arange(CELLS)

    def solved(source, resistance, total):
        """Unknown: the cells' currents, then the voltage between the bars at the leads.

        Row k: between cell k − 1 and k the bars take 2·bar times what flows to k and beyond; as
        the difference of two such rows it holds three currents.
        """
        z = resistance + CONTACT
        rows = [n, n[1:], n, np.full(count, count)]
        columns = [n, n[1:] - 1, np.full(count, count), n]
        values = [z, -z[:-1], -(n == 0).astype(float), np.ones(count)]
        right = np.append(-np.diff(source, prepend=0.0), total)
        if bar:
            inflow = np.arange(count + 1, 2 * count)  # what flows to k and beyond
            rows += [n[1:], inflow, inflow, inflow[:-1]]
            columns += [inflow, n[1:], inflow, inflow[1:]]
            values += [np.full(count - 1, 2 * bar), np.ones(count - 1), -np.ones(count - 1)]
            values += [np.ones(count - 2)]
            right = np.append(right, np.zeros(count - 1))
        entries = (np.concatenate(part) for part in (rows, columns, values))
        row, column, value = entries
        size = len(right)
        matrix = coo_matrix((value, (row, column)), (size, size)).tocsc()
        return spsolve(matrix, right)[:count]

    run = lambda: _stepped(cells, wiring, time, load, solved)  # noqa: E731
    return Entry("numpy, scipy sparse solve of the network", run, None, runs=3)


def _liionpack(cells, wiring, time, load, bar):
    """Each step as a netlist to liionpack's solver; its cells' own electrochemistry is not run."""
    import liionpack

    least = bar or 1e-9  # [ohm] its bars always have resistances
    netlist = liionpack.setup_circuit(Np=CELLS, Ns=1, Rb=least, Rc=CONTACT, Rt=1e-9)
    source = netlist["desc"].str.startswith("V").to_numpy()
    inner = netlist["desc"].str.startswith("Ri").to_numpy()
    values = netlist["value"].to_numpy(float, copy=True)

    def solved(open_circuit, resistance, total):
        values[source], values[inner] = open_circuit, resistance
        netlist["value"] = values
        return np.ravel(liionpack.solve_circuit(netlist, current=-total)[1])

    note = "its network solve alone, our cells"
    note += "" if bar else "; its bars of 1 nΩ cause the difference"
    run = lambda: _stepped(cells, wiring, time, load, solved)  # noqa: E731
    return Entry("liionpack solve_circuit", run, None, runs=1, note=note)


def _stepped(cells, wiring, time, load, solved):
    """Currents and voltages of all steps, each step's network solved by `solved`."""
    tables, capacity = cells.tables, 3600.0 * cells.capacity_ampere_hour
    share, total = cells.capacity_ampere_hour / cells.capacity_ampere_hour.sum(), 0.0
    soc, relaxed, current = np.full(CELLS, 0.8), np.zeros(CELLS), np.zeros(CELLS)
    old, tau = _at(tables["r_ohm"], soc)[0], tables["tau_second"][0, :, 0, 0]
    found = np.empty((2, len(time), CELLS))
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        ramp, total = share * (load[k] - total), load[k]
        guess, charge = current + ramp, step / capacity
        ahead = soc + charge * (guess - 0.5 * ramp)
        (ocv, slope), (r0, _), (r, _) = (
            _at(table, ahead) for table in (tables["ocv_volt"], tables["r0_ohm"], tables["r_ohm"])
        )
        decay, before, after = lag_weights(np.full(CELLS, step), tau, hold="first_order")
        steep, lagged = np.maximum(slope, 0.0) * charge, before * old + after * r
        settled = decay * relaxed - before * old * ramp
        source, resistance = ocv - steep * guess + settled, r0 + steep + lagged
        current = solved(source, resistance, total)
        found[:, k] = current, source + resistance * current
        relaxed, old = settled + lagged * current, r
        soc = soc + charge * (current - 0.5 * ramp)
    return found


def _at(table, soc):
    """A table at each cell's SoC, and its slope over it."""
    values, rows = table[0, :, 0], np.arange(len(soc))
    last = values.shape[1] - 1
    lower = np.clip((soc * last).astype(int), 0, last - 1)
    rise = values[rows, lower + 1] - values[rows, lower]
    return values[rows, lower] + rise * (soc * last - lower), rise * last
