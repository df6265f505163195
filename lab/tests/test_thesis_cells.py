"""The thesis' cells: ageing as told, circuits, losses, and the spectra of table 3.1."""

import numpy as np
import pytest

from virtual_lab import electrodes, fast, protocols, thesis_cells
from virtual_lab.chamber import steady
from virtual_lab.electrodes import HALF_CELLS
from virtual_lab.protocols import Step
from virtual_lab.thesis_cells import TabulatedCircuit, circuit_at, impedance_ohm

LIVES = [(kind, protocol) for kind in thesis_cells.CELL_TYPES for protocol in protocols.AGEING]
CHECK_UPS = np.linspace(0.0, 1.0, 26)


def states(kind, protocol, shares=CHECK_UPS):
    last = thesis_cells.last_cycle(kind, protocol)
    return np.array([thesis_cells.ageing_state(kind, protocol, share * last) for share in shares])


def remaining(kind, protocol, cycle):
    """Capacity at rest [1] of the electrodes that are left, over the fresh ones'."""
    made = thesis_cells.CELL_TYPES[kind]
    lost = thesis_cells.ageing_state(kind, protocol, cycle)
    losses = {name: getattr(lost, name) for name in ("lli", "lam_negative", "lam_positive")}
    left = electrodes.window(made.chemistry, made.rating, **losses)
    fresh = electrodes.window(made.chemistry, made.rating)
    return left.capacity_ampere_hour / fresh.capacity_ampere_hour


@pytest.mark.parametrize(
    ("cycle", "told_ampere_hour"), [(0, 19.56), (200, 19.66), (1200, 16.0), (1250, 9.0)]
)
def test_capacity_of_the_ncm_cell(cycle, told_ampere_hour):
    """Section 4.3, cell EIG #3 (at 200 cycles #1, whose pattern was the same)."""
    found = thesis_cells.CELL_TYPES["C"].fresh_ampere_hour * remaining("C", "standard", cycle)
    assert found == pytest.approx(told_ampere_hour, rel=0.001)


@pytest.mark.parametrize(("cycle", "told"), [(300, 0.95), (500, 0.92), (900, 0.83)])
def test_capacity_of_the_lfp_cell(cycle, told):
    """Figure 4.15."""
    assert remaining("B", "standard", cycle) == pytest.approx(told, abs=1e-6)


def test_resistance_of_the_ncm_cell():
    """+0.2 mΩ in 1100 cycles, +0.4 mΩ more until 1200, four times the fresh 2 mΩ at the end."""
    factors = [
        thesis_cells.ageing_state("C", "standard", cycle).resistance_factor
        for cycle in (0, 900, 1100, 1200)
    ]
    ohm = thesis_cells.CELL_TYPES["C"].fresh_ohm * np.array(factors)
    assert ohm - ohm[0] == pytest.approx([0.0, 0.0, 0.0002, 0.0006], abs=0.00003)
    assert thesis_cells.ageing_state("C", "standard", 1250).resistance_factor == pytest.approx(4.0)


def test_knees():
    told = {("C", "standard"): 1200, ("C", "fast_charge"): 300, ("B", "standard"): 850}
    for life, cycle in told.items():
        assert thesis_cells.knee_cycle(*life) == cycle
        before, knee, after = (
            thesis_cells.capacity_share(*life, cycle + step) for step in (-50, 0, 50)
        )
        assert knee - after > 1.2 * (before - knee)
    assert thesis_cells.knee_cycle("C", "high_power") is None


@pytest.mark.parametrize(("kind", "protocol"), LIVES)
def test_a_cell_only_wears_after_its_early_rise(kind, protocol):
    life = states(kind, protocol)
    worn = CHECK_UPS >= 0.25
    assert (np.diff(life[worn, :4], axis=0) >= -1e-9).all()
    assert (np.diff(life[:, 4]) <= 1e-12).all()
    assert life[0] == pytest.approx([0, 0, 0, 1, 1], abs=1e-8)
    assert life[:, 0].min() > -0.01


@pytest.mark.parametrize(("kind", "protocol"), LIVES)
def test_losses_leave_the_capacity_that_is_told(kind, protocol):
    for cycle in (0.3, 0.7, 1.0) * np.array(thesis_cells.last_cycle(kind, protocol)):
        share = thesis_cells.capacity_share(kind, protocol, cycle)
        assert remaining(kind, protocol, cycle) == pytest.approx(share, abs=1e-7)


