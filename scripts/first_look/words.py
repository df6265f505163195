"""A look at a file as lines of text, with a small plot of its voltage and current."""

import numpy as np

from first_look.one_file import Look, celsius

BARS = " ▁▂▃▄▅▆▇█"
WIDTH = 72


def lines_of(look: Look) -> list[str]:
    """What a file holds, one thing a line."""
    reading, columns = look.reading, look.reading.columns
    rows = len(next(iter(columns.values())))
    out = [
        f"{look.name}: {reading.kind} of {rows} rows, read as {reading.instrument}",
        "columns: " + ", ".join(sorted(columns)),
    ]
    out += _spectrum(columns) if reading.kind == "impedance" else _series(look)
    out += [f"note: {note}" for note in look.notes]
    out += [f"a campaign refuses it: {look.refused}"] if look.refused else []
    out += [f"could be of kind {kind}: {why}" for kind, why in look.kinds]
    return out


def _spectrum(columns):
    frequency, real = columns["frequency_hertz"], columns["impedance_real_ohm"]
    scale, unit = (1e3, "mΩ") if np.median(np.abs(real)) < 1 else (1.0, "Ω")
    return [
        f"frequency: {frequency.min():.4g} to {frequency.max():.4g} Hz, {len(frequency)} points",
        f"real part: {_range(real * scale)} {unit}",
        f"imaginary part: {_range(columns['impedance_imaginary_ohm'] * scale)} {unit}",
    ]


def _series(look):
    columns = look.series or look.reading.columns
    time = columns["test_time_second"]
    step = np.diff(time)
    warm = celsius(columns)
    said = {1: "positive on charge", -1: "negative on charge", 0: "not told by counters"}
    out = [
        f"time: {(np.nanmax(time) - np.nanmin(time)) / 3600:.4g} h, a row every "
        f"{np.median(step):.4g} s (median), longest {step.max():.4g} s",
        f"voltage: {_range(columns['voltage_volt'])} V",
        f"current: {_range(columns['current_ampere'])} A, in the file "
        f"{said[look.reading.sign]}" + (", here turned positive on charge" if look.series else ""),
    ]
    out += [f"temperature around the cell: {warm:.1f} °C"] if warm is not None else []
    if look.steps:
        kinds, counts = np.unique(look.steps["kind"], return_counts=True)
        out.append("steps: " + ", ".join(f"{n} {k}" for k, n in zip(kinds, counts, strict=True)))
        moved = look.steps["charge_ampere_hour"]
        out.append(f"charge: {moved[moved > 0].sum():.4g} Ah in, {-moved[moved < 0].sum():.4g} out")
    out += [f"voltage  {_bars(time, columns['voltage_volt'])}"]
    return [*out, f"current  {_bars(time, columns['current_ampere'])}"]


def _range(values):
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}"


def _bars(time, values):
    """Medians over equal stretches of time as bars between the lowest and the highest value."""
    good = np.isfinite(time) & np.isfinite(values)
    time, values = time[good], values[good]
    place = np.minimum(WIDTH * (time - time.min()) / max(np.ptp(time), 1e-9), WIDTH - 1).astype(int)
    low, high = values.min(), values.max()
    scale = (len(BARS) - 1) / max(high - low, 1e-12)
    shown = ""
    for k in range(WIDTH):
        here = values[place == k]
        shown += BARS[round((np.median(here) - low) * scale)] if len(here) else " "
    return shown
