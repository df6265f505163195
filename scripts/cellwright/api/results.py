"""Results of the steps of the public interface: NamedTuples that have `to_frame()`."""

from typing import NamedTuple

from cellwright.effects.story.result import Finding


def frame(table):
    """A pandas DataFrame of columns, of rows, or of a NamedTuple of arrays.

    Facts of one value each are repeated in every row; what has neither rows nor columns is one row.
    """
    import numpy as np
    import pandas as pd

    if hasattr(table, "_asdict"):
        table = table._asdict()
    if not isinstance(table, dict):
        rows = [row._asdict() if hasattr(row, "_asdict") else row for row in table]
        return pd.DataFrame(rows)
    sizes = {len(v) for v in table.values() if isinstance(v, np.ndarray | list) and len(v)}
    if len(sizes) != 1:
        return pd.DataFrame([table])
    (size,) = sizes
    fits = {k: v for k, v in table.items() if not hasattr(v, "__len__") or isinstance(v, str)}
    fits |= {k: v for k, v in table.items() if hasattr(v, "__len__") and len(v) == size}
    return pd.DataFrame(fits, index=range(size))


class Raw(NamedTuple):
    """A record as its files hold it, current positive on charge.

    columns : (n,) by name. kind : "series" or "impedance". instrument : the reader of each file.
    """

    columns: dict
    kind: str
    instrument: list
    notes: tuple

    def to_frame(self):
        """One row a sample."""
        return frame(self.columns)


class CleanSeries(NamedTuple):
    """A clean series with charge_ampere_hour, and what was done to it, one entry a flagged row."""

    columns: dict
    actions: dict
    notes: tuple

    def to_frame(self):
        """One row a sample."""
        return frame(self.columns)


class Table(NamedTuple):
    """Rows of one analysis, a NamedTuple of (k,) columns or a list of rows, and notes."""

    rows: object
    notes: tuple = ()

    def to_frame(self):
        """One row each."""
        return frame(self.rows)


class Document(NamedTuple):
    """A document as it is written to a JSON file, its table, and notes."""

    content: dict
    notes: tuple = ()
    table: object = ()

    def to_frame(self):
        """The document's table: OCV curves of a basis, parameters of a model."""
        return frame(self.table or self.content)


class Ocv(NamedTuple):
    """Open-circuit voltage of one slow test.

    curve : `protocols.ocv.slow.OcvCurve`. functions : analytic functions fitted to it.
    """

    curve: object
    functions: list
    notes: tuple

    def to_frame(self):
        """One row a SoC."""
        return frame(self.curve)


class RestOcv(NamedTuple):
    """Open-circuit voltage from the rests of a pulse test: curve, rests, source of the capacity.

    From a long load it has no points.
    """

    curve: object
    points: dict
    capacity_source: str
    notes: tuple

    def to_frame(self):
        """One row a SoC."""
        return frame(self.curve)


class Cycles(NamedTuple):
    """Complete half cycles of an ageing record, notes, and those of them on what was left out."""

    rows: object
    notes: tuple
    left_out: tuple

    def to_frame(self):
        """One row a half cycle."""
        return frame(self.rows)


class Relaxation(NamedTuple):
    """Exponentials in rests: one row a rest, and voltage over time of one of them."""

    rows: object
    curve: object
    notes: tuple

    def to_frame(self):
        """One row a rest."""
        return frame(self.rows)


class Ica(NamedTuple):
    """Incremental capacity of a charge: the curve dQ/dV [Ah/V], the rate of the charge [1/h].

    slope : the fitted V(Q) behind it, where the method has one.
    """

    curve: object
    c_rate: float
    slope: object = None

    def to_frame(self):
        """One row a voltage."""
        return frame(self.curve)


class IcaLife(NamedTuple):
    """dQ/dV over an ageing record: rows, one a peak; curves: columns of all charges; notes."""

    rows: list
    curves: dict
    notes: tuple = ()

    def to_frame(self):
        """One row a peak."""
        return frame(self.rows)


class Impedance(NamedTuple):
    """A spectrum analysed.

    row : values of the circuit and the error of its fit. curve : (n,) measured and fitted.
    parameters, candidates, processes : rows. distribution : of relaxation times.
    """

    row: dict
    curve: dict
    parameters: list
    candidates: list
    distribution: dict
    processes: list
    notes: tuple

    def to_frame(self):
        """One row: the circuit and its values."""
        return frame([self.row])


class Laws(NamedTuple):
    """Laws over temperature: rows of the laws, and the points that they were fitted to."""

    rows: list
    points: object
    notes: tuple

    def to_frame(self):
        """One row a parameter of a law."""
        return frame(self.rows)


class OcvMap(NamedTuple):
    """Open-circuit voltage over SoC and temperature: laws, map, entropic coefficient, as rows."""

    rows: list
    map: object
    entropic: object
    surface: object
    functions: object
    notes: tuple

    def to_frame(self):
        """One row a parameter of a law."""
        return frame(self.rows)


