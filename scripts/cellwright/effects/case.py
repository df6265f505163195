"""One cell as a case of the search: from its tests to the records fitted and those that judge.

Also its fits, the noise of its residuals, and measurements that decide between tied effects.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base, proof, ties
from cellwright.effects.candidates import State, candidates, chi_square_of, frees_of, screened
from cellwright.effects.judge import rests_of, started, tolerated, unfitted
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.records import lacking, stacked
from cellwright.numerics import noise
from cellwright.numerics.least_squares import SETTLED, Problem, fit, stds
from cellwright.numerics.statistics import rms
from cellwright.protocols.ocv.gap import HYSTERESIS, SlowGap, shows_hysteresis, slow_gap
from cellwright.records.basis import REFERENCE_CELSIUS
from cellwright.records.facts import of_first_checkup
from cellwright.records.record import laid_out_to_fit
from cellwright.records.thinning import averaged_to, thin
from cellwright.refusal import Refusal
from cellwright.settings import MissingEffect

UNUSED_VOLT = 1e4  # error of a row that is not compared: so large that it has no weight
SLOW_TEST = "ocv"
MEASURED_SOC = 0.1, 0.9  # of a slow test; towards its ends the OCV is joined to what rests show
KINDS = ("capacity", "hppc", "pulse_resistance", "drive")  # and the slow test of the OCV
GRID = np.linspace(0.0, 1.0, 1001)
EDGE_PART = 200.0  # a change of this part of a record's largest ends a steady stretch
RATED_CAPACITY = 0.05  # tolerance of a capacity that nobody measured
JUDGING = ("validation", "split")  # roles of tests that judge
HOLDS = ("zero_order", "first_order")
STEPS_OF_HOLD = 6  # of the fit by which the hold is chosen

SEARCH = MissingEffect()  # the schema's defaults


class Gates(NamedTuple):
    """When an effect counts; meaning and source in config/README.md (missing_effect)."""

    refits: int = SEARCH.refits
    bic: float = SEARCH.bic
    validation_chi_square: float = SEARCH.validation_chi_square
    visible_chi_square: float = SEARCH.visible_chi_square
    material_volt: float = SEARCH.material_volt
    unknown_volt: float = SEARCH.unknown_volt
    tie_absolute: float = SEARCH.tie_absolute
    tie_relative: float = SEARCH.tie_relative
    rounds: int = SEARCH.rounds
    most_slow_volt: float = SEARCH.most_slow_volt
    most_slow_second: float = SEARCH.most_slow_second
    steep_volt: float = SEARCH.steep_volt


STEADY_C_RATE = 0.02
LOGGED = {"current_offset", "leakage"}  # what the current logged at rest decides between
SLOW = "slow_diffusion"
MOST_WHITE = 1.5  # times the scatter of neighbouring rows
FAR_LOG = 0.2  # change of a log resistance or time constant up to which derivatives are kept
FAR_SOC = 0.003  # and of the SoC at the start of a record


class Filters(NamedTuple):
    """Whitening of both stacks by one noise, and which of their rows an rms error counts.

    noise : noise.Noise. extra_volt : see `extra_volt_of`. Rows on a steep end of the OCV, where a
    little charge is many millivolts, do not count. misfit_volt : (n,) of each row fitted, what the
    best model leaves of its block beyond the noise; zero as long as nobody would act on it.
    """

    noise: noise.Noise
    extra_volt: tuple
    fit: noise.Whitening
    validation: noise.Whitening
    fit_rows: np.ndarray
    validation_rows: np.ndarray
    misfit_volt: np.ndarray


class Case(NamedTuple):
    """A cell, its records fitted and those that judge (records.Stack), tolerances and gates.

    gap : voltage between the branches of the slow test, gap.SlowGap. start, log_std : values of the
    companion of a given model and how well they are known (`own`), else None. otherwise : the same
    Case with the other hold of the current, or None. first_capacity : where a fit begins, relative
    to the measured one [1]. The methods are those that `search` needs.
    """

    cell: base.Cell
    fit: object
    validation: object
    tolerance: base.Tolerance = base.Tolerance()
    gates: Gates = Gates()
    gap: SlowGap = SlowGap()
    polish_share: float = 0.3  # of the best J, from which a misled trial is refitted
    settled: float = SETTLED
    most_small: int = 4
    keeps_derivatives: bool = True
    start: dict | None = None
    log_std: dict | None = None
    otherwise: object = None
    first_capacity: float = 0.0

    @property
    def steady_ampere(self):
        """Change of the current between two rows up to which it counts as steady [A]."""
        return STEADY_C_RATE * self.cell.capacity_ampere_hour

    def possible(self, library):
        """Effects, by key, that the records excite and that current and voltage can show."""
        return {
            key: effect
            for key, effect in library.items()
            if not not_excited(self, effect) and ties.tie_of(effect.id) is None
        }

    def begun(self):
        """Free parameters of the plain model, its first values, and filters of a first noise."""
        values, free = unfitted(self)
        return free, values, filters_of(self, noise.FIRST, extra_volt_of(self, values))

    def with_effect(self, free, effect):
        """Free parameters with those of an effect after them."""
        return (*free, *frees_of(effect))

    def problem(self, effects, free, filters):
        """The fit of a model with these effects to the records of role fit."""
        return problem_of(self, effects, free, filters)

    def candidates(self, effects, solution, possible, further):
        """What each further effect would change: list of candidates.Candidate."""

        def predict(values, effect):
            together = in_order((*effects, effect), possible)
            return base.voltage(self.cell, self.fit, values, together)

        return candidates(predict, solution.prediction, solution.values, further)

    def filters_for(self, residual, filters, earlier):
        """Filters by the noise of the residual with all candidates in the model."""
        limits = {
            name: getattr(self.gates, name) for name in ("most_slow_volt", "most_slow_second")
        }
        extra = filters.extra_volt[0]
        spread = noise.estimate_noise(residual, self.fit, extra_volt=extra, **limits)
        # What a reading scatters by, neighbouring rows show; more of it is misfit of the model.
        read = noise.read_volt(residual, self.fit, steady_ampere=self.steady_ampere)
        spread = spread._replace(white_volt=min(spread.white_volt, MOST_WHITE * read))
        return filters_of(self, spread, filters.extra_volt, misfit_volt=filters.misfit_volt)

    def sharper(self, trials, filters):
        """Filters by the misfit that no trial removes; None where it is as it was.

        A knee that no effect bends as the cell does would else, by the square of its error, decide
        resistances, capacity and OCV everywhere. Nobody acts on changes up to `unknown_volt`.
        """
        soc = base.fields_of(self.cell, self.fit, base.first_values(self.cell, self.fit)).soc
        residuals = [trial.state.solution.residual for trial in trials]
        misfit = proof.misfit_of(self.fit, soc, residuals, noise_volt=filters.noise.volt)
        if np.abs(misfit - filters.misfit_volt).max() <= self.gates.unknown_volt:
            return None
        return filters_of(self, filters.noise, filters.extra_volt, misfit_volt=misfit)

    def screened(self, lined_up, before, free, possible, filters):
        """Scores, best first, and keys of effects that the records cannot show."""
        return screened(self, lined_up, before, possible, filters)

    def state(self, effects, solution, filters):
        """State of a fitted model: its errors on the records that judge."""
        return state_of(self, effects, solution, filters)

    def floor(self, before, free, residual, filters, earlier):
        """Error that readings and stated tolerances leave, of the plain model: proof.Floor."""
        if earlier:
            return earlier[0].floor
        read = noise.read_volt(residual, self.fit, steady_ampere=self.steady_ampere)
        read = min(read, filters.noise.white_volt)
        return proof.floor_of(self, before, free, filters.validation_rows, read)

    def proof(self, before, after, filters, inflations):
        """How evenly a further effect helps: (Consistency, whether records that judge show it).

        Where these cannot tell, it is judged on the records fitted. inflations : by role.
        """
        fit, judging = self.fit, self.validation
        sides = before.solution.residual, after.solution.residual
        fitted = proof.evenly(self, fit, sides, after, after.solution.values, filters.fit_rows)
        sides = before.validation, after.validation
        shown = proof.evenly(self, judging, sides, after, after.values, filters.validation_rows)
        about = before, after, judging.file, inflations["validation"]
        promised = proof.promised_of(*about).sum()
        proven = proof.can_judge(self.gates, shown, fitted, promised)
        return (shown if proven else fitted), proven

    def inflation(self, state):
        """By how much the chi-square of each record is too large by correlation, by role.

        What a model misses lasts for minutes to hours and is no reading noise.
        """
        stacks = ("fit", state.solution.whitened), ("validation", state.validation_white)
        sides = {role: (getattr(self, role), white) for role, white in stacks}
        return {
            role: proof.inflation(white, stack.file, len(stack.first))
            for role, (stack, white) in sides.items()
        }

    def falls(self, before, after):
        """Fall of the chi-square of each record from one State to another, by role."""
        white = (np.square(s.solution.whitened) for s in (before, after))
        fit = np.subtract(*(np.bincount(self.fit.file, squares) for squares in white))
        judged = before.validation_chi_squares - after.validation_chi_squares
        return {"fit": fit, "validation": judged}

    def rows_per_record(self):
        """Number of rows of each record fitted (f,)."""
        return np.bincount(self.fit.file)

    def matters(self, first, before, trial, floor, *, share=1.0):
        """Whether an effect has a size, and takes so much off the error, that somebody acts on."""
        after = trial.state
        taken = proof.excess_volt(before.rmse_volt, after.rmse_volt)
        if trial.proven:
            errors = before.validation_rmse_volt, after.validation_rmse_volt
            taken = max(taken, proof.excess_volt(*errors)) if errors[1] < errors[0] else 0.0
        errors = ("rmse_volt", "validation_rmse_volt")
        risen = [proof.excess_volt(getattr(after, e), getattr(before, e)) for e in errors]
        if max(risen) > self.gates.material_volt:
            return False
        # A small size matters, too, where the load makes a large voltage of it.
        sized = trial.material or taken >= self.gates.unknown_volt
        return sized and taken >= share * self.gates.material_volt

    def misled(self, before, trial):
        """Whether resistances, time constants or starts moved too far for kept derivatives."""
        then, now = before.solution.values, trial.state.solution.values
        moved = {name: abs(now[name] - then[name]) for name in before.solution.names}
        starts = (size for name, size in moved.items() if name.startswith("soc0["))
        return max(moved[name] for name in base.LOGARITHMS) > FAR_LOG or max(starts) > FAR_SOC

    def denied(self, trials):
        """Keys of trials that a measurement outside the fit contradicts.

        The current logged at rest decides between an offset and a leak. A gap between the branches
        of the slow test that no resistance explains is hysteresis, and no slow diffusion.
        """
        at_rest = {t.effect.id: _by_rest_current(self, t) for t in trials if t.effect.id in LOGGED}
        denied = {name for name, effect in at_rest.items() if effect not in (None, name)}
        slow = [t for t in trials if t.effect.id == SLOW and _in_place_of_hysteresis(self, t)]
        return denied | {t.effect.key for t in slow}

    def ties(self, chosen, tied, denied, library):
        """The ties of a choice with their structural partners, without those that are denied."""
        values = chosen.state.solution.values
        tied = ties.with_partners(chosen.effect.id, tied, library, values)
        ampere_hour = self.cell.capacity_ampere_hour
        tied = (*tied, *ties.at_one_temperature(chosen.effect.id, self.fit, ampere_hour))
        if chosen.effect.id in LOGGED and _by_rest_current(self, chosen) is not None:
            denied = denied | LOGGED
        return tuple(name for name in tied if name not in denied)


def not_excited(case, effect):
    """What the records fitted lack to excite this effect, in words; empty: nothing."""
    return lacking(effect, case.fit, case.cell.capacity_ampere_hour)


def _by_rest_current(case, trial):
    """Which of current offset and leak the log at rest shows; None where it does not decide."""
    name = trial.effect.names[0]
    size, std = trial.state.solution.values[name], stds(trial.state.solution)[name]
    rest = ties.rest_current(case.fit, capacity_ampere_hour=case.cell.capacity_ampere_hour)
    return ties.offset_or_leak(rest, size_ampere=size, std_ampere=std)


def _in_place_of_hysteresis(case, trial):
    """Whether slow diffusion is fitted to a gap that is hysteresis by the slow test's branches."""
    values = trial.state.solution.values
    ohm = sum(np.exp(values[name]) for name in ("log_r0", "log_r1", "log_r2"))
    modelled = HYSTERESIS & {effect.id for effect in trial.state.effects}
    return not modelled and shows_hysteresis(case.gap, ohm + values[f"{SLOW}.resistance_ohm"])


