"""Each witness with data that agree, that contradict and that are silent, made by hand."""

import numpy as np
import pytest

from cellwright.effects.library import LIBRARY
from cellwright.effects.witnesses.collected import contradicted, measured_of, witnesses_of
from cellwright.effects.witnesses.statement import Measured, same

CAPACITY = 4.0
VALUES = {"log_r0": np.log(0.020), "log_r1": np.log(0.010), "log_r2": np.log(0.005)}
VALUES |= {"log_tau1": np.log(10.0), "log_tau2": np.log(60.0)}
MODEL = {"values": VALUES, "capacity_ampere_hour": CAPACITY, "ocv_soc": [0.0, 1.0]}
MODEL |= {"ocv_volt": [3.0, 4.2]}
BASIS = {"capacity_ampere_hour": CAPACITY, "borrowed_from": None, "ocv": []}
GAS, FARADAY = 8.314462618, 96485.33212
SOC = (0.1, 0.3, 0.5, 0.7, 0.9)


def entry(effect, std=None, **values):
    parameters = {
        p.name: {
            "value": values.get(p.name, p.neutral),
            "std": std if p.name in values else None,
            "unit": p.unit,
        }
        for p in LIBRARY[effect].parameters
    }
    return {"effect": effect, "alternatives": [], "parameters": parameters}


def verdict(*entries, word="named"):
    return {"verdict": word, "effects": list(entries), "partial": []}


def heard(tables, *entries, basis=BASIS, ambient=None):
    """What each measurement says: (name, effect) → Witness."""
    measured = measured_of(tables, basis, MODEL, ambient=ambient or {})
    found = witnesses_of(verdict(*entries), MODEL, measured, LIBRARY)
    return {(one.name, one.effect): one for one in found}


def arrhenius(energy, celsius):
    return np.exp(energy / GAS * (1 / (celsius + 273.15) - 1 / 298.15))


def pulses(over_soc=lambda soc: 1.0, energy=0.0, growth=lambda soc: 1.0, celsius=(25.0,), **more):
    """Rows of discharge pulses of 1C: 20 mΩ after 1 s, 25 after 10 s, times given factors."""
    rates, charge = more.get("rates", {1.0: 1.0}), more.get("charge", {"discharge": 1.0})
    rows = []
    for c in celsius:
        for soc in SOC:
            for rate, lower in rates.items():
                for direction, side in charge.items():
                    first = 0.020 * over_soc(soc) * lower * side
                    late = first + 0.005 * growth(soc)
                    about = {"soc": soc, "direction": direction, "c_rate": rate}
                    about |= {"ambient_temperature_celsius": c, "cycle": None}
                    rows += [
                        about | {"delay_second": d, "resistance_ohm": ohm * arrhenius(energy, c)}
                        for d, ohm in ((1.0, first), (10.0, late))
                    ]
    return {"resistance": rows}


def spectra(
    ohmic=lambda soc: 0.012,
    arc=lambda soc: 0.008,
    energy=0.0,
    celsius=(25.0,),
    hertz=10.0,
    faster=0.0,
):
    return {
        "eis": [
            {
                "soc": soc,
                "ambient_temperature_celsius": c,
                "r_ohmic_ohm": ohmic(soc) * arrhenius(energy, c),
                "r_charge_transfer_ohm": arc(soc) * arrhenius(energy, c),
                "r_before_diffusion_ohm": (ohmic(soc) + faster + arc(soc)) * arrhenius(energy, c),
                "charge_transfer_told": True,
                "characteristic_frequency_hertz": hertz,
            }
            for c in celsius
            for soc in SOC
        ]
    }


def says(tables, name, one, **options):
    return heard(tables, one, **options)[name, one["effect"]].says


def straight(slope):
    """Steps of a course whose logarithm falls by `slope` from empty to full, straight over SoC."""
    towards_empty = {35: 0.15, 20: 0.15, 10: 0.1, 4: 0.06, 0: 0.04}
    towards_full = {65: -0.15, 80: -0.15, 90: -0.1, 100: -0.1}
    both = towards_empty | towards_full
    return {f"step_to_{percent}_percent": slope * part for percent, part in both.items()}


