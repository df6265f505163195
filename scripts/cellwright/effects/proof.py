"""Whether an effect is proven, what may be left, and what of it could still be learned.

An effect counts by how evenly it helps over the records that judge, block by block, not by one
pooled error: the misfit of a real cell lasts for hours, so that a pooled test finds anything that
follows it, and one record with a large error decides for all the others.
"""

from typing import NamedTuple

import numpy as np

from cellwright.effects import base
from cellwright.effects.judge import BANDS, LEAST_ROWS
from cellwright.numerics.least_squares import inverse

HALF = 0.5  # of what an effect promises: below it, it makes the error larger
TWICE = 2.0  # of what an effect promises: records that ask for more lack something beside it
SURE = 2.0  # standard errors: 95 %
ALIKE = 4.0  # parts that lie side by side err alike: so many count as one
LITTLE = 0.2  # of what an effect takes off the errors, so much it may add to others
ENOUGH = 2.0  # least fall of chi-square that a change must promise over that which is asked of it
BATCHES = (10, 30, 100, 300)  # rows over which whitened residuals are summed


class Consistency(NamedTuple):
    """How an effect explains what was missing, block by block of the records that judge.

    gain : mean over the blocks of <residual before, change>/<change, change>: 1 where the effect
    explains all that it changes, 0 where it explains nothing, below 1/2 where it makes things
    worse. Blocks count by their rms change, so that one record with a large error does not decide.
    std : its standard error by the scatter between the blocks. changed_volt : rms change over all
    rows that count [V]. excited, helped, hurt : numbers of blocks that the effect changes by more
    than is material; of those among them, and of all blocks, whose error falls or rises by as much.
    harm : of the excited blocks together, what rms errors rise by over what they fall by, both
    times the blocks' rows. worse_volt : largest rise of the rms error of one record [V].
    """

    gain: float
    std: float
    changed_volt: float
    excited: int
    helped: int
    hurt: int
    harm: float
    worse_volt: float

    @property
    def holds(self):
        """Whether it helps most blocks that it changes, beyond chance, in its size, and harms few.

        Where records that were not fitted ask for twice the size and more, what they lack is
        something else that goes along with it.
        """
        return all(helps(self) for _, helps in ASKED)

    @property
    def beyond_chance(self):
        """Whether it gains more than its parts scatter, or helps more of them than chance would.

        Parts that have a large error of another kind, too, scatter by that, however well all others
        agree on the size.
        """
        by_chance = HALF * self.excited + SURE * np.sqrt(ALIKE * self.excited) / 2
        return bool(self.gain > SURE * self.std or self.helped > by_chance)

    @property
    def sized(self):
        """Whether what was missing is of its size, however unevenly."""
        return HALF < self.gain < TWICE

    @property
    def against(self):
        """What speaks against the effect, in words: tuple of str, empty where it `holds`."""
        return tuple(words for words, helps in ASKED if not helps(self))


ASKED = (
    ("makes the error of its parts larger", lambda proof: proof.gain > HALF),
    ("helps no more than its parts scatter", lambda proof: proof.beyond_chance),
    ("its parts ask for twice its size", lambda proof: proof.gain < TWICE),
    ("helps half of its parts or fewer", lambda proof: proof.helped > HALF * proof.excited),
    ("harms some parts too much", lambda proof: proof.harm <= LITTLE),
)


class BlockSums(NamedTuple):
    """What a change of the residual does in each block, and to each record.

    rows : (b,) of a block. kept : (b,) bool, blocks that count. file : (b,) number of its record.
    block : (b,) its number. energy, shared : (b,) mean square of the change, mean product of it and
    the residual [V²]. was, now : (b,) rms error before and after it [V].
    """

    rows: np.ndarray
    kept: np.ndarray
    file: np.ndarray
    block: np.ndarray
    energy: np.ndarray
    shared: np.ndarray
    was: np.ndarray
    now: np.ndarray


def block_sums(before, after, block, record):
    """BlockSums of a change of the residual.

    Parameters
    ----------
    before, after : (n,) residual without and with the effect [V].
    block : (n,) number of the block of each row, -1 where a row does not count.
    record : (n,) number of the record of each row.
    """
    counts = block >= 0
    names, first, number = np.unique(block[counts], return_index=True, return_inverse=True)
    rows = np.bincount(number)
    change = before - after

    def mean(values):
        return np.bincount(number, values[counts]) / rows

    energy = mean(change**2)
    kept = (energy > 0) & (rows >= LEAST_ROWS)
    errors = (np.sqrt(mean(r**2)) for r in (before, after))
    about = rows, kept, record[counts][first], names
    return BlockSums(*about, energy, mean(before * change), *errors)


def consistency(before, after, block, record, *, material_volt):
    """Consistency of a change of the residual over blocks.

    Parameters
    ----------
    before, after, block, record : see `block_sums`. material_volt : a change below it is none [V].

    Returns
    -------
    consistency : Consistency.
    """
    return evenly(block_sums(before, after, block, record), material_volt=material_volt)


