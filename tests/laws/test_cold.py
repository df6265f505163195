"""What limits in the cold: the thesis' own table, pulses alone, and what cannot be told."""

import numpy as np
import pytest
from pulse_rows import pulse

from cellwright.laws.cold import cold_limit
from cellwright.laws.points import impedance_points, resistance_points, rows_of_points
from cellwright.laws.temperature import law_rows
from cellwright.refusal import Refusal

# Thesis table 3.1 at 20, 10, 5, 0, −10 °C; the last Rs at 5 % SoC is lost in print.
CELSIUS = [20.0, 10.0, 5.0, 0.0, -10.0]
OHMIC = {
    0.05: [1.67e-3, 1.83e-3, 1.99e-3, 2.19e-3, np.nan],
    0.5: [2.02e-3, 2.23e-3, 2.41e-3, 2.67e-3, 3.05e-3],
    1.0: [1.91e-3, 2.06e-3, 2.19e-3, 2.42e-3, 3.17e-3],
}
TRANSFER = {
    0.05: [9.33e-4, 2.22e-3, 3.91e-3, 6.64e-3, 2.46e-2],
    0.5: [6.48e-4, 1.63e-3, 2.76e-3, 4.86e-3, 1.74e-2],
    1.0: [6.80e-4, 1.56e-3, 2.60e-3, 4.48e-3, 1.60e-2],
}


def table(ohmic=OHMIC, transfer=TRANSFER, share=0.02):
    rows = [
        {
            "soc": soc,
            "cycle": None,
            "ambient_temperature_celsius": celsius,
            "r_ohmic_ohm": rs,
            "r_ohmic_ohm_std": share * rs,
            "r_charge_transfer_ohm": rct,
            "r_charge_transfer_ohm_std": share * rct,
        }
        for soc in ohmic
        for celsius, rs, rct in zip(CELSIUS, ohmic[soc], transfer[soc], strict=True)
    ]
    return impedance_points(rows)[0]


def pulses(first, later, socs=(0.2, 0.5, 0.8)):
    rows = [
        pulse(soc, ohm, celsius, delay=delay)
        for soc in socs
        for delay, course in ((0.0, first), (10.0, later))
        for celsius, ohm in zip((25.0, 10.0, 0.0), course, strict=True)
    ]
    return resistance_points(rows, soc=socs)[0]


def told(points):
    return cold_limit(law_rows(points)[0], rows_of_points(points)).content


def test_charge_transfer_limits_the_cell_of_the_thesis():
    limit = told(table())
    assert (limit["source"], limit["limit"]) == ("impedance", "charge transfer")
    assert (limit["agreeing"], limit["sure"], limit["levels"]) == (2, 2, 2)
    assert (limit["warmest_celsius"], limit["coldest_celsius"]) == (20, -10)
    growth = {(g["part"], g["soc"]): g["cold_ohm"] / g["warm_ohm"] for g in limit["growth"]}
    assert growth["charge transfer", 0.5] == pytest.approx(26.9, abs=0.1)
    assert growth["ohmic resistance", 0.5] == pytest.approx(1.51, abs=0.01)
    assert "limited by charge transfer at its electrodes: from 20 to -10 °C" in limit["paragraph"]
    assert "23.5 to 26.9 times, ohmic resistance 1.51 to 1.66 times" in limit["paragraph"]
    assert "Below -10 °C nothing was tested" in limit["paragraph"]
    assert limit["paragraph"].endswith("over the next 10 K.")


def test_what_was_measured_three_times_counts_once():
    single, three = told(table()), told([p for p in table() for _ in range(3)])
    assert [part["cold_ohm"] for part in three["growth"]] == pytest.approx(
        [part["cold_ohm"] for part in single["growth"]]
    )
    assert three["growth"][0]["log_std"] == pytest.approx(
        single["growth"][0]["log_std"] / np.sqrt(3)
    )


def test_a_flat_charge_transfer_leaves_the_ohmic_resistance():
    flat = {soc: [1e-4] * 5 for soc in TRANSFER}
    limit = told(table(transfer=flat))
    assert limit["limit"] == "ohmic resistance"
    assert "its ohmic resistance" in limit["paragraph"]


def test_errors_as_large_as_the_growth_are_not_sure():
    near = {soc: [1.01 * value for value in OHMIC[soc]] for soc in (0.5, 1.0)}
    same = {soc: OHMIC[soc] for soc in near}
    limit = told(table(ohmic=same, transfer=near, share=0.1))
    assert limit["sure"] == 0
    assert "at 0." in limit["paragraph"]


def test_pulses_speak_where_there_are_no_spectra():
    limit = told(pulses([0.020, 0.025, 0.030], [0.030, 0.050, 0.080]))
    assert (limit["source"], limit["limit"]) == ("pulses", "the rise after it")
    assert limit["growth"][1]["cold_ohm"] == pytest.approx(0.05)
    assert "what builds up after the onset of a load" in limit["paragraph"]
    at_once = told(pulses([0.020, 0.040, 0.080], [0.025, 0.046, 0.088]))
    assert at_once["limit"] == "the first sample of a pulse"


def test_spectra_speak_first_and_pulses_beside_them():
    limit = told([*table(), *pulses([0.020, 0.025, 0.030], [0.030, 0.050, 0.080])])
    assert limit["source"] == "impedance"
    assert "The pulse resistance grows 1.5 times (first sample, 25 to 0 °C)" in limit["paragraph"]


def test_tests_that_never_were_in_the_cold_only_point_to_it():
    warm = [p._replace(temperature_celsius=p.temperature_celsius + 30) for p in table()]
    assert told(warm)["paragraph"].startswith("Towards the cold")


def test_one_part_alone_is_refused():
    only = [point for point in table() if point.family.startswith("ohmic")]
    with pytest.raises(Refusal, match="neither spectra nor pulses"):
        told(only)
