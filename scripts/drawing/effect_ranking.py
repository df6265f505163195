"""Which effects were tried, how much better each makes the model, and which passed."""

import figure

NO_TRIAL = "No effect was fitted: there was nothing left to explain, or none that these data show."
CHOSEN, TIED, OTHER, OUT = figure.SERIES[0], figure.SERIES[7], "#c9d6e2", "#d5d8dc"
LABELS = {
    CHOSEN: "added to the model",
    TIED: "as good as that one",
    OTHER: "not added",
    OUT: "a parameter at the end of its physical range",
}
LINEAR = 100.0  # of the axis, around zero
HATCH = "////"


def draw(columns, settings):
    """Figure of stage `missing_effect/ranking`; settings: section of the config."""
    rows = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    if not rows:
        return figure.message(NO_TRIAL)
    rounds = sorted({row["round"] for row in rows})
    sizes = [sum(row["round"] == number for row in rows) for number in rounds]
    canvas, axes = figure.canvas(
        len(rounds), 1, height=1.3 + 0.24 * sum(sizes) + 0.9 * len(rounds),
        height_ratios=[size + 1.0 for size in sizes], sharex=True,
    )  # fmt: skip
    gate = settings["bic"] + settings["validation_chi_square"]
    for panel, number in zip(axes[:, 0], rounds, strict=True):
        mine = sorted((r for r in rows if r["round"] == number), key=lambda r: -r["j"])
        _round(panel, mine, gate)
        panel.set(title=_title(number, mine))
    largest = max(abs(row["j"]) for row in rows)
    axes[0, 0].set_xscale("symlog", linthresh=LINEAR)
    low = min(0.0, *(row["j"] for row in rows))
    axes[0, 0].set_xlim(2 * low - 40 if low < 0 else 0.0, 40 * max(largest, LINEAR))
    axes[-1, 0].set(xlabel="J: how much better with the effect, fit and proof together [1]")
    _legend(canvas, settings)
    return canvas


def _title(number, rows):
    best = next((row["effect"].replace("_", " ") for row in rows if row["chosen"]), None)
    found = f"added “{best}”" if best else "nothing more to add" if number > 1 else "nothing to add"
    return f"Round {number}: {found}"


def _round(panel, rows, gate):
    for place, row in enumerate(rows):
        hatch = None if row["in_range"] else HATCH
        panel.barh(place, row["j"], height=0.7, color=_colour(row), hatch=hatch, edgecolor="white")
        panel.annotate(_words(row), (max(row["j"], gate), place), va="center", fontsize=7,
                       xytext=(3, 0), textcoords="offset points")  # fmt: skip
    panel.axvline(gate, color=figure.ERROR, lw=0.9, ls="--")
    panel.axvline(0.0, color=figure.QUIET, lw=0.8)
    panel.set_yticks(range(len(rows)), [r["effect"].replace("_", " ") for r in rows], fontsize=8)
    panel.invert_yaxis()
    panel.grid(visible=False, axis="y")


def _words(row):
    fit, proof = row["delta_bic"], row["delta_validation_chi_square"]
    return f"fit {_signed(fit)}, proof {_signed(proof)}"


def _signed(value):
    return f"{round(value):+,}".replace("-", "−").replace(",", "\u2009")


def _colour(row):
    if row["chosen"]:
        return CHOSEN
    if not row["in_range"]:
        return OUT
    return TIED if row["tied"] else OTHER


def _legend(canvas, settings):
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    keys = [Patch(facecolor=c, edgecolor="white", label=text) for c, text in LABELS.items()]
    keys[-1].set_hatch(HATCH)
    gates = f"gates: fit above {settings['bic']:g}, proof above"
    gates = f"{gates} {settings['validation_chi_square']:g}; the line is their sum"
    gate = Line2D([], [], color=figure.ERROR, lw=0.9, ls="--", label=gates)
    canvas.legend(handles=[*keys, gate], loc="outside lower center", ncols=2, fontsize=7.5)
