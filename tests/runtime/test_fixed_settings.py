"""What a campaign is told of a key that there was is what the code does without it."""

from pathlib import Path

import pytest

from cellwright.effects.base import Tolerance
from cellwright.filters import evaluate
from cellwright.filters.plant import Noise
from cellwright.identification.lacking import FITTED
from cellwright.laws.points import PREFERRED_C_RATE
from cellwright.packs.decisions.group_use import GROUP_C_RATE
from cellwright.packs.series.power import LARGEST_C_RATE
from cellwright.packs.uncertainty.draws import INITIAL_SOC_STD, WIRE_RELATIVE_STD
from cellwright.protocols.ica.spline import PROMINENCE
from cellwright.protocols.rests import SHORTEST_REST_SECOND
from cellwright.records.conditions import REFERENCE_CELSIUS
from cellwright.series.steps import GAP_SECOND
from runtime import settings

SCHEMA = settings.load(Path(__file__).resolve().parents[2] / "workflow/schemas", "config")
NUMBERS = {
    "segment.gap_second": GAP_SECOND,
    "ocv.rest_second": SHORTEST_REST_SECOND,
    "temperature.c_rate": PREFERRED_C_RATE,
    "relaxation.shortest_rest_second": SHORTEST_REST_SECOND,
    "ica.prominence": PROMINENCE,
    "soc.initial_soc_error": evaluate.START_ERROR,
    "soc.initial_soc_std": evaluate.START_STD,
    "soc.current_offset_c_rate": evaluate.OFFSET_C_RATE,
    "soc.voltage_bias_volt": evaluate.BIAS_VOLT,
    "soc.capacity_error": evaluate.CAPACITY_ERROR,
    "soc.sensor_volt": Noise().sensor_volt,
    "missing_effect.ocv_volt_tolerance": Tolerance().ocv_volt,
    "missing_effect.capacity_tolerance": Tolerance().capacity,
    "missing_effect.soc_tolerance": Tolerance().soc,
    "missing_effect.kelvin_tolerance": Tolerance().kelvin,
    "pack_decisions.group_c_rate": GROUP_C_RATE,
    "pack_decisions.largest_c_rate": LARGEST_C_RATE,
    "pack_decisions.matching_celsius": REFERENCE_CELSIUS,
    "pack_decisions.initial_soc_std": INITIAL_SOC_STD,
    "pack_decisions.wire_relative_std": WIRE_RELATIVE_STD,
}
WORDS = {"models.fit_kinds": list(FITTED), "relaxation.kinds": ["hppc", "pulse_resistance"]}


@pytest.mark.parametrize(("key", "number"), NUMBERS.items())
def test_a_fixed_key_is_told_with_the_number_that_is_used(key, number):
    assert float(SCHEMA["fixed"][key].split()[0]) == number


def test_every_fixed_key_is_known_here_and_no_setting():
    assert set(SCHEMA["fixed"]) == {*NUMBERS, *WORDS}
    assert not set(SCHEMA["fixed"]) & {name for name, _ in settings.keys(SCHEMA)}
    for key, words in WORDS.items():
        assert all(word in SCHEMA["fixed"][key] for word in words)
