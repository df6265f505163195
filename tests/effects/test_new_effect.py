"""A new effect is one entry: found, named, ranked, in words, in a model file, simulated from it."""

from functools import cache

import numpy as np
import pytest
from small_cells import CELL

from cellwright.circuits.circuit import KINDS
from cellwright.circuits.model_file import simulate_model
from cellwright.effects import base
from cellwright.effects import finding as module
from cellwright.effects.case import Case
from cellwright.effects.finding import of_case
from cellwright.effects.library import LIBRARY
from cellwright.effects.library.sizes import as_is
from cellwright.effects.library.vocabulary import Effect, Parameter
from cellwright.effects.member import NAME, effect_member
from cellwright.effects.records import stacked
from cellwright.effects.verdict import CONTRADICTED
from cellwright.effects.witnesses.collected import Others, witnesses_of
from cellwright.effects.witnesses.statement import Measured
from cellwright.records.record import record_of
from cellwright.refusal import Refusal

OHM = 0.04


def _branch(p, r0_ohm, capacity_ampere_hour, soc):
    parameters = {"r_ohm": p["resistance_ohm"], "tau_second": 20.0, "scale_volt": 0.02}
    return r0_ohm, "kinetic", parameters


def _act(fields, stack, p):
    _, kind, parameters = _branch(p, None, None, None)
    drive = KINDS[kind].drive(fields.current, **parameters)
    return fields._replace(volt=fields.volt + base.relaxed(stack, drive, parameters["tau_second"]))


NEW = Effect(
    id="film_kinetics",
    sentence="a film on the electrode: charge transfer that lags and saturates",
    parameters=(
        Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.2, step=1e-3, plausible=0.03, material=1e-4),
    ),
    stage="overpotential",
    act=_act,
    circuit=_branch,
    starts=({"resistance_ohm": 0.02}, {"resistance_ohm": 0.06}),
    needs=("rates",),
    shows="pulses of a minute at four currents",
    short="a film on the electrode",
    sizes_in_words=as_is("resistance_ohm", "mΩ", factor=1e3),
    quantity="large_over_small",
    consequence="small loads cost more than large ones say",
)
RIVALS = ("slow_diffusion", "charge_transfer_nonlinearity", "polarisation_soc", "leakage")
WITH_NEW = {name: LIBRARY[name] for name in RIVALS} | {NEW.id: NEW}
LOGS = dict(zip(base.LOGARITHMS, np.log([0.025, 0.010, 8.0, 0.015, 130.0]), strict=True))


def measured(seed):
    """A drive from 90 % SoC by a cell with the new effect, read with 1 mV of noise."""
    random = np.random.default_rng(seed)
    current = np.repeat(random.uniform(-2.2, 1.2, 300) * CELL.capacity_ampere_hour, 20)
    second = np.arange(float(len(current)))
    current[(second % 1800 > 1150) | (second < 60)] = 0.0
    blank = np.zeros(len(current))
    record = record_of(second, current, blank, 0.9, celsius=25.0, test=f"drive_{seed}")
    stack = stacked([record], capacity_ampere_hour=CELL.capacity_ampere_hour)
    values = dict.fromkeys(base.base_names(1), 0.0) | LOGS | {"soc0[0]": 0.9, NEW.names[0]: OHM}
    volt = base.voltage(CELL, stack, values, (NEW,))
    return stack._replace(voltage_volt=volt + random.normal(0.0, 1e-3, len(volt)))


@cache
def finding():
    return of_case("cell", Case(CELL, measured(1), measured(2)), WITH_NEW)


def test_it_is_found_with_its_size():
    verdict = finding().verdict
    assert verdict["verdict"] == "named"
    assert [entry["effect"] for entry in verdict["effects"]] == [NEW.id]
    size = verdict["effects"][0]["parameters"]["resistance_ohm"]
    assert abs(size["value"] - OHM) < 4 * size["std"]