TOWARDS_EMPTY = entry("resistance_soc", **straight(1.3))
FACTOR_OF_R0 = float(np.exp(1.3 * 0.8))


@pytest.mark.parametrize("tables", [pulses, lambda over: spectra(lambda s: 0.012 * over(s), over)])
def test_resistance_over_soc(tables):
    rising = FACTOR_OF_R0 ** (1 - (np.array(SOC) - 0.1) / 0.8)
    course = dict(zip(SOC, rising, strict=True))
    flat, falling = (lambda soc: 1.0), (lambda soc: 1 / course[soc])
    scaled = {"pulses": 1.0} if tables is pulses else {"impedance": 0.008}
    (name,) = scaled
    assert says(tables(lambda soc: course[soc] * scaled[name]), name, TOWARDS_EMPTY) == "agrees"
    assert says(tables(lambda soc: flat(soc) * scaled[name]), name, TOWARDS_EMPTY) == "contradicts"
    assert says(tables(lambda s: falling(s) * scaled[name]), name, TOWARDS_EMPTY) == "contradicts"
    assert says({}, name, TOWARDS_EMPTY) == "silent"


@pytest.mark.parametrize(("make", "name"), [(pulses, "pulses"), (spectra, "impedance")])
def test_resistance_over_temperature(make, name):
    celsius = (0.0, 10.0, 25.0, 40.0)
    one = entry("resistance_temperature", 500.0, activation_energy_joule_per_mole=24e3)
    assert says(make(energy=24e3, celsius=celsius), name, one) == "agrees"
    other = heard(make(energy=12e3, celsius=celsius), one)[name, one["effect"]]
    assert (other.says, other.shown) == ("contradicts", True)
    assert other.text.endswith("the effect is there, with another size")
    absent = heard(make(energy=1e3, celsius=celsius), one)[name, one["effect"]]
    assert (absent.says, absent.shown) == ("contradicts", False)
    assert says(make(energy=-24e3, celsius=celsius), name, one) == "contradicts"
    assert says(make(energy=24e3), name, one) == "silent", "one temperature"
    witness = heard(make(energy=24e3, celsius=celsius), one)[name, one["effect"]]
    assert witness.measured == pytest.approx(24e3, rel=1e-6)
    assert witness.implied == pytest.approx(24e3, rel=1e-6)
    assert witness.unit == "J/mol"


def test_polarisation_over_soc_in_pulses():
    one = entry("polarisation_soc", **straight(1.5))
    factor = np.exp(1.5 * 0.8)

    def course(soc):
        return factor ** ((0.9 - soc) / 0.8)

    assert says(pulses(growth=course), "pulses", one) == "agrees"
    assert says(pulses(), "pulses", one) == "contradicts"
    assert says(pulses(growth=lambda soc: 1 / course(soc)), "pulses", one) == "contradicts"
    assert says({}, "pulses", one) == "silent"


def test_an_arc_speaks_of_what_relaxes_only_where_it_is_slow():
    one = entry("polarisation_soc", **straight(1.5))

    def arc(soc):
        return 0.008 * np.exp(1.5 * (0.9 - soc))

    assert says(spectra(arc=arc, hertz=0.02), "impedance", one) == "agrees"
    assert says(spectra(hertz=0.02), "impedance", one) == "contradicts"
    assert says(spectra(arc=arc, hertz=10.0), "impedance", one) == "silent"


def test_asymmetry():
    one = entry("resistance_asymmetry", charge_resistance_excess_relative=0.5)
    both = {"discharge": 1.0, "charge": 1.5}
    assert says(pulses(charge=both), "pulses", one) == "agrees"
    assert says(pulses(charge=both | {"charge": 0.8}), "pulses", one) == "contradicts"
    assert says(pulses(), "pulses", one) == "silent"


def test_a_falling_load_says_nothing_of_a_resistance():
    one = entry("resistance_soc", step_to_20_percent=0.3)
    falling = pulses(over_soc=lambda soc: 2 - soc, charge={"falling charge": 0.3})
    assert says(falling, "pulses", one) == "silent"


def kinetics(per_ampere, share):
    given = {"per_exchange_current_per_ampere": per_ampere, "share_of_resistance": share}
    return entry("charge_transfer_nonlinearity", **given)


