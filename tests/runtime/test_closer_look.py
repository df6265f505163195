"""What a reader of the report may zoom into."""

import base64
import gzip
import json

import numpy as np

from runtime import closer_look

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