def test_there_is_no_state_beyond_the_last_cycle():
    with pytest.raises(ValueError, match="lived 0 to 1250 cycles, asked: 1300"):
        thesis_cells.ageing_state("C", "standard", 1300)


every_kind = pytest.mark.parametrize("kind", thesis_cells.CIRCUITS)
MIDDLE = np.array([0.5])


def _resistance(cell, *, celsius=25.0, soc=MIDDLE):
    """At once, after 10 s, in the long run [ohm], shape (3, soc)."""
    return np.array(list(fast.resistances(cell, soc, celsius=celsius).values()))


@every_kind
def test_a_slow_discharge_gives_a_little_more_than_one_at_half_rate(kind):
    """C/20 from full to the lower cut-off."""
    cell = thesis_cells.cell(kind)
    slow = protocols.discharge(cell.rating, 1 / 20, period_second=600.0)
    (run,) = fast.run([slow], cell, chamber=steady(25.0))
    end = float(run.voltage(run.duration_second))
    assert end == pytest.approx(cell.rating.lower_cutoff_volt, abs=1e-3)
    taken = -float(run.charge(run.duration_second))
    told = thesis_cells.CELL_TYPES[kind].fresh_ampere_hour
    assert told < taken < 1.04 * told
    # All that lies between the cut-offs at rest but what so small a current cannot reach.
    assert taken == pytest.approx(cell.capacity_ampere_hour, rel=3e-3)


@every_kind
def test_table_of_voltage_is_that_of_the_half_cells(kind):
    """Positive against negative, by the lithium that each holds; from cut-off to cut-off."""
    sheet, cell = (
        thesis_cells.CELL_TYPES[kind],
        thesis_cells.cell(kind, lli=0.05, lam_positive=0.03),
    )
    made = electrodes.CHEMISTRIES[sheet.chemistry]
    window = electrodes.window(sheet.chemistry, sheet.rating, lli=0.05, lam_positive=0.03)
    positive, negative = HALF_CELLS[made.positive], HALF_CELLS[made.negative]
    soc = np.linspace(0.0, 1.0, 41)
    # The type gives what the thesis measured, not what its data sheet says: all in proportion.
    moved = soc * window.capacity_ampere_hour
    y = window.y_0 - moved / window.positive_ampere_hour
    x = window.x_0 + moved / window.negative_ampere_hour
    expected = positive.potential_volt(y) - negative.potential_volt(x)
    shown = fast.rested_volt(cell, soc, celsius=25.0)
    np.testing.assert_allclose(shown, expected, atol=2e-4)
    limits = (sheet.rating.lower_cutoff_volt, sheet.rating.upper_cutoff_volt)
    assert shown[[0, -1]] == pytest.approx(limits, abs=1e-4)
    assert (np.diff(shown) > 0).all()


@pytest.mark.parametrize("kind", ["C", "D"])
@pytest.mark.parametrize("share", [0.95, 0.8, 0.65])
@pytest.mark.parametrize("lam_positive", [0.0, 0.04])
def test_losses_found_leave_the_capacity_asked(kind, share, lam_positive):
    sheet = thesis_cells.CELL_TYPES[kind]
    losses = thesis_cells.worn(kind, share * sheet.fresh_ampere_hour, lam_positive=lam_positive)
    left = thesis_cells.cell(kind, **losses).capacity_ampere_hour
    assert left == pytest.approx(share * thesis_cells.cell(kind).capacity_ampere_hour, rel=1e-6)
    assert losses["lam_positive"] == lam_positive
    assert losses["lam_negative"] == 0.5 * lam_positive
    # What the positive electrode gives between the cut-offs is the capacity, whoever lost what.
    fresh = electrodes.window(sheet.chemistry, sheet.rating)
    aged = electrodes.window(sheet.chemistry, sheet.rating, **losses)
    given = fresh.positive_ampere_hour * (1 - lam_positive) * (aged.y_0 - aged.y_100)
    assert given == pytest.approx(share * fresh.capacity_ampere_hour, rel=1e-6)


