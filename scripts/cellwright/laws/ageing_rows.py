"""Rows of the table of laws over temperature from the cycles of an ageing record."""

import numpy as np


def law_rows(summary, *, test):
    """Rows of the table of laws over temperature: slope, start, loss and daily cycle."""
    capacity, percent = summary["capacity_start_ampere_hour"], "%"
    entries = [
        ("capacity_at_start", capacity, np.nan, "Ah"),
        (
            "temperature_slope",
            summary["slope_percent_per_kelvin"],
            summary["slope_std_percent_per_kelvin"],
            "%/degC",
        ),
        ("reference_temperature", summary["reference_celsius"], np.nan, "degC"),
        ("loss_over_record", summary["loss_percent"], summary["loss_std_percent"], percent),
        ("daily_amplitude", summary["daily_percent"], summary["daily_std_percent"], percent),
    ]
    return [
        {
            "quantity": f"discharge capacity over the cycles of {test}",
            "law": "fade and temperature",
            "parameter": name,
            "value": float(value),
            "std": float(std),
            "unit": unit,
            "r_squared": summary["explained"],
            "cross_validation_rmse": np.nan,
            "chosen": True,
        }
        for name, value, std, unit in entries
        if np.isfinite(value)
    ]
