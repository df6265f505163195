"""The ways in which a search for a missing effect goes wrong, each with a cell that invites it.

Elsewhere: noise that swallows (test_noise), NaN and clocks (test_records), other protocols in
paired mode (test_paired), a tie broken silently and the effect that nobody knows (test_search).
"""

import numpy as np
import pytest
import small_plant as plant
from small_plant import (
    CAPACITY,
    HEALTHY,
    Truth,
    case,
    case_of,
    drive,
    laid,
    measured,
    names_of,
    searched,
    slow_discharge,
)

from cellwright.effects import base, beginning, finding
from cellwright.effects.case import Gates, not_excited
from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.records import stacked
from cellwright.records.thinning import rows_of

HYSTERESIS = Truth(hysteresis=0.012)
GATES = Gates()
SINKS = ("current_offset", "slow_diffusion", "coulombic_inefficiency", "leakage", "ocv_shift")


def search(made):
    """(Found, Outcome) of a search of a case by the whole library."""
    return finding.searched(made, LIBRARY)[:2]


def test_the_base_fit_does_not_swallow_a_skew_as_a_fast_pair():
    result = searched(Truth(delay=0.5), every=0.5)[1]
    assert names_of(result) == ["time_skew"]
    values = result.last.solution.values
    assert np.exp(values["log_tau1"]) == pytest.approx(9.0, rel=0.1)


def test_the_noise_does_not_swallow_slow_diffusion():
    found, result, _ = searched(Truth(slow_ohm=0.04))
    assert found.filters.noise.slow_volt < 5e-4
    assert names_of(result) == ["slow_diffusion"]


@pytest.mark.parametrize("wave", [-1.5e-3, 1.5e-3])
def test_an_error_of_the_ocv_within_its_tolerance_fills_no_sink(wave):
    result = searched(Truth(wave=wave))[1]
    assert result.word == "none"
    assert not set(names_of(result)) & set(SINKS)


def proved_by(truth, *proof):
    """Case of a truth, with other records in the place of those that judge."""
    return case(truth)._replace(validation=stacked(proof, capacity_ampere_hour=CAPACITY))


@pytest.mark.slow
def test_an_effect_that_the_fitted_records_excite_may_compete_whatever_the_proof_holds():
    truth = Truth(activation=2.5e4)
    proof = proved_by(truth, measured("wild", drive(103), 8.0, 0.95, truth, seed=13))
    assert not not_excited(proof, LIBRARY["resistance_temperature"])
    verdict = of_case("c", proof, LIBRARY).verdict
    assert [entry["effect"] for entry in verdict["effects"]] == ["resistance_temperature"]
    assert verdict["effects"][0]["proof"] == "proven"
    assert "resistance_temperature" not in verdict["not_testable"]


@pytest.mark.slow
def test_what_the_proof_cannot_show_is_named_and_told_as_unproven():
    """Loads too mild to warm the cell say nothing of its own heat."""
    truth = Truth(thermal=8.0)
    mild = measured("mild", 0.25 * drive(103), 20.0, 0.95, truth, seed=13)
    verdict = of_case("c", proved_by(truth, mild), LIBRARY).verdict
    assert verdict["verdict"] == "named"
    (entry,) = verdict["effects"]
    assert (entry["effect"], entry["proof"]) == ("self_heating", "unproven")
    assert "self-heating (unproven)" in verdict["paragraph"]


def test_what_the_fitted_records_do_not_excite_is_not_testable():
    truth = Truth(activation=2.5e4)
    one = case(truth, celsius=(25.0, 25.0))
    effect = LIBRARY["resistance_temperature"]
    assert "temperatures" in not_excited(one, effect)[0]
    verdict = of_case("c", one, LIBRARY).verdict
    assert "resistance_temperature" in verdict["not_testable"]
    assert "resistance_temperature" not in [entry["effect"] for entry in verdict["effects"]]


