"""What a reader of the report may zoom into."""

import base64
import gzip
import json

import numpy as np

from runtime import artefact, closer_look

TIME = np.arange(10_000.0)


def unpacked(text):
    return json.loads(gzip.decompress(base64.b64decode(text)))


def drive(saved, name="t", **more):
    columns = {"test_time_second": TIME, "current_ampere": np.sin(TIME / 50)}
    columns |= {"voltage_volt": 3.7 + 0.05 * np.sin(TIME / 50), "soc": 0.5 + 0 * TIME}
    columns |= {"scored": TIME >= 0} | more
    return saved(f"results/stages/simulation/A/{name}.parquet", columns)


def test_a_spike_of_one_sample_is_seen_and_the_rest_is_thinned(saved):
    model = 3.7 + 0.05 * np.sin(TIME / 50)
    model[4321] -= 0.5
    path = drive(saved, simulated_2RC_volt=model)
    (lines,) = closer_look.looks_of([path], [], {("A", "t"): "2RC"}).values()
    labels = ["time", "measured", "model 2RC", "measured − model", "current"]
    found = {line["label"]: line["values"] for line in unpacked(lines)}
    assert list(found) == labels
    assert len(found["time"]) <= closer_look.MOST_ROWS * 1.1
    worst = int(np.argmax(found["measured − model"]))
    assert found["measured − model"][worst] == 500.0
    assert round(3600 * found["time"][worst]) == 4321


def test_many_tests_have_lines_and_refused_ones_have_none(saved):
    paths = [drive(saved, f"t{k}") for k in range(3)]
    refused = saved("results/stages/simulation/A/none.parquet", "no start")
    looks = closer_look.looks_of([*paths, refused], [], {})
    assert [test for _, test in looks] == ["t0", "t1", "t2"]


def test_temperature_is_that_of_the_cell_where_it_was_recorded(saved):
    columns = {"test_time_second": TIME[:5000:10], "voltage_volt": 3.7 + 0 * TIME[:5000:10]}
    zeros = ("current_ampere", "charge_ampere_hour", "step_index", "doubt")
    columns |= {name: 0 * TIME[:5000:10].astype(int) for name in zeros}
    columns |= {"surface_temperature_celsius": 25 + TIME[:5000:10] / 1000}
    clean = saved("results/stages/clean/A/t.parquet", columns)
    assert artefact.read_about(clean)["reason"] is None
    (lines,) = closer_look.looks_of([drive(saved)], [clean], {}).values()
    last = unpacked(lines)[-1]
    assert last["panel"] == "temperature [°C]"
    assert last["values"][0] == 25.0
    assert last["values"][-1] is None, "beyond the last reading there is none"
