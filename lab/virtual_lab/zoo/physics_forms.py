"""Effects inside cells by physics, and errors of their instruments and sheets.

Each is a change of the porous-electrode equations, of the instrument's channels or of the chamber,
not of a circuit. `accept` holds names of the vocabulary that explain the same data.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from virtual_lab.instruments.chain import Chain
from virtual_lab.physics import LFP_DECAY, LFP_HALF_GAP_VOLT, Cell


class Setup(NamedTuple):
    """A cell in one test, with its channel.

    `leak_ampere` flows beside the ammeter and `warmer_kelvin` is how much warmer the chamber is
    than the sheet says. `open_second`: within each pair of times of the test `open_ohm` is in
    series with the cell.
    """

    cell: Cell
    chain: Chain
    leak_ampere: float = 0.0
    warmer_kelvin: float = 0.0
    open_ohm: float = 0.0
    open_second: tuple[tuple[float, float], ...] = ()

    def inside(self, **changes) -> "Setup":
        """The setup with changes of what the cell has inside."""
        return self._replace(cell=self.cell._replace(inside=self.cell.inside._replace(**changes)))

    def lost(self, **changes) -> "Setup":
        """The setup with changes of the cell's other parameters."""
        return self._replace(cell=self.cell._replace(**changes))


class Moment(NamedTuple):
    """Which test it is.

    `checkup`: a capacity or slow test. `share`: of the tests that came before [1]. `cold`: its
    sheet says at most 15 °C. `seed`: of what happens at random in it. `duration_second`: its
    longest duration.
    """

    checkup: bool
    share: float
    cold: bool
    seed: int
    duration_second: float


class Form(NamedTuple):
    """One way in which a cell, an instrument or a sheet differs from healthy ones.

    `effect`: its name; `kind` and `accept` as in the truth. `parameter`: name of its size with the
    unit, drawn between `low` and `high`; with `either_sign` of both signs.
    `act(setup, size, moment)` gives the setup of one test.
    """

    effect: str
    parameter: str
    low: float
    high: float
    act: Callable[[Setup, float, Moment], Setup]
    accept: tuple[str, ...] = ()
    kind: str = "single"
    either_sign: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """Names that count as right."""
        return () if self.kind == "unknown" else (self.effect, *self.accept)


HYSTERESIS_DECAY = 15.0  # per lithiation: a change of branch takes a tenth of the capacity


def _inside(parameter):
    return lambda setup, size, moment: setup.inside(**{parameter: size})


def _slow_kinetics(setup, size, moment):
    return setup.lost(kinetics=setup.cell.kinetics * size)


def _hysteresis(setup, size, moment):
    """Two branches of the positive potential; those that LFP has anyway lie further apart."""
    if setup.cell.chemistry == "LFP":
        return setup.inside(hysteresis_volt=LFP_HALF_GAP_VOLT + size, hysteresis_decay=LFP_DECAY)
    return setup.inside(hysteresis_volt=size, hysteresis_decay=HYSTERESIS_DECAY)


def _leak(setup, size, moment):
    return setup._replace(leak_ampere=size * setup.cell.rating.capacity_ampere_hour)


def _offset(setup, size, moment):
    ampere = size * setup.cell.rating.capacity_ampere_hour
    return setup._replace(chain=setup.chain._replace(current_offset_ampere=ampere))


def _late_voltage(setup, size, moment):
    return setup._replace(chain=setup.chain._replace(voltage_delay_second=size))


def _lost_lithium(setup, size, moment):
    """Lithium lost after the capacity and slow tests."""
    return setup if moment.checkup else setup.lost(lli=setup.cell.lli + size)


def _lost_positive(setup, size, moment):
    """Positive material lost after the capacity and slow tests, with the lithium in it."""
    if moment.checkup:
        return setup
    return setup.lost(lam_positive=setup.cell.lam_positive + size, lli=setup.cell.lli + size / 2)


OPEN_SECOND, CLOSED_SECOND = 150.0, 300.0  # mean durations


def _open_contact(setup, size, moment):
    """A contact whose resistance rises for minutes while current flows through it."""
    random = np.random.default_rng(moment.seed)
    count = int(moment.duration_second / (OPEN_SECOND + CLOSED_SECOND)) + 5
    waits = 5.0 + random.exponential([CLOSED_SECOND, OPEN_SECOND], (count, 2))
    change = np.round(np.cumsum(waits.ravel()), 1).reshape(count, 2)
    return setup._replace(open_ohm=size, open_second=tuple(map(tuple, change.tolist())))


