"""Effects that no fit of current and voltage tells apart, and what the log of rests adds."""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from cellwright.effects.library import LIBRARY
from cellwright.effects.records import lacking
from cellwright.records.conditions import at_rest, low_current

REST_SECOND = 60.0
DECIDED = 9.0  # chi-square between the two explanations of a current logged at rest
FITTING = 9.0  # chi-square up to which the better of them fits
SLACK = 0.15  # share of its size by which a fit of an imperfect model may miss an offset
FINEST_C_RATE = 1e-7  # no log resolves less
ONE_ORDER = 0.95  # correlation of dates and temperatures of records, from which they are one
WARMED_KELVIN = 1.0  # a smaller change of the logged temperature within a record moves nothing


class RestCurrent(NamedTuple):
    """Logged current at commanded open circuit.

    mean_ampere, std_ampere : and its standard deviation [A], NaN where the log shows nothing.
    rests : number of rests. informative : the log can show an offset: there is a rest of a minute
    or more in the records, and it does not read exactly zero (switched off, or not resolved).
    """

    mean_ampere: float
    std_ampere: float
    rests: int
    informative: bool


def with_partners(effect, tied, library, values):
    """Ids tied with an effect, and the structural partners of all of them.

    Parameters
    ----------
    effect : id that was chosen. tied : ids that explain as much.
    library : dict of Effect by id.
    values : dict of the fitted values by id.parameter; a partner of the same size whose bounds
    exclude it (a leak that charges) is no partner.

    Returns
    -------
    tied : tuple of ids without `effect`, the given ones first.
    """
    ids = list(tied)
    for tied_effect in (effect, *tied):
        ids += _partners(tied_effect, library, values)
    return tuple(dict.fromkeys(other for other in ids if other != effect))


def at_one_temperature(effect, stack, capacity_ampere_hour):
    """Partners of an effect where the logged temperature rises with the load: tuple of ids.

    Resistances fall under lasting load by heat inside the cell, or because they follow the
    temperature that was logged. Nothing tells which, without records at another temperature; where
    there are such, the second is a candidate, too, and the fits decide.

    Parameters
    ----------
    effect : Effect that was chosen. stack : records.Stack fitted. capacity_ampere_hour : [Ah].
    """
    partners = [tie.partner for tie in effect.ties if tie.one_temperature]
    hidden = [p for p in partners if lacking(LIBRARY[p], stack, capacity_ampere_hour)]
    if not hidden:
        return ()
    warmed = max(np.ptp(stack.celsius[stack.part([k])]) for k in range(len(stack.first)))
    return tuple(hidden) if warmed >= WARMED_KELVIN else ()


def in_order_of_temperature(effect, stack):
    """Partners of an effect where the tests were made in the order of their temperatures: ids.

    What a cell loses from test to test is then as well what it lacks from one temperature to the
    next.

    Parameters
    ----------
    effect : Effect that was chosen. stack : records.Stack fitted.
    """
    means = stack.mean_celsius
    if stack.age is None or min(np.ptp(means), np.ptp(stack.age)) == 0.0:
        return ()
    if abs(np.corrcoef(means, stack.age)[0, 1]) < ONE_ORDER:
        return ()
    pairs = [(name, tie.partner) for name, tie in structural_ties() if tie.one_order]
    return tuple(b if a == effect.id else a for a, b in pairs if effect.id in (a, b))


def structural_ties():
    """Ties of all effects of the library: list of (id, vocabulary.Tie)."""
    return [(effect.id, tie) for effect in LIBRARY.values() for tie in effect.ties]


def _partners(effect, library, values):
    """Ids of the partners of an effect by ties that hold always: those no search could weigh.

    The bounds of a partner that is of the same size leave it out.
    """
    always = [(name, tie) for name, tie in structural_ties() if tie.always]
    pairs = [(tie, name, tie.partner) for name, tie in always]
    pairs += [(tie, tie.partner, name) for name, tie in always]
    found = []
    for tie, tied, other in pairs:
        if tied == effect and other in library:
            size, bounds = values.get(library[effect].names[0]), library[other].parameters[0]
            inside = size is None or bounds.lower <= size <= bounds.upper
            found += [other] if inside or not tie.same_size else []
    return found


