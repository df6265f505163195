"""Effects of the instrument: what it reads is not what is there."""

import numpy as np

from cellwright.effects.effect import Effect, Parameter

EDGE_SECOND = 0.06  # before the stamp of a row, within which the current of the row sets in
APART_SECOND = 1e6  # between records on one clock


def _current_offset(fields, stack, p):
    true = fields.current - p["offset_ampere"]
    return fields._replace(
        current=true, held=fields.held - p["offset_ampere"] * (1.0 - stack.fresh)
    )


def _current_gain(fields, stack, p):
    """The capacity was counted by the same ammeter: only the true current differs, not the SoC."""
    factor = 1.0 / (1.0 + p["gain_relative"])
    return fields._replace(
        current=fields.current * factor,
        held=fields.held * factor,
        capacity=fields.capacity * factor,
    )


def _voltage_offset(fields, stack, p):
    return fields._replace(volt=fields.volt + p["offset_volt"])


def _voltage_gain(fields, stack, p):
    return fields._replace(volt=fields.volt * (1.0 + p["gain_relative"]))


def _skew(fields, stack, p):
    """Voltage of t − delay, on the model's own course between rows.

    Where the current stepped, the old one flowed until shortly before the stamp; there the course
    has a corner, without which a delay shorter than the sampling interval would smear every step.
    """
    clock = stack.second + APART_SECOND * stack.file
    edge = np.minimum(EDGE_SECOND, stack.step_second / 2.0)
    old_ohmic, old = _before(fields.ohmic, stack), _before(fields.volt, stack)
    part = np.divide(edge, stack.step_second, out=np.zeros_like(edge), where=edge > 0)
    stepped = fields.volt - fields.ohmic + old_ohmic
    corner = np.where(stack.linear > 0, fields.volt + part * (old - fields.volt), stepped)
    times = np.stack([clock - edge, clock], axis=1).ravel()
    volts = np.stack([corner, fields.volt], axis=1).ravel()
    return fields._replace(volt=np.interp(clock - p["voltage_delay_second"], times, volts))


def _before(values, stack):
    """Values of the row before; in first rows their own."""
    return np.where(stack.fresh > 0, values, np.concatenate([values[:1], values[:-1]]))


EFFECTS = (
    Effect(
        id="current_offset",
        sentence="the current reading is off by a constant",
        parameters=(
            Parameter(
                *("offset_ampere", "A", 0.0, -0.5, 0.5),
                step=1e-3,
                plausible=0.02,
                material=1e-3,
            ),
        ),
        stage="current",
        act=_current_offset,
        shows="the logged current at commanded open circuit",
        consequence="counted state of charge drifts with time",
    ),
    Effect(
        id="current_gain",
        sentence="the current reading is off by a factor",
        parameters=(Parameter("gain_relative", "1", 0.0, -0.1, 0.1, step=1e-3, plausible=0.01),),
        stage="current",
        act=_current_gain,
        shows="a reference shunt, a second channel, or other cells of the same channel",
        consequence="capacity and resistance are off by the same factor",
    ),
    Effect(
        id="time_skew",
        sentence="voltage and current are not read at the same time",
        parameters=(
            Parameter(
                *("voltage_delay_second", "s", 0.0, -3.0, 3.0),
                step=0.05,
                plausible=0.3,
                material=0.02,
            ),
        ),
        stage="reading",
        act=_skew,
        starts=tuple(
            {"voltage_delay_second": sign * d}
            for d in (0.05, 0.12, 0.25, 0.5, 1.0)
            for sign in (1.0, -1.0)
        ),
        held=True,
        bends=True,
        needs=("edges",),
        shows="pulses with sharp edges, sampled ten times a second",
        consequence="resistance is mistaken for fast polarisation",
    ),
    Effect(
        id="voltage_offset",
        sentence="the voltage reading is off by a constant",
        parameters=(
            Parameter(
                *("offset_volt", "V", 0.0, -0.1, 0.1),
                step=1e-3,
                plausible=0.01,
                material=1e-3,
            ),
        ),
        stage="reading",
        act=_voltage_offset,
        shows="a voltage reference in place of the cell",
        consequence="every state of charge by voltage is biased",
    ),
    Effect(
        id="voltage_gain",
        sentence="the voltage reading is off by a factor",
        parameters=(
            Parameter(
                *("gain_relative", "1", 0.0, -0.05, 0.05),
                step=5e-4,
                plausible=3e-3,
                material=3e-4,
            ),
        ),
        stage="reading",
        act=_voltage_gain,
        shows="two voltage references in place of the cell",
        consequence="every state of charge by voltage is biased, most near full",
    ),
)