def test_kinetics_in_pulses_of_several_rates():
    one = kinetics(1.0, 0.7)
    implied = heard(pulses(rates={0.5: 1.0, 3.0: 0.5}), one)["pulses", one["effect"]].implied
    assert 0.2 < implied < 0.8
    assert says(pulses(rates={0.5: 1.0, 3.0: implied}), "pulses", one) == "agrees"
    assert says(pulses(rates={0.5: 1.0, 3.0: 1.0}), "pulses", one) == "contradicts"
    assert says(pulses(rates={1.0: 1.0, 1.2: implied}), "pulses", one) == "silent"


def test_kinetics_in_spectra_follow_butler_volmer():
    """8 mΩ of charge transfer at 4 A: asinh(x)/x with x = 4·0.008/(2·25.7 mV)."""
    x = CAPACITY * 0.008 * FARADAY / (2 * GAS * 298.15)
    factor = (0.012 + 0.008 * np.arcsinh(x) / x) / 0.020
    one = kinetics(10.0, 0.9)
    witness = heard(spectra(), one)["impedance", one["effect"]]
    assert witness.measured == pytest.approx(factor)
    assert witness.says == "contradicts"
    mild = next(k for k in np.linspace(0.01, 1.0, 100) if _drop(k) <= factor)
    assert says(spectra(), "impedance", kinetics(mild, 0.4)) == "agrees"
    assert says(spectra(celsius=(0.0,)), "impedance", one) == "silent"


def test_arcs_faster_than_charge_transfer_do_not_fall_under_load():
    """12 mΩ, 4 mΩ of another arc and 8 mΩ of charge transfer."""
    x = CAPACITY * 0.008 * FARADAY / (2 * GAS * 298.15)
    one = kinetics(10.0, 0.9)
    witness = heard(spectra(faster=0.004), one)["impedance", one["effect"]]
    assert witness.measured == pytest.approx((0.016 + 0.008 * np.arcsinh(x) / x) / 0.024)


def _drop(per_ampere):
    one = kinetics(per_ampere, 0.4)
    return heard(spectra(), one)["impedance", one["effect"]].implied


def rests(slow_ohm, tau_second, r1=lambda soc: 0.010, minutes=120.0):
    """Rests after an hour of 2 A discharge, whose slow part has charged all the way."""
    return {
        "relaxation": [
            {
                "chosen": True,
                "soc": soc,
                "temperature_celsius": 25.0,
                "load": "CC",
                "current_before_ampere": -2.0,
                "load_second": 3600.0,
                "rest_second": 60.0 * minutes,
                "a_volt": -2.0 * r1(soc),
                "tau1_second": 30.0,
                "b_volt": -2.0 * slow_ohm * (1 - np.exp(-3600.0 / tau_second)),
                "tau2_second": tau_second,
                "r1_ohm": r1(soc),
                "r2_ohm": slow_ohm,
            }
            for soc in SOC
        ]
    }


def test_slow_diffusion_in_rests():
    one = entry("slow_diffusion", 2e-4, resistance_ohm=0.01, time_constant_second=1500.0)
    found = heard(rests(0.01, 1500.0), one)["relaxations", "slow_diffusion"]
    assert found.says == "agrees", found.text
    late = 0.01 * (1 - np.exp(-2.4)) * (np.exp(-0.4) - np.exp(-4.8))
    assert found.measured == pytest.approx(late, rel=1e-6)
    assert found.implied == pytest.approx(late, rel=0.01)
    assert says(rests(0.0005, 1500.0), "relaxations", one) == "contradicts"
    assert says(rests(0.01, 1500.0, minutes=20.0), "relaxations", one) == "silent"


def test_polarisation_over_soc_in_rests():
    one = entry("polarisation_soc", **straight(1.5))
    course = rests(0.0, 100.0, lambda soc: 0.010 * np.exp(1.5 * (0.5 - soc)))
    assert says(course, "relaxations", one) == "agrees"
    assert says(rests(0.0, 100.0), "relaxations", one) == "contradicts"
    narrow = {"relaxation": [row for row in course["relaxation"] if row["soc"] < 0.4]}
    assert says(narrow, "relaxations", one) == "silent"


