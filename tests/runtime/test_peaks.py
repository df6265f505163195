"""Peaks gathered from artefacts: check-ups with and without peaks, records that count on."""

from contract_rows import row_of

from runtime import peaks

FACTS = {"kind": "ica", "ambient_temperature_celsius": 25.0, "cycle": None, "soc": None}
CURVE = {name: [1.0, 2.0] for name in row_of("ica_curve")}
PEAK = row_of("ica")


def test_a_charge_without_peaks_counts_and_one_without_a_curve_does_not(saved):
    charges = {"one": [PEAK], "flat": "no peaks: flat", "bad": "12 rows of charge are too few"}
    paths = [saved(f"results/ica/A/{test}.parquet", found) for test, found in charges.items()]
    places = [f"results/ica_curve/A/{test}.parquet" for test in charges]
    curves = [saved(path, CURVE, c_rate=0.5) for path in places[:2]]
    curves.append(saved(places[2], charges["bad"]))
    tests = {f"A/{test}": FACTS | {"cycle": k * 100} for k, test in enumerate(charges)}
    found = peaks.of_check_ups(paths, curves, tests)
    assert [(c.test, c.cycle, c.c_rate, c.reason) for c in found] == [
        ("one", 0.0, 0.5, ""),
        ("flat", 100.0, 0.5, "no peaks: flat"),
    ]
    assert found[1].peaks == {}


def test_records_without_a_stated_cycle_count_on(saved):
    rows = [row_of("ica_life", reason="", cycle=1.0)]
    rows.append(row_of("ica_life", reason="no peaks: flat", cycle=9.0, peak=0))
    paths = [saved(f"results/ica_life/A/{test}.parquet", rows) for test in ("first", "second")]
    tests = {f"A/{test}": FACTS for test in ("first", "second")}
    found = peaks.of_lives(paths, tests)
    assert [charge.cycle for charge in found] == [1.0, 9.0, 10.0, 18.0]
    assert [bool(charge.peaks) for charge in found] == [True, False, True, False]