class PeakMatches(NamedTuple):
    """Peaks of dQ/dV across temperatures: matches, the peaks themselves, the smoothed curves."""

    rows: list
    peaks: object
    curves: object
    notes: tuple

    def to_frame(self):
        """One row a match."""
        return frame(self.rows)


class PeakHealth(NamedTuple):
    """State of health from peaks of dQ/dV: rows of charges; what each peak tells; notes."""

    rows: list
    information: list
    notes: tuple

    def to_frame(self):
        """One row a charge."""
        return frame(self.rows)


class AgeingLaws(NamedTuple):
    """Temperature in the capacities of an ageing record."""

    summary: dict
    rows: list
    cycles: dict
    periodogram: dict
    notes: tuple

    def to_frame(self):
        """One row a cycle."""
        return frame(self.cycles)


class FadeOfLife(NamedTuple):
    """Fade of a life: every discharge with the law, the laws, and a summary with the knee."""

    columns: dict
    laws: list
    summary: dict
    notes: tuple

    def to_frame(self):
        """One row a discharge."""
        return frame(self.columns)


class CheckUps(NamedTuple):
    """Ratings of the check-ups of a cell, and growth of its resistance over SoC, as rows."""

    rows: list
    growth: list
    notes: tuple

    def to_frame(self):
        """One row a check-up."""
        return frame(self.rows)


class FleetResistance(NamedTuple):
    """Resistance against capacity over a fleet: the line, one row a cell, delay into pulses."""

    line: object
    rows: list
    delay: str

    def to_frame(self):
        """One row a cell."""
        return frame(self.rows)


class Simulation(NamedTuple):
    """A model simulated: test_time_second, current_ampere, soc, ocv_volt, voltage_volt, (n,) each.

    member : of the family that was run.
    """

    columns: dict
    member: str

    def to_frame(self):
        """One row a sample."""
        return frame(self.columns)


class Scored(NamedTuple):
    """Scores of a model or filter on a test, and the series that they are computed from."""

    rows: list
    series: dict
    notes: tuple

    def to_frame(self):
        """One row a member of the family, a filter and start, or a branch."""
        return frame(self.rows)


class ScoredGroup(NamedTuple):
    """Scores of a group, what its cells do to each other, that over SoC, and the series of both."""

    rows: list
    findings: list
    spread: list
    series: dict
    notes: tuple

    def to_frame(self):
        """One row a branch."""
        return frame(self.rows)


class FinishedModel(NamedTuple):
    """A model ready for use: its document, rows of its parameters, rows of the choice of member."""

    content: dict
    parameters: list
    choice: list
    notes: tuple

    def to_frame(self):
        """One row a parameter, SoC and temperature."""
        return frame(self.parameters)


class Exported(NamedTuple):
    """A model for other tools: PyBaMM's document, a look-up table, parameters over temperature."""

    pybamm: dict
    lookup: object
    temperature: object
    notes: tuple

    def to_frame(self):
        """The look-up table."""
        return frame(self.lookup)


class PackDocument(NamedTuple):
    """The model of a pack: its document, and its tables in long form, one row a value."""

    content: dict
    lookup: list
    notes: tuple

    def to_frame(self):
        """One row a value of a table."""
        return frame(self.lookup)


class Fmu(NamedTuple):
    """A functional mock-up unit of a cell or a pack.

    content : bytes of a .fmu file. token : instantiation token, the hash of what it is made of.
    platform : that its binary is built for as FMI 3 names it, None where it holds sources only.
    variables : `fmu.description.Variable` each.
    """

    content: bytes
    token: str
    platform: str | None
    variables: tuple
    notes: tuple

    def to_frame(self):
        """One row a variable."""
        return frame(self.variables)


class MissingEffect(Finding):
    """Result of a search for missing effects, of a cell or a group; fields as of `Finding`."""

    __slots__ = ()

    def to_frame(self):
        """One row for each effect tried."""
        return frame(self.ranking)


class Stability(NamedTuple):
    """Names of a search without each record in turn, as rows.

    rows : a name each. repeats : a search each.
    """

    rows: list
    repeats: list

    def to_frame(self):
        """One row for each name."""
        return frame(self.rows)


class PackSimulation(NamedTuple):
    """A pack simulated: (n,) columns of the pack and of each cell, names of the cells in the order
    of the columns and the members that they ran as; rows say how each phase ended."""

    columns: dict
    cells: tuple
    members: tuple
    rows: list

    def to_frame(self):
        """One row a sample."""
        return frame(self.columns)


class SeriesPack(NamedTuple):
    """A series pack: rows of the pack (one), its cells, its power over its discharge, its charge
    from the cells' capacities down to what it gives; series (n,) of its record."""

    pack: list
    cells: list
    power: list
    waterfall: list
    series: dict
    notes: tuple

    def to_frame(self):
        """One row a cell."""
        return frame(self.cells)


class Matching(NamedTuple):
    """Cells put together: rows of what is gained, and of which cell is where."""

    rows: list
    assembly: list

    def to_frame(self):
        """One row a quantity of an assembly."""
        return frame(self.rows)
