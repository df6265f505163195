"""Degradation modes and losses of plateaus of one cell, from its slow curves."""

from typing import NamedTuple

from cellwright.api import inputs, results
from cellwright.refusal import Refusal
from cellwright.settings import DegradationModes


def degradation_modes(
    tests,
    cell,
    chemistry=None,
    *,
    rests=(),
    half_cells=(None, None),
    fresh=None,
    settings=None,
    **changes,
):
    """Lithium and active material lost by one cell at each check-up [1], from slow curves or rests.

    Parameters
    ----------
    tests : (test, clean series) each, of slow charges, discharges or both; tests that are not slow
        are passed over.
    cell : CellFacts or mapping: cut-offs [V].
    chemistry : NMC, NCA, LCO, LMO or LFP: whose published half cells are tried.
    rests : (test, points of `ocv_from_rests`) each, of pulse tests at check-ups: they count where
        more check-ups have them than slow curves of one protocol.
    half_cells : (negative, positive): name of the library or `health.half_cells.HalfCell` each;
        None: those of the chemistry.
    fresh : (cell, tests) of a fresh cell of the type, for a cell without check-ups of its own.
    settings : `settings.DegradationModes`, or its keys as keywords.

    Returns
    -------
    modes : Result; one row a check-up: losses as shares of the fresh cell's lithium and electrodes,
        with standard deviations, NaN and a reason where the curve does not tell.

    Raises
    ------
    Refusal : Fewer than two check-ups, no half cells, or half cells that do not fit.

    Source: docs/health-modes.md.
    """
    from cellwright.health.electrodes import mode_rows
    from cellwright.health.electrodes.alignment import chosen_pair
    from cellwright.health.electrodes.modes import degradation_modes as modes_of
    from cellwright.health.electrodes.slow_curves import alike, growth, need_two

    options = inputs.settings_of(DegradationModes, settings, changes)
    tests = list(tests)
    facts, ends_seen = _with_ends_seen(inputs.cell_facts(cell), tests)
    slow = _curves(tests, facts, options)
    own, left_out = _check_ups(_with_rests(slow, rests, facts))
    if fresh is not None and len(own) == 1:
        lender, _ = _with_ends_seen(inputs.cell_facts(fresh[0]), fresh[1])
        lent = _curves(fresh[1], lender, options).curves
        lent = [curve for curve in lent if alike(curve, own[0])][:1]
        own = [*lent, *own]
        left_out += [f"fresh state: {curve.cell}, not this cell's own" for curve in lent]
    need_two(own, facts.cell)
    pairs = _pairs(chemistry, half_cells)
    fitting = chosen_pair(own, pairs, misfit_volt=options.misfit_volt)
    found = modes_of(own, fitting[0][0], others=[pair for pair, _ in fitting[1:]])
    rows = mode_rows.mode_rows(found, fitting[0][0], own)
    words = mode_rows.notes(found, fitting, given=None not in half_cells)
    words += [f"the last check-up {rows[-1]['doubt']}"] if rows[-1]["doubt"] else []
    return results.Result({"rows": rows}, notes=(*words, *ends_seen, *left_out, *growth(own)))


CUTOFFS = ("lower_cutoff_volt", "upper_cutoff_volt")


def _with_ends_seen(facts, tests):
    """The cell with the ends of its tests' voltage as cut-offs that are not stated, and a sentence.

    Of all tests the lowest and the highest voltage: one that does not reach them is no full one.
    """
    voltages = [test.series["voltage_volt"] for test in inputs.tests(tests)]
    found, words = {}, []
    for name, end, most in zip(CUTOFFS, (min, max), ("lowest", "highest"), strict=True):
        if getattr(facts, name) is None and voltages:
            found[name] = float(end(end(voltage) for voltage in voltages))
            volt = f"{found[name]:.3f} V, the {most} voltage of its slow tests"
            words.append(f"{name} is blank in cells.tsv: taken is {volt}")
    return facts._replace(**found), words