def slow_test(half_gap, ampere=0.2, **more):
    soc = np.linspace(0, 1, 21)
    curve = {"branches": "both", "soc": soc.tolist(), "half_gap_volt": [half_gap] * 21}
    curve |= {"charge_current_ampere": ampere, "discharge_current_ampere": -ampere}
    curve |= {"ambient_temperature_celsius": 25.0, "cycle": None, "ocv_volt": (3 + soc).tolist()}
    return BASIS | {"ocv": [curve | more]}


@pytest.mark.parametrize("effect", ["hysteresis_one_state", "hysteresis_instant"])
def test_hysteresis_in_the_gap_of_the_slow_test(effect):
    one = entry(effect, 1e-3, amplitude_volt=0.02)
    drop = 0.2 * 0.035
    wide = heard({}, one, basis=slow_test(0.02 + drop))
    (witness,) = [w for w in wide.values() if w.name == "slow test"]
    assert (witness.says, witness.effect) == ("agrees", effect)
    assert witness.measured == pytest.approx(0.02)
    narrow = heard({}, one, basis=slow_test(0.001 + drop))
    assert [w.says for w in narrow.values() if w.name == "slow test"] == ["contradicts"]
    assert [w.says for w in heard({}, one).values() if w.name == "slow test"] == ["silent"]
    leads = heard({}, one, basis=slow_test(0.3, step_volt=0.29))
    (witness,) = [w for w in leads.values() if w.name == "slow test"]
    assert (witness.says, witness.measured) == ("contradicts", pytest.approx(0.01))
    assert "1.45e+03 mΩ that it shows at once, leads and contacts" in witness.text
    lent = heard({}, one, basis=slow_test(0.03) | {"borrowed_from": "C9"})
    assert [w.text for w in lent.values() if w.name == "slow test"] == ["its OCV is that of C9"]


def records(ampere, tests=4, warm=0.0):
    """Ten minutes of rest, an hour of 2 A, rest: the logged current at rest is `ampere`."""
    second = np.arange(0.0, 6000.0, 10.0)
    load = (second > 600) & (second < 4200)
    lag = 1 - np.exp(-np.clip(second - 600, 0, 3600) / 600.0)
    lag *= np.exp(-np.maximum(second - 4200, 0) / 600.0)
    columns = {name: [] for name in ("test", "test_time_second", "current_ampere", "celsius")}
    for k in range(tests):
        columns["test"] += [f"t{k}"] * len(second)
        columns["test_time_second"] += second.tolist()
        columns["current_ampere"] += np.where(load, -2.0, ampere * (1 + 0.01 * k)).tolist()
        columns["celsius"] += (25.0 + warm * lag).tolist()
    count = len(columns["test"])
    columns |= {"soc": [0.5] * count, "voltage_volt": [3.6] * count}
    columns["voltage_volt"] = [3.6 + 0.03 * i for i in columns["current_ampere"]]
    return {"series": {name: np.array(values) for name, values in columns.items()}}


def test_offset_of_the_current_in_the_log_at_rest():
    one = entry("current_offset", 5e-4, offset_ampere=-0.010)
    assert says(records(-0.010), "current at rest", one) == "agrees"
    assert says(records(0.010), "current at rest", one) == "contradicts"
    assert says(records(-0.001), "current at rest", one) == "contradicts"
    assert says(records(0.0), "current at rest", one) == "silent", "switched off at rest"
    reading = heard(records(-0.010), one)["current at rest", "current_offset"]
    assert reading.measured == pytest.approx(-0.01015)
    assert reading.implied == pytest.approx(-0.010)


def test_a_leak_passes_the_ammeter_by():
    one = entry("leakage", 5e-4, leak_ampere=0.010)
    assert says(records(-0.010), "current at rest", one) == "contradicts", "the ammeter sees it"
    assert says(records(0.0), "current at rest", one) == "silent"


def test_the_surface_tells_of_no_core():
    one = entry("self_heating", thermal_resistance_kelvin_per_watt=3.0)
    chamber = {f"t{k}": 25.0 for k in range(4)}
    witness = heard(records(0.0, warm=6.0), one, ambient=chamber)[
        "surface temperature", one["effect"]
    ]
    assert witness.says == "silent"
    assert "warms by up to 6.0 K" in witness.text
    # 2 A over 30 mΩ are 0.12 W.
    assert "50 K for each watt" in witness.text
    blind = heard(records(0.0), one, ambient=chamber)["surface temperature", one["effect"]]
    assert "no temperature of the surface was logged" in blind.text


