"""The one score by which models of a cell are compared: how well each predicts what it did not see.

Real misfit lasts for hours, so that a pooled test of thousands of rows finds anything that follows
it. So the unit is a block, a record's tenth of the SoC. Each is predicted by the model fitted
without it, under an error with heavy tails, so that no block decides for all others:

    q = mean(e²),  lpd = −(ν + 1)/2 · ln(1 + q/ν),  D = Σ (lpd − lpd of another model),  z = D/SE

with e the whitened error of the block's rows. Of two models the better is the one with the larger
sum; what differs from block to block says how sure that is (`numerics.compare`, with its sources).

Source: Student's t for errors of unknown size: K. Lange, R. Little, J. Taylor, J. Am. Stat. Assoc.
84 (1989) 881.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

NU = 4.0  # degrees of freedom of the error: the usual ones of a robust fit (Lange et al.)
BANDS = 10  # of the SoC
LEAST_ROWS = 5


class Blocks(NamedTuple):
    """Blocks of training and validation records.

    fitted, judging : (n,), (m,) number of the block of each row, -1: in none; of several channels
    one after the other a block holds all. record : (b,) of each block, those of one record
    side by side and in order of the SoC. band : (b,) number of the tenth. judges : (b,) bool.
    """

    fitted: np.ndarray
    judging: np.ndarray
    record: np.ndarray
    band: np.ndarray
    judges: np.ndarray

    def on(self, side):
        """Number of the block of each row of a side, "fit" or "validation"."""
        return self.fitted if side == "fit" else self.judging


def blocks_of(fitted, judging, *, channels=1):
    """Blocks: tenths of the SoC of each record that have five rows or more.

    Parameters
    ----------
    fitted, judging : (file (n,), soc (n,) [1], rows (n,) bool that count) of either side, of one
    channel. channels : of each record.
    """
    numbers, places, count = [], [], 0
    for file, soc, rows in (fitted, judging):
        place = file * BANDS + np.clip((soc * BANDS).astype(int), 0, BANDS - 1)
        found, many = np.unique(place[rows], return_counts=True)
        found = found[many >= LEAST_ROWS]
        number = np.full(len(place), -1)
        at = np.minimum(np.searchsorted(found, place), max(len(found) - 1, 0))
        inside = rows & (found[at] == place) if len(found) else np.zeros(len(rows), bool)
        number[inside] = at[inside] + count
        numbers.append(number)
        places.append(found)
        count += len(found)
    # Records of the two sides have numbers of their own.
    behind = BANDS * (places[0].max(initial=-1) // BANDS + 1)
    place = np.concatenate([places[0], places[1] + behind])
    record, band, judges = place // BANDS, place % BANDS, np.arange(count) >= len(places[0])
    return Blocks(*(np.tile(one, channels) for one in numbers), record, band, judges)


class LeftOut(NamedTuple):
    """Fits without each block, in closed form.

    change : (b, k) by how much a parameter is smaller without the block. grams : (b, k, k) products
    of the block's derivatives. moments : (b, k) of these with its residual. sums : (b,) of the
    residual's squares. rows : (b,) of the block.
    """

    change: np.ndarray
    grams: np.ndarray
    moments: np.ndarray
    sums: np.ndarray
    rows: np.ndarray

    @property
    def squares(self):
        """Mean square error of each block as predicted by the fit without it (b,), NaN of none."""
        grown = 2 * np.sum(self.change * self.moments, axis=1)
        grown += np.sum((self.change[:, None, :] @ self.grams)[:, 0] * self.change, axis=1)
        whole = np.maximum(self.sums + grown, 0.0)
        return np.divide(whole, self.rows, out=np.full(len(whole), np.nan), where=self.rows > 0)


def left_out(white, whitened, precision, slope, block, blocks, *, vague=None):
    """Fits without each block, in closed form: LeftOut.

    The error of a block's rows is w + X (P − X'X)⁻¹ (X'w − s) with its whitened residual w,
    derivatives X, and the precision P and slope s of the fit: no fit is repeated. The slope, next
    to nothing to the whole fit, is much to a parameter of which the other blocks tell little.

    Parameters
    ----------
    white : (n, k) whitened derivatives. whitened : (n,) residual. precision : (k, k) of the
    posterior. slope : (k,) of the cost where the fit ended, see `least_squares.Solution`. block :
    (n,) number of each row's block, -1: in none. blocks : how many there are.
    vague : (precision (k,), distance (k,)) of parameters without a prior from where they are
    absent: what no other block tells of is predicted to be absent.

    Source: R. Cook, S. Weisberg, Residuals and Influence in Regression (1982), 3.6 (deletion of
    groups of rows).
    """
    known, away = (np.zeros(len(precision)),) * 2 if vague is None else vague
    size = np.sqrt(np.maximum(np.diag(precision) + known, 1e-300))
    order = np.argsort(block, kind="stable")
    order = order[block[order] >= 0]
    # A row a parameter, each in one piece of memory, as `Whitening.apply` lays them.
    columns = np.take(white.T, order, axis=1)
    rest, edges = whitened[order], np.searchsorted(block[order], np.arange(blocks + 1))
    units = np.outer(size, size)
    whole, pull = precision / units + np.diag(known / size**2), (known * away - slope) / size
    grams, moments = np.zeros((blocks, *precision.shape)), np.zeros((blocks, len(size)))
    sums, rows = np.zeros(blocks), np.diff(edges)
    for number, (begin, end) in enumerate(pairwise(edges.tolist())):
        if begin < end:
            mine, w = columns[:, begin:end], rest[begin:end]
            grams[number], moments[number], sums[number] = mine @ mine.T, mine @ w, w @ w
    # Rounding alone, for a parameter that one block tells all of.
    whole = whole + 1e-9 * np.eye(len(size))
    change, filled = np.empty_like(moments), rows > 0
    right = (moments[filled] / size + pull)[:, :, None]
    change[filled] = np.linalg.solve(whole - grams[filled] / units, right)[:, :, 0]
    change[~filled] = np.linalg.solve(whole, pull)
    return LeftOut(change / size, grams, moments, sums, rows.astype(float))


def mean_squares(whitened, block, blocks):
    """Mean square of whitened errors (n,) over each block (b,), NaN where it has no rows."""
    inside = block >= 0
    rows = np.bincount(block[inside], minlength=blocks)
    sums = np.bincount(block[inside], whitened[inside] ** 2, blocks)
    return np.divide(sums, rows, out=np.full(blocks, np.nan), where=rows > 0)


def densities(squares):
    """Log predictive density of each block (b,), from the mean square of its errors."""
    return -(NU + 1.0) / 2.0 * np.log1p(squares / NU)


def rms_of_blocks(residual, block, chosen):
    """Root mean square of a residual (n,) over blocks that are chosen (b,), each of them once."""
    squares = mean_squares(residual, block, len(chosen))
    kept = squares[chosen & np.isfinite(squares)]
    return float(np.sqrt(kept.mean())) if len(kept) else 0.0