def evenly(sums, *, material_volt):
    """Consistency of a change over all its blocks, each of them once.

    Parameters
    ----------
    sums : BlockSums. material_volt : a change below it is none [V].
    """
    if not len(sums.rows):
        return Consistency(0.0, np.inf, 0.0, 0, 0, 0, np.inf, 0.0)
    whole = consistency_of(sums, np.ones((1, len(sums.rows))), material_volt=material_volt)[0]
    numbers = {name: round(getattr(whole, name)) for name in ("excited", "helped", "hurt")}
    return whole._replace(**numbers)


def consistency_of(sums, weights, *, material_volt):
    """Consistency of a change where each block is there as often as a weight says.

    Parameters
    ----------
    sums : BlockSums, of one block or more. weights : (d, b) [1]. material_volt : [V].

    Returns
    -------
    consistencies : list of d Consistency, its numbers of blocks being sums of weights.
    """
    kept, rows = sums.kept, sums.rows
    size = np.where(kept, rows * np.sqrt(sums.energy), 0.0)
    each = np.where(kept, sums.shared / np.maximum(sums.energy, 1e-300), 0.0)
    whole = np.maximum(weights @ size, 1e-300)
    gain = weights @ (size * each) / whole
    scatter = weights * (size * (each - gain[:, None])) ** 2
    std = np.sqrt(scatter.sum(axis=1)) / whole if kept.sum() > 1 else np.full(len(gain), np.inf)
    excited = kept & (sums.energy >= material_volt**2)
    rise = np.where(excited, rows * (sums.now - sums.was), 0.0)
    risen, fallen = (weights @ np.maximum(way * rise, 0.0) for way in (1.0, -1.0))
    harm = np.divide(risen, fallen, out=np.where(risen > 0, np.inf, 0.0), where=fallen > 0)
    numbers = (
        excited,
        excited & (sums.now < sums.was),
        kept & (sums.now > sums.was + material_volt),
    )
    changed = np.sqrt(weights @ (rows * sums.energy) / np.maximum(weights @ rows, 1e-300))
    measures = (gain, std, changed, *(weights @ n for n in numbers), harm, _worse(sums, weights))
    return [Consistency(*row) for row in np.stack(measures, axis=1).tolist()]


def _worse(sums, weights):
    """Largest rise of the rms error of one record (d,) [V]."""
    of_file = (sums.file[:, None] == np.unique(sums.file)).astype(float)
    rows = np.maximum((weights * sums.rows) @ of_file, 1e-300)
    now, was = (
        np.sqrt((weights * sums.rows * error**2) @ of_file / rows) for error in sums[-1:-3:-1]
    )
    return (now - was).max(axis=1)


def blocks_of(stack, soc, rows):
    """Number of the block of each row, a record's band of the SoC; -1 where a row does not count.

    Parameters
    ----------
    stack : records.Stack. soc : (n,) [1]. rows : (n,) bool, rows that count.
    """
    band = np.clip((soc * BANDS).astype(int), 0, BANDS - 1)
    return np.where(rows, stack.file * BANDS + band, -1)


def can_judge(gates, shown, fitted, promised):
    """Whether records that were not fitted can judge an effect.

    They must change by what matters. And where they see less than half of what the fitted records
    see of it, they must be able to pass it: of a change of which three quarters were missing, which
    holds well, chi-square falls by half of what it promises. Where that is below what is asked,
    even a true effect would fail, and what nuisances do that were refitted beside it would decide.
    What makes their error larger they can always refuse.

    Parameters
    ----------
    gates : of the case. shown, fitted : Consistency over these records, and over those fitted.
    promised : sum of `promised_of`.
    """
    passable = promised >= ENOUGH * gates.validation_chi_square
    seen = passable or shown.changed_volt >= HALF * fitted.changed_volt
    return bool(shown.excited > 0 and (seen or shown.gain <= HALF))