def entropy(millivolt, std=0.02):
    rows = [{"soc": soc, "used": True, "entropic_millivolt_per_kelvin": millivolt} for soc in SOC]
    return {"ocv_entropic": [row | {"std_millivolt_per_kelvin": std} for row in rows]}


def test_entropic_coefficient():
    one = entry("entropic_ocv", 1e-5, coefficient_volt_per_kelvin=3e-4)
    assert says(entropy(0.3), "entropic coefficient", one) == "agrees"
    assert says(entropy(-0.3), "entropic coefficient", one) == "contradicts"
    assert says(entropy(0.3, std=0.5), "entropic coefficient", one) == "silent", "as near to none"
    assert says({}, "entropic coefficient", one) == "silent"


def ruled_out(measured, **size):
    """Effects that a slope of the OCV over temperature, ± .003 mV/K, rules out."""
    one = entry("entropic_ocv", 1e-4, coefficient_volt_per_kelvin=size.get("searched", 4e-4))
    read = Measured(
        *("entropic coefficient", "ocv_per_kelvin", "slope of the OCV", (0.3, 0.7)),
        *(measured, size.get("std", 3e-6), "V/K"),
    )
    return contradicted([one], MODEL, [read], LIBRARY)


def test_a_measurement_that_shows_nothing_rules_an_effect_out_and_says_both_numbers():
    (one,) = ruled_out(4e-6)
    assert (one["effect"], one["measurement"]) == ("entropic_ocv", "entropic coefficient")
    assert (one["measured"], one["measured_std"], one["unit"]) == (4e-6, 3e-6, "V/K")
    assert one["searched"] == pytest.approx(4e-4, rel=1e-3)
    assert one["searched_std"] == pytest.approx(1e-4, rel=1e-3)


def test_one_on_the_other_side_rules_it_out_as_well():
    assert ruled_out(-3e-4)


def test_another_size_of_the_effect_leaves_it_its_name():
    assert not ruled_out(1e-4)


@pytest.mark.parametrize("std", [np.nan, 0.0, 3e-4], ids=["not stated", "none", "too unsure"])
def test_a_measurement_that_is_not_surely_off_rules_nothing_out(std):
    assert not ruled_out(4e-6, std=std)


def capacities(per_kelvin, rate=0.05, celsius=(0.0, 10.0, 25.0, 40.0), cycle=None, times=1.0):
    return [
        {
            "direction": "discharge",
            "c_rate": rate,
            "capacity_ampere_hour": CAPACITY * times * (1 + per_kelvin * (c - 25.0)),
            "ambient_temperature_celsius": c,
            "cycle": cycle,
        }
        for c in celsius
    ]


def test_capacity_over_temperature():
    one = entry("capacity_temperature", 1e-5, relative_per_kelvin=2e-3)
    assert says({"capacity": capacities(2e-3)}, "capacities", one) == "agrees"
    assert says({"capacity": capacities(5e-4)}, "capacities", one) == "contradicts"
    fast = {"capacity": capacities(2e-3, rate=1.0)}
    assert says(fast, "capacities", one) == "silent", "a fast discharge ends by resistance"


def test_capacity_before_and_after():
    one = entry("capacity_error", relative=-0.05)

    def aged(times):
        before, after = (capacities(0.0, 1.0, (25.0,), c, t) for c, t in ((None, 1), (100, times)))
        return {"capacity": before + after}

    assert says(aged(0.95), "check-ups", one) == "agrees"
    assert says(aged(0.999), "check-ups", one) == "contradicts"
    assert says({"capacity": capacities(0.0, 1.0)}, "check-ups", one) == "silent"


