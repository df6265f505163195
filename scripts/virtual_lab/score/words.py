"""Numbers and names as people read them."""

import math

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


def plain(quantity: str) -> str:
    """A quantity without its unit and underscores."""
    head, comma, rest = str(quantity).partition(",")
    suffix = next((one for one in SUFFIXES if head.endswith(one)), "")
    return f"{head.removesuffix(suffix)}{comma}{rest}".replace("_", " ")


def scaled(unit) -> tuple[float, str]:
    """Factor and unit in which errors of a unit are shown."""
    return SHOWN.get(unit, (1.0, unit if isinstance(unit, str) else ""))


def number(value) -> str:
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
    """An error in the unit in which it reads well."""
    factor, name = scaled(unit)
    if not number(value):
        return ""
    return f"{number(float(value) * factor)} {name}".strip()


def percent(value) -> str:
    """A share in per cent; blank where not known."""
    return f"{number(round(100 * float(value), 4))} %" if number(value) else ""


def line(row: dict) -> dict:
    """One row of the summary for people: every statistic as text with its unit."""
    known = {f"n_{name}": number(row[f"n_{name}"]) for name in ("compared", "missing", "extra")}
    worst = [row[name] for name in ("worst_cell", "worst_test", "worst_at")]
    return {
        "table": row["table"],
        "quantity": plain(row["quantity"]),
        "state": row["state"],
        **known,
        **{name: with_unit(row[name], row["unit"]) for name in STATISTICS},
        "relative_rms": percent(row["relative_rms"]),
        "share": _between(row, "share", "share") or _between(row, "coverage_95", "coverage"),
        "worst": " ".join(part for part in worst if isinstance(part, str) and part),
        "remark": remark(row),
    }


def _between(row, name, stem):
    low, high = (row[f"{stem}_{side}"] for side in ("low", "high"))
    if not number(low):
        return percent(row[name])
    return f"{percent(row[name])} ({100 * low:.0f}–{100 * high:.0f})"


def remark(row: dict) -> str:
    """What a reader must see: intervals that are not what they say, and what is missing."""
    said = []
    if number(row["coverage_95"]) and row["n_interval"] >= SMALL_SAMPLE:
        said += ["intervals too narrow"] if row["coverage_high"] < 0.95 else []
        said += ["intervals too wide"] if row["coverage_low"] > 0.95 else []
    counts = {"spoiled": "spoiled on purpose", "untested": "without such a test"}
    said += [f"{int(row[f'n_{k}'])} {v}" for k, v in counts.items() if row[f"n_{k}"] > 0]
    return "; ".join(said)
