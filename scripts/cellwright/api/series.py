"""From an instrument's files to one clean series and its steps."""

from collections.abc import Mapping

from cellwright import gate
from cellwright.records import inputs
from cellwright.refusal import Refusal
from cellwright.result import Result
from cellwright.settings import Clean, Files, Segment

FILES = Files()


def read(
    source,
    *,
    kind="series",
    name=None,
    instrument=None,
    current_sign=None,
    columns=None,
    members=None,
    cells=None,
    largest_megabyte=FILES.largest_megabyte,
):
    """A record from the files of an instrument.

    source : a path, bytes, (name, bytes), a DataFrame or mapping of columns with the labels of a
        csv, or a list of these: the files of one test in time order.
    kind : what the files must hold, "series" or "impedance"; of a file that holds both, the one.
    name : of the file in messages, where `source` is bytes.
    instrument : name of its reader; None: recognised from the content.
    current_sign : "charge_positive" or "discharge_positive"; None: determined from the data.
    columns : what labels hold that nobody can know, as ["Zeit=time h", "T_Zelle=surface degC"].
    members, cells : of a group, how many its wiring has; its numbered channels are held against it.
    largest_megabyte : length of a file, and to which it may unpack [MB].

    Returns of a series test_time_second [s], current_ampere [A], positive on charge, voltage_volt
    [V], file_index [1] and other columns; of a spectrum frequency_hertz [Hz], impedance_real_ohm,
    impedance_imaginary_ohm [ohm], and doubt, what its file says against it. Raises Refusal: no such
    file, a pipe or device, no reader for it, a broken or too long file, a sign that cannot be
    known, or channels of more branches or cells than a group has.

    >>> import cellwright as cw
    >>> own = {"Time [s]": [0, 1, 2], "Current [mA]": [0, 100, 0], "Voltage [V]": [3.7, 3.71, 3.7]}
    >>> cw.read(own, current_sign="charge_positive").columns["current_ampere"]
    array([0. , 0.1, 0. ])
    """
    from cellwright import formats
    from cellwright.records.channels import refuse_beyond
    from cellwright.series.joining import assemble

    # Files are joined in the order given: their clocks often begin anew, so they cannot be sorted.
    parts = source if isinstance(source, list) else [source]
    files = [_named_bytes(part, name, largest_megabyte) for part in parts]
    how = {"instrument": instrument, "kind": kind, "largest_megabyte": largest_megabyte}
    readings = formats.read_together(files, **how, columns=columns or ())
    about = {"kind": kind, "instrument": [reading.instrument for reading in readings]}
    if kind == "series":
        joined = assemble(readings, stated_sign=current_sign)
        if members:
            refuse_beyond(joined.columns, members=members, cells=cells or members)
        return Result({"columns": joined.columns}, about, tuple(joined.notes))
    # Spectra are not joined: at two states of the cell they are two measurements.
    if len(readings) != 1 or readings[0].kind != kind:
        found = ", ".join(reading.kind for reading in readings)
        raise Refusal(f"the files hold {found or 'nothing'}, wanted one of {kind}")
    about["doubt"] = readings[0].doubt
    return Result({"columns": readings[0].columns}, about, tuple(readings[0].notes))


def read_simulated(source, *, name=None, largest_megabyte=FILES.largest_megabyte):
    """A voltage that was simulated for a test, for `missing_effect(..., simulated=...)`.

    source : a path, bytes or (name, bytes): CSV or Parquet with `Test Time / s` and `Simulated
        Voltage / V`; the file of the test itself may hold both. A file without current may say
        `Voltage / V`.
    name : of the file in messages, where `source` is bytes.
    largest_megabyte : length of a file, and to which it may unpack [MB].

    Returns time (n,) [s], voltage (n,) [V] and name of the file. Raises Refusal: no such file, a
    broken file, or one of the two columns is not there. Source: docs/missing-effect.md.
    """
    from cellwright import formats

    called, data = _named_bytes(source, name, largest_megabyte)
    columns = formats.read_simulated(data, name=called, largest_megabyte=largest_megabyte)
    return columns["test_time_second"], columns["voltage_volt"], called