def rest_current(stack, *, capacity_ampere_hour):
    """Mean logged current during rests.

    1. A rest is a stretch of 60 s or more within C/200 of its middle, itself below C/40.
    2. The mean of each rest is one reading; their spread is the uncertainty, with the resolution
       of the log beneath it.
    3. A rest that reads exactly zero throughout has its reading switched off, or resolves nothing
       so small: it does not count. Without any other rest the log is not informative.

    Parameters
    ----------
    stack : records.Stack. capacity_ampere_hour : of the cell [Ah].

    Returns
    -------
    rest : RestCurrent.
    """
    columns = stack.current_ampere, stack.second, capacity_ampere_hour
    places = steady_rests(*columns, np.flatnonzero(stack.fresh))
    rests = [stack.current_ampere[begin:end] for begin, end in places]
    logged = [rest for rest in rests if np.any(rest)]
    if not logged:
        return RestCurrent(np.nan, np.nan, len(rests), informative=False)
    means = np.array([rest.mean() for rest in logged])
    weights = np.array([len(rest) for rest in logged], float)
    mean = float(np.average(means, weights=weights))
    spread = np.sqrt(np.average((means - mean) ** 2, weights=weights) / max(len(means) - 1, 1))
    within = np.sqrt(sum(rest.var() * len(rest) for rest in logged)) / weights.sum()
    digits = [stack.least_digit_ampere[stack.file[begin]] for begin, _ in places]
    finest = max(*digits, FINEST_C_RATE * capacity_ampere_hour)
    std = float(np.sqrt(spread**2 + within**2 + finest**2 / 12.0))
    return RestCurrent(mean, std, len(logged), informative=True)


def is_in_rest_log(rest, *, size_ampere, std_ampere):
    """Whether the logged current at commanded open circuit shows a current that moves the SoC.

    An offset of the reading is in the log of a rest; a leak is not: it does not pass the ammeter.

    Parameters
    ----------
    rest : RestCurrent. size_ampere : size of the offset, or of the leak, that explains the records
    [A]; either has the same sign. std_ampere : its standard deviation [A].

    Returns
    -------
    shown : True, False, or None: the log does not decide. See `Effect.in_rest_log`.
    """
    if not rest.informative:
        return None
    # ASSUME: The size of an offset that the fit finds is right within 15 %.
    spread = np.sqrt(rest.std_ampere**2 + std_ampere**2 + (SLACK * size_ampere) ** 2)
    as_leak = (rest.mean_ampere / rest.std_ampere) ** 2
    as_offset = ((rest.mean_ampere - size_ampere) / spread) ** 2
    small = abs(rest.mean_ampere) < abs(size_ampere) / 4
    if as_leak - as_offset > DECIDED and as_offset <= FITTING:
        return True
    if as_offset > DECIDED and small:
        return False
    return None


def steady_rests(current_ampere, second, capacity_ampere_hour, starts=()):
    """First rows of steady stretches near zero current, and the rows after their last: list.

    A stretch lasts 60 s, and 95 % of its rows are at rest about its median.

    Parameters
    ----------
    current_ampere, second : (n,) [A], [s]. capacity_ampere_hour : of the cell [Ah].
    starts : rows at which a record begins: no stretch goes on over one.
    """
    low = low_current(current_ampere, capacity_ampere_hour)
    edges = np.flatnonzero(np.diff(np.r_[0, low.astype(int), 0]))
    found = []
    for begin, end in edges.reshape(-1, 2):
        cuts = [begin, *(row for row in starts if begin < row < end), end]
        for first, behind in pairwise(cuts):
            logged = current_ampere[first:behind]
            near = at_rest(logged - np.median(logged), capacity_ampere_hour)
            if second[behind - 1] - second[first] >= REST_SECOND and near.mean() > 0.95:
                found.append((first, behind))
    return found
