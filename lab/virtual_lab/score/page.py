"""The score as files for people: an HTML page with pictures, CSV tables, a Markdown table."""

import base64
import io
import math
from pathlib import Path

import jinja2
import matplotlib as mpl
import numpy as np
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from virtual_lab.score import files, verdicts
from virtual_lab.score.missing import COUNTED
from virtual_lab.score.summary import QUANTITIES, Score, score

SHOWN = {
    "V": (1e3, "mV"),
    "Ohm": (1e3, "mΩ"),
    "Ah": (1e3, "mAh"),
    "A": (1e3, "mA"),
    "1": (1, ""),
    "J/mol": (1e-3, "kJ/mol"),
}
SUFFIXES = ("_ampere_hour_per_volt", "_ampere_hour", "_watt_hour", "_ampere", "_volt", "_ohm")
STATISTICS = ("bias", "rms_error", "worst_error")
SMALL_SAMPLE = 10


def plain_name(quantity: str) -> str:
    """A quantity without its unit and underscores."""
    head, comma, rest = str(quantity).partition(",")
    suffix = next((one for one in SUFFIXES if head.endswith(one)), "")
    return f"{head.removesuffix(suffix)}{comma}{rest}".replace("_", " ")


def shown_unit(unit) -> tuple[float, str]:
    """Factor and unit in which errors of a unit are shown."""
    return SHOWN.get(unit, (1.0, unit if isinstance(unit, str) else ""))


