"""What the state of charge of a cell refers to, and the state of charge over a record."""

from cellwright.api import inputs, results


def basis(cell, curves=(), capacities=(), lenders=(), *, rests=(), shifts=()):
    """The capacity and OCV curves that the SoC of a cell refers to, its own or borrowed.

    curves : (test, result of `ocv`) each.
    lenders : result of `lender` of each cell of the same type.
    rests : (test, result of `ocv_from_rests`, or of `ocv_from_load`) each.
    shifts : result of `ocv_shifts`, or its rows.

    Returns content: cell, capacity_ampere_hour, capacity_std_ampere_hour [Ah] (None: nothing tells
    it), capacity_source, borrowed_from, ocv, the curves over SoC [1], and checkups, the same for
    each of several check-ups; curves: one row a curve and SoC. Raises Refusal: no capacity test, no
    slow test and no rating.
    Source: docs/state-of-charge.md.
    """
    from cellwright.records.checkups import basis_of_life as basis_of

    # Over a life: each check-up has its own capacity and curves, so that SoC 1 stays "full".
    facts = inputs.cell_facts(cell)
    content = basis_of(
        facts.cell,
        inputs.entries(curves, curves_of),
        inputs.entries(capacities),
        lenders,
        rests=inputs.entries(rests, curves_of),
        shifts=inputs.rows(shifts),
        rated_capacity_ampere_hour=facts.rated_capacity_ampere_hour,
        state_of_health=facts.state_of_health,
        lower_cutoff_volt=facts.lower_cutoff_volt,
    )
    rows = [
        {name: curve[name] for name in ("test", "ambient_temperature_celsius")}
        | {"soc": soc, "ocv_volt": volt}
        for curve in content["ocv"]
        for soc, volt in zip(curve["soc"], curve["ocv_volt"], strict=True)
    ]
    return results.Result({"curves": rows}, content, tuple(basis_notes(content)))


def basis_notes(basis):
    """Sentences on where capacity [Ah] and OCV come from; with ± where over 3 % of it is open."""
    from cellwright.records.anchor import is_unsure

    size = f"{basis['capacity_ampere_hour']:.4g}"
    if is_unsure(basis):
        size += f" ± {basis['capacity_std_ampere_hour']:.2g}"
    notes = [f"SoC refers to {size} Ah: {basis['capacity_source']}"]
    if basis["borrowed_from"]:
        notes.append(f"OCV borrowed from {basis['borrowed_from']}: no usable slow test of its own")
    elif not basis["ocv"]:
        notes.append("no OCV: no slow test of its own, and no cell of its type has one")
    notes += [
        f"check-up at cycle {checkup['cycle']:g}: SoC refers to "
        f"{checkup['capacity_ampere_hour']:.4g} Ah: {checkup['capacity_source']}; OCV "
        f"{checkup['ocv_source']}"
        for checkup in basis.get("checkups", [])[1:]
    ]
    tests = [curve["test"] for curve in basis["ocv"] if curve["branches"] == "rests"]
    if tests and not basis["borrowed_from"]:
        notes.append(
            f"OCV from the rests of {', '.join(tests)}: no slow test of its or of its type"
        )
    return notes


def curves_of(result):
    """The OCV curve of a result as plain lists; of rests with the source of its capacity."""
    import numpy as np

    curve = {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in result.curve._asdict().items()
    }
    source = getattr(result, "capacity_source", None)
    return [curve if source is None else curve | {"capacity_source": source}]


def ocv_from_load(series, cell, test):
    """Voltage [V] over SoC of the slowest full load of a test that is not slow, for want of an OCV.

    Under one direction it still holds the drop over the resistance: `identify` takes that off with
    what other rates tell.

    Returns curve over SoC as of `ocv`, no points. Raises Refusal: no leg of the record is full and
    runs to its cut-off. Source: docs/ocv.md.
    """
    from cellwright.protocols.ocv.slow import slowest_load
    from cellwright.records.basis import slow_capacity

    curve = slowest_load(*inputs.quantities(series, inputs.COUNTED), **inputs.cutoffs(cell))
    # The charge of this leg is at its own rate: less than a slow one, and said to be so.
    slow = slow_capacity(curve._asdict() | {"test": inputs.test_facts(test).test}, [])
    words = {"capacity_source": slow["capacity_source"].replace("slow test", "long load")}
    return results.Result({"curve": curve, "points": {}}, words, (curve.note,))


def basis_at(basis, cycle):
    """The basis of a cell at one of its check-ups: that capacity and OCV, for a model of that age.

    cycle : of the check-up.

    Returns dict, content as of `basis`, without check-ups. Source: docs/state-of-charge.md.
    """
    from cellwright.records.basis import at_cycle

    return at_cycle(inputs.basis(basis), cycle) | {"checkups": []}


def lender(cell, curves, capacities, *, marked=False):
    """OCV curves and capacities of a cell, for other cells of its type to borrow.

    curves : as of `basis`. marked : whether it is a reference of its type.

    Returns `records.basis.Lender`.
    """
    from cellwright.records.basis import Lender

    shown = (inputs.entries(curves, curves_of), inputs.entries(capacities))
    return Lender(inputs.cell_facts(cell).cell, marked, *shown)


def state_of_charge(series, basis, test, cell):
    """State of charge over a record of a cell.

    Returns `records.anchor.Anchored`: soc (n,) [1], NaN where it cannot be known, and in words what
    it is counted from.
    """
    from cellwright.records.basis import soc_or_unknown

    columns, facts = inputs.columns(series, *inputs.COUNTED), inputs.cell_facts(cell)
    return soc_or_unknown(columns, inputs.basis(basis), inputs.test_facts(test), facts)
