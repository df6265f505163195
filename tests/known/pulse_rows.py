"""Rows of stage `resistance` with what a sheet says of their test, for tests of what follows."""


def pulse(
    soc,
    ohm,
    celsius=25.0,
    *,
    rate=1.0,
    delay=10.0,
    direction="discharge",
    cycle=None,
    share=0.01,
    rest=3.7,
    **more,
):
    """A pulse: `share` of its resistance is its standard deviation, `rest` the voltage before."""
    return {
        "test": f"hppc_{cycle}",
        "cycle": cycle,
        "ambient_temperature_celsius": celsius,
        "soc": soc,
        "direction": direction,
        "c_rate": rate,
        "delay_second": delay,
        "actual_delay_second": max(float(delay), 0.01),
        "resistance_ohm": ohm,
        "resistance_std_ohm": share * ohm,
        "voltage_before_volt": rest,
    } | more
