"""One 32 Ah LMO cell from 25 to −20 °C (S6 to S10), and 29 cycles in a room (S4)."""

from functools import partial

from virtual_lab import ageing, cells, protocols, stock
from virtual_lab.campaigns.thesis.pack import CHAIN
from virtual_lab.chamber import room, steady
from virtual_lab.plan import Cell, Test
from virtual_lab.protocols.rests import THESIS_CELSIUS
from virtual_lab.specimens import Behavioural, Physical

KIND = "E"
RATING = ageing.KINDS[KIND].rating
CAPACITY_CELSIUS = (25, 10, 0, -10, -20)
PULSE_CELSIUS = (20, 10, 0, -10, -20)
SLOW_CELSIUS = (20, 0, -20)
STEP_SOC = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.2, 0.1)
ROOM_KIND, ROOM_CYCLES, ROOM_CELSIUS, ROOM_SWING_KELVIN = "C", 29, 24.0, 4.0
COLD_SHARE = 0.75  # of the capacity is pulsed: in the cold a discharge at C/3 ends early
REFERENCE_CELSIUS = 25.0


def tests_and_cells(seed: int) -> tuple[list[Cell], list[Test]]:
    """E3 by the fast equations, E4 by physics, C6 in the room."""
    behavioural = _behavioural()
    physical = Physical(_porous())
    in_room = Behavioural(partial(stock.cell, ROOM_KIND))
    rows = [
        Cell("E3", "LMO", RATING, behavioural, reference=True, note="temperature"),
        Cell("E4", "LMO", RATING, physical, note="temperature, slow charges by physics"),
        Cell("C6", "NMC", ageing.KINDS[ROOM_KIND].rating, in_room, note="29 cycles in a room"),
    ]
    tests = [*_of_fast_cell(behavioural, seed), *_slow_charges(physical, seed)]
    return rows, [*tests, _room_test(in_room, seed)]


def _behavioural():
    circuit = stock.CIRCUITS[KIND]
    energy = {"parameter": "activation_energy", "law": "arrhenius", "unit": "J/mol"}
    first = "resistance at 50 % SoC, first sample"
    known = {"temperature": [{"quantity": first, **energy, "value": circuit.ohmic}]}
    temperatures = tuple(float(celsius) for celsius in PULSE_CELSIUS)
    return Behavioural(partial(stock.cell, KIND), temperatures, lambda: known)


def _porous():
    sheet = ageing.KINDS[KIND]
    return cells.Cell(
        lli=0.0,
        lam_negative=0.0,
        lam_positive=0.0,
        contact_resistance_ohm=0.3 * sheet.fresh_ohm,
        kinetics=1.0,
        capacity_ampere_hour=sheet.fresh_ampere_hour,
        cycle=None,
        note="fresh",
        chemistry=sheet.chemistry,
        rating=sheet.rating,
        entropy=1.0,
    )


def _at(name, specimen, seed):
    return partial(
        Test,
        name,
        instrument="parquet",
        specimen=specimen,
        chain=CHAIN,
        batch=name,
        seed_of_campaign=seed,
    )


def _of_fast_cell(specimen, seed):
    at, full = _at("E3", specimen, seed), ageing.KINDS[KIND].fresh_ampere_hour
    rests, chamber = protocols.temperature_steps(RATING, full, soc=STEP_SOC)
    found = [
        at("ocv_25C", "ocv", 25.0, steps=protocols.slow_ocv(RATING, period_second=60.0)),
        at("ocv_steps", "ocv_temperature", THESIS_CELSIUS[0], steps=rests, chamber=chamber),
    ]
    for celsius in CAPACITY_CELSIUS:
        half = protocols.capacity(RATING, repeats=1)
        quick = partial(_fast_charge, specimen, celsius)
        found += [
            at(f"capacity_{celsius}C", "capacity", celsius, steps=half),
            at(f"fast_charge_{celsius}C", "fast_charge", celsius, steps=quick),
        ]
    for celsius in PULSE_CELSIUS:
        on_discharge = protocols.pulses_on_discharge(RATING, COLD_SHARE * full)
        pulses = protocols.hybrid_pulses(RATING, full, highest_charge_pulse_soc=0.6)
        found += [
            at(f"pulses_{celsius}C", "pulse_resistance", celsius, steps=on_discharge),
            at(f"hppc_{celsius}C", "hppc", celsius, steps=pulses),
            at(
                f"rests_{celsius}C",
                "relaxation",
                celsius,
                steps=protocols.relaxations(RATING, full),
            ),
            at(f"udds_{celsius}C", "drive", celsius, steps=_drive(full)),
        ]
    return found


def _fast_charge(specimen, celsius):
    """2C to the upper cut-off, held for what is left of half an hour."""
    return protocols.fast_charge(RATING, run=partial(specimen.run, chamber=steady(celsius)))


def _drive(full):
    return protocols.drive(RATING, full, schedule="udds", scale=0.5, deepest_soc=0.2)


def _slow_charges(specimen, seed):
    """C/30, at which what is missing in the cold is truly missing (S9)."""
    at = _at("E4", specimen, seed)
    steps = protocols.incremental_capacity(
        RATING, c_rate=1 / 30, emptying_c_rate=1 / 30, period_second=30.0
    )
    return [
        at(f"ica_{celsius}C", "ica", celsius, steps=steps, batch=f"E4_{celsius}".replace("-", "m"))
        for celsius in SLOW_CELSIUS
    ]


def _room_test(specimen, seed):
    rating = ageing.KINDS[ROOM_KIND].rating
    steps = protocols.ageing_cycles(rating, "standard", cycles=ROOM_CYCLES, period_second=20.0)
    around = room(
        ROOM_CELSIUS,
        swing_kelvin=ROOM_SWING_KELVIN,
        duration_second=5 * 3600.0 * ROOM_CYCLES,
        drift_kelvin=0.3,
        seed=seed,
    )
    at = _at("C6", specimen, seed)
    return at("room", "ageing", ROOM_CELSIUS, steps=steps, chamber=around)
