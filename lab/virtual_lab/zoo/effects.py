"""Effects in behavioural cells: other forms, simple forms, what no vocabulary holds, wrong sheets.

Each acts on a specimen with one size, by which its strength is set. Ids are those of the contract's
vocabulary; equations and constants are this module's own.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.zoo.cell import COURSE, ONE, Specimen

Drawn = dict[str, Any]


class Form(NamedTuple):
    """One form of one effect.

    effect : id of the vocabulary, or of what is outside. parameter : name of its size, with unit.
    first, most : size to begin the search of a strength with, and the largest plausible one.
    act : (specimen, size, drawn) → specimen. draw : further parameters. parts : names that describe
    part of the same form, and so are no extra names. either_sign : whether the size may be
    negative. fixed : the size is `first`, whatever strength is asked for. over_hours : it grows
    with time, and its strength is that on the fitted records, of which one is long.
    layouts : of tests.
    """

    effect: str
    parameter: str
    first: float
    most: float
    act: Callable[[Specimen, float, Drawn], Specimen]
    draw: Callable[[np.random.Generator], Drawn] = lambda random: {}
    parts: tuple[str, ...] = ()
    either_sign: bool = False
    fixed: bool = False
    over_hours: bool = False
    layouts: tuple[str, ...] = ("wide", "cold")


def _uniform(**limits):
    return lambda random: {name: float(random.uniform(*ends)) for name, ends in limits.items()}


def _cell(**fields):
    """An action that sets fields of the cell, each a function of the size."""
    return lambda specimen, size, drawn: specimen.with_cell(
        **{name: value(size) for name, value in fields.items()}
    )


def _meter(**fields):
    """The same of the meter."""
    return lambda specimen, size, drawn: specimen.with_meter(
        **{name: value(size) for name, value in fields.items()}
    )


def _itself(size):
    return size


def _course_of(specimen, elements, shape):
    """The specimen with courses of some elements times a shape over SoC, positive everywhere."""
    courses = tuple(
        course * np.maximum(shape, 0.1) if k in elements else course
        for k, course in enumerate(specimen.cell.course)
    )
    return specimen.with_cell(course=courses)


def _steps(specimen, size, drawn):
    """Two steps of the ohmic resistance over SoC, each within 2 % SoC."""
    rise = sum(
        sign / (1 + np.exp((COURSE - drawn[name]) / 0.01))
        for name, sign in (("lower_soc", 1.0), ("upper_soc", 0.6))
    )
    return _course_of(specimen, {0}, 1 + size * (rise - rise.mean()))


def _one_element(specimen, size, drawn):
    """The ohmic resistance as a wave over SoC."""
    return _course_of(specimen, {0}, 1 + size * np.cos(2 * np.pi * (COURSE - drawn["crest_soc"])))


def _fast_pair(specimen, size, drawn):
    """The fast pair rises steeply below a state of charge."""
    shape = 0.5 * (1 - np.tanh((COURSE - drawn["bend_soc"]) / 0.12))
    return _course_of(specimen, {1}, 1 + size * (shape - shape.mean()))


def _line(elements):
    return lambda specimen, size, drawn: _course_of(specimen, elements, 1 + size * (0.5 - COURSE))


def _energies(specimen, size, drawn):
    """Each element has an activation energy of its own, kinetics more than the ohmic part."""
    return specimen.with_cell(energy=(0.4 * size, 1.5 * size, size, size))


def _play(specimen, size, drawn):
    """Play operators of several widths in parallel, after Prandtl and Ishlinskii."""
    weight = np.array([0.1, 0.15, 0.25, 0.3, 0.2])
    return specimen.with_cell(play_volt=tuple((size * weight / weight.sum()).tolist()))


def _two_nodes(specimen, size, drawn):
    """Core and can; the resistances follow the core."""
    return specimen.with_cell(
        core=(0.6 * size, 150.0), can=(0.4 * size, 900.0), energy=(22e3, 38e3, 30e3, 30e3)
    )


def _own_heat(specimen, size, drawn):
    """One thermal mass; resistances follow the cell's own rise alone."""
    return specimen.with_cell(core=(size, 420.0), can=(1e-6, 10.0), own_energy=26e3)


def _diffusion(specimen, size, drawn):
    return specimen.with_cell(
        depletion_volt=size,
        diffusion_second=drawn["diffusion_second"],
        diffusion_slope=drawn["slope"],
    )


def _kinetics(specimen, size, drawn):
    """Asymmetric kinetics whose exchange current is largest half full; `size`: rated over I₀."""
    soc = np.clip(COURSE, 0.02, 0.98)
    course = (2 * np.sqrt(soc * (1 - soc))) ** drawn["bulge"]
    ampere = specimen.cell.rating.capacity_ampere_hour / size
    symmetry = drawn["symmetry"]
    return specimen.with_cell(exchange_ampere=ampere, exchange_course=course, symmetry=symmetry)


