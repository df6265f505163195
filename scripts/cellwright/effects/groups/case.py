"""One parallel group as a case of the search: its records, fits, noise and candidates.

A group is healthy if its branches differ from what is known of their cells by no more than the
declared spread. So most free parameters have bounds, and candidates are scored within them.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects.groups.model import (
    at_branch,
    group_coupling,
    group_fields,
    group_frees,
    group_names,
    group_run,
)
from cellwright.effects.judge import READ_VOLT
from cellwright.effects.library.vocabulary import in_order
from cellwright.effects.proof import Floor, excess_volt
from cellwright.effects.records import LOADED_C_RATE
from cellwright.effects.screen import Score, candidates
from cellwright.effects.search import State, frees_of
from cellwright.numerics import noise
from cellwright.numerics.least_squares import Problem, bounded_minimum, priors
from cellwright.numerics.statistics import rms
from cellwright.settings.effects import MissingEffectGroupGates
from cellwright.settings.effects import MissingEffectGroupShared as Shared
from cellwright.settings.effects import MissingEffectGroupSpread as Spread

GATES = MissingEffectGroupGates()  # the schema's defaults
PASSES = 2
SOC_APART = 0.005
SLOW_SECOND = (30.0, 100.0, 300.0)
FIRST_NOISE_VOLT = 2e-3
FIRST_NOISE_SHARE = 2e-3  # of the largest branch current
SHARPER = 0.8  # fall of the slow noise for which a round is repeated
VISIBLE = 25.0  # fall of chi-square by an effect of plausible size


class GroupGates(NamedTuple):
    """When an effect of a branch counts; meanings as those of a cell's gates.

    material_volt : fall of the rms error of the branch currents on validation records, times their
    cells' ohmic resistance, below which nobody would act on it [V]. adequate_volt : such an error
    that may be left [V]. most_slow_volt : largest slow noise of a branch current, times its cell's
    ohmic resistance [V]. shared_slow_volt : slow error of the model's voltage that all branches
    share, and that must not move their currents [V].
    """

    refits: int = GATES.refits
    bic: float = GATES.bic
    validation_chi_square: float = GATES.validation_chi_square
    validation_fall: float = GATES.validation_fall
    material_volt: float = GATES.material_volt
    nothing_ratio: float = GATES.nothing_ratio
    adequate_ratio: float = GATES.adequate_ratio
    adequate_volt: float = GATES.adequate_volt
    adequate_closed: float = GATES.adequate_closed
    partial_closed: float = GATES.partial_closed
    tie_absolute: float = GATES.tie_absolute
    tie_relative: float = GATES.tie_relative
    rounds: int = GATES.rounds
    most_slow_volt: float = GATES.most_slow_volt
    shared_slow_volt: float = GATES.shared_slow_volt

    @property
    def unknown_volt(self):
        """Error beyond the noise up to which there is no unknown effect: `adequate_volt` [V]."""
        return self.adequate_volt


class Channels(NamedTuple):
    """Whitening of the channels of a stack, one after the other: voltage, then branch currents."""

    channels: tuple

    def apply(self, rows):
        """Whitened copy of rows (m,) or (m, k)."""
        parts = np.split(rows, len(self.channels))
        pairs = zip(self.channels, parts, strict=True)
        return np.concatenate([whitening.apply(part) for whitening, part in pairs])


class GroupFilters(NamedTuple):
    """Whitening of both stacks. noise : tuple of noise.Noise, one a channel."""

    noise: tuple
    fit: Channels
    validation: Channels


class GroupCase(NamedTuple):
    """A group, its records fitted and those that judge, tolerances and gates.

    cells : tuple of Branch. fit, validation : records.GroupStack. fit_soc, validation_soc : (f, b)
    stated SoC at the start of each record [1]. The methods are those that `search` needs.
    """

    cells: tuple
    fit: object
    validation: object
    fit_soc: np.ndarray
    validation_soc: np.ndarray
    spread: Spread = Spread()
    shared: Shared = Shared()
    gates: GroupGates = GroupGates()
    polish_share: float = 0.8  # of the best J, from which a trial is refitted as its rival
    settled: float = 1.0
    keeps_derivatives: bool = False

    @property
    def sensors(self):
        """Whether all records have branch currents."""
        logged = (self.fit.branch_current_ampere, self.validation.branch_current_ampere)
        return all(currents is not None for currents in logged)

    def possible(self, library):
        """Every effect in every branch; of the branch sensors only where there are any."""
        asked = [e for e in library.values() if self.sensors or e.stage != "current"]
        placed = [at_branch(effect, k) for effect in asked for k in range(len(self.cells))]
        return {effect.key: effect for effect in placed}

    def begun(self):
        """Free parameters of the healthy group, its first values, and filters of a first noise."""
        files = len(self.fit.first)
        names = group_names(files, len(self.cells))
        free = group_frees(self.cells, files, self.spread, self.shared, sensors=self.sensors)
        noises = [noise.Noise(FIRST_NOISE_VOLT, FIRST_NOISE_VOLT, 300.0)]
        if self.sensors:
            size = FIRST_NOISE_SHARE * np.abs(self.fit.branch_current_ampere).max() / 4
            noises += [noise.Noise(size, size, 200.0)] * len(self.cells)
        return free, dict.fromkeys(names, 0.0), _filters(self, tuple(noises))

    def with_effect(self, free, effect):
        """Free parameters and those of an effect; what it replaces is held at zero."""
        names = {f"{effect.position}.{name}" for name in effect.replaces}
        held = [f._replace(lower=0.0, upper=0.0) if f.name in names else f for f in free]
        return (*held, *frees_of(effect))

    def problem(self, effects, free, filters):
        """The fit of a healthy group and some effects to the records of role fit."""
        return Problem(
            lambda values: predicted(self, self.fit, self.fit_soc, values, effects),
            rows_of(self, self.fit),
            filters.fit.apply,
            free,
            group_coupling(free, self.cells, self.spread, self.shared),
            exact=True,
        )

    def candidates(self, effects, solution, possible, further):
        """What each further effect would change: list of screen.Candidate."""

        def predict(values, effect):
            together = in_order((*effects, effect), possible)
            return predicted(self, self.fit, self.fit_soc, values, together)

        every = candidates(predict, solution.prediction, solution.values, further)
        return [candidate for candidate in every if np.any(candidate.columns)]

    def filters_for(self, residual, filters, earlier):
        """Filters by the noise of a residual; with more effects the noise does not grow."""
        return _filters(self, noises_of(self, residual, filters.noise if earlier else None))

    def sharper(self, trials, filters):
        """Filters by the residual of the best trial where its slow noise falls by 20 %, else None.

        The noise is first taken from a linear extrapolation, which fails for a strong effect.
        """
        noises = noises_of(self, trials[0].state.solution.residual, filters.noise)
        pairs = zip(noises, filters.noise, strict=True)
        alike = all(new.slow_volt > SHARPER * old.slow_volt for new, old in pairs)
        return None if alike else _filters(self, noises)

    def screened(self, lined_up, before, free, possible, filters):
        """Scores, best first, and keys of effects that do not show at a plausible size."""
        problem = self.problem(before.effects, free, filters)
        scores = _bounded_scores(self, problem, before.solution, lined_up)
        hidden = tuple(s.candidate.effect.key for s in scores if s.visible < VISIBLE)
        return sorted(scores, key=lambda s: -s.chi_square), hidden

    def state(self, effects, solution, filters):
        """State of a fitted model: its errors on the records that judge."""
        values = _started(self, solution.values, effects)
        rows = rows_of(self, self.validation)
        error = rows - predicted(self, self.validation, self.validation_soc, values, effects)
        white = filters.validation.apply(error)
        sizes = error_volt(self, solution.residual), error_volt(self, error)
        return State(effects, solution, values, error, white, np.array([white @ white]), *sizes)

    def floor(self, before, free, residual, filters, earlier):
        """Size of the noise alone, in the measure of `error_volt`: proof.Floor."""
        volt = filters.noise[0].volt
        if self.sensors:
            pairs = zip(filters.noise[1:], ohms(self), strict=True)
            volt = rms([channel.volt * ohm for channel, ohm in pairs])
        return Floor(volt, volt, {})

    def proof(self, before, after, filters):
        """No consistency over blocks: an effect of a branch counts by the gates."""
        return None, True

    def inflation(self, state):
        """1: the misfit of branch currents is carried in the noise of the shared voltage."""
        return {"fit": np.ones(1), "validation": np.ones(1)}

    def falls(self, before, after):
        """Fall of the chi-square from one State to another, by role."""
        fit = before.solution.chi_square - after.solution.chi_square
        judged = before.validation_chi_squares - after.validation_chi_squares
        return {"fit": np.array([fit]), "validation": judged}

    def rows_per_record(self):
        """Number of rows fitted, of all channels (1,)."""
        return np.array([len(rows_of(self, self.fit))])

    def explained(self, before, floor):
        """Whether the error is within what healthy branches leave."""
        gates, worst = self.gates, before.worst_volt
        if worst <= max(gates.nothing_ratio * floor.fit_volt, gates.adequate_volt):
            return True
        return bool(before.effects) and worst <= gates.adequate_ratio * floor.fit_volt

    def significant(self, before, trial):
        """Whether a trial improves the fit by more than chance, on both kinds of records."""
        gates, was = self.gates, before.validation_rmse_volt
        return (
            trial.delta_bic > gates.bic
            and trial.delta_validation > gates.validation_chi_square
            and trial.state.validation_rmse_volt <= (1.0 - gates.validation_fall) * was
        )

    def matters(self, first, before, trial, floor, *, share=1.0):
        """Whether an effect has a size, and takes so much off the error, that somebody acts on."""
        errors = before.validation_rmse_volt, trial.state.validation_rmse_volt
        return trial.material and excess_volt(*errors) >= share * self.gates.material_volt

    def misled(self, before, trial):
        """True: the best trials are always refitted with derivatives at their own optimum."""
        return True

    def denied(self, trials):
        """No keys: no measurement outside the fit contradicts an effect of a branch."""
        return set()

    def ties(self, chosen, tied, denied, library):
        """Keys that explain as much as the choice: those of the fit alone."""
        return tied


def _filters(case, noises):
    both = [
        Channels(tuple(noise.whitening(channel, stack) for channel in noises))
        for stack in (case.fit, case.validation)
    ]
    return GroupFilters(tuple(noises), *both)


def _bounded_scores(case, problem, solution, lined_up):
    """Score of each candidate: the fall of the quadratic cost at its minimum within all bounds."""
    prior, pull = priors(problem)
    names = [f.name for f in problem.free]
    at = np.array([solution.values[name] for name in names])
    residual = problem.whiten(solution.residual)
    moment = solution.white.T @ residual + pull + (solution.precision - prior) @ at
    healthy = bounded_minimum(solution.precision, moment, *_limits(problem.free), at)
    without = 0.5 * healthy @ solution.precision @ healthy - moment @ healthy
    scores = []
    for candidate in lined_up:
        effect, column = candidate.effect, problem.whiten(candidate.columns[:, 0])
        mixed = solution.white.T @ column
        precision = np.block([[solution.precision, mixed[:, None]], [mixed[None], column @ column]])
        moments = np.append(moment, column @ residual + mixed @ at)
        limits = _limits(case.with_effect(problem.free, effect))
        x = bounded_minimum(precision, moments, *limits, np.append(healthy, 0.0))
        fall = 2 * (without - (0.5 * x @ precision @ x - moments @ x))
        values = solution.values | dict(zip((*names, *effect.names), x.tolist(), strict=True))
        information = column @ column - mixed @ np.linalg.solve(solution.precision, mixed)
        visible = float(information * effect.parameters[0].plausible ** 2)
        scores.append(Score(candidate, float(fall), x[-1:], information, visible, values))
    return scores


def _limits(free):
    return np.array([f.lower for f in free]), np.array([f.upper for f in free])


def rows_of(case, stack):
    """Measured rows of all channels (m,): voltage [V], then branch currents [A]."""
    if not case.sensors:
        return stack.voltage_volt
    return np.concatenate([stack.voltage_volt, stack.branch_current_ampere.T.ravel()])


def predicted(case, stack, soc, values, effects):
    """Rows of `rows_of` by the model (m,) [V, A]."""
    run = group_run(group_fields(case.cells, soc, values, effects), stack)
    if not case.sensors:
        return run.voltage
    return np.concatenate([run.voltage, run.current.T.ravel()])


def ohms(case):
    """Ohmic resistance of each cell before the search (b,) [ohm]."""
    return np.array([cell.r_ohm[0] for cell in case.cells])


def error_volt(case, residual):
    """Size of a residual as a voltage, root mean square [V].

    Of the branch currents times their cells' ohmic resistance; of the voltage, where no branch
    currents were logged.
    """
    if not case.sensors:
        return rms(residual)
    currents = residual.reshape(1 + len(case.cells), -1)[1:]
    return rms(currents * ohms(case)[:, None])


def noises_of(case, residual, earlier=None):
    """Most likely noise of each channel, from the residual of a model with all candidates.

    Parameters
    ----------
    case : GroupCase. residual : (m,) [V, A]. earlier : noises with fewer effects, beyond which
        it does not grow, or None.
    """
    channels = np.split(residual, 1 + len(case.cells) if case.sensors else 1)
    shared = case.gates.shared_slow_volt
    most = [shared, *(case.gates.most_slow_volt / ohms(case))]
    if earlier is not None:
        most = [channel.slow_volt for channel in earlier]
    pairs = zip(channels, most, strict=False)
    voltage, *currents = [_noise_of(rows, case.fit, slow) for rows, slow in pairs]
    if case.sensors:
        voltage = noise.Noise(voltage.white_volt, shared, SLOW_SECOND[-1])
    return (voltage, *currents)


def _noise_of(residual, stack, most_slow):
    """Noise of a channel: white from differences of rows, the slow part from the rest."""
    step = np.diff(residual)[stack.fresh[1:] == 0]
    white = max(1.4826 * float(np.median(np.abs(step))) / np.sqrt(2), noise.SMALLEST_VOLT)
    slow = min(np.sqrt(max(np.mean(residual**2) - white**2, 0.0)), most_slow)
    tried = [noise.Noise(white, slow, second) for second in SLOW_SECOND]
    return min(tried, key=lambda spread: _minus_log_likelihood(spread, residual, stack))


def _minus_log_likelihood(spread, residual, stack):
    whitening = noise.whitening(spread, stack)
    return whitening.log_variance + float(np.sum(whitening.apply(residual) ** 2))


def _started(case, values, effects):
    """Values with the shift of the group's SoC at the start of each validation record [1]."""
    stack, soc = case.validation, case.validation_soc
    rating = sum(cell.capacity_ampere_hour for cell in case.cells)
    loaded = np.abs(stack.current_ampere) > LOADED_C_RATE * rating
    values = values | {f"soc0[{k}]": 0.0 for k in range(len(stack.first))}
    for _ in range(PASSES):
        run = group_run(group_fields(case.cells, soc, values, effects), stack)
        error = stack.voltage_volt - run.voltage
        shifts = {}
        for k in range(len(stack.first)):
            rows = np.flatnonzero(stack.file == k)
            rest = rows[: int(np.argmax(loaded[rows])) if loaded[rows].any() else len(rows)]
            shifts[f"soc0[{k}]"] = _shift(case, soc[k], values[f"soc0[{k}]"], error[rest])
        values = values | shifts
    return values


def _shift(case, stated, shift, error):
    """Shift of the SoC by the error of a first rest [V], weighted against none [1]."""
    near = np.mean(stated) + shift + np.array([-SOC_APART, SOC_APART])
    ocv = np.mean([cell.ocv_volt for cell in case.cells], axis=0)
    slope = np.diff(np.interp(near, np.linspace(0, 1, len(ocv)), ocv))[0] / (2 * SOC_APART)
    if not len(error) or abs(slope) < READ_VOLT:
        return shift
    by_sheet = case.shared.soc**-2.0
    by_rest = slope**2 / (READ_VOLT**2 / len(error) + case.spread.type_ocv_volt**2)
    return float((shift + error.mean() / slope) * by_rest / (by_sheet + by_rest))
