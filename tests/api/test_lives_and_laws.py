"""Lives and laws through the public interface: what is known of simulated cells comes back."""

import numpy as np
import pandas as pd
import pytest

import cellwright as cw

CELL = {"cell": "A", "rated_capacity_ampere_hour": 2.0, "lower_cutoff_volt": 3.0}
CELL |= {"upper_cutoff_volt": 4.2}


def cycles_of(fade, *, count=300, start=2.0, noise=1e-3, warmer=None):
    """Columns of `ageing_cycles`: a linear fade [1/cycle], and 0.5 %/K of a room's temperature."""
    cycle = np.arange(1.0, count + 1)
    kelvin = np.zeros(count) if warmer is None else warmer(cycle)
    scatter = np.random.default_rng(0).normal(0, noise, count)
    size = start * (1 - fade * cycle) * (1 + 0.005 * kelvin) + scatter
    columns = {"cycle": cycle, "direction": np.full(count, "discharge"), "c_rate": np.ones(count)}
    columns |= {"start_time_second": 7200 * cycle, "duration_second": np.full(count, 3600.0)}
    columns |= {"capacity_ampere_hour": size, "energy_watt_hour": 3.6 * size}
    nothing = dict.fromkeys(
        ["coulombic_efficiency", "temperature_mean_celsius"], np.full(count, np.nan)
    )
    read = dict.fromkeys(["room_temperature_celsius", "temperature_start_celsius"], 25.0 + kelvin)
    return columns | nothing | read


def test_a_fade_is_found_from_columns_and_from_a_frame():
    columns = cycles_of(4e-4)
    test = {"test": "life", "kind": "ageing", "ambient_temperature_celsius": 25.0}
    found = cw.fade([(test, columns, None)], CELL)
    assert found.summary["soh"] == pytest.approx(1 - 0.12, abs=0.005)
    again = cw.fade([(test, pd.DataFrame(columns), None)], CELL)
    pd.testing.assert_frame_equal(found.to_frame(), again.to_frame())
    (row,) = [r for r in cw.state_of_health(fade=found).rows if r["cycle"] == 300.0]
    assert row["soh"] == pytest.approx(found.summary["soh"], abs=0.005)


def test_a_fade_of_capacities_says_what_it_wants():
    """Results of `capacity` look like cycles, and are of tests far apart."""
    row = {"direction": ["discharge"], "c_rate": [1.0], "capacity_ampere_hour": [2.9]}
    with pytest.raises(cw.Refusal, match=r"start_time_second.*; `ageing_cycles` makes it"):
        cw.fade([({"test": "capacity_25C", "kind": "capacity"}, row, None)], CELL)


def test_temperature_is_taken_out_of_a_fade():
    """Of a room that goes up and down by 3 K within the twelve cycles of a day."""
    columns = cycles_of(4e-4, warmer=lambda cycle: 3 * np.sin(2 * np.pi * cycle / 12))
    test = {"test": "life", "kind": "ageing", "ambient_temperature_celsius": 25.0}
    laws = cw.ageing_over_temperature(columns, test)
    low, high = (laws.summary[f"slope_{end}_percent_per_kelvin"] for end in ("lower", "upper"))
    assert low < 0.5 < high
    found = cw.fade([(test, columns, laws)], CELL)
    pair = cw.fade([(test, columns, (laws.summary, laws.cycles))], CELL)
    assert repr(found) == repr(pair)
    shifted = found.columns["at_reference_ampere_hour"] - found.columns["capacity_ampere_hour"]
    assert np.ptp(shifted) == pytest.approx(0.005 * 2.0 * 6, rel=0.05)


def test_protocols_differ_by_the_factor_of_their_cycles():
    """Cells of each protocol differ by 2 %, the protocols by a factor of two."""
    lives = []
    for protocol, fade in (("slow", 4e-4), ("fast", 8e-4)):
        for k in range(3):
            columns = cycles_of(fade * (1 + 0.02 * (k - 1)), noise=1e-4)
            found = cw.fade([({"test": "life", "kind": "ageing"}, columns, None)], CELL)
            lives.append((f"{protocol}{k}", protocol, found))
    (row,) = cw.compare_protocols(lives).rows
    assert max(row["ratio"], 1 / row["ratio"]) == pytest.approx(2.0, rel=0.05)
    with pytest.raises(cw.Refusal):
        cw.compare_protocols(lives[:3])


def fast_charges(celsius):
    share = 1 / (1 + np.exp(2000 * (1 / (celsius + 273.15) - 1 / 298.15)))
    row = {"ambient_temperature_celsius": celsius, "cycle": None, "c_rate": 1.0, "minutes": 30.0}
    row |= {"share": share, "constant_current_share": 0.5, "minutes_to_80": np.nan}
    return row | {"from_empty": True, "test": f"t{celsius:g}"}


def test_what_is_charged_follows_its_law_and_points_of_no_law_stay():
    found = cw.fast_charge_laws([fast_charges(celsius) for celsius in (0.0, 10.0, 25.0, 40.0)])
    energy = found.to_frame().query("parameter == 'activation_energy'")
    of_ratio = energy[energy["quantity"].str.startswith("charged over not")]
    assert abs(of_ratio["value"].iloc[0]) == pytest.approx(2000 * 8.314462618, rel=1e-3)
    with pytest.raises(cw.Refusal):
        cw.fast_charge_laws([fast_charges(celsius) for celsius in (0.0, 25.0)])


def test_thermometers_are_compared_where_both_have_read():
    tests = [{"test": f"t{k}", "kind": "eis", "ambient_temperature_celsius": 25.0} for k in (1, 2)]
    spectra = [(test, {"temperature_celsius": 26.5 + 0.2 * k}) for k, test in enumerate(tests)]
    time = np.arange(0.0, 7200.0, 60.0)
    rest = {"test_time_second": time, "current_ampere": 0 * time}
    series = [(test, rest | {"surface_temperature_celsius": 25.1 + 0 * time}) for test in tests]
    (row,) = cw.thermometer(spectra, series).rows
    assert row["offset_kelvin"] == pytest.approx(1.5)


def test_a_fleet_tells_the_capacity_of_a_cell_from_its_resistances():
    """R0 falls by 0.1 mΩ/Ah; the line has that slope."""
    cells = []
    for k in range(10):
        size, noise = 20.0 + k, 1e-6 * (-1) ** k
        means = dict.fromkeys(("resistance_mean_ohm", "resistance_mean_1s_ohm"), np.nan)
        first = {"cycle": 0.0, "capacity_ampere_hour": size, "first_delay_second": 0.01} | means
        growth = [
            {"cycle": 0.0, "direction": "discharge", "delay_second": 0.0, "soc": soc}
            | {"resistance_ohm": 5e-3 - 1e-4 * size + noise, "factor": 1.0, "factor_std": 0.0}
            for soc in (0.2, 0.5, 0.8)
        ]
        cells.append((f"P{k}", first, growth))
    found = cw.fleet_resistance(cells)
    assert found.line["slope_ohm_per_ampere_hour"] == pytest.approx(-1e-4, rel=0.02)
    assert len(found.rows) == 10