def test_it_is_said_in_its_own_words():
    text = finding().verdict["paragraph"]
    assert text.startswith(f"Shows {NEW.short}: it lowers the error")
    (size,) = finding().verdict["effects"][0]["sizes"]
    assert size["value"] == pytest.approx(1e3 * OHM, rel=0.1)
    assert f"{NEW.sentence[0].upper()}{NEW.sentence[1:]} ({size['value']:.3g} ± " in text
    assert NEW.consequence in text


def test_a_witness_of_its_quantity_speaks_of_it():
    read = Measured("pulses", NEW.quantity, "ratio", (0.1, 1.0), 0.6, 0.1, "1", 1.0, material=True)
    (heard,) = witnesses_of(finding().verdict, finding().model, [read], WITH_NEW)
    assert (heard.effect, heard.named, heard.measured) == (NEW.id, True, 0.6)


def test_it_is_ranked_before_its_rivals():
    ranking = finding().ranking
    assert ranking["effect"][0] == NEW.id
    assert ranking["chosen"][0] is True
    assert set(ranking["effect"]) > {NEW.id}


def family():
    """A model file of the cell, without a member yet."""
    soc = np.linspace(0.0, 1.0, len(CELL.ocv_volt))
    table = {"soc": soc.tolist(), "ocv_volt": CELL.ocv_volt.tolist()}
    table["ambient_temperature_celsius"] = 25.0
    model = {"cell": "cell", "capacity_ampere_hour": CELL.capacity_ampere_hour, "ocv": [table]}
    return model | {"members": [], "chosen": NAME}


def test_a_model_file_holds_it_and_simulates_as_the_search_did():
    model, searched = family(), finding().model
    model["members"] = [effect_member(searched, model, [25.0], WITH_NEW)]
    branch = model["members"][0]["conditions"][0]["branches"][-1]
    assert branch["kind"] == "kinetic"
    assert branch["r_ohm"][0] == pytest.approx(searched["values"][NEW.names[0]])
    stack = measured(1)
    volt = base.voltage(CELL, stack, searched["values"], (NEW,))
    moved = np.cumsum(stack.held_ampere * stack.step_second) / 3600.0 / CELL.capacity_ampere_hour
    # The member counts from what was stated, as the scale of the search lies beside it.
    soc = searched["values"]["soc0[0]"] - searched["start_shift_soc"] + moved
    run = simulate_model(model, NAME, stack.second, stack.current_ampere, soc, stack.celsius)
    assert np.abs(run.voltage_volt - volt).max() < 1e-4


def test_one_without_a_place_in_a_model_file_is_refused_by_name():
    homeless = NEW._replace(circuit=None)
    with pytest.raises(Refusal, match="'film_kinetics' has no place in a model file"):
        effect_member(finding().model, family(), [25.0], {NEW.id: homeless})


def test_one_that_another_measurement_contradicts_is_no_name(monkeypatch):
    # A quantity that reads the first parameter as it is, here the resistance of the film.
    film = NEW._replace(quantity="half_gap")
    read = Measured("impedance", film.quantity, "resistance of a film", (), 0.0, 0.001, "Ohm")
    monkeypatch.setattr(module, "measured_of", lambda *_, **__: [read])
    case = Case(CELL, measured(1), measured(2))
    verdict = module.of_case(
        "cell", case, WITH_NEW | {NEW.id: film}, others=Others({}, {}, {})
    ).verdict
    assert NEW.id not in [entry["effect"] for entry in verdict["effects"] + verdict["partial"]]
    assert NEW.id not in verdict["small"]
    assert verdict["against"][NEW.id] == CONTRADICTED
    (one,) = verdict["contradicted"]
    assert (one["effect"], one["measured"]) == (NEW.id, 0.0)
    said = f"Not named, although the drives ask for it: {NEW.short}, "
    assert said in verdict["paragraph"]
    assert "contradicts it: 0 ± 1 mΩ (impedance: resistance of a film)" in verdict["paragraph"]
    # Without it as much is missing as before: the word is by what is left.
    assert verdict["verdict"] in ("unknown", "named", "ambiguous")