def _named_bytes(part, name, largest_megabyte):
    """(name for messages, content) of a path, of bytes, or of (name, content).

    A large file stays open and is read in blocks.
    """
    if isinstance(part, bytes):
        return name or "the file", part
    if isinstance(part, tuple):
        return part
    if isinstance(part, Mapping) or hasattr(part, "to_csv") or hasattr(part, "to_pandas"):
        from cellwright.series.joining import csv_of

        return name or "the table", csv_of(part)
    return str(part), gate.content_at(part, largest_megabyte=largest_megabyte)


def clean(series, settings=None, *, cell=None, test=None, **changes):
    """A series without corrupt samples and with its charge [Ah], and the list of flagged samples.

    series : without charge_ampere_hour; further columns are kept; a table with labels of its own is
        read as by `read`. settings : `settings.Clean`.
    cell : its rating and cut-offs are held against what the record shows; None: they are not.
    test : its ambient_temperature_celsius is held against the record's own thermometer.

    Returns columns, with charge_ampere_hour [Ah] and, where rows contradict each other, doubt,
    flags of `series.doubts.Doubt`; actions: one a flag. Raises Refusal: fewer than
    two samples are left, or the charge is off the rating by the factor of a unit.
    Source: thesis ch. 5.2 and table 5.1; docs/cleaning.md.

    >>> import cellwright as cw
    >>> record = {"test_time_second": [0.0, 36.0, 72.0], "current_ampere": [1.0, 1.0, 1.0]}
    >>> found = cw.clean(record | {"voltage_volt": [3.70, 3.71, 3.72]})
    >>> found.columns["charge_ampere_hour"]
    array([0.  , 0.01, 0.02])
    """
    from cellwright.series.cleaning import clean as cleaned

    options = inputs.settings_of(Clean, settings, changes)
    known = {} if cell is None else inputs.ratings(cell)
    rated, limits = known.get("rated_capacity_ampere_hour"), (known.get(n) for n in inputs.CUTOFFS)
    notes = ()
    if inputs.labelled(series):
        from cellwright.series.joining import of_labels

        series, notes = of_labels(series)
    columns = inputs.columns(series, *inputs.NAMES)
    celsius = None if test is None else inputs.test_facts(test).ambient_temperature_celsius
    about = {"rated_capacity_ampere_hour": rated, "cutoffs_volt": tuple(limits)}
    about["ambient_temperature_celsius"] = celsius
    cleaning = cleaned(columns, **about, **options._asdict())
    tables = {"columns": cleaning.columns, "actions": cleaning.actions}
    return Result(tables, notes=(*notes, *cleaning.notes))


def segment(series, cell=None, settings=None, **changes):
    """Steps of a clean series: rest, constant current, held voltage, pulse, dynamic load.

    cell : C-rates refer to its rating; None: to the charge moved. settings : `settings.Segment`.

    Returns rows, `series.steps.Steps`, (k,): rows, times [s], mean current [A], voltages [V],
    charge [Ah] and rate [1/h] of each step. Raises Refusal: a record without two samples.
    Source: docs/cleaning.md.

    >>> import cellwright as cw, numpy as np
    >>> time = np.arange(0.0, 7300.0, 10.0)  # rest, 2 A for an hour, rest
    >>> current = np.where((time >= 600) & (time < 4200), -2.0, 0.0)
    >>> voltage = np.interp(time, [600, 4200], [4.2, 3.0])
    >>> record = {"test_time_second": time, "current_ampere": current, "voltage_volt": voltage}
    >>> cell = cw.CellFacts("A", 2.0, lower_cutoff_volt=3.0, upper_cutoff_volt=4.2)
    >>> cw.segment(cw.clean(record), cell).rows.kind.tolist()
    ['rest', 'CC', 'rest']
    """
    from cellwright.series.steps import segment as segmented

    columns = inputs.columns(series, *inputs.COUNTED)
    # Without a rating the charge that the record moves stands for the capacity.
    rated = inputs.cell_facts(cell).rated_capacity_ampere_hour if cell else None
    steps = segmented(
        *inputs.quantities(columns, inputs.COUNTED),
        file_index=columns.get("file_index"),
        rated_capacity_ampere_hour=rated,
        **inputs.settings_of(Segment, settings, changes)._asdict(),
    )
    return Result({"rows": steps})