def short_number(value) -> str:
    """Three significant digits; blank where not known."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        return value
    if abs(value) >= 1000:
        return f"{value:,.0f}".replace(",", " ")
    whole = float(value).is_integer()
    return f"{value:.0f}" if whole else f"{value:.3g}"


def with_unit(value, unit) -> str:
    """An error in a unit in which it is easy to read."""
    factor, name = shown_unit(unit)
    if not short_number(value):
        return ""
    return f"{short_number(float(value) * factor)} {name}".strip()


def percent(value) -> str:
    """A share in per cent; blank where not known."""
    return f"{short_number(round(100 * float(value), 4))} %" if short_number(value) else ""


def summary_line(row: dict) -> dict:
    """One row of the summary for people: every statistic as text with its unit."""
    counts = {
        f"n_{name}": short_number(row[f"n_{name}"]) for name in ("compared", "missing", "extra")
    }
    worst = [row[name] for name in ("worst_cell", "worst_test", "worst_at")]
    return {
        "table": row["table"],
        "quantity": plain_name(row["quantity"]),
        "state": row["state"],
        **counts,
        **{name: with_unit(row[name], row["unit"]) for name in STATISTICS},
        "relative_rms": percent(row["relative_rms"]),
        "share": _between(row, "share", "share") or _between(row, "coverage_95", "coverage"),
        "worst": " ".join(part for part in worst if isinstance(part, str) and part),
        "remark": remark(row),
    }


def _between(row, name, stem):
    low, high = (row[f"{stem}_{side}"] for side in ("low", "high"))
    if not short_number(low):
        return percent(row[name])
    return f"{percent(row[name])} ({100 * low:.0f}–{100 * high:.0f})"


def remark(row: dict) -> str:
    """Warnings for the reader: intervals that do not hold, and rows that are missing on purpose."""
    said = []
    if short_number(row["coverage_95"]) and row["n_interval"] >= SMALL_SAMPLE:
        said += ["intervals too narrow"] if row["coverage_high"] < 0.95 else []
        said += ["intervals too wide"] if row["coverage_low"] > 0.95 else []
    counts = {"spoiled": "spoiled on purpose", "untested": "without such a test"}
    said += [f"{int(row[f'n_{k}'])} {v}" for k, v in counts.items() if row[f"n_{k}"] > 0]
    return "; ".join(said)


MOST_CELLS = 40
MOST_VECTORS = 1500
WIDTH = 10.5
INSIDE, OUTSIDE, NO_INTERVAL = "#0b6fb8", "#c0392b", "#5d6d7e"
INK, QUIET = "#1d2733", "#67727e"
# Text as text, and the same names of marks in each drawing.
LOOK = {"svg.fonttype": "none", "svg.hashsalt": "score", "font.size": 9.0, "axes.titlesize": 9.0}


def table_picture(compared) -> str | None:
    """One row of two panels for each quantity of a table; None where nothing was compared."""
    kinds = [
        (name, part)
        for name, part in compared.groupby("quantity", sort=False)
        if (part["status"] == "compared").any()
    ]
    if not kinds:
        return None
    size = (WIDTH, 2.7 * len(kinds))
    canvas, axes = _subplots(size, len(kinds), 2, width_ratios=[2, 3])
    for (name, part), (against, cells) in zip(kinds, axes, strict=True):
        _draw_against_truth(against, name, part)
        _draw_errors(cells, part)
    return _svg_text(canvas)


def _draw_against_truth(axes, name, part):
    rows = part[part["status"] == "compared"]
    unit = rows["unit"].iloc[0]
    true, found = rows["true"].to_numpy(float), rows["found"].to_numpy(float)
    low, high = min(true.min(), found.min()), max(true.max(), found.max())
    room = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
    line = [low - room, high + room]
    axes.plot(line, line, color=QUIET, linewidth=0.8, zorder=1)
    look = {"s": 11, "linewidths": 0, "alpha": 0.7, "rasterized": len(rows) > MOST_VECTORS}
    axes.scatter(true, found, c=_colours(rows), **look)
    shown = f" [{unit}]" if unit not in ("", "1") else ""
    axes.set(xlabel=f"true{shown}", ylabel=f"found{shown}", title=plain_name(name))
    axes.set(xlim=line, ylim=line)
    axes.locator_params(nbins=5)


def _colours(rows):
    inside = rows["inside_95"]
    classes = [inside.isna(), inside.isin([True])]
    return np.select(classes, [NO_INTERVAL, INSIDE], default=OUTSIDE)


def _draw_errors(axes, part):
    """Errors of each cell; its missing rows are a cross below."""
    sizes = part.assign(size=part["error"].abs()).groupby("cell")["size"].max()
    names = sorted(sizes.sort_values(ascending=False, na_position="first").index[:MOST_CELLS])
    place = {name: number for number, name in enumerate(names)}
    factor, unit = shown_unit(part["unit"].iloc[0])
    rows = part[(part["status"] == "compared") & part["cell"].isin(names)]
    at = rows["cell"].map(place).to_numpy(float) + _spread(rows)
    axes.axhline(0, color=QUIET, linewidth=0.8)
    look = {"s": 11, "linewidths": 0, "alpha": 0.7, "rasterized": len(rows) > MOST_VECTORS}
    axes.scatter(at, factor * rows["error"], c=_colours(rows), **look)
    lost = part[(part["status"] == "missing") & part["cell"].isin(names)]["cell"].map(place)
    below = {"transform": axes.get_xaxis_transform(), "clip_on": False, "linewidth": 0}
    if len(lost):
        axes.plot(sorted(set(lost)), np.full(lost.nunique(), 0.03), "x", color=OUTSIDE, **below)
    worst = f", the {MOST_CELLS} worst cells" if len(sizes) > MOST_CELLS else ""
    axes.set(ylabel=f"found − true{f' [{unit}]' if unit else ''}", title=f"Error{worst}")
    turn = {"rotation": 90, "fontsize": 7} if len(names) > 12 else {}
    axes.set_xticks(range(len(names)), names, **turn)
    axes.set_xlim(-0.6, len(names) - 0.4)


def _spread(rows):
    """Horizontal offsets that put the points of one cell beside each other."""
    number = rows.groupby("cell").cumcount()
    of = rows.groupby("cell")["cell"].transform("size")
    return (0.6 * ((number + 0.5) / of - 0.5)).to_numpy(float)


def coverage_picture(summary) -> str | None:
    """Share of 95 % intervals that hold the truth, each share with its own interval."""
    rows = summary[summary["coverage_95"].notna()]
    if not len(rows):
        return None
    rows = rows.iloc[::-1]
    canvas, axes = _subplots((WIDTH, 0.7 + 0.26 * len(rows)))
    axes = axes[0, 0]
    share = 100 * rows["coverage_95"].to_numpy(float)
    low, high = (100 * rows[f"coverage_{side}"].to_numpy(float) for side in ("low", "high"))
    holds = (low <= 95) & (high >= 95)
    for good, colour in ((True, INSIDE), (False, OUTSIDE)):
        mine = np.flatnonzero(holds == good)
        reach = [np.maximum(share - low, 0)[mine], np.maximum(high - share, 0)[mine]]
        axes.errorbar(share[mine], mine, xerr=reach, fmt="o", color=colour, capsize=2)
    axes.axvline(95, color=INK, linewidth=0.8, linestyle="--")
    names = rows["table"] + ": " + rows["quantity"].map(plain_name)
    counts = rows["n_interval"].map("{:.0f}".format)
    axes.set_yticks(range(len(rows)), names + "  (" + counts + ")")
    axes.set(xlim=(-2, 102), xlabel="95 % intervals that hold the truth [%]")
    return _svg_text(canvas)


def _subplots(size_inch, rows=1, columns=1, **more):
    with mpl.rc_context(LOOK):
        canvas = Figure(figsize=size_inch, layout="constrained")
        FigureCanvasSVG(canvas)
        return canvas, canvas.subplots(rows, columns, squeeze=False, **more)


def _svg_text(canvas) -> str:
    text = io.StringIO()
    with mpl.rc_context(LOOK):
        canvas.savefig(text, format="svg", dpi=150, metadata={"Date": None, "Creator": None})
    return text.getvalue()


TEMPLATE = Path(__file__).with_name("score.html.j2")
SHOWN_ROWS = 12
MARKDOWN = {
    "table": "table",
    "quantity": "quantity",
    "n_compared": "compared",
    "n_missing": "missing",
    "n_extra": "extra",
    "bias": "bias",
    "rms_error": "RMS error",
    "relative_rms": "relative",
    "share": "in the 95 % interval, or found",
    "worst_error": "worst",
    "worst": "where",
    "remark": "remark",
}
TITLES = {
    "capacity": "Capacity",
    "resistance": "Pulse resistance",
    "ocv": "Open-circuit voltage",
    "eis": "Impedance",
    "temperature": "Over temperature",
    "temperature_prediction": "Temperatures left out",
    "capacity_loss": "Capacity lost to temperature",
    "ica_temperature": "Peaks over temperature",
    "fast_charge": "Fast charge",
    "ageing": "Ageing records",
    "ica": "Incremental capacity",
    "ica_tracks": "Peaks over the life",
    "health": "State of health",
    "checkups": "Ratings of check-ups",
    "resistance_growth": "Growth of resistance",
    "fade": "Fade of lives",
    "fade_laws": "Laws of the fade",
    "fleet_health": "Resistance over a fleet",
    "fleet_health_lines": "Lines over a fleet",
    "protocols": "Ageing protocols compared",
    "models": "Model parameters",
    "models_of_checkups": "Models of later check-ups",
    "choice": "Choice of the model",
    "identification_methods": "Identification methods",
    "soc": "State of charge",
    "validation": "Validation of models",
    "packs": "Parallel groups",
    "series_packs": "Series packs",
    "series_pack_cells": "Cells of series packs",
    "pack_findings": "What a group does to its cells",
    "pack_spread": "How currents part over SoC",
    "pack_checks": "Records of packs checked",
    "nested_packs": "Packs of groups",
    "pack_decisions": "Decisions on packs",
    "thermal": "Thermal constants",
    "bias": "Four ways to a model",
    "missing_effect": "Missing effects",
    "excluded": "Spoiled files",
    "faults": "Spoiled samples",
}
ABOUT = {
    "capacity": "Charge and energy of full charges and discharges.",
    "resistance": "Pulse by pulse: the nearest in time, at the same delay. At 0 s the truth is "
    "10 ms after the edge; a first sample that came later than 20 ms is scored by itself.",
    "ocv": "The curve beside the cell's rested voltage, point by point; the ends by themselves.",
    "eis": "Parameters of the fitted circuit, where the physics has such a parameter.",
    "temperature": "Coefficients of the laws over temperature.",
    "temperature_prediction": "Errors are measured against the record, not against a truth.",
    "capacity_loss": "True and false capacity loss at each temperature and rate.",
    "ica_temperature": "What became of each peak at another temperature.",
    "fast_charge": "Charge put in within the time asked for.",
    "ageing": "Slope over temperature, daily cycle and fade of ageing records.",
    "ica": "Peaks of the incremental capacity, each beside the nearest within 50 mV.",
    "ica_tracks": "Peaks of the incremental capacity followed from charge to charge.",
    "health": "State of health, method by method, at the same cycle (within 2).",
    "checkups": "Capacity, power, resistance, efficiency of a check-up; its SoH is scored above.",
    "resistance_growth": "Resistance of a check-up over the first one's; pulses are scored above.",
    "fade": "Law, knee and remaining cycles of a life; knee and SoH are scored with the health.",
    "fade_laws": "Evidence of each law.",
    "fleet_health": "Resistance against capacity, cell by cell.",
    "fleet_health_lines": "The line through a fleet, and its error on cells left out.",
    "protocols": "Which protocol wears cells out faster.",
    "models": "The chosen circuit's resistance 10 ms (r0), 10 s and long after a step.",
    "models_of_checkups": "Parameters of models fitted to one later check-up.",
    "choice": "Errors are measured against the records fitted, not against a truth.",
    "identification_methods": "Methods side by side. The tables of the truth have resistances "
    "at once, after 10 s and in the long run, which the chosen model and the pulses are scored by; "
    "they have no RC pairs.",
    "soc": "State of charge at the ends of a test: counted, and by the filters from a wrong start.",
    "validation": "Errors of simulations are measured against the record, not against a truth.",
    "packs": "Branches of parallel groups as simulated: the charge of all discharges, the "
    "largest current; the capacity of the group as recorded and simulated; errors of current (over "
    "the mean branch current) and voltage against the record.",
    "series_packs": "Usable charge and energy of strings, where a cell's cut-off ended the record.",
    "series_pack_cells": "How each cell stands when the string has ended, and its full charge.",
    "pack_findings": "Measured and simulated side by side; the branches are scored above.",
    "pack_spread": "Measured and simulated side by side.",
    "pack_checks": "What a record contradicts in itself.",
    "nested_packs": "Errors are measured against the record, not against a truth.",
    "thermal": "Heat capacity and resistance to the ambient; the laboratory's cells have a core "
    "and a surface, and no single number of either.",
    "bias": "Errors are measured against the record, not against a truth.",
    "pack_decisions": "Intervals and gains; the tables of the truth have no other pack to compare.",
    "missing_effect": "What was hidden in a cell, and what was said of it.",
    "excluded": "Files spoiled beyond use on purpose: refused, or taken for good (missing).",
    "faults": "Samples spoiled on purpose: flagged, not seen (missing); other flags are extra.",
}


def render(scored, *, title: str) -> str:
    """The page as one HTML text, from a `summary.Score`."""
    settings = {"autoescape": True, "trim_blocks": True, "lstrip_blocks": True}
    environment = jinja2.Environment(undefined=jinja2.StrictUndefined, **settings)
    environment.filters |= {"number": short_number, "percent": percent, "plain": plain_name}
    lines = [summary_line(row) for row in scored.summary.to_dict("records")]
    # Rows of the truth are lost only where the pipeline has made the table.
    made = scored.summary.loc[scored.summary["state"] == "scored", "table"]
    in_made_tables = scored.errors["table"].isin(made)
    return environment.from_string(TEMPLATE.read_text(encoding="utf-8")).render(
        title=title,
        tables=[_page_table(scored, name, lines) for name in QUANTITIES],
        lines=lines,
        titles=TITLES,
        lost=int(((scored.errors["status"] == "missing") & in_made_tables).sum()),
        counts=scored.errors["status"].value_counts().to_dict(),
        coverage=_embedded(coverage_picture(scored.summary)),
        verdicts=_verdict_tables(scored.verdicts),
    )


def _page_table(scored, name, lines) -> dict:
    mine = scored.errors[scored.errors["table"] == name]
    lines = [row for row in lines if row["table"] == name]
    states = [row["state"] for row in lines]
    numbers = mine[mine["unit"] != COUNTED]
    return {
        "name": name,
        "title": TITLES[name],
        "about": ABOUT[name],
        "lines": [row for row in lines if row["state"] == "scored"],
        "rest": _unscored(lines),
        "state": "scored" if "scored" in states else (states or ["no truth"])[0],
        "picture": _embedded(table_picture(numbers)) if len(numbers) else None,
        "worst": _worst(numbers),
        "alone": [
            _unpaired_rows(mine, status) for status in ("missing", "extra", "spoiled", "untested")
        ],
    }


def _unscored(lines) -> dict:
    """Quantities that could not be scored, by the reason."""
    rest = {}
    for row in lines:
        if row["state"] != "scored":
            rest.setdefault(row["state"], []).append(row["quantity"])
    # Each law once, without its coefficients.
    short = {state: [name.split(":")[0] for name in names] for state, names in rest.items()}
    return {state: list(dict.fromkeys(filter(None, names))) for state, names in short.items()}


def _worst(rows) -> list[dict]:
    """The largest error of each quantity first, then by size relative to others of the quantity."""
    rows = rows[rows["status"] == "compared"]
    size = rows["error"].abs()
    usual = rows.groupby("quantity")["error"].transform(lambda error: (error**2).mean() ** 0.5)
    order = (size / usual.where(usual > 0)).sort_values(ascending=False, kind="stable").index
    rows = rows.loc[order[:SHOWN_ROWS]].to_dict("records")
    return [row | {"error": with_unit(row["error"], row["unit"])} for row in rows]


def _unpaired_rows(rows, status) -> dict:
    rows = rows[rows["status"] == status]
    named = rows.groupby(["quantity", "cell", "test"], dropna=False, sort=False)
    shown = [
        {
            "who": " ".join(part for part in key[1:] if isinstance(part, str) and part),
            "quantity": plain_name(key[0]),
            "number": len(part),
            "at": "; ".join(part["at"].dropna().astype(str).unique()[:3]),
            "reason": "; ".join(part["reason"].dropna().astype(str).unique()[:2]),
        }
        for key, part in named
    ]
    return {"status": status, "number": len(rows), "rows": shown[: 2 * SHOWN_ROWS]}


def _verdict_tables(judged) -> dict | None:
    if not len(judged):
        return None
    tables = {
        "outcomes": verdicts.confusion(judged),
        "answers": verdicts.answers(judged),
        "power": verdicts.power(judged),
    }
    return {
        "rows": judged.to_dict("records"),
        **{
            name: {"columns": list(table), "rows": [(k, list(v)) for k, *v in table.itertuples()]}
            for name, table in tables.items()
        },
    }


def _embedded(svg) -> str | None:
    return base64.b64encode(svg.encode()).decode() if svg else None


def markdown(scored) -> str:
    """The summary as a Markdown table."""
    lines = [summary_line(row) for row in scored.summary.to_dict("records")]
    rows = [row for row in lines if row["state"] == "scored"]
    shown = [name for name in MARKDOWN if any(row[name] for row in rows)]
    text = [f"| {' | '.join(MARKDOWN[name] for name in shown)} |", f"|{' --- |' * len(shown)}"]
    text += [f"| {' | '.join(row[name].replace('|', '/') for name in shown)} |" for row in rows]
    return "\n".join([*text, *_unscored_text(lines)]) + "\n"


def _unscored_text(lines) -> list[str]:
    said = {}
    for table in QUANTITIES:
        rest = _unscored([row for row in lines if row["table"] == table])
        for state, names in rest.items():
            shown = f"{table} ({', '.join(names)})" if names else table
            said.setdefault(state, []).append(shown)
    return [
        f"\n{state[0].upper()}{state[1:]}: {'; '.join(shown)}." for state, shown in said.items()
    ]


def write(place: files.Campaign, *, title: str) -> Score:
    """Score a campaign into `results/score/`: tables, and the page for people."""
    scored = score(place)
    folder = place.results / "score"
    folder.mkdir(parents=True, exist_ok=True)
    for name in ("errors", "summary", "verdicts"):
        path = folder / ("score.csv" if name == "summary" else f"{name}.csv")
        table = getattr(scored, name)
        path.write_text(table.to_csv(index=False, float_format="%.9g"), encoding="utf-8")
    (folder / "score.html").write_text(render(scored, title=title), encoding="utf-8")
    return scored
