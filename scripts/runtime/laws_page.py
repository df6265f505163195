"""Laws over temperature in the report: a row a law, its parameters in words and units of people."""

from runtime.page_tables import SHOWN_ROWS, WORST_ROWS, measured, plain_table

READ = (
    "The chosen law of each quantity, the best by leave-one-out error; in brackets 95 % limits, "
    "else ± one standard deviation. R² of the fit. Beyond the tested temperatures a law is a guess."
)
COLUMNS = ["quantity", "law", "parameters", "R²", "tested [°C]", "doubt"]
LAWS = {
    "arrhenius": "Arrhenius",
    "arrhenius_t": "Arrhenius, factor T",
    "additive": "f(SoC) + quadratic in T",
    "multiplicative": "f(SoC) times Arrhenius",
    "table": "interpolated between pulses",
    "split": "lost, not given back when slow",
}
PARAMETERS = {
    "value_at_25_celsius": "at 25 °C",
    "value_at_soc_0": "at SoC 0",
    "ln_value_at_25_celsius": "logarithm at 25 °C",
    "b1": "T² times",
    "b2": "T times",
    "b3": "at 0 °C",
    "ocv": "voltage",
    "soc": "SoC",
    "slope_p_value": "p without slope",
    "zero_p_value": "p through zero",
    "left_out_soc_rmse": "RMS error at SoC left out",
    "left_out_soc_share": "of the resistance",
    "left_out_temperature_share": "error at temperatures left out",
}
# Shown unit and how many of it are one of the table's; of ohms, volts and shares below one the
# thousandths and hundredths that people say.
UNITS = {"J/mol": ("kJ/mol", 1e-3), "V/K": ("mV/K", 1e3), "ln(Ohm)": ("ln Ω", 1.0), "1": ("", 1.0)}
SMALL = {"Ohm": ("mΩ", 1e3), "V": ("mV", 1e3)}
SHARES = ("_share", "soc")  # ends of names of parameters that are shares of one


def table(frame):
    """The chosen laws of tables/temperature of one cell (a frame of text); None without one."""
    chosen = frame[frame["chosen"] == "True"]
    lines = []
    for (quantity, law), rows in chosen.groupby(["quantity", "law"], sort=False):
        first = rows.iloc[0]
        tested = [measured(first[f"tested_{end}_celsius"]) for end in ("from", "to")]
        lines.append(
            [
                quantity.replace("degC", "°C"),
                LAWS.get(law, law.replace("_", " ")),
                "; ".join(map(_parameter, rows.to_dict("records"))),
                # An interpolation runs through its points: its R² of 1 says nothing.
                "" if law == "table" else measured(first["r_squared"], None, 1.0, 3),
                " to ".join(filter(None, tested)),
                first["doubt"],
            ]
        )
    shown = [k for k in range(len(COLUMNS)) if any(line[k] for line in lines)]
    lines = [[line[k] for k in shown] for line in lines]
    columns, made = [COLUMNS[k] for k in shown], "results/tables/temperature.csv"
    about = "temperature", "Laws over temperature", READ
    found = plain_table(*about, columns, lines, made=made) if lines else None
    if found is None or len(lines) <= SHOWN_ROWS or "R²" not in columns:
        return found
    at = columns.index("R²")
    worst = sorted(found.rows, key=lambda row: float(row[at].text or "inf"))[:WORST_ROWS]
    read = f"{READ} The {WORST_ROWS} with the lowest R²."
    return found._replace(read=read, rows=worst, more=len(lines) - WORST_ROWS)


def _parameter(row) -> str:
    """One parameter, such as `activation energy 12.3 (10.1 to 14.5) kJ/mol`."""
    name = row["parameter"].replace("degC", "°C")
    unit, scale = _unit(row)
    low, high = (measured(row.get(end, ""), None, scale, 3) for end in ("lower", "upper"))
    known = low and high
    value = measured(row["value"], None if known else row["std"], scale, 3)
    value += f" ({low} to {high})" if known else ""
    return f"{PARAMETERS.get(name, name.replace('_', ' '))} {value} {unit}".rstrip()


def _unit(row):
    if row["unit"] == "1" and row["parameter"].endswith(SHARES):
        return "%", 1e2
    base, slash, per = row["unit"].partition("/")
    if row["unit"] in UNITS:
        return UNITS[row["unit"]]
    small = base in SMALL and abs(float(row["value"])) < 1.0
    shown, scale = SMALL[base] if small else (base, 1.0)
    shown = {"Ohm": "Ω", "degC": "°C", "1": ""}.get(shown, shown)
    return shown + slash + per.replace("degC", "°C").replace("^2", "²"), scale
