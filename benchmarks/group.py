"""A thousand cells in parallel, one RC pair each."""

import cell
import numpy as np
from timing import Entry, Goal, Topic, where_importable

from cellwright.packs import parallel
from cellwright.packs.parallel import Group, simulate_parallel

CELLS, STEPS = 1000, 200


def topic():
    """Topic: 1,000 cells, 200 steps of a second."""
    group, time, load = _group(), np.arange(float(STEPS)), CELLS * cell.drive(STEPS)
    makers = {
        "**Cellwright**": lambda: _ours(group, time, load),
        "numpy": lambda: _numpy(group, time, load),
        "scipy": lambda: _sparse(group, time, load),
        "liionpack": lambda: _liionpack(group, time, load),
    }
    entries, skipped = where_importable({"liionpack": ("liionpack",)}, makers)
    true = parallel.simulate_parallel(time, load, group, initial_soc=0.8)

    def judge(found):
        current, volt = found[0], found[1]
        kirchhoff = np.max(np.abs(current.sum(axis=1) - load))
        return f"{kirchhoff:.1g} A, {np.max(np.abs(volt - true.voltage_volt)):.1g} V"

    return Topic(
        "Cells in parallel",
        f"{CELLS:,} unequal cells on one bar, one RC pair each with parameters over SoC, "
        f"{STEPS} steps of 1 s; every current, voltage and SoC is kept",
        "sum of the branch currents less the total; difference to ours",
        [entry._replace(accuracy=judge) for entry in entries],
        skipped,
        CELLS * STEPS,
        "cell and step",
        (Goal("**Cellwright**", 6e-9),),
    )


def _group():
    rng = np.random.default_rng(9)
    scale = rng.uniform(0.9, 1.1, (CELLS, 1))
    return Group(
        ocv_volt=np.tile(cell.OCV, (CELLS, 1)),
        r0_ohm=scale * cell.R0,
        r_ohm=scale[:, :, None] * cell.R[:1],
        tau_second=np.full((CELLS, 1, len(cell.GRID)), cell.TAU[1]),
        capacity_ampere_hour=rng.uniform(2.8, 3.2, CELLS),
    )


def _ours(group, time, load):
    def run():
        return simulate_parallel(time, load, group, initial_soc=0.8)

    return Entry("**Cellwright**", run, None, runs=11)


def _numpy(group, time, load):
    """Our own numpy form: one step after the other, all cells at once."""

    def run():
        kept, parallel.function = parallel.function, lambda *_types: None
        try:
            return simulate_parallel(time, load, group, initial_soc=0.8)
        finally:
            parallel.function = kept

    return Entry("numpy, all cells of a step at once", run, None)


def _sparse(group, time, load):
    """Each step as a network: Kirchhoff's equations to a sparse solver."""
    from scipy.sparse import csc_matrix
    from scipy.sparse.linalg import spsolve

    def solved(source, resistance, total):
        cells = np.arange(CELLS)
        rows = np.concatenate([cells, cells, np.full(CELLS, CELLS)])
        columns = np.concatenate([cells, np.full(CELLS, CELLS), cells])
        values = np.concatenate([resistance, -np.ones(CELLS), np.ones(CELLS)])
        matrix = csc_matrix((values, (rows, columns)), (CELLS + 1, CELLS + 1))
        return spsolve(matrix, np.append(-source, total))

    return Entry(
        "numpy, scipy sparse solve of the network",
        lambda: _stepped(group, time, load, solved),
        None,
    )


def _liionpack(group, time, load):
    """Each step as a netlist to liionpack's solver; its cells' own electrochemistry is not run."""
    import liionpack

    bus = 1e-9  # [ohm] its bars always have resistances: they cause the difference to ours
    netlist = liionpack.setup_circuit(Np=CELLS, Ns=1, Rb=bus, Rc=bus, Rt=bus)
    source = netlist["desc"].str.startswith("V").to_numpy()
    inner = netlist["desc"].str.startswith("Ri").to_numpy()
    values = netlist["value"].to_numpy(float, copy=True)

    def solved(open_circuit, resistance, total):
        values[source], values[inner] = open_circuit, resistance
        netlist["value"] = values
        current = liionpack.solve_circuit(netlist, current=-total)[1]
        return np.append(current, open_circuit[0] + resistance[0] * current[0])

    note = "its network solve alone, our cells"
    return Entry(
        "liionpack solve_circuit",
        lambda: _stepped(group, time, load, solved),
        None,
        runs=1,
        note=note,
    )


def _stepped(group, time, load, solved):
    """Currents and voltages of all steps, each step's network solved by `solved`."""
    soc, relaxed = np.full(CELLS, 0.8), np.zeros(CELLS)
    found = np.empty((STEPS, CELLS + 1))
    for k, step in enumerate(np.diff(time, prepend=time[0])):
        ocv, slope, r0, r, tau = parallel._tables_at(group, soc)
        gain = -np.expm1(-step / tau[:, 0])
        charge = step / (3600.0 * group.capacity_ampere_hour)
        resistance = r0 + slope * charge + gain * r[:, 0]
        found[k] = solved(ocv + relaxed * (1 - gain), resistance, load[k])
        current = found[k, :-1]
        relaxed, soc = relaxed * (1 - gain) + gain * r[:, 0] * current, soc + charge * current
    return found[:, :-1], found[:, -1]
