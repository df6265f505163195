"""Errors of reading of one test alone: of its voltage, its current, or its clock.

An effect of the library is in every test. A channel that was changed, or a lead that was moved, is
wrong in one. `taken_off` is (stack, size, capacity_ampere_hour) → stack without an error of so much
in each record (f,); what is read less what is true, of a gain relative.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

# Sizes that a delay is tried at: it is not linear; between rows any may be alike.
DELAYS_SECOND = 1.0, -1.0, 0.3, -0.3, 0.1, -0.1


class Reading(NamedTuple):
    """One kind of error of reading.

    name : in the verdict's nuisances. unit : of its size there. sizes : that it is tried at.
    tolerance : function (tolerance, capacity_ampere_hour) → its standard deviation as the sheets of
    the instruments state it. taken_off : see above. sentence : in words, its size after it.
    unit_in_words, unit_factor : unit of that size, and it over `unit`. linear : whether what it
    changes is linear in its size.
    """

    name: str
    unit: str
    sizes: tuple
    tolerance: Callable
    taken_off: Callable
    sentence: str
    unit_in_words: str
    unit_factor: float
    linear: bool = True


def _without_offset(stack, size, capacity_ampere_hour):
    return stack._replace(voltage_volt=stack.voltage_volt - size[stack.file])


def _without_drift(stack, size, capacity_ampere_hour):
    """From none at the start of a record to all of it at the end."""
    off = size[stack.file]
    ends = stack.second[np.append(stack.first[1:], len(off)) - 1]
    course = stack.second / np.maximum(ends[stack.file], 1.0)
    return stack._replace(voltage_volt=stack.voltage_volt - off * course)


def _without_delay(stack, size, capacity_ampere_hour):
    known = 0.0 if stack.late_second is None else stack.late_second
    return stack._replace(late_second=known + size[stack.file])


def _without_current_gain(stack, size, capacity_ampere_hour):
    columns, off = ("current_ampere", "held_ampere", "unseen_ampere_hour"), size[stack.file]
    scaled = {column: getattr(stack, column) / (1.0 + off) for column in columns}
    anchor_rise = stack.anchor_rise / (1.0 + size)
    return stack._replace(**scaled, anchor_rise=anchor_rise, responses={}, courses={})


def _without_current_offset(stack, size, capacity_ampere_hour):
    off = size[stack.file]
    anchor = stack.first if stack.anchor_row is None else stack.anchor_row
    hours = (stack.second[anchor] - stack.second[stack.first]) / 3600.0
    return stack._replace(
        current_ampere=stack.current_ampere - off,
        held_ampere=stack.held_ampere - off * (1.0 - stack.fresh),
        anchor_rise=stack.anchor_rise - size * hours / capacity_ampere_hour,
        responses={},
        courses={},
    )


def _of_voltage(tolerance, capacity_ampere_hour):
    return tolerance.voltage_reading


READINGS = {
    reading.name: reading
    for reading in (
        Reading(
            *("voltage_offset", "V", (1e-3,), _of_voltage, _without_offset),
            *("the voltage is off by", "mV", 1e3),
        ),
        Reading(
            *("voltage_drift", "V", (1e-3,), _of_voltage, _without_drift),
            *("the voltage drifts until the end by", "mV", 1e3),
        ),
        Reading(
            *("current_offset", "A", (1e-3,)),
            lambda tolerance, ampere_hour: tolerance.current_reading * ampere_hour,
            *(_without_current_offset, "the current is off by", "mA", 1e3),
        ),
        Reading(
            *("current_gain", "1", (1e-3,)),
            lambda tolerance, ampere_hour: tolerance.current_reading,
            *(_without_current_gain, "the current is off by the factor 1 plus", "%", 1e2),
        ),
        Reading(
            *("voltage_delay", "s", DELAYS_SECOND),
            lambda tolerance, ampere_hour: tolerance.clock,
            *(_without_delay, "the voltage is behind the current by", "s", 1.0),
            linear=False,
        ),
    )
}
