"""Terminal voltage of a model under any current."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.messages import say
from cellwright.circuits.model_file import in_use, member_of, simulate_model
from cellwright.circuits.particle import NAME
from cellwright.circuits.temperature import celsius_of, usual_from_kelvin
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.cleaning import COLDEST, HOTTEST, net_charge

BEYOND = 1e-3  # SoC beyond 0 or 1 that counting alone may give


def simulate(model, current, *, initial_soc, temperature_celsius=25.0, member=None):
    """Terminal voltage of a model under a current.

    current : DataFrame or columns: test_time_second [s], current_ampere [A], positive on charge.
    initial_soc : state of charge at the first sample [1].
    temperature_celsius : of the cell, scalar or (n,) [°C].
    member : of the family, "P" for the particle; None: what predicts best.

    Returns columns, (n,): soc [1], ocv_volt, voltage_volt [V]; notes where the model is left: SoC
    outside 0 to 1 or what was measured, temperatures beyond it, no voltage left. Raises
    Refusal: the model has no such member, the SoC at the start is not within 0 to 1, or a
    temperature is none of a cell.

    >>> import cellwright as cw
    >>> table = {"soc": [0.0, 1.0], "ocv_volt": [3.0, 4.2], "resistance_ohm": [0.02, 0.02]}
    >>> model = cw.model_of_table("A", table, capacity_ampere_hour=2.0)
    >>> load = {"test_time_second": [0.0, 1800.0], "current_ampere": [-2.0, -2.0]}
    >>> cw.simulate(model, load, initial_soc=1.0).columns["voltage_volt"].round(2)
    array([4.16, 3.56])
    """

    model = given.model(model)
    # Only the start: a current that goes beyond empty or full is the simulation's to show.
    if not 0.0 <= initial_soc <= 1.0:
        raise Refusal(f"SoC {initial_soc:g} at the start; wanted 0 to 1")
    time, ampere = inputs.quantities(current, ("test_time_second", "current_ampere"))
    # From the current that is simulated, not from a counter that an instrument has logged.
    charge = net_charge(time, ampere)
    soc = initial_soc + (charge - charge[0]) / model["capacity_ampere_hour"]
    celsius = np.broadcast_to(np.asarray(temperature_celsius, float), time.shape)
    if not np.all((celsius >= COLDEST) & (celsius <= HOTTEST)):
        found = f"{celsius.min():g} to {celsius.max():g}"
        wanted = f"wanted {COLDEST:g} to {HOTTEST:g} °C"
        kelvin = "; in kelvin?" if np.all(celsius > HOTTEST) else ""
        raise Refusal(f"temperature_celsius: found {found}, {wanted}{kelvin}")
    member = in_use(model) if member is None else member
    run = simulate_model(model, member, time, ampere, soc, celsius)
    columns = {"test_time_second": time, "current_ampere": ampere, "soc": soc}
    columns |= {"ocv_volt": run.ocv_volt, "voltage_volt": run.voltage_volt}
    return Result(
        {"columns": columns},
        {"member": member},
        (*_left_model(columns, celsius, run), *_reach(model, member, celsius, run)),
    )


def _reach(model, member, celsius, run):
    """Notes on how far a circuit reaches, where a simulation leaves the temperatures it knows."""
    if member == NAME or not np.any(run.outside_temperature):
        return
    outside = celsius[run.outside_temperature]
    conditions = member_of(model, member)["conditions"]
    stated = celsius_of(conditions[0]["ambient_temperature_celsius"])
    if np.any(np.abs(outside - stated) > usual_from_kelvin(conditions)):
        yield say("left_model.one_temperature", celsius=stated)
    elif len(conditions) == 1 and not conditions[0]["activation_energy_joule_per_mole"]:
        yield say("left_model.held", celsius=stated)
    for entry in model.get("left_out_temperatures", ()):
        at, without, own = (
            entry[n] for n in ("ambient_temperature_celsius", "rmse_volt", "own_rmse_volt")
        )
        colder = at < np.mean([c["ambient_temperature_celsius"] for c in conditions])
        beyond = outside < at if colder else outside > at
        if entry["beyond"] and entry["model"] == member and beyond.any():
            fields = {"celsius": at, "model": member, "end": "coldest" if colder else "warmest"}
            fields |= {"without_mv": 1e3 * without, "own_mv": 1e3 * own}
            yield say("left_model.temperature_error", **fields)


def _left_model(columns, celsius, run):
    """Notes on the samples at which a simulation is outside of what its model knows."""
    time, soc, volt = (columns[n] for n in ("test_time_second", "soc", "voltage_volt"))
    within = (soc >= -BEYOND) & (soc <= 1.0 + BEYOND)
    for code, rows, values in (
        ("left_model.soc", ~within, soc),
        ("left_model.measured_soc", run.extrapolated & within, soc),
        ("left_model.temperature", run.outside_temperature, celsius),
        ("left_model.voltage", volt <= 0.0, volt),
    ):
        if np.any(rows):
            found = values[rows]
            least, most = float(found.min()), float(found.max())
            span = f"{least:.3g} to {most:.3g}" if most > least else f"{least:.3g}"
            fields = {"count": int(rows.sum()), "size": len(time), "least": least, "span": span}
            yield say(code, first_second=float(time[rows][0]), **fields)
