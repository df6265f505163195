"""Effects of the instrument: errors of its current, voltage and clock."""

from cellwright.circuits.instrument import displayed, through_cell
from cellwright.effects.base import late
from cellwright.effects.library.sizes import as_is, current
from cellwright.effects.library.vocabulary import (
    Effect,
    Parameter,
    Tie,
    numbers_of,
    since_slow_test,
    worded,
)


def _current_offset(fields, stack, p):
    offset = p["offset_ampere"] * (1.0 if p["in_slow_test"] else since_slow_test(stack))
    return fields._replace(
        current=through_cell(fields.current, offset=offset),
        held=through_cell(fields.held, offset=offset * (1.0 - stack.fresh)),
    )


def _current_gain(fields, stack, p):
    """Current with a gain. The capacity was counted with the same gain, so that the SoC stays."""
    counted = ("current", "held", "capacity")
    gain = p["gain_relative"]
    return fields._replace(
        **{name: through_cell(getattr(fields, name), gain_relative=gain) for name in counted}
    )


def _voltage_offset(fields, stack, p):
    off = p["offset_volt"] * since_slow_test(stack)
    return fields._replace(volt=displayed(fields.volt, offset_volt=off))


def _voltage_gain(fields, stack, p):
    gain = p["gain_relative"] * since_slow_test(stack)
    return fields._replace(volt=displayed(fields.volt, gain_relative=gain))


def _skew(fields, stack, p):
    return fields._replace(volt=late(stack, fields, p["voltage_delay_second"]))


TWO_REFERENCES = "two voltage references in place of the cell"
EFFECTS = worded(
    Effect(
        id="current_offset",
        parameters=(
            Parameter("offset_ampere", "A", 0.0, -0.5, 0.5, step=1e-3, plausible=0.02),
            # 1: the slow test was read with it, too; it may be older, or of another channel. Tried,
            # not fitted.
            Parameter("in_slow_test", "1", 1.0, 0.0, 1.0, step=0.0, shape=True),
        ),
        stage="current",
        act=_current_offset,
        starts=({"in_slow_test": 1.0}, {"in_slow_test": 0.0}),
        blocks=numbers_of("reading", offset_ampere="current_offset_ampere"),
        ties=(
            Tie(
                "leakage",
                "the logged current at commanded open circuit (free); where it is not logged "
                "there, a rest of 48 h, in which only a leak discharges the cell",
                always=True,
                same_size=True,
            ),
        ),
        in_rest_log=True,
        quantity="current_at_rest",
        sizes_in_words=current("offset_ampere"),
    ),
    Effect(
        id="current_gain",
        parameters=(Parameter("gain_relative", "1", 0.0, -0.1, 0.1, step=1e-3, plausible=0.01),),
        stage="current",
        act=_current_gain,
        blocks=numbers_of("reading", gain_relative="current_gain_relative"),
        ties=(
            Tie(
                "capacity_error",
                "a reference shunt, a second channel, or other cells of the same channel",
                always=True,
                exact=True,
            ),
        ),
        sizes_in_words=as_is("gain_relative", "% of reading", factor=100),
    ),
    Effect(
        id="time_skew",
        parameters=(
            Parameter(
                *("voltage_delay_second", "s", 0.0, -3.0, 3.0),
                step=0.05,
                plausible=0.3,
                # Half a sample of the quickest pulses. Rows a millisecond beside an edge show less,
                # which biases no resistance.
                material=0.05,
            ),
        ),
        stage="reading",
        act=_skew,
        blocks=numbers_of("reading", voltage_delay_second="voltage_delay_second"),
        starts=tuple(
            {"voltage_delay_second": sign * d}
            for d in (0.05, 0.12, 0.25, 0.5, 1.0)
            for sign in (1.0, -1.0)
        ),
        needs=("edges",),
        hold_imitates=True,
        sizes_in_words=as_is("voltage_delay_second", "s", name="voltage behind current by"),
    ),
    Effect(
        id="voltage_offset",
        parameters=(Parameter("offset_volt", "V", 0.0, -0.1, 0.1, step=1e-3, plausible=0.01),),
        stage="reading",
        act=_voltage_offset,
        blocks=numbers_of("reading", offset_volt="voltage_offset_volt"),
        ties=(
            Tie("ocv_shift", "a voltage reference in place of the cell", exact=True),
            Tie("voltage_gain", TWO_REFERENCES, exact=True),
        ),
        sizes_in_words=as_is("offset_volt", "mV", factor=1e3),
    ),
    Effect(
        id="voltage_gain",
        parameters=(Parameter("gain_relative", "1", 0.0, -0.05, 0.05, step=5e-4, plausible=3e-3),),
        stage="reading",
        act=_voltage_gain,
        blocks=numbers_of("reading", gain_relative="voltage_gain_relative"),
        shows=TWO_REFERENCES,
        ties=(Tie("ocv_shift", TWO_REFERENCES, exact=True),),
        sizes_in_words=as_is("gain_relative", "% of reading", factor=100),
    ),
)