def _ageing(setup, size, moment):
    """Lithium and exchange current fall and the contact's resistance grows from test to test."""
    share = moment.share * size
    return setup.lost(
        lli=setup.cell.lli + 0.5 * share,
        kinetics=setup.cell.kinetics * (1 - 3.0 * share),
        contact_resistance_ohm=setup.cell.contact_resistance_ohm * (1 + 12.0 * share),
    )


def _wrong_sheet(setup, size, moment):
    """The cold tests run at another temperature than the sheet says; sensors show the true one."""
    return setup._replace(warmer_kelvin=size) if moment.cold else setup


def _wrong_thermometer(setup, size, moment):
    """As `_wrong_sheet`, and the sensors, too, show the temperature of the sheet."""
    if not moment.cold:
        return setup
    chain = setup.chain._replace(chamber_offset_celsius=-size, surface_offset_celsius=-size)
    return setup._replace(chain=chain, warmer_kelvin=size)


DIFFUSION = ("polarisation_soc",)
FORMS = {
    # Core and can, with the sensor on the can.
    "two_node_heat": Form(
        "self_heating", "core_kelvin_per_watt", 4.0, 7.0, _inside("core_kelvin_per_watt")
    ),
    # Both exchange currents by a factor: Butler–Volmer bends, and more so in the cold.
    "slow_kinetics": Form(
        "charge_transfer_nonlinearity",
        "exchange_current_factor",
        1 / 3,
        1 / 2,
        _slow_kinetics,
        accept=("resistance_temperature",),
    ),
    "kinetics_over_soc": Form(
        "resistance_soc",
        "kinetics_per_lithiation",
        1.5,
        2.5,
        _inside("kinetics_per_lithiation"),
        accept=("polarisation_soc",),
    ),
    "slow_negative_particles": Form(
        "slow_diffusion",
        "diffusivity_factor",
        0.30,
        0.45,
        _inside("diffusivity_negative"),
        accept=DIFFUSION,
    ),
    "slow_positive_particles": Form(
        "slow_diffusion",
        "diffusivity_factor",
        0.40,
        0.60,
        _inside("diffusivity_positive"),
        accept=DIFFUSION,
    ),
    "steep_kinetics": Form(
        "resistance_temperature",
        "added_joule_per_mole",
        20e3,
        30e3,
        _inside("kinetics_joule_per_mole"),
    ),
    "positive_hysteresis": Form("hysteresis_one_state", "half_gap_volt", 0.012, 0.020, _hysteresis),
    "leak": Form("leakage", "leak_per_hour", 0.006, 0.010, _leak, accept=("current_offset",)),
    "shunt_offset": Form(
        "current_offset",
        "offset_per_hour",
        0.007,
        0.012,
        _offset,
        accept=("leakage",),
        either_sign=True,
    ),
    "late_voltage": Form(
        "time_skew", "voltage_delay_second", 0.4, 0.9, _late_voltage, either_sign=True
    ),
    "lost_lithium": Form("ocv_shift", "lli", 0.04, 0.06, _lost_lithium, accept=("capacity_error",)),
    "lost_positive": Form(
        "ocv_shift", "lam_positive", 0.04, 0.06, _lost_positive, accept=("capacity_error",)
    ),
    "open_contact": Form(
        "open_contact", "contact_ohm", 0.006, 0.012, _open_contact, kind="unknown"
    ),
    "ageing": Form("ageing", "lithium_and_kinetics", 0.08, 0.12, _ageing, kind="unknown"),
    "wrong_sheet": Form(
        "sheet_temperature", "warmer_kelvin", 4.5, 5.5, _wrong_sheet, kind="sheet", either_sign=True
    ),
    "wrong_thermometer": Form(
        "sheet_temperature",
        "warmer_kelvin",
        4.5,
        5.5,
        _wrong_thermometer,
        kind="sheet",
        either_sign=True,
    ),
}
# A healthy cell too: no record tells a larger resistance of the contact from that of the cell.
MORE_CONTACT = 1.6
