"""Terminal voltage of a model under any current."""

import numpy as np

from cellwright.circuits import inputs as given
from cellwright.circuits.model_file import in_use, simulate_model
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.series.cleaning import net_charge


def simulate(model, current, *, initial_soc, temperature_celsius=25.0, member=None):
    """Terminal voltage of a model under a current.

    current : DataFrame or columns: test_time_second [s], current_ampere [A], positive on charge.
    initial_soc : state of charge at the first sample [1].
    temperature_celsius : of the cell, scalar or (n,) [°C].
    member : of the family, "P" for the particle; None: what predicts best.

    Returns columns, (n,): soc [1], ocv_volt, voltage_volt [V]. Raises Refusal: the model has no
    such member, or the SoC at the start is not within 0 to 1. Source: docs/circuits.md.
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
    member = in_use(model) if member is None else member
    run = simulate_model(model, member, time, ampere, soc, celsius)
    columns = {"test_time_second": time, "current_ampere": ampere, "soc": soc}
    columns |= {"ocv_volt": run.ocv_volt, "voltage_volt": run.voltage_volt}
    return Result({"columns": columns}, {"member": member})
