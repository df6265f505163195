"""What must hold of any cell's results, whatever the laboratory: physics first."""

import itertools
import math


def _faults(rows, wrong, *names):
    """Rows that are wrong, as short texts."""
    who = ("cell", "group", "test")
    return [
        " ".join(str(row[n]) for n in (*who, *names) if row.get(n) is not None)
        for row in rows
        if wrong(row)
    ]


def test_resistance_is_positive_and_below_ten_ohm(table):
    """A resistance is not negative, and no cell's is tens of ohms."""
    rows = table("resistance")
    assert not _faults(rows, lambda r: not 0 < r["resistance_ohm"] < 10, "soc", "resistance_ohm")


def test_resistance_does_not_fall_within_a_pulse(table):
    """Polarisation only adds to a pulse's resistance: later delays are lower by noise at most."""
    pulses = {}
    for row in table("resistance"):
        if row["direction"].startswith("falling"):
            continue  # the load before it goes on polarising, against the answer
        key = (row["cell"], row["test"], row["start_time_second"])
        value = (row["delay_second"], row["resistance_ohm"], row["resistance_std_ohm"] or 0.0)
        pulses.setdefault(key, []).append(value)
    falling = [
        key
        for key, values in pulses.items()
        for (_, earlier, std), (_, later, later_std) in itertools.pairwise(sorted(values))
        if earlier - later > max(0.05 * earlier, 2.0 * math.hypot(std, later_std))
    ]
    assert not falling


def test_state_of_health_is_between_a_tenth_and_one_and_a_half(table):
    """No cell delivers half more than its rating, or next to nothing."""
    rows = [row for row in table("../summary") if row["soh"] is not None]
    assert not _faults(rows, lambda r: not 0.1 < r["soh"] < 1.5, "soh")


def test_coulombic_efficiency_is_near_one(table):
    """A cell gives back what it took, within what rate and temperature explain."""
    rows = [row for row in table("capacity") if row["coulombic_efficiency"] is not None]
    wrong = _faults(
        rows, lambda r: not 0.8 < r["coulombic_efficiency"] < 1.1, "coulombic_efficiency"
    )
    assert not wrong


def test_capacity_does_not_grow_in_the_cold(table):
    """At one rate and age a colder cell gives no more charge (2 % tolerance)."""
    series = {}
    for row in table("capacity"):
        if row["ambient_temperature_celsius"] is not None and row["direction"] == "discharge":
            rate = round(row["c_rate"], 2)
            key = (row["cell"], row["cycle"], rate)
            point = (row["ambient_temperature_celsius"], row["capacity_ampere_hour"])
            series.setdefault(key, []).append(point)
    growing = [
        key
        for key, points in series.items()
        if max(points)[0] - min(points)[0] > 15 and min(points)[1] > 1.02 * max(points)[1]
    ]
    assert not growing


def test_activation_energies_are_those_of_batteries(table):
    """Resistance falls with temperature, with 2 to 120 kJ/mol somewhere in the interval."""
    rows = [
        row
        for row in table("temperature")
        if row["parameter"] == "activation_energy" and "resistance" in row["quantity"]
    ]

    def wrong(row):
        low, high = (row["value"] if row[k] is None else row[k] for k in ("lower", "upper"))
        return high < 2e3 or low > 1.2e5

    assert not _faults(rows, wrong, "quantity", "value")


def test_branch_currents_add_up(table):
    """Kirchhoff: simulated branch currents sum to the total."""
    assert not _faults(table("packs"), lambda r: r["kcl_residual_ampere"] > 1e-9, "branch")


def test_models_are_within_half_a_volt(table):
    """A model half a volt off, or outside all that was measured by half a volt, has a fault."""
    tested, fitted = table("validation"), table("choice")
    wrong = _faults(tested, lambda r: r["rmse_volt"] > 0.5, "model", "rmse_volt")
    wrong += _faults(tested, lambda r: _outside(r, "beyond_volt"), "model", "beyond_volt")
    wrong += _faults(fitted, lambda r: _outside(r, "fit_beyond_volt"), "model", "fit_beyond_volt")
    assert not wrong


def _outside(row, name):
    """Whether the chosen member simulates half a volt outside what was measured."""
    return row["chosen"] and (row[name] or 0.0) > 0.5


def test_a_knee_and_an_end_of_life_lie_within_their_limits(table):
    """Lower limit, value and upper limit stand in this order, and a knee within its life."""
    rows = table("fade")
    told = [row for row in rows if row["knee_cycle"] is not None]
    wrong = _faults(
        told,
        lambda r: (
            not 0 < r["knee_lower_cycle"] <= r["knee_cycle"] <= r["knee_upper_cycle"]
            or r["knee_upper_cycle"] > r["last_cycle"]
        ),
        "knee_cycle",
    )
    told = [row for row in rows if row["remaining_cycles"] is not None]
    wrong += _faults(
        told,
        lambda r: (
            not 0 <= r["remaining_lower_cycles"] <= r["remaining_cycles"]
            or (r["remaining_upper_cycles"] or math.inf) < r["remaining_cycles"]
        ),
        "remaining_cycles",
    )
    assert not wrong


def test_a_state_of_health_does_not_rise_by_more_than_recovery(table):
    """A cell gains some percent by a rest or at first; a tenth only by a wrong reference."""
    rows = [row for row in table("health") if row["soh"] is not None]
    assert not _faults(rows, lambda r: not 0.02 < r["soh"] < 1.1, "cycle", "method", "soh")