@pytest.mark.parametrize("truth", [HEALTHY, Truth(activation=3e4)])
def test_a_wobble_of_one_chamber_is_no_activation_energy(truth):
    made = case(truth, celsius=(25.0, 25.0))
    assert not_excited(made, LIBRARY["resistance_temperature"])
    found, result, _ = searched(truth, celsius=(25.0, 25.0))
    assert not set(found.possible) & {
        "resistance_temperature",
        "entropic_ocv",
        "capacity_temperature",
    }
    assert "resistance_temperature" not in names_of(result)


def test_an_optimum_at_a_bound_is_flagged():
    effect = LIBRARY["resistance_temperature"]
    parameters = {one.name: one for one in effect.parameters}
    parameters["growth_towards_cold"] = parameters["growth_towards_cold"]._replace(lower=0.4)
    narrow = effect._replace(parameters=tuple(parameters.values()))
    finding = of_case("c", case(Truth(activation=2.5e4)), {effect.id: narrow})
    size = finding.verdict["effects"][0]["parameters"]["growth_towards_cold"]
    assert size["at_bound"]
    assert size["value"] == 0.4
    assert "ended at a limit of the fit" in finding.verdict["paragraph"]
    rows = zip(finding.ranking["chosen"], finding.ranking["in_range"], strict=True)
    assert (True, False) in rows


@pytest.mark.slow
@pytest.mark.parametrize(("slope", "answer"), [(1.2, "none"), (2.0, "unknown")])
def test_a_rival_that_half_explains_is_not_the_name(slope, answer):
    """Without the name, what is left counts as unknown only where somebody acts on it: 3 mV."""
    truth = Truth(slope_r1=slope)
    assert names_of(searched(truth)[1]) == ["polarisation_soc"]
    # Diffusion that is slower towards empty is its near relative, and explains more than half.
    result = searched(truth, without=("polarisation_soc", "slow_diffusion"))[1]
    assert (result.word, names_of(result)) == (answer, [])
    assert (result.excess_volt > GATES.unknown_volt) is (answer == "unknown")


@pytest.mark.parametrize("late", [0, 3])
def test_edges_that_are_sampled_coarsely_show_no_skew(late):
    """A row every 10 s, at the steps of the current or 6 s after them."""
    judging = [measured(*drive_of, 0.95, seed=k) for k, drive_of in enumerate(proofs(), 30)]
    made = laid(*([thinned(r, late) for r in side] for side in (fitted(), judging)))
    assert not_excited(made, LIBRARY["time_skew"])
    assert not not_excited(case(HEALTHY), LIBRARY["time_skew"])
    found, result = search(made)
    assert "time_skew" not in found.possible
    assert not names_of(result)


def thinned(record, late):
    few = rows_of(record, slice(late, None, 5))
    return few._replace(soc=np.append(record.soc[0], few.soc[1:]))


def test_a_start_from_an_unrelaxed_rest_is_no_effect():
    whole = [measured(*drive_of, 0.95, seed=k) for k, drive_of in enumerate(proofs(), 30)]
    parts = [cut(record, 460) for record in whole]
    assert not names_of(search(laid(fitted(), parts))[1])


def proofs():
    return [("wild", drive(103), 8.0), ("mild", drive(104, highest=0.9), 34.0)]


def fitted(truth=HEALTHY):
    return [
        measured("slow", slow_discharge(), 21.0, 1.0, truth, seed=20, kind="capacity"),
        measured("cold", drive(101), 8.0, 0.95, truth, seed=21),
        measured("warm", drive(102), 34.0, 0.95, truth, seed=22),
    ]


def cut(record, row):
    """What is left of a record from a row on, within a rest whose load ended 40 s before."""
    moved = np.sum(record.current_ampere[:row]) * plant.ROW_SECOND / 3600 / CAPACITY
    rest = rows_of(record, slice(row, None))
    soc = np.append(record.soc[0] + moved, rest.soc[1:])
    return rest._replace(test_time_second=rest.test_time_second - rest.test_time_second[0], soc=soc)