def promised_of(before, after, file, inflation):
    """Fall of chi-square of each row of the records that judge, if all of a change was missing.

    Parameters
    ----------
    before, after : candidates.State, their whitened errors of one or several channels of (m,) rows.
    file : (m,) number of the record of each row. inflation : (f,) of each record.
    """
    change = before.validation_white - after.validation_white
    return change**2 / np.tile(inflation[file], len(change) // len(file))


def changed(cell, stack, sides, state, values, rows):
    """BlockSums of a change of the residual of one side of a case.

    Parameters
    ----------
    cell : base.Cell. stack : records.Stack. sides : (n,) residual before and after [V].
    state : candidates.State after. values : dict, of this side. rows : (n,) bool, that count.
    """
    soc = base.fields_of(cell, stack, values, state.effects).soc
    return block_sums(*sides, blocks_of(stack, soc, rows), stack.file)


def misfit_of(stack, soc, residuals, *, noise_volt):
    """What the best of some models leaves of each block beyond the noise.

    Parameters
    ----------
    stack : records.Stack. soc : (n,) [1]. residuals : sequence of (n,), one a model [V].
    noise_volt : [V].

    Returns
    -------
    misfit : (n,) root mean square over the block of each row, without rows that are not used [V].
    """
    used = stack.used.astype(float)
    block = np.unique(blocks_of(stack, soc, used >= 0), return_inverse=True)[1]
    rows = np.maximum(np.bincount(block, used), 1.0)
    left = np.min([np.bincount(block, used * r**2) / rows for r in residuals], axis=0)
    return np.sqrt(np.maximum(left - noise_volt**2, 0.0))[block]


def inflation(white, file, files):
    """Ratio of the variance of sums over batches of whitened rows to that of independent rows.

    Parameters
    ----------
    white : (n,) whitened residual. file : (n,) number of the record of each row. files : how many.

    Returns
    -------
    inflation : (f,) of each record, 1 or more: by it a chi-square of its rows is too large.

    Source: J. Flegal, G. Jones, Ann. Statist. 38 (2010) 1034 (batch means).
    """
    most = np.ones(files)
    for number in range(files):
        rows = white[file == number]
        for length in (size for size in BATCHES if len(rows) >= 4 * size):
            batches = rows[: len(rows) // length * length].reshape(-1, length).sum(axis=1)
            most[number] = max(most[number], np.mean(batches**2) / length)
    return most


class Floor(NamedTuple):
    """Error that is left by readings and by the tolerances of what is known beforehand [V].

    fit_volt, validation_volt : root mean square over the rows that count, of the records fitted
    and of those that judge. by_test : of each record that judges, by its name.
    """

    fit_volt: float
    validation_volt: float
    by_test: dict


def floor_of(case, state, free, rows, read_volt):
    """Floor of a case: noise of the readings, and what stated tolerances leave on other records.

    The parameters of the plain model are known to within their posterior: priors (tolerances of
    the OCV, of the capacity, of the SoC at a start) narrowed by the records fitted. Through the
    sensitivities of the records that judge this is an error that no missing effect has made.

    Parameters
    ----------
    case : case.Case. state : candidates.State of the plain model. free : tuple of Free, of its fit.
    rows : (m,) bool, rows that count. read_volt : noise of a single reading [V].

    Returns
    -------
    floor : Floor.
    """
    stack, solution = case.validation, state.solution
    at = base.voltage(case.cell, stack, state.values, state.effects)
    shared = [f for f in free if not f.name.startswith("soc0[")]
    columns = np.stack([_derivative(case, state, at, f) for f in shared], axis=1)
    place = [solution.names.index(f.name) for f in shared]
    covariance = inverse(solution.precision)[np.ix_(place, place)]
    variance = np.einsum("ij,jk,ik->i", columns, covariance, columns)
    variance = np.maximum(variance, 0.0) + read_volt**2
    by_test = {
        test: float(np.sqrt(variance[rows & (stack.file == k)].mean()))
        for k, test in enumerate(stack.tests)
        if np.any(rows & (stack.file == k))
    }
    return Floor(read_volt, float(np.sqrt(variance[rows].mean())), by_test)


def _derivative(case, state, at, free):
    """Derivative of the voltage of the records that judge by one parameter (m,)."""
    moved = state.values | {free.name: state.values[free.name] + free.step}
    return (base.voltage(case.cell, case.validation, moved, state.effects) - at) / free.step


def excess_volt(error_volt, floor_volt):
    """What is left of an rms error beyond its floor [V]."""
    return float(np.sqrt(max(error_volt**2 - floor_volt**2, 0.0)))


def explained(gates, before, floor):
    """Whether no error is left that would be material beyond the floor.

    Parameters
    ----------
    gates : of the case. before : candidates.State. floor : Floor.
    """
    return left_volt(before, floor) <= gates.material_volt


def left_volt(state, floor):
    """Error beyond the floor, of the side, fit or proof, where it is larger [V].

    Parameters
    ----------
    state : candidates.State. floor : Floor.
    """
    fit = excess_volt(state.rmse_volt, floor.fit_volt)
    return max(fit, excess_volt(state.validation_rmse_volt, floor.validation_volt))


def significant(gates, trial):
    """Whether a trial is no chance, in the fit and evenly over the records that judge.

    Parameters
    ----------
    gates : of the case. trial : candidates.Trial with its proof.
    """
    return followed(gates, trial) and judged_well(gates, trial) and trial.proof.holds


def prominent(before, trial, floor):
    """Whether an effect takes off at least half as much as is left beside it, beyond the floor.

    Of a fifth of the squared error or less nobody can say what it is the effect of: whatever the
    model lacks besides is several times as large.

    Parameters
    ----------
    before : candidates.State without it. trial : candidates.Trial with its proof. floor : Floor.
    """
    shown = ("validation_rmse_volt", floor.validation_volt), ("rmse_volt", floor.fit_volt)
    name, lowest = shown[0] if trial.proven else shown[1]
    was, now = getattr(before, name), getattr(trial.state, name)
    return now < was and excess_volt(was, now) >= HALF * excess_volt(now, lowest)


def followed(gates, trial):
    """Whether the records fitted are followed better, beyond what its parameters would anyway."""
    return trial.delta_bic > gates.bic


def judged_well(gates, trial):
    """Whether the records that judge are followed better, where they show the effect at all."""
    return trial.delta_validation > gates.validation_chi_square or not trial.proven
