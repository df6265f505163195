"""What must hold of any cell's results, whatever the laboratory: physics first.

A law notes each row where it does not hold, in a sentence that says what was found and wanted.
"""

import itertools
import math


def known(rows, *names):
    """Rows in which all of these columns are known."""
    return [row for row in rows if all(row[name] is not None for name in names)]


def test_resistance_is_positive_and_below_ten_ohm(table, law):
    """A resistance is not negative, and no cell's is tens of ohms."""
    law.each(
        known(table("resistance"), "resistance_ohm"),
        lambda row: not 0 < row["resistance_ohm"] < 10,
        "a resistance of {resistance_ohm} Ω at SoC {soc}, wanted above 0 and below 10 Ω",
    )
    law.hold()


def test_resistance_does_not_fall_within_a_pulse(table, law):
    """Polarisation only adds to a pulse's resistance: later delays are lower by noise at most."""
    pulses = {}
    for row in known(table("resistance"), "resistance_ohm"):
        if row["direction"].startswith("falling"):
            continue  # the load before it goes on polarising, against the answer
        pulses.setdefault((row["cell"], row["test"], row["start_time_second"]), []).append(row)
    for rows in pulses.values():
        for before, after in itertools.pairwise(sorted(rows, key=lambda r: r["delay_second"])):
            fall = before["resistance_ohm"] - after["resistance_ohm"]
            noise = math.hypot(*(row["resistance_std_ohm"] or 0.0 for row in (before, after)))
            if fall > max(0.05 * before["resistance_ohm"], 2.0 * noise):
                law.add(
                    before,
                    "the resistance of the pulse at {start_time_second:g} s falls from "
                    "{resistance_ohm:.4g} Ω".format(**before)
                    + " to {resistance_ohm:.4g} Ω after {delay_second:g} s".format(**after),
                )
    law.hold()


def test_state_of_health_is_between_a_tenth_and_one_and_a_half(table, law):
    """No cell delivers half more than its rating, or next to nothing."""
    law.each(
        known(table("../summary"), "soh"),
        lambda row: not 0.1 < row["soh"] < 1.5,
        "a state of health of {soh:.4g}, wanted 0.1 to 1.5: is the rating in cells.tsv right?",
    )
    law.hold()


def test_coulombic_efficiency_is_near_one(table, law):
    """A cell gives back what it took, within what rate and temperature explain."""
    law.each(
        known(table("capacity"), "coulombic_efficiency"),
        lambda row: not 0.8 < row["coulombic_efficiency"] < 1.1,
        "a coulombic efficiency of {coulombic_efficiency:.4g}, wanted 0.8 to 1.1",
    )
    # Where a charge is no partner of the discharge there is no efficiency; both are published.
    halves = {}
    for row in known(table("capacity"), "capacity_ampere_hour"):
        if row["coulombic_efficiency"] is None:
            of_test = halves.setdefault((row["cell"], row["test"], row["cycle"]), {})
            of_test[row["direction"]] = row
    for pair in (pair for pair in halves.values() if len(pair) == 2):
        out, taken = (pair[name]["capacity_ampere_hour"] for name in ("discharge", "charge"))
        if out > 1.1 * taken:
            law.add(
                pair["discharge"], f"discharged {out:.4g} Ah but charged {taken:.4g} Ah in one test"
            )
    law.hold()


def test_capacity_does_not_grow_in_the_cold(table, law):
    """At one rate and age a colder cell gives no more charge (2 % tolerance)."""
    series = {}
    rows = known(table("capacity"), "ambient_temperature_celsius", "c_rate", "capacity_ampere_hour")
    for row in (row for row in rows if row["direction"] == "discharge"):
        key = (row["cell"], row["cycle"], round(row["c_rate"], 2))
        series.setdefault(key, []).append(row)
    for points in series.values():
        order = [(r["ambient_temperature_celsius"], r["capacity_ampere_hour"]) for r in points]
        cold, warm = min(order), max(order)
        if warm[0] - cold[0] > 15 and cold[1] > 1.02 * warm[1]:
            row = points[order.index(cold)]
            law.add(
                row,
                f"{cold[1]:.4g} Ah at {cold[0]:g} °C and {warm[1]:.4g} Ah at {warm[0]:g} °C, at "
                f"{row['c_rate']:.2g}C",
            )
    law.hold()