def test_a_cell_with_more_than_its_type_gives_is_a_larger_one():
    fresh = thesis_cells.CELL_TYPES["D"].fresh_ampere_hour
    assert thesis_cells.worn("D", 1.07 * fresh, lam_positive=0.0) == {"size": pytest.approx(1.07)}
    larger = thesis_cells.cell("D", **thesis_cells.worn("D", 1.07 * fresh, lam_positive=0.0))
    assert larger.capacity_ampere_hour == pytest.approx(
        1.07 * thesis_cells.cell("D").capacity_ampere_hour
    )
    lost = [
        thesis_cells.worn("D", share * fresh, lam_positive=0.0)["lli"] for share in (0.9, 0.8, 0.7)
    ]
    assert lost == sorted(lost)
    with pytest.raises(ValueError, match="sign"):
        thesis_cells.worn("D", 0.05 * fresh, lam_positive=0.0)


@pytest.mark.parametrize("kind", ["B", "C", "D", "E"])
def test_a_fresh_cell_gives_at_half_rate_what_the_thesis_measured(kind):
    """Figures 4.8 and 4.21: 19.56 Ah (C), 29.5 Ah (D); within 2 %."""
    made, sheet = thesis_cells.cell(kind), thesis_cells.CELL_TYPES[kind]
    step = Step(
        "current", -sheet.rating.ampere(0.5), 12_000.0, 60.0, sheet.rating.lower_cutoff_volt
    )
    (found,) = fast.run([step], made, chamber=steady(25.0))
    given = -found.charge(found.duration_second)
    assert given == pytest.approx(sheet.fresh_ampere_hour, rel=0.02)


@every_kind
def test_resistance_grows_in_the_cold_and_near_empty(kind):
    cell = thesis_cells.cell(kind)
    colder = [_resistance(cell, celsius=celsius) for celsius in (40.0, 25.0, 10.0, -20.0)]
    assert (np.diff(colder, axis=0) > 0).all()
    over_soc = _resistance(cell, soc=np.array([0.02, 0.2, 0.5]))
    assert (np.diff(over_soc, axis=1) < 0).all()


def test_activation_energies_are_those_of_table_3_1():
    """E: Rs and Rct of the printed table over 20 and −10 °C, by Arrhenius' law."""
    cell = thesis_cells.cell("E")
    printed = {"ohmic": (3.05e-3, 2.02e-3), "transfer": (1.74e-2, 6.48e-4)}
    energy = {
        name: 8.314 * np.log(cold / warm) / (1 / 263.15 - 1 / 293.15)
        for name, (cold, warm) in printed.items()
    }
    assert cell.r0_activation_joule_per_mole == pytest.approx(energy["ohmic"], abs=2e3)
    assert cell.pair_activation_joule_per_mole[0] == pytest.approx(energy["transfer"], abs=3e3)


@pytest.mark.parametrize(("kind", "protocol"), sorted(thesis_cells.AGEING_LAWS))
def test_resistance_grows_with_age(kind, protocol):
    cycles = np.linspace(0, thesis_cells.last_cycle(kind, protocol), 6)
    aged = [_resistance(thesis_cells.aged(kind, protocol, cycle)) for cycle in cycles]
    assert (np.diff(aged, axis=0) > 0).all()
    grown = aged[-1][0, 0] / aged[0][0, 0]
    assert grown == pytest.approx(thesis_cells.AGEING_LAWS[kind, protocol].points[-1][2], rel=1e-6)


def test_a_life_under_the_standard_protocol_is_that_of_figure_4_10():
    """19.56 Ah fresh, some 16 Ah at 1200 cycles, 9 Ah at 1250: the knee is in the capacity."""
    capacity = {
        c: thesis_cells.aged("C", "standard", c).capacity_ampere_hour for c in (0, 900, 1200, 1250)
    }
    shares = {cycle: value / capacity[0] for cycle, value in capacity.items()}
    assert shares[1200] == pytest.approx(16 / 19.56, abs=0.005)
    assert shares[1250] == pytest.approx(9 / 19.56, abs=0.005)
    before = (shares[900] - shares[1200]) / 300
    after = (shares[1200] - shares[1250]) / 50
    assert after > 10 * before > 0
    assert thesis_cells.knee_cycle("C", "standard") == pytest.approx(1200, abs=50)


def test_fast_charge_wears_a_cell_out_first():
    """Figure 4.12: what takes the standard protocol 1200 cycles takes fast charge 300."""
    left = [
        thesis_cells.aged("C", p, 340).capacity_ampere_hour for p in ("standard", "fast_charge")
    ]
    assert left[1] < 0.7 * left[0]


