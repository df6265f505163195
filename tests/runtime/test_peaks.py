"""Peaks gathered from artefacts: check-ups with and without peaks, records that count on."""

from contract_rows import row_of

from runtime import type_inputs

FACTS = {"kind": "ica", "ambient_temperature_celsius": 25.0, "cycle": None, "soc": None}
CURVE = {name: [1.0, 2.0] for name in row_of("ica_curve")}
PEAK = row_of("ica")


def test_a_charge_without_peaks_counts_and_one_without_a_curve_does_not(saved):
    charges = {"one": [PEAK], "flat": "no peaks: flat", "bad": "12 rows of charge are too few"}
    paths = [
        saved(f"results/stages/ica/A/{test}.parquet", found) for test, found in charges.items()
    ]
    places = [f"results/stages/ica_curve/A/{test}.parquet" for test in charges]
    curves = [saved(path, CURVE, c_rate=0.5) for path in places[:2]]
    curves.append(saved(places[2], charges["bad"]))
    tests = {f"A/{test}": FACTS | {"cycle": k * 100} for k, test in enumerate(charges)}
    found = type_inputs.charges_of_check_ups(paths, curves, tests)
    assert [(c.test, c.cycle, c.c_rate, c.reason) for c in found] == [
        ("one", 0.0, 0.5, ""),
        ("flat", 100.0, 0.5, "no peaks: flat"),
    ]
    assert found[1].peaks == {}


def test_records_without_a_stated_cycle_count_on(saved):
    rows = [row_of("ica_life", reason="", cycle=1.0)]
    rows.append(row_of("ica_life", reason="no peaks: flat", cycle=9.0, peak=0))
    paths = [
        saved(f"results/stages/ica_life/A/{test}.parquet", rows) for test in ("first", "second")
    ]
    tests = {f"A/{test}": FACTS for test in ("first", "second")}
    found = type_inputs.charges_of_lives(paths, tests)
    assert [charge.cycle for charge in found] == [1.0, 9.0, 10.0, 18.0]
    assert [bool(charge.peaks) for charge in found] == [True, False, True, False]


def test_capacities_and_curves_of_records_that_count_on_are_found_by_the_count_of_the_tracks(saved):
    """The second record's charges 1 and 9 are 10 and 18 of the life; 9 of the first has no peak."""
    tests = {f"A/{test}": FACTS for test in ("first", "second")}
    tracks = [{"cell": "A", "test": "first", "cycle": 1.0}]
    tracks += [{"cell": "A", "test": "second", "cycle": cycle} for cycle in (10.0, 18.0)]
    lives, sizes = [], []
    for test in ("first", "second"):
        rows = [row_of("ica_life_curve", cycle=cycle) for cycle in (1.0, 9.0)]
        lives.append(saved(f"results/stages/ica_life_curve/A/{test}.parquet", rows))
        rows = [row_of("ageing_cycles", cycle=cycle, direction="discharge") for cycle in (1.0, 9.0)]
        sizes.append(saved(f"results/stages/ageing_cycles/A/{test}.parquet", rows))
    before = type_inputs.cycles_before(lives, tracks)
    assert before == {("A", "first"): 0.0, ("A", "second"): 9.0}
    wanted = [("first", 1.0), ("first", 9.0), ("second", 10.0), ("second", 18.0)]
    assert [key[1:] for key in type_inputs.curves_of_type([], lives, tests, before)] == wanted
    found = type_inputs.capacities_of_type([], sizes, tests, before)
    assert [(row["test"], row["cycle"]) for row in found] == wanted