def test_capacity_from_date_to_date():
    """Forty days apart 6 % are lost: of a cell that loses 9 % in sixty days what is expected."""
    about = MODEL | {"aged_day": 60.0}
    one = entry("ageing_between_tests", 0.005, capacity_loss_relative=0.09)

    def dated(times, rate=1.0):
        both = capacities(0.0, 1.0, (25.0,)), capacities(0.0, rate, (25.0,), times=times)
        dates = "2024-01-01", "2024-02-10 00:00"
        return [row | {"started": date} for (row,), date in zip(both, dates, strict=True)]

    def by_date(rows):
        measured = measured_of({"capacity": rows}, BASIS, about, ambient={})
        found = witnesses_of(verdict(one), about, measured, LIBRARY)
        return next(w for w in found if w.name == "capacities by date")

    heard = by_date(dated(0.94))
    assert (heard.says, heard.measured) == ("agrees", pytest.approx(-0.06))
    assert heard.implied == pytest.approx(0.91 ** (40 / 60) - 1)
    assert by_date(dated(0.999)).says == "contradicts"
    assert by_date(dated(0.94, rate=0.5)).says == "silent", "another rate"


def test_moved_ocv_before_and_after():
    one = entry("ocv_shift", wave_1_volt=0.02)
    soc = np.array(slow_test(0.0)["ocv"][0]["soc"])
    moved = (3 + soc + 0.02 * np.cos(np.pi * soc)).tolist()
    for volts, answer in ((moved, "agrees"), ((3 + soc + 0.001).tolist(), "contradicts")):
        after = slow_test(0.0, cycle=100.0, ocv_volt=volts)["ocv"]
        basis = BASIS | {"ocv": slow_test(0.0)["ocv"] + after}
        assert says({}, "check-ups", one, basis=basis) == answer
    assert says({}, "check-ups", one, basis=slow_test(0.0)) == "silent"


def test_an_effect_that_is_not_named_although_a_witness_shows_it():
    found = heard(pulses(lambda soc: 3.0 if soc < 0.2 else 1.0))
    witness = found["pulses", "resistance_soc"]
    assert (witness.says, witness.named) == ("contradicts", False)
    assert witness.measured == pytest.approx(3.0)
    assert witness.implied == 1.0
    assert witness.text.startswith(
        "not named, although measured: resistance 1 s into the pulse at 10 %"
    )
    assert not heard(pulses()), "what is flat shows nothing"
    assert not heard(pulses(lambda soc: 1.3 if soc < 0.2 else 1.0)), "too little for anyone to act"
    tied = entry("polarisation_soc", **straight(1.0)) | {"alternatives": ["resistance_soc"]}
    both = heard(pulses(lambda soc: 3.0 if soc < 0.2 else 1.0), tied)
    assert ("pulses", "resistance_soc") not in both, "the verdict names it as good as the other"


@pytest.mark.parametrize(("std", "answer"), [(0.3, "silent"), (0.003, "contradicts")])
def test_a_reading_without_a_deviation_does_not_contradict_what_a_size_allows(std, answer):
    tables = pulses(lambda soc: 1.05 if soc < 0.2 else 1.0)
    reading = heard(tables, entry("resistance_soc", std, **straight(0.5)))[
        "pulses", "resistance_soc"
    ]
    assert np.isnan(reading.std)
    assert reading.says == answer


def test_the_nearest_explanation_of_an_unknown_is_held_against_witnesses_too():
    measured = measured_of(pulses(), BASIS, MODEL, ambient={})
    unknown = verdict(word="unknown") | {"partial": [TOWARDS_EMPTY]}
    found = {w.name: w.says for w in witnesses_of(unknown, MODEL, measured, LIBRARY)}
    assert found["pulses"] == "contradicts"


@pytest.mark.parametrize(
    ("measured", "implied", "std", "neutral", "answer"),
    [
        (10.0, 13.9, 2.0, 0.0, True),
        (10.0, 14.1, 2.0, 0.0, False),
        (10.0, 14.9, np.nan, 0.0, True),
        (10.0, 15.1, np.nan, 0.0, False),
        (10.0, -10.0, np.nan, 0.0, False),
        (2.0, 2.8, np.nan, 1.0, True),
        (2.0, 2.9, np.nan, 1.0, False),
        (0.5, 2.0, np.nan, 1.0, False),
        (0.5, 0.4, np.nan, 1.0, True),
    ],
)
def test_the_rule_of_agreement(measured, implied, std, neutral, answer):
    assert same(measured, implied, std, neutral=neutral) is answer
    assert same(implied, measured, std, neutral=neutral) is answer
