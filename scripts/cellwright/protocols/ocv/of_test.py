"""Open-circuit voltage that one test tells: a slow one, by its rests, or by its slowest load."""

from cellwright.protocols.half_cycles import known_of_start
from cellwright.protocols.ocv.functions import fit_functions
from cellwright.protocols.ocv.rests import ocv_of_rests, rest_points, soc_at
from cellwright.protocols.ocv.slow import slow_ocv, slowest_load
from cellwright.records import inputs
from cellwright.records.anchor import rest_scale
from cellwright.records.basis import slow_capacity
from cellwright.result import Result
from cellwright.settings import Ocv

OCV = Ocv()


def ocv(series, cell, *, least_hour=OCV.least_hour, test=None, course=None):
    """Open-circuit voltage [V] over SoC of one slow test: a curve, and functions fitted to it.

    least_hour : shortest charge or discharge that is slow enough [h].
    test : for its SoC at the start, or None. course : result of `course`, or None.

    Returns curve, `protocols.ocv.slow.OcvCurve` over SoC; functions: `OcvFunction` each. Raises
    Refusal: no charge or discharge is slow enough or complete. Source: docs/ocv.md.
    """
    curve = slow_ocv(
        inputs.columns(series, *inputs.COUNTED),
        least_hour=least_hour,
        **known_of_start(course, test),
        **inputs.cutoffs(cell),
    )
    tables = {"curve": curve, "functions": fit_functions(curve.soc, curve.ocv_volt)}
    return Result(tables, notes=tuple(filter(None, [curve.note])))


def ocv_from_rests(series, steps, cell, test, capacities=(), *, course=None):
    """Open-circuit voltage [V] over SoC from the rests of a pulse test.

    Returns curve over SoC as of `ocv`; points: dict of (k,) columns, one entry a rest. Raises
    Refusal: no capacity, or too few rests. Source: docs/ocv.md.
    """
    test, steps = inputs.test_facts(test), inputs.steps(steps)
    series = inputs.columns(series, *inputs.COUNTED)
    # Pulse tests rarely end at the lower cut-off: full comes from the record or the test before
    # it, the capacity from the discharges of the cell near this temperature and cycle.
    scale = rest_scale(
        *inputs.quantities(series, inputs.COUNTED[1:]),
        steps,
        inputs.entries(capacities),
        state_of_health=inputs.cell_facts(cell).state_of_health,
        ambient_temperature_celsius=test.ambient_temperature_celsius,
        cycle=test.cycle,
        **inputs.ratings(cell),
        **known_of_start(course, test),
    )
    points = rest_points(series, steps)
    curve = ocv_of_rests(points, scale, **inputs.cutoffs(cell))
    table = points | {"soc": soc_at(points, scale)}
    words = {"capacity_source": scale.source}
    return Result({"curve": curve, "points": table}, words, (curve.note,))


def ocv_from_load(series, cell, test):
    """Voltage [V] over SoC of the slowest full load of a test that is not slow, for want of an OCV.

    Under one direction it still holds the drop over the resistance: `identify` takes that off with
    what other rates tell.

    Returns curve over SoC as of `ocv`, no points. Raises Refusal: no leg of the record is full and
    runs to its cut-off. Source: docs/ocv.md.
    """
    curve = slowest_load(inputs.columns(series, *inputs.COUNTED), **inputs.cutoffs(cell))
    # The charge of this leg is at its own rate: less than a slow one, and said to be so.
    slow = slow_capacity(curve._asdict() | {"test": inputs.test_facts(test).test}, [])
    words = {"capacity_source": slow["capacity_source"].replace("slow test", "long load")}
    return Result({"curve": curve, "points": {}}, words, (curve.note,))