class _Curves(NamedTuple):
    """Slow curves of a cell, and why tests of a cycle gave none, by that cycle."""

    curves: list
    refused: dict


def _curves(tests, facts, options):
    from cellwright.health.electrodes.slow_curves import slow_curve

    found, limits = _Curves([], {}), {name: getattr(facts, name) for name in CUTOFFS}
    limits["least_hour"] = options.least_hour
    for test in inputs.tests(tests):
        try:
            curve = slow_curve(test.series, test.facts, cell=facts.cell, **limits)
            found.curves.append(curve)
        except Refusal as refusal:  # most often a faster charge of the same kind of test
            cycle = float(test.facts.cycle or 0)
            found.refused.setdefault(cycle, f"{test.facts.test}: {refusal}")
    return found


def _with_rests(found, rests, facts):
    """Slow curves and the rests of pulse tests, and why tests of a cycle gave neither."""
    from cellwright.health.electrodes.slow_curves import rest_curve

    curves, refused = list(found.curves), dict(found.refused)
    for test, points in rests:
        about = inputs.test_facts(test)
        try:
            curves.append(rest_curve(inputs.columns(points), about, cell=facts.cell))
        except Refusal as refusal:
            refused.setdefault(float(about.cycle or 0), f"{about.test}: {refusal}")
    return _Curves(curves, refused)


def plateau_losses(tests, cell, settings=None, **changes):
    """Charge lost by each plateau of one cell's slow curve since the first check-up [Ah].

    Parameters
    ----------
    tests : (test, clean series) each, as of `degradation_modes`.
    cell : CellFacts or mapping: cut-offs [V].
    settings : `settings.DegradationModes`, or its keys as keywords.

    Returns
    -------
    losses : Result; rows: one a plateau and check-up [Ah].

    Raises
    ------
    Refusal : Fewer than two check-ups, or a first curve without plateaus.

    Source: thesis 4.3; docs/health-plateaus.md.
    """
    from cellwright.health.electrodes.plateaus import plateau_losses as losses_of
    from cellwright.health.electrodes.slow_curves import growth, need_two

    options = inputs.settings_of(DegradationModes, settings, changes)
    tests = list(tests)
    facts, ends_seen = _with_ends_seen(inputs.cell_facts(cell), tests)
    own, left_out = _check_ups(_curves(tests, facts, options))
    need_two(own, facts.cell)
    return results.Result({"rows": losses_of(own)}, notes=(*ends_seen, *left_out, *growth(own)))


def _check_ups(found):
    """Curves by check-up, and what was left out: also check-ups without any slow curve."""
    from cellwright.health.electrodes.slow_curves import check_ups

    chosen, left_out = check_ups(found.curves)
    seen = {curve.cycle for curve in found.curves}
    without = [
        f"no slow curve or rests: {why}"
        for cycle, why in found.refused.items()
        if cycle not in seen
    ]
    return chosen, [*left_out, *without]


def _pairs(chemistry, half_cells):
    """Pairs of half cells to try: those given, else the chemistry's."""
    from cellwright.health.electrodes.alignment import Pair
    from cellwright.health.electrodes.half_cells import CHEMISTRIES, half_cell

    known = CHEMISTRIES.get(str(chemistry).upper())
    if known is None and None in half_cells:
        raise Refusal(
            f"no half cells: found chemistry {chemistry or 'blank'}, wanted one of "
            f"{', '.join(CHEMISTRIES)}, or negative_half_cell and positive_half_cell in cells.tsv"
        )
    tried = []
    for given, names in zip(half_cells, known or (None, None), strict=True):
        named = names if given is None else [given] if isinstance(given, str) else []
        tried.append([half_cell(name) for name in named] or [given])
    return [Pair(negative, positive) for negative in tried[0] for positive in tried[1]]
