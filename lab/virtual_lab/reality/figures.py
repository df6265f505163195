"""Four figures of records: simulated ones in thick warm colours, real ones in thin cool ones."""

from collections import defaultdict

import numpy as np

from figures import style

REAL = ("#0b6fb8", "#2a9d5c", "#8e4ec6", "#00868b", "#5d6d7e", "#3d5a80", "#7a9e3f", "#1d2733")
SIMULATED = ("#e07b00", "#c0392b", "#b8860b")
TRACE_STEP_MILLIVOLT = 2.5
GRID_POINTS = 60
MOST_CURVES = 8
FAR = 1.5
RELAXATIONS = (
    "after a discharge pulse, to 40 s",
    "after a discharge step, to 600 s",
    "after a discharge to the end, to 3500 s",
    "after a charge and hold, to 3500 s",
)


def colours(sources) -> dict:
    """Colour of each source, by its name; `sources` in the order of the legend."""
    real, simulated = iter(REAL * 4), iter(SIMULATED * 4)
    return {source.name: next(real if source.real else simulated) for source in sources}


def noise(curves, sources):
    """Sixty neighbouring samples of each source above one another, and noise spectra below."""
    drawing, axes = style.subplots(2, 2, width=11.0, height=8.0)
    for column, condition in enumerate(("at rest", "under constant current")):
        _traces(axes[0, column], curves, sources, f"trace {condition}")
        axes[0, column].set_title(f"Voltage {condition}, its drift taken out")
        chosen = [c for c in curves if c.panel == f"spectrum {condition}"]
        _bands(axes[1, column], chosen, sources, logarithmic=True)
        axes[1, column].set(xscale="log", yscale="log", xlabel="frequency [Hz]")
        axes[1, column].set_ylabel("density [mV/√Hz]")
        axes[1, column].set_title(f"Spectrum of the voltage {condition}")
    axes[1, 0].set_ylim(top=20 * axes[1, 0].get_ylim()[1])
    style.legend_once(axes[1, 0], ncols=2, loc="upper right")
    return drawing


def _traces(axes, curves, sources, panel):
    """The trace of median scatter of each source, one source above the other."""
    colour, names = colours(sources), []
    for source in sources:
        chosen = [c for c in curves if c.panel == panel and c.source == source.name]
        if chosen:
            typical = sorted(chosen, key=lambda c: c.y.std())[len(chosen) // 2]
            level = TRACE_STEP_MILLIVOLT * len(names)
            axes.plot(typical.x, typical.y + level, color=colour[source.name], marker=".", lw=0.8)
            names.append(source.name)
    axes.set_yticks(TRACE_STEP_MILLIVOLT * np.arange(len(names)), names)
    axes.set(xlabel="sample", ylabel=f"lines are {TRACE_STEP_MILLIVOLT:g} mV apart")


def relaxation(curves, sources):
    """Share of the voltage change that is still to come, against time."""
    drawing, axes = style.subplots(2, 2, width=11.0, height=8.0)
    for axis, panel in zip(axes.flat, RELAXATIONS, strict=True):
        _bands(axis, [c for c in curves if c.panel == panel], sources)
        axis.set(xscale="log", xlim=(0.05, None), ylim=(-0.05, 1.0))
        axis.set_xlabel("time since the load ended [s]")
        axis.set_title(panel[0].upper() + panel[1:])
        style.legend_once(axis)
    for axis in axes[:, 0]:
        axis.set_ylabel("share of the way still to go")
    return drawing


def pulse(curves, sources):
    """Resistance against time over that after 10 s."""
    drawing, axes = style.subplots(1, 2, width=11.0, height=4.4, sharey=True)
    for axis, way in zip(axes[0], ("discharge", "charge"), strict=True):
        _bands(axis, [c for c in curves if c.panel == way], sources)
        axis.set(xscale="log", xlim=(0.01, 10.5), ylim=(0.0, 1.1))
        axis.set_xlabel("time since the current began [s]")
        axis.set_title(f"A {way} out of a rest")
        style.legend_once(axis)
    axes[0, 0].set_ylabel("(V(t) − V(0)) / I, over that after 10 s")
    return drawing


def peaks(curves, sources):
    """dQ/dV over capacity, a panel for each source: its slowest charges, and dotted its fastest."""
    colour = colours(sources)
    by_source = {s.name: [c for c in curves if c.source == s.name] for s in sources}
    shown = [source for source in sources if by_source[source.name]]
    rows = max(-(-len(shown) // 2), 1)
    drawing, axes = style.subplots(rows, 2, width=11.0, height=2.6 * rows)
    for axis, source in zip(axes.flat, shown, strict=False):
        _rates(axis, by_source[source.name], colour[source.name])
        axis.set_title(source.name)
        axis.set(xlabel="voltage [V]", ylabel="dQ/dV over capacity [1/V]", ylim=(0, None))
    for axis in axes.flat[len(shown) :]:
        axis.set_axis_off()
    return drawing


def _rates(axes, curves, colour):
    """At most eight curves of the slowest and of the fastest rate, spread over those there are."""
    panels = sorted({curve.panel for curve in curves}, key=lambda panel: -int(panel.split("C/")[1]))
    ends = dict(zip(dict.fromkeys([panels[0], panels[-1]]), ("-", ":"), strict=False))
    for panel, line_style in ends.items():
        chosen = [curve for curve in curves if curve.panel == panel]
        for row in np.unique(np.linspace(0, len(chosen) - 1, MOST_CURVES).astype(int)):
            line = {"color": colour, "ls": line_style, "lw": 1.0, "alpha": 0.8, "label": panel}
            axes.plot(chosen[row].x, chosen[row].y, **line)
    style.legend_once(axes)


def _bands(axes, curves, sources, *, logarithmic=False):
    """Median of each source's curves on a common grid, and the band of eight in ten of them."""
    colour, by_source = colours(sources), defaultdict(list)
    for curve in curves:
        by_source[curve.source].append(curve)
    for source in (s for s in sources if s.name in by_source):
        at, values = _on_one_grid(by_source[source.name])
        low, middle, high = np.nanquantile(values, (0.1, 0.5, 0.9), axis=0)
        label = f"{source.name} ({len(by_source[source.name])})"
        width = 1.2 if source.real else 2.4
        axes.plot(at, middle, color=colour[source.name], lw=width, label=label)
        if len(values) > 2 and not logarithmic:
            axes.fill_between(at, low, high, color=colour[source.name], alpha=0.12, lw=0)


def _on_one_grid(curves):
    """Times or frequencies (m,), even in their logarithm, and values (curves, m), NaN outside.

    Values far from any sample are left out, and places that fewer than half of the curves reach.
    """
    begin, end = min(c.x[0] for c in curves), max(c.x[-1] for c in curves)
    at = np.geomspace(begin, end, GRID_POINTS)
    values = np.array([_interpolated(at, curve) for curve in curves])
    reached = np.mean(np.isfinite(values), axis=0) >= 0.5
    return at[reached], values[:, reached]


def _interpolated(at, curve):
    """Values of a curve at places (m,); NaN outside of it and far from its samples."""
    after = np.clip(np.searchsorted(curve.x, at), 1, curve.x.size - 1)
    ratio = np.minimum(at / curve.x[after - 1], curve.x[after] / at)
    values = np.interp(at, curve.x, curve.y, left=np.nan, right=np.nan)
    return np.where(ratio <= FAR, values, np.nan)