def _simple_kinetics(specimen, size, drawn):
    ampere = specimen.cell.rating.capacity_ampere_hour / size
    return specimen.with_cell(exchange_ampere=ampere, exchange_course=ONE, symmetry=0.5)


def _waves(specimen, size, drawn):
    """Entropy of two waves over SoC."""
    angle = 2 * np.pi * (COURSE + drawn["phase_soc"])
    return specimen.with_cell(entropy=size * (np.sin(angle) + 0.6 * np.cos(2 * angle)))


def _third_pair(specimen, size, drawn):
    """A slow third pair; where there was one, its resistance goes to the second."""
    cell, second = specimen.cell, drawn["time_constant_second"]
    r = (cell.r[0], cell.r[1], cell.r[2] + cell.r[3], size)
    return specimen.with_cell(r=r, tau=(cell.tau[0], cell.tau[1], second))


def _older_at_capacity(specimen, size, drawn):
    """The capacity has changed since the capacity and the slow test."""
    now = specimen.cell.ampere_hour * (1 + size)
    return specimen._replace(earlier=specimen.cell).with_cell(ampere_hour=now)


OTHER = {
    "play_operators": Form(
        *("hysteresis_one_state", "amplitude_volt", 8e-3, 0.06, _play),
        parts=("hysteresis_instant",),
    ),
    "resistance_steps": Form(
        *("resistance_soc", "amount_relative", 0.3, 2.5, _steps),
        _uniform(lower_soc=(0.3, 0.42), upper_soc=(0.62, 0.78)),
    ),
    "ohmic_wave": Form(
        *("resistance_soc", "amount_relative", 0.2, 0.85, _one_element),
        _uniform(crest_soc=(0.0, 1.0)),
    ),
    "fast_pair_bend": Form(
        *("polarisation_soc", "amount_relative", 0.5, 4.0, _fast_pair),
        _uniform(bend_soc=(0.3, 0.6)),
        parts=("resistance_soc",),
    ),
    "three_energies": Form(
        *("resistance_temperature", "activation_energy_joule_per_mole", 8e3, 60e3, _energies),
        parts=("self_heating",),
    ),
    "two_node_heat": Form(
        *("self_heating", "thermal_resistance_kelvin_per_watt", 4.0, 40.0, _two_nodes),
        parts=("resistance_temperature",),
        layouts=("one",),
    ),
    "finite_volumes": Form(
        *("slow_diffusion", "depletion_volt", 0.02, 0.4, _diffusion),
        _uniform(diffusion_second=(8e3, 4e4), slope=(-1.6, 1.6)),
        parts=("polarisation_soc",),
    ),
    "asymmetric_kinetics": Form(
        *("charge_transfer_nonlinearity", "rated_per_exchange_current", 2.0, 60.0, _kinetics),
        _uniform(symmetry=(0.3, 0.42), bulge=(0.6, 1.2)),
        parts=("resistance_asymmetry", "resistance_soc", "polarisation_soc"),
    ),
    "entropy_waves": Form(
        *("entropic_ocv", "coefficient_volt_per_kelvin", 2e-4, 2e-3, _waves),
        _uniform(phase_soc=(0.0, 1.0)),
    ),
    "leak_over_soc": Form(
        *("leakage", "leak_ampere", 0.01, 0.3),
        _cell(leak=lambda a: a * np.exp(2.5 * (COURSE - 1))),
        over_hours=True,
    ),
    "capacity_bend": Form(
        "capacity_temperature",
        "share_lost_in_the_cold",
        0.03,
        0.25,
        _cell(ampere_hour_bend=lambda share: (share, 9.0)),
    ),
    "charge_asymmetry_over_soc": Form(
        "resistance_asymmetry",
        "charge_resistance_excess",
        0.3,
        3.0,
        _cell(on_charge=lambda a: a * (1 + 0.6 * np.cos(np.pi * COURSE))),
    ),
    "late_voltage": Form(
        "time_skew",
        "voltage_delay_second",
        0.1,
        1.5,
        _meter(skew_second=_itself),
        either_sign=True,
    ),
    "warming_offset": Form(
        "current_offset",
        "offset_ampere",
        0.02,
        0.3,
        lambda specimen, size, drawn: specimen.with_meter(offset_ampere=size, warm_share=0.4),
        either_sign=True,
        over_hours=True,
    ),
    "capacity_since_test": Form(
        *("capacity_error", "relative", 0.03, 0.05, _older_at_capacity), either_sign=True
    ),
}
SIMPLE = {
    "constant_gap": Form(
        "hysteresis_instant", "amplitude_volt", 4e-3, 0.05, _cell(gap_volt=_itself)
    ),
    "one_loop": Form(
        "hysteresis_one_state", "amplitude_volt", 8e-3, 0.08, _cell(loop_volt=_itself)
    ),
    "ohmic_line": Form("resistance_soc", "amount_relative", 0.3, 1.7, _line({0})),
    "pairs_line": Form("polarisation_soc", "amount_relative", 0.4, 1.7, _line({1, 2, 3})),
    "third_pair": Form(
        *("slow_diffusion", "resistance_ohm", 4e-3, 0.08, _third_pair),
        _uniform(time_constant_second=(700.0, 2200.0)),
    ),
    "symmetric_kinetics": Form(
        *("charge_transfer_nonlinearity", "rated_per_exchange_current", 2.0, 60.0),
        _simple_kinetics,
    ),
    "one_energy": Form(
        "resistance_temperature",
        "activation_energy_joule_per_mole",
        8e3,
        60e3,
        _cell(energy=lambda joule: (joule,) * 4),
        parts=("self_heating",),
    ),
    "constant_entropy": Form(
        "entropic_ocv",
        "coefficient_volt_per_kelvin",
        2e-4,
        2e-3,
        _cell(entropy=lambda a: a * ONE),
        either_sign=True,
    ),
    "own_heat": Form(
        *("self_heating", "thermal_resistance_kelvin_per_watt", 4.0, 40.0, _own_heat),
        layouts=("wide", "one"),
    ),
    "constant_leak": Form(
        *("leakage", "leak_ampere", 0.01, 0.3, _cell(leak=lambda a: a * ONE)), over_hours=True
    ),
    "constant_asymmetry": Form(
        *("resistance_asymmetry", "charge_resistance_excess_relative", 0.3, 3.0),
        _cell(on_charge=lambda a: a * ONE),
    ),
    "constant_offset": Form(
        "current_offset",
        "offset_ampere",
        0.02,
        0.3,
        _meter(offset_ampere=_itself),
        either_sign=True,
        over_hours=True,
    ),
    "constant_gain": Form(
        "voltage_gain", "gain_relative", 2e-3, 0.03, _meter(gain_volt=_itself), either_sign=True
    ),
}
OUTSIDE = {
    "opening_contact": Form(
        "opening_contact",
        "resistance_ohm",
        0.01,
        0.15,
        lambda specimen, size, drawn: specimen.with_cell(
            contact=(size, drawn["c_rate"] * specimen.cell.rating.capacity_ampere_hour)
        ),
        _uniform(c_rate=(0.9, 1.6)),
    ),
    "ageing_within": Form(
        "ageing_within", "growth_relative", 0.3, 0.3, _cell(growth=_itself), fixed=True
    ),
    "stripping_plateau": Form(
        *("stripping_plateau", "plateau_volt", 0.02, 0.3, _cell(plating_volt=_itself)),
        layouts=("cold",),
    ),
    "inductive_pick_up": Form(
        *("inductive_pick_up", "volt_second_per_ampere", 1e-3, 0.02),
        _meter(inductive_volt=_itself),
    ),
    "periodic_pick_up": Form(
        "periodic_pick_up",
        "amplitude_volt",
        4e-3,
        0.05,
        lambda specimen, size, drawn: specimen.with_meter(ripple=(size, drawn["period_second"])),
        _uniform(period_second=(500.0, 1500.0)),
    ),
}
# The right answer is none, or a name that says the fault itself.
SHEETS = {
    "temperature_5_kelvin": Form(
        *("sheet_temperature", "error_kelvin", 5.0, 5.0, _meter(sheet_kelvin=_itself)), fixed=True
    ),
    "rating_10_percent": Form(
        *("sheet_rating", "error_relative", 0.1, 0.1, _meter(rating_share=_itself)), fixed=True
    ),
    "drift_3_millivolt": Form(
        "voltmeter_drift", "volt_a_test", 3e-3, 3e-3, _meter(drift_volt=_itself), fixed=True
    ),
    "file_4_millivolt": Form(
        "voltage_offset", "offset_volt", 4e-3, 4e-3, _meter(file_volt=_itself), fixed=True
    ),
    "start_5_percent": Form(
        *("sheet_start", "error_soc", 0.05, 0.05, _meter(start_soc=_itself)), fixed=True
    ),
}
FORMS = OTHER | SIMPLE | OUTSIDE | SHEETS
# Effects that only a change of temperature shows: on records at one temperature they are unproven.
NEED_TEMPERATURE = ("three_energies", "entropy_waves", "capacity_bend")
# Of which two may be in one cell: each shows by its own dynamics.
PAIRED = (
    *("play_operators", "resistance_steps", "three_energies", "finite_volumes", "entropy_waves"),
    *("charge_asymmetry_over_soc", "late_voltage", "warming_offset"),
)
