"""What an instrument does to the quantities that it shows."""

from typing import NamedTuple


class Chain(NamedTuple):
    """Channels of an instrument; all but resolution and white noise is neutral by default.

    Noise: standard deviations; slow noise is an Ornstein–Uhlenbeck process with its correlation
    time [s]. A gain is relative: shown = (1 + gain) × true + offset, in the counters too. A lag is
    the time constant [s] of a first-order low-pass. What is shown of the voltage at t was there at
    t − `voltage_delay_second`. `branch_*`: of the branches' own sensors, in their order.
    `rest_is_open`: the relay opens at rest and the current shown is exactly zero.
    `clock`: see `clock.sample_times`.
    """

    voltage_resolution_volt: float = 0.0003
    voltage_noise_volt: float = 0.0003
    current_resolution_ampere: float = 0.001
    current_noise_ampere: float = 0.0005
    temperature_resolution_celsius: float = 0.1
    temperature_noise_celsius: float = 0.05
    voltage_slow_noise_volt: float = 0.0
    voltage_slow_noise_second: float = 250.0
    current_slow_noise_ampere: float = 0.0
    current_slow_noise_second: float = 250.0
    voltage_offset_volt: float = 0.0
    voltage_gain: float = 0.0
    current_offset_ampere: float = 0.0
    current_gain: float = 0.0
    branch_offset_ampere: tuple[float, ...] = ()
    branch_gain: tuple[float, ...] = ()
    surface_offset_celsius: float = 0.0
    chamber_offset_celsius: float = 0.0
    voltage_delay_second: float = 0.0
    voltage_lag_second: float = 0.0
    current_lag_second: float = 0.0
    surface_lag_second: float = 0.0
    rest_is_open: bool = True
    clock: str = "late"


CHAIN = Chain()
# What public records of real instruments show, by differences of neighbouring samples at steady
# current: LG HG2 (Digatron), Nissan Leaf (Bitrode), A123 in the form of Plett's toolbox. The
# Arbin is the thesis' own.
TYPICAL = {
    "arbin": CHAIN,
    "digatron": Chain(
        voltage_resolution_volt=0.00017,
        voltage_noise_volt=0.0001,
        current_resolution_ampere=0.00255,
        current_noise_ampere=0.0012,
        temperature_resolution_celsius=0.10515,
        clock="steady",
    ),
    "bitrode": Chain(
        voltage_resolution_volt=0.001,
        voltage_noise_volt=0.0002,
        current_resolution_ampere=0.01,
        current_noise_ampere=0.003,
        current_offset_ampere=0.006,
        rest_is_open=False,
        clock="steady",
    ),
    "plett": Chain(
        voltage_resolution_volt=0.0001,
        voltage_noise_volt=0.00006,
        current_resolution_ampere=0.0001,
        current_noise_ampere=0.0009,
        current_offset_ampere=-0.001,
        rest_is_open=False,
        clock="steady",
    ),
}