def test_a_slow_discharge_gives_the_most_energy(table, law):
    """At one temperature and age no faster discharge gives more energy than a slow one (2 %)."""
    series = {}
    for row in known(table("capacity"), "c_rate", "energy_watt_hour"):
        if row["direction"] == "discharge":
            key = (row["cell"], row["cycle"], row["ambient_temperature_celsius"])
            series.setdefault(key, []).append(row)
    for rows in series.values():
        slow, most = (
            min(rows, key=lambda row: row["c_rate"]),
            max(rows, key=lambda row: row["energy_watt_hour"]),
        )
        # Slower than C/5 a cell hardly warms itself, by which alone a faster one may give more.
        if slow["c_rate"] < 0.2 and most["energy_watt_hour"] > 1.02 * slow["energy_watt_hour"]:
            law.add(
                slow,
                "its discharge at {c_rate:.2g}C gives {energy_watt_hour:.4g} Wh".format(**slow)
                + ", {test} at {c_rate:.2g}C gives {energy_watt_hour:.4g} Wh: ".format(**most)
                + "its voltage holds the drop of leads or contacts, or it did not begin full",
            )
    law.hold()


def test_activation_energies_are_those_of_batteries(table, law):
    """Resistance falls with temperature, with 2 to 120 kJ/mol somewhere in the interval."""
    rows = [
        row
        for row in known(table("temperature"), "value")
        if row["parameter"] == "activation_energy" and "resistance" in row["quantity"]
    ]

    def wrong(row):
        low, high = (row["value"] if row[k] is None else row[k] for k in ("lower", "upper"))
        return high < 2e3 or low > 1.2e5

    law.each(
        rows, wrong, "{quantity}: an activation energy of {value:.4g} J/mol, wanted 2000 to 120000"
    )
    law.hold()


def test_branch_currents_add_up(table, law):
    """Kirchhoff: simulated branch currents sum to the total."""
    law.each(
        known(table("packs"), "kcl_residual_ampere"),
        lambda row: row["kcl_residual_ampere"] > 1e-9,
        "the currents of the branches miss the total by {kcl_residual_ampere:.3g} A",
    )
    law.hold()


def test_models_are_within_half_a_volt(table, law):
    """A model half a volt off, or outside all that was measured by half a volt, has a fault."""
    tested, fitted = table("validation"), table("choice")
    law.each(
        known(tested, "rmse_volt"),
        lambda row: row["rmse_volt"] > 0.5,
        "model {model} misses the measured voltage by {rmse_volt:.3g} V",
    )
    law.each(
        [row for row in known(tested, "max_abs_volt") if row["chosen"]],
        lambda row: row["rmse_volt"] <= 0.5 < row["max_abs_volt"],
        "model {model} misses the measured voltage by up to {max_abs_volt:.3g} V",
    )
    for rows, name in ((tested, "beyond_volt"), (fitted, "fit_beyond_volt")):
        law.each(
            [row for row in rows if row["chosen"] and row[name] is not None],
            lambda row, name=name: row[name] > 0.5,
            f"model {{model}} leaves what was measured by {{{name}:.3g}} V",
        )
    law.hold()


def test_a_knee_and_an_end_of_life_lie_within_their_limits(table, law):
    """Lower limit, value and upper limit stand in this order, and a knee within its life."""
    rows = table("fade")
    law.each(
        known(rows, "knee_cycle"),
        lambda row: (
            not 0 < row["knee_lower_cycle"] <= row["knee_cycle"] <= row["knee_upper_cycle"]
            or row["knee_upper_cycle"] > row["last_cycle"]
        ),
        "a knee at cycle {knee_cycle} between {knee_lower_cycle} and {knee_upper_cycle}, of a life "
        "to cycle {last_cycle}",
    )
    law.each(
        known(rows, "remaining_cycles"),
        lambda row: (
            not 0 <= row["remaining_lower_cycles"] <= row["remaining_cycles"]
            or (row["remaining_upper_cycles"] or math.inf) < row["remaining_cycles"]
        ),
        "{remaining_cycles} remaining cycles between {remaining_lower_cycles} and "
        "{remaining_upper_cycles}",
    )
    law.hold()


def test_a_state_of_health_does_not_rise_by_more_than_recovery(table, law):
    """A cell gains some percent by a rest or at first; a tenth only by a wrong reference."""
    law.each(
        known(table("health"), "soh"),
        lambda row: not 0.02 < row["soh"] < 1.1,
        "a state of health of {soh:.4g} at cycle {cycle} by {method}, wanted 0.02 to 1.1",
    )
    law.hold()