def changed(records, **factors):
    """Records with columns multiplied."""
    return [r._replace(**{n: getattr(r, n) * f for n, f in factors.items()}) for r in records]


def test_a_flipped_sign_of_the_current_is_no_effect():
    judging = [measured(*drive_of, 0.95, seed=k) for k, drive_of in enumerate(proofs(), 30)]
    both = [changed(side, current_ampere=-1.0) for side in (fitted(), judging)]
    assert search(laid(*both))[1].word == "unknown"


def test_millivolts_in_the_place_of_volts_are_no_effect():
    judging = [measured(*drive_of, 0.95, seed=k) for k, drive_of in enumerate(proofs(), 30)]
    both = [changed(side, voltage_volt=1e3) for side in (fitted(), judging)]
    assert not names_of(search(laid(*both))[1])


def test_one_part_of_a_record_judges_from_the_start_that_the_other_found():
    """A file in both roles is only a split one: its rows are compared once."""
    fit = fitted()
    split = np.arange(len(fit[1].current_ampere)) % 200 < 100
    halves = [fit[1]._replace(used=split), fit[1]._replace(used=~split)]
    found, result = search(laid([fit[0], halves[0], fit[2]], [halves[1]]))
    before = found.first
    assert before.values["soc0[0]"] == before.solution.values["soc0[1]"]
    assert result.word == "none"


@pytest.mark.slow
def test_the_order_of_the_records_does_not_matter():
    made = [
        fitted(HYSTERESIS),
        [measured(*drive_of, 0.95, HYSTERESIS, seed=30) for drive_of in proofs()],
    ]
    sizes = []
    for order in (1, -1):
        result = search(laid(*(side[::order] for side in made)))[1]
        assert names_of(result) == ["hysteresis_instant"]
        values = result.last.solution.values
        sizes.append(values["hysteresis_instant.amplitude_volt"])
    assert sizes[0] == pytest.approx(sizes[1], rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [2])
def test_other_noise_is_the_same_answer(seed):
    assert names_of(searched(HYSTERESIS, seed=seed)[1]) == ["hysteresis_instant"]
    assert searched(HEALTHY, seed=seed)[1].word == "none"


@pytest.mark.slow
def test_the_same_records_are_the_same_answer_to_the_last_digit():
    again = search(case_of(HYSTERESIS))
    first, second = (one[0].last.solution.values for one in (searched(HYSTERESIS), again))
    assert first == second


def with_dip(made, volt, *, shape):
    """The case with less voltage in the slow discharge [V], by the shape of a function of SoC."""
    soc = base.fields_of(made.cell, made.fit, beginning.first_values(made.cell, made.fit)).soc
    loaded = (made.fit.file == 0) & (np.abs(made.fit.current_ampere) > 0.1)
    bend = np.where(loaded, -volt * shape(soc), 0.0)
    return made._replace(fit=made.fit._replace(voltage_volt=made.fit.voltage_volt + bend))


@pytest.mark.slow
def test_beside_a_dip_that_no_effect_bends_what_is_there_is_found():
    """A dip of a per cent of SoC: by its squares worth more than all other rows together."""
    made = with_dip(
        *(case_of(Truth(activation=2.5e4)), 0.3),
        shape=lambda soc: np.exp(-0.5 * ((soc - 0.6) / 0.01) ** 2),
    )
    found = search(made)[0]
    assert "resistance_temperature" in found.model.keys


@pytest.mark.slow
def test_a_knee_gives_a_healthy_cell_no_name():
    """A course over SoC takes it up, and all others are predicted better: fitted without the knee
    they show none."""
    made = with_dip(case_of(HEALTHY), 0.1, shape=lambda soc: np.exp(-(soc - soc.min()) / 0.04))
    assert names_of(search(made)[1]) == []
