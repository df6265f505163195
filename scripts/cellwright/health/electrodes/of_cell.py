"""Degradation modes and losses of plateaus of one cell, from its slow curves."""

from cellwright.health.electrodes import mode_rows, modes, plateaus, slow_curves
from cellwright.health.electrodes.alignment import Pair, chosen_pair
from cellwright.health.electrodes.half_cells import CHEMISTRIES, half_cell
from cellwright.health.electrodes.slow_curves import (
    alike,
    growth,
    need_two,
    rest_curve,
    slow_curve,
)
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result


def degradation_modes(
    tests,
    cell,
    chemistry=None,
    *,
    rests=(),
    half_cells=(None, None),
    fresh=None,
):
    """Lithium and active material lost by one cell at each check-up [1], from slow curves or rests.

    tests : slow charges, discharges or both; tests that are not slow are passed over.
    chemistry : NMC, NCA, LCO, LMO or LFP: whose published half cells are tried.
    rests : (test, points of `ocv_from_rests`) each, of pulse tests at check-ups: they count where
        more check-ups have them than slow curves of one protocol.
    half_cells : (negative, positive): name of the library or `health.half_cells.HalfCell` each;
        None: those of the chemistry.
    fresh : (cell, tests) of a fresh cell of the type, for a cell without check-ups of its own.

    Returns one row a check-up: losses as shares of the fresh cell's lithium and electrodes, with
    standard deviations, NaN and a reason where the curve does not tell. Raises Refusal: fewer than
    two check-ups, no half cells, or half cells that do not fit. Source: docs/health-modes.md.
    """
    facts, slow, refused, notes = _slow_curves(cell, tests)
    points = [(inputs.test_facts(test), inputs.columns(table)) for test, table in rests]
    at_rest = _curves_of(points, rest_curve, refused, cell=facts.cell)
    own, left_out = _by_check_up([*slow, *at_rest], refused)
    # Losses are differences: a single check-up needs a fresh cell of the type to differ from, and a
    # curve of another rate would differ by its polarisation as well.
    if fresh is not None and len(own) == 1:
        _, lent, _, _ = _slow_curves(*fresh)
        lent = [curve for curve in lent if alike(curve, own[0])][:1]
        own = [*lent, *own]
        left_out += [f"fresh state: {curve.cell}, not this cell's own" for curve in lent]
    need_two(own, facts.cell)
    pairs = _pairs(chemistry, half_cells)
    # Half cells of a chemistry differ between makers: all pairs that fit bound the error by choice.
    fitting = chosen_pair(own, pairs)
    found = modes.degradation_modes(own, fitting[0][0], others=[pair for pair, _ in fitting[1:]])
    rows = mode_rows.mode_rows(found, fitting[0][0], own)
    words = mode_rows.notes(found, fitting, given=None not in half_cells)
    words += [f"the last check-up {rows[-1]['doubt']}"] if rows[-1]["doubt"] else []
    return Result({"rows": rows}, notes=(*words, *notes, *left_out, *growth(own)))


def plateau_losses(tests, cell):
    """Charge lost by each plateau of one cell's slow curve since the first check-up [Ah].

    tests : as of `degradation_modes`.

    Returns rows, one a plateau and check-up [Ah]. Raises Refusal: fewer than two check-ups, or a
    first curve without plateaus.
    Source: thesis 4.3; docs/health-modes.md.
    """
    facts, slow, refused, notes = _slow_curves(cell, tests)
    own, left_out = _by_check_up(slow, refused)
    need_two(own, facts.cell)
    return Result({"rows": plateaus.plateau_losses(own)}, notes=(*notes, *left_out, *growth(own)))


def _slow_curves(cell, tests):
    """CellFacts, slow curves of its tests, why others gave none (by cycle), and sentences.

    A cut-off that is not stated is the lowest or highest voltage of all tests: one that does not
    reach it is no full one.
    """
    # Charges of a wider window would hold more lithium without any having been lost.
    facts, tests, notes = inputs.cell_facts(cell), inputs.tests(tests), []
    voltages = [test.series["voltage_volt"] for test in tests]
    for name, end, most in zip(inputs.CUTOFFS, (min, max), ("lowest", "highest"), strict=True):
        if getattr(facts, name) is None and voltages:
            volt = float(end(end(voltage) for voltage in voltages))
            facts = facts._replace(**{name: volt})
            taken = f"{volt:.3f} V, the {most} voltage of its slow tests"
            notes.append(f"{name} is blank in cells.tsv: taken is {taken}")
    limits = inputs.cutoffs(facts)
    refused = {}
    pairs = [(test.facts, test.series) for test in tests]
    slow = _curves_of(pairs, slow_curve, refused, cell=facts.cell, **limits)
    return facts, slow, refused, notes


def _curves_of(pairs, curve_of, refused, **options):
    """Curves of (TestFacts, columns) each; `refused` gets why a test of a cycle gave none."""
    curves = []
    for facts, columns in pairs:
        try:
            curves.append(curve_of(columns, facts, **options))
        except Refusal as refusal:  # most often a faster charge of the same kind of test
            refused.setdefault(float(facts.cycle or 0), f"{facts.test}: {refusal}")
    return curves


def _by_check_up(curves, refused):
    """Curves by check-up, and what was left out: also check-ups without any slow curve."""

    chosen, left_out = slow_curves.check_ups(curves)
    # A faster charge that was passed over is no news where the same check-up has a slow one.
    seen = {curve.cycle for curve in curves}
    without = [why for cycle, why in refused.items() if cycle not in seen]
    return chosen, [*left_out, *(f"no slow curve or rests: {why}" for why in without)]


def _pairs(chemistry, half_cells):
    """Pairs of half cells to try: those given, else the chemistry's."""

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
