"""Losses of capacity as rows: of the table of laws, and charges with what was left in before."""

import numpy as np

from cellwright.refusal import Refusal


def law_rows(losses):
    """Rows of the table of laws over temperature: the true loss of each temperature."""
    slow = [loss for loss in losses if loss.known and loss.c_rate == loss.slow_c_rate]
    rates = {}
    for loss in slow:
        rates[loss.direction] = max(rates.get(loss.direction, 0.0), loss.slow_c_rate)
    names = {name: f"{name} at up to {rate:.2g}C" for name, rate in rates.items()}
    rows = [
        {
            "quantity": f"true capacity loss, {names[loss.direction]}",
            "law": "split",
            "parameter": f"at {loss.temperature_celsius:g} degC",
            "value": loss.true_percent,
            "std": loss.true_std_percent,
            "unit": "%",
            "r_squared": np.nan,
            "cross_validation_rmse": np.nan,
            "chosen": True,
        }
        for loss in slow
    ]
    if not rows:
        raise Refusal("no slow test at any temperature, so no true loss is known")
    return rows


def with_left_in(losses):
    """Losses (list of Loss), each charge with what a discharge of its test had left in the cell."""
    drawn = {one.tests: one for one in losses if one.direction == "discharge" and one.known}
    slow = {one.tests: one for one in drawn.values() if one.total_percent == 0}
    whole = next((one.reference_ampere_hour + one.held_ampere_hour for one in slow.values()), None)
    return [
        one._replace(left_in_percent=_left(drawn[one.tests], whole, one.reference_ampere_hour))
        if one.direction == "charge" and one.tests in drawn and whole
        else one
        for one in losses
    ]


def _left(discharge, whole, reference):
    """Share of a charge's reference that a discharge and what was drawn after it left [%]."""
    return 100 * (whole - discharge.capacity_ampere_hour - discharge.held_ampere_hour) / reference