def problem_of(case, effects, free, filters):
    """The fit of a model with these effects to the records of role fit."""
    return Problem(
        lambda values: base.voltage(case.cell, case.fit, values, effects),
        case.fit.voltage_volt,
        filters.fit.apply,
        free,
        base.coupling(free, case.tolerance),
        lambda values: _of_own_rows(case, effects, values),
    )


def _of_own_rows(case, effects, values):
    """Parameters that move rows of their own, for `Problem.apart`.

    SoC at the start of a record: its rows. Every other knot of the OCV's error: those around it.
    """
    soc = base.fields_of(case.cell, case.fit, values, effects).soc
    below = base.knot_below(soc)
    starts = base.start_names(len(case.fit.first))
    even, odd = base.OCV_NAMES[::2], base.OCV_NAMES[1::2]
    return [(starts, case.fit.file), (even, (below + 1) // 2), (odd, below // 2)]


def state_of(case, effects, solution, filters):
    """State of a fitted model: its errors on the records that judge.

    Of these records only the first rest enters a parameter, their SoC at the start. What that and
    a stated temperature leave unsure is taken out of their errors.
    """
    stack = case.validation
    pairs = [(k, case.fit.tests.index(t)) for k, t in enumerate(stack.tests) if t in case.fit.tests]
    rests = rests_of(case.cell, case.fit, solution)
    values = started(case.cell, stack, solution.values, effects, case.tolerance, pairs, rests)
    volt = base.voltage(case.cell, stack, values, effects)
    about = case.cell, stack, values, effects, case.tolerance
    moved, explained, kelvin = tolerated(*about, volt, filters.validation, pairs)
    values = values | {f"kelvin[{k}]": float(error) for k, error in enumerate(kelvin)}
    error = stack.voltage_volt - volt - moved
    white = filters.validation.apply(stack.voltage_volt - volt)
    return State(
        effects,
        solution,
        values,
        error,
        filters.validation.apply(error),
        np.bincount(stack.file, white**2) - explained,
        rms(solution.residual[filters.fit_rows]),
        rms(error[filters.validation_rows]),
    )


def extra_volt_of(case, values):
    """Error of each row of both stacks beyond noise [V]: on a steep OCV, or not compared."""
    extra = []
    for stack in (case.fit, case.validation):
        socs = {f"soc0[{k}]": float(soc) for k, soc in enumerate(stack.soc_at_start)}
        soc = base.fields_of(case.cell, stack, values | socs).soc
        unused = np.where(stack.used, 0.0, UNUSED_VOLT)
        extra.append(unused + base.steep_volt(case.cell, soc, case.tolerance))
    return tuple(extra)


def filters_of(case, spread, extra, *, misfit_volt=0.0):
    """Filters of both stacks for a noise.

    extra : see `extra_volt_of`. misfit_volt : (n,) or 0, see `Filters`. By it times the noise the
    variance of a row grows: least squares reweighted so that a block costs by its rms error, not by
    its square (E. Schlossmacher, J. Am. Stat. Assoc. 68 (1973) 857).
    """
    misfit = np.broadcast_to(misfit_volt, len(extra[0]))
    further = np.sqrt(np.square(extra[0]) + misfit * spread.volt)
    return Filters(
        spread,
        extra,
        noise.whitening(spread, case.fit, extra_volt=further),
        noise.whitening(spread, case.validation, extra_volt=extra[1]),
        extra[0] <= case.gates.steep_volt,
        extra[1] <= case.gates.steep_volt,
        misfit,
    )


class Prepared(NamedTuple):
    """A case and its records, fitted and judging; notes on how it was made.

    caveats : what weakens a proof by it, part of the verdict.
    """

    case: Case
    records: tuple
    notes: tuple
    caveats: tuple = ()


def prepared(cell, basis, tests, *, tolerance, gates, settings):
    """Case of a cell's tests: laid out over SoC, thinned, and divided into fitted and judging.

    Tests of role fit are fitted, of role validation judge; of a split test the odd blocks are
    fitted and the even ones judge. Where no test judges, every third one is kept out of the fit
    for it, so that rates and temperatures stay on both sides.

    Parameters
    ----------
    cell : CellFacts. basis : dict, from `basis.basis`.
    tests : list of MeasuredTest. tolerance : base.Tolerance. gates : Gates.
    settings : dict with most_rows, split_rest_second.

    Returns
    -------
    prepared : Prepared.

    Raises
    ------
    Refusal : no OCV, nothing to fit, or nothing that judges.
    """
    if not basis["ocv"]:
        raise Refusal(
            "no OCV curve: no slow test of the cell or its type, and no rests that tell one"
        )
    curve = _curve_at_reference(basis)
    fitted, judging, notes = _sides(cell, basis, _with_slow_test(tests, curve), settings)
    if basis["capacity_source"] == "rating":
        tolerance = tolerance._replace(capacity=RATED_CAPACITY)
        notes.append("no measured capacity: the rating, to 5 %")
    caveats = (*_stand_in(tests, judging), *_of_rests(curve, judging))
    capacity = basis["capacity_ampere_hour"]
    sides = tuple(_thinned(side, settings["most_rows"], capacity) for side in (fitted, judging))
    measured = base.Cell(capacity, np.interp(GRID, curve["soc"], curve["ocv_volt"]))
    about = tolerance, gates, slow_gap(curve)
    cases = [
        Case(measured, *(stacked(s, capacity_ampere_hour=capacity, hold=h) for s in sides), *about)
        for h in HOLDS
    ]
    begin = base.first_capacity(measured, cases[0].fit)
    cases = [case._replace(first_capacity=begin) for case in cases]
    better, other = sorted(cases, key=_misfit)
    return Prepared(better._replace(otherwise=other), sides, tuple(notes), caveats)


def _with_slow_test(tests, curve):
    """Tests that the search reads: none slow but that of the OCV, if of the same check-up.

    Both branches of it hold the OCV where it is. Drives discharge most of the time, and alone they
    would let it follow a hysteresis.
    """
    others = [test for test in tests if test.facts.kind != SLOW_TEST]
    own = [t for t in tests if t.facts.kind == SLOW_TEST and t.facts.test == curve["test"]]
    first, _ = of_first_checkup(others)
    together, _ = of_first_checkup([*own, *first])
    return [*own, *others] if len(together) == len(own) + len(first) else others


def _sides(cell, basis, tests, settings):
    """Records that are fitted and that judge, with notes on those that cannot be used."""
    young, later = of_first_checkup(tests)
    fitted, judging, notes = [], [], [f"not used, of a later check-up: {n}" for n in later]
    for test in young:
        role, given = test.facts.role, (test, basis, cell, settings)
        try:
            fitted += [] if role == "validation" else [_record(*given)]
            judging += [_record(*given, proof=True)] if role in JUDGING else []
        except Refusal as refusal:
            notes.append(f"not used: {test.facts.test}: {refusal}")
    dynamic = [record for record in fitted if record.kind != SLOW_TEST]
    if not judging and len(dynamic) >= 3:
        judging = [record for k, record in enumerate(dynamic) if k % 3 == (k // 3) % 3]
        kept_out = {record.test for record in judging}
        fitted = [record for record in fitted if record.test not in kept_out]
        names = ", ".join(record.test for record in judging)
        notes.append(f"no test of role validation: {names} judged instead, and were not fitted")
    if not dynamic or not judging:
        which = "fitted" if not dynamic else "kept out of the fit for validation"
        raise Refusal(f"no test can be {which}; {'; '.join(notes)}")
    return fitted, judging, notes


def _record(test, basis, cell, settings, *, proof=False):
    # What the instrument read, with what cleaning did not count: an offset is one of the effects.
    cut = {"split_rest_second": settings["split_rest_second"]}
    record = laid_out_to_fit(test, basis, cell, proof=proof, as_read=True, **cut)
    if record.kind != SLOW_TEST:
        return record
    low, high = MEASURED_SOC
    return record._replace(used=record.used & (record.soc >= low) & (record.soc <= high))


def _curve_at_reference(basis):
    """OCV curve of the temperature nearest 25 °C."""

    def distance_kelvin(curve):
        celsius = curve["ambient_temperature_celsius"]
        return abs(REFERENCE_CELSIUS - (REFERENCE_CELSIUS if celsius is None else celsius))

    return min(basis["ocv"], key=distance_kelvin)


def _stand_in(tests, judging):
    """Caveat of a cell without a test for validation, where others judge."""
    if not any(test.facts.role in JUDGING for test in tests):
        names = ", ".join(record.test for record in judging)
        yield f"No test of this cell is for validation: {names} judged, unfitted; that is no proof."


def _of_rests(curve, judging):
    """Caveat of an OCV that is from a test's own rests."""
    if curve.get("branches") == "rests":
        judges = any(record.test == curve["test"] for record in judging)
        also = "it is one of those that judge" if judges else "what they had not relaxed is in it"
        yield f"The open-circuit voltage is from the rests of {curve['test']}: {also}."


def _thinned(records, most_rows, capacity_ampere_hour):
    """Records thinned for the search: whole seconds, steady stretches sparse, `most_rows`."""

    def sparse(record):
        largest = np.abs(np.diff(record.current_ampere)).max(initial=0.0)
        return thin(
            record, step_ampere=largest / EDGE_PART, capacity_ampere_hour=capacity_ampere_hour
        )

    return averaged_to(records, most_rows=most_rows, thinned=sparse)


def _misfit(case):
    """Chi-square of the plain model on the records fitted, the least over delays of the voltage.

    Fitted, for guessed time constants err by more than the holds differ. Without the delays, a time
    skew of the readings would choose the hold that imitates it.
    """
    free, values, filters = case.begun()
    values = fit(case.problem((), free, filters), values, steps=STEPS_OF_HOLD).values
    skew = LIBRARY["time_skew"]
    costs = [chi_square_of(case, values, (), filters)]
    for start in skew.starts:
        skewed = values | {skew.names[0]: start["voltage_delay_second"]}
        skewed = base.regressed(case.cell, case.fit, skewed, (skew,))
        costs.append(chi_square_of(case, skewed, (skew,), filters))
    return min(costs)
