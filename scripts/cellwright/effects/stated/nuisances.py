"""What ends in a model otherwise than it was stated: of the cell, and of its tests."""

from cellwright.effects import base
from cellwright.effects.judge import FAR_STDS, unfitted
from cellwright.numerics.least_squares import stds

WRONG_STDS = 2.0  # from which on a stated temperature is said to be wrong


def declared_values_at_limit(case, state, parts):
    """What was declared with a tolerance and ends at its limit, or surely beyond, in a model.

    Such a quantity stands in for something that the model lacks, or was declared wrongly: a
    capacity taken 12 % smaller than was measured may be a current that reads 12 % too much.

    Parameters
    ----------
    case : case.Case. state : state.State of the model. parts : (n,) number of the part of
        each row of the fit, see `records.parts_of`.

    Returns
    -------
    nuisances : list of dict, of the capacity (relative), of the OCV where it is farthest off [V],
        of each start that its limit holds (SoC), and of each temperature of a record that judges
        that the sheet seems to state wrongly [K]: name, test, soc (None where there is none), value
        (beyond what was declared), std (None where a limit holds it), unit, prior_std.
    """
    solution, free = state.solution, {one.name: one for one in unfitted(case)[1]}
    found, held, deviations = [], set(solution.at_bound), stds(solution, parts)

    def beyond(parameter, tolerance):
        value, std = solution.values[parameter], deviations[parameter]
        return parameter in held or abs(value) > FAR_STDS * max(tolerance, std)

    def entry(name, parameter, soc, unit, tolerance):
        std = None if parameter in held else deviations[parameter]
        return _beyond(name, None, soc, solution.values[parameter], std, unit, tolerance)

    if beyond("capacity", case.tolerance.capacity):
        found.append(entry("capacity", "capacity", None, "1", case.tolerance.capacity))
    tolerances = base.ocv_stds(case.cell, case.tolerance).tolist()
    knots = dict(zip(base.OCV_NAMES, tolerances, strict=True))
    if far := [name for name, tolerance in knots.items() if beyond(name, tolerance)]:
        farthest = max(far, key=lambda name: abs(solution.values[name]))
        soc = base.OCV_NAMES.index(farthest) / (base.OCV_KNOTS - 1)
        found.append(entry("open_circuit_voltage", farthest, soc, "V", knots[farthest]))
    for k, test in enumerate(case.fit.tests):
        name = f"soc0[{k}]"
        if name in held:
            value, std = solution.values[name] - free[name].prior, free[name].std
            found.append(_beyond("soc_at_start", test, None, value, None, "1", std))
    for k, test in enumerate(case.validation.tests):
        value, std = state.values[f"kelvin[{k}]"], case.tolerance.kelvin
        if abs(value) > WRONG_STDS * std:
            found.append(_beyond("temperature", test, None, value, None, "K", std))
    return found


def _beyond(name, test, soc, value, std, unit, prior_std):
    numbers = {"value": float(value), "std": std, "unit": unit, "prior_std": float(prior_std)}
    return {"name": name, "test": test, "soc": soc} | numbers