def test_an_aged_cell_stores_less_and_sags_more():
    """Under the same 1C, from the same state of charge."""
    load = [Step("current", -20.0, 60.0, 1.0)]
    sag = []
    for cycle in (0, 1200):
        (run,) = fast.run(load, thesis_cells.aged("C", "standard", cycle), chamber=steady(25.0),
                          initial_soc=0.5)  # fmt: skip
        rest = fast.rested_volt(thesis_cells.aged("C", "standard", cycle), MIDDLE, celsius=25.0)[0]
        sag.append(rest - float(run.voltage(60.0)))
    # 30 % more resistance after 1200 cycles (2.0 to 2.6 milliohm).
    assert 1.2 * sag[0] < sag[1] < 1.6 * sag[0]


@every_kind
def test_heat_is_what_the_voltage_has_lost(kind):
    """Two minutes of 2C, too short for much of the heat to leave; entropy put aside."""
    cell = thesis_cells.cell(kind)._replace(entropic_volt_per_kelvin=0.0)
    ampere = cell.rating.ampere(2.0)
    load = [Step("current", -ampere, 120.0, 1.0)]
    (run,) = fast.run(load, cell, chamber=steady(25.0), initial_soc=0.8)
    second = np.linspace(0.0, 120.0, 241)
    soc = 0.8 - ampere * second / 3600 / cell.capacity_ampere_hour
    lost_watt = ampere * (fast.rested_volt(cell, soc, celsius=25.0) - run.voltage(second))
    all_of_it = np.trapezoid(lost_watt, second) / cell.heat_capacity_joule_per_kelvin
    outside = cell.surface_resistance_kelvin_per_watt
    share = outside / (outside + cell.core_resistance_kelvin_per_watt)
    rise = (float(run.temperature(120.0)) - 25.0) / share
    assert 0.85 * all_of_it < rise < all_of_it


def test_without_diffusion_and_spread_it_is_a_semicircle():
    randles = TabulatedCircuit(0.002, 0.001, cpe_t=10.0, cpe_p=1.0, warburg_y0=1e12)
    top_hertz = 1 / (2 * np.pi * 0.001 * 10.0)
    found = impedance_ohm(randles, np.array([1e9, top_hertz, 1e-9]))
    np.testing.assert_allclose(found, [0.002, 0.0025 - 0.0005j, 0.003], atol=1e-6)


@pytest.mark.parametrize(("soc", "celsius"), thesis_cells.conditions())
def test_limits(soc, celsius):
    parameters = circuit_at(soc, celsius)
    highest, low, lower = impedance_ohm(parameters, np.array([1e12, 1e-7, 1e-8]))
    assert highest == pytest.approx(parameters.r_ohmic_ohm, rel=1e-3)
    # Diffusion: both parts grow alike, along 45 degrees.
    assert (lower - low).real == pytest.approx(-(lower - low).imag, rel=0.02)


def test_fifteen_conditions_of_finite_capacitive_spectra():
    assert len(set(thesis_cells.conditions())) == 15
    for soc, celsius in thesis_cells.conditions():
        found = impedance_ohm(circuit_at(soc, celsius), thesis_cells.TABLE_FREQUENCY_HERTZ)
        assert (found.imag < 0).all()
        assert (np.diff(found.real) > 0).all()


@pytest.mark.parametrize(("soc", "told_kilojoule"), [(0.05, 70.2), (0.5, 70.5), (1.0, 67.7)])
def test_charge_transfer_follows_arrhenius(soc, told_kilojoule):
    """The erratum's evidence: with the header's signs turned ln Rct is linear in 1/T."""
    kelvin = 273.15 + np.array(thesis_cells.TEMPERATURES_CELSIUS)
    ohm = [circuit_at(soc, t).r_charge_transfer_ohm for t in thesis_cells.TEMPERATURES_CELSIUS]
    slope, _ = np.polyfit(1 / kelvin, np.log(ohm), 1)
    assert 8.314462618e-3 * slope == pytest.approx(told_kilojoule, abs=0.1)
    assert np.corrcoef(1 / kelvin, np.log(ohm))[0, 1] ** 2 > 0.995


def test_resistances_rise_in_the_cold():
    for soc in thesis_cells.SOCS:
        found = np.array([circuit_at(soc, t)[:2] for t in thesis_cells.TEMPERATURES_CELSIUS])
        assert (np.diff(found, axis=0) > 0).all()
        assert found[-1, 0] < 2 * found[0, 0]
        assert found[-1, 1] > 20 * found[0, 1]


def test_what_the_table_does_not_know_is_refused():
    with pytest.raises(ValueError, match=r"asked: 0\.4, 20\.0"):
        circuit_at(0.4, 20.0)
