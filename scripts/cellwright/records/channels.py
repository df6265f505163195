"""Channels of a group's record that are numbered: branch currents, cell voltages, temperatures.

A branch is a member of the group, a cell a leaf of its wiring; both are counted from 1. Any subset
may be logged.
"""

import re

import numpy as np

from cellwright.refusal import Refusal

BRANCH_CURRENT = "branch_{}_current_ampere"
CELL_VOLTAGE = "cell_{}_voltage_volt"
CELL_TEMPERATURE = "cell_{}_temperature_celsius"
LABELS = {
    BRANCH_CURRENT: "Branch {} Current / A",
    CELL_VOLTAGE: "Cell {} Voltage / V",
    CELL_TEMPERATURE: "Cell {} Temperature / degC",
}


def logged(series, channel):
    """Numbers, from 1 and in their order, under which a series has a channel: list of int.

    Parameters
    ----------
    series : dict of columns. channel : BRANCH_CURRENT, CELL_VOLTAGE or CELL_TEMPERATURE.
    """
    pattern = re.compile(channel.replace("{}", r"(\d+)"))
    return sorted(int(match[1]) for match in map(pattern.fullmatch, series) if match)


def table(series, channel, count):
    """Readings of one channel, (n, count), NaN where not logged; None where none was.

    Parameters
    ----------
    series : dict of (n,) columns. channel : as in `logged`. count : of members or cells.
    """
    numbers = [number for number in logged(series, channel) if number <= count]
    if not numbers:
        return None
    readings = np.full((len(series[channel.format(numbers[0])]), count), np.nan)
    for number in numbers:
        readings[:, number - 1] = series[channel.format(number)]
    return readings


def refuse_beyond(series, *, members, cells):
    """Refuse numbered channels of more members or cells than a group has.

    Parameters
    ----------
    series : dict of columns. members, cells : of the group by its wiring.

    Raises
    ------
    Refusal : names the channels, in a file's words, and the numbers that there are.
    """
    counts = {BRANCH_CURRENT: members, CELL_VOLTAGE: cells, CELL_TEMPERATURE: cells}
    for channel, count in counts.items():
        beyond = [number for number in logged(series, channel) if not 1 <= number <= count]
        if beyond:
            found = ", ".join(LABELS[channel].format(number) for number in beyond)
            what = "members" if channel == BRANCH_CURRENT else "cells"
            raise Refusal(f"found {found}; groups.tsv wires {count} {what}, numbered from 1")
