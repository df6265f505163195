"""A file of any instrument as Battery Data Format, with what was decided in a sidecar."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd

from cellwright.refusal import Refusal
from first_look.one_file import look

LABELS = {
    "test_time_second": "Test Time / s",
    "current_ampere": "Current / A",
    "voltage_volt": "Voltage / V",
    "unix_time_second": "Unix Time / s",
    "cycle_count": "Cycle Count / 1",
    "step_index": "Step Index / 1",
    "ambient_temperature_celsius": "Ambient Temperature / degC",
    "surface_temperature_celsius": "Surface Temperature T1 / degC",
    "net_capacity_ampere_hour": "Net Capacity / Ah",
    "frequency_hertz": "Frequency / Hz",
    "impedance_real_ohm": "Real Impedance / ohm",
    "impedance_imaginary_ohm": "Imaginary Impedance / ohm",
}


def convert(path, to=None) -> tuple[Path, Path]:
    """Write the file as BDF (csv, or Parquet where `to` ends so) and its sidecar (json).

    The current is positive on charge; rows that cleaning flags stay out, as in a campaign.

    Raises
    ------
    Refusal
        The file cannot be read, or a campaign would refuse it, or the goal is there already.
    """
    path = Path(path)
    goal = Path(to) if to else path.with_name(path.name.split(".")[0] + ".bdf.csv")
    if goal.exists():
        raise Refusal(f"{goal} is there already; it is not overwritten")
    seen = look(path)
    if seen.refused:
        raise Refusal(seen.refused)
    columns = seen.series or seen.reading.columns
    frame = pd.DataFrame({LABELS[k]: v for k, v in columns.items() if k in LABELS})
    if goal.suffix == ".parquet":
        frame.to_parquet(goal)
    else:
        frame.to_csv(goal, index=False)
    about = {
        "source": path.name,
        "source_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "instrument": seen.reading.instrument,
        "rows": len(frame),
        "rows_in_source": len(next(iter(seen.reading.columns.values()))),
        "current_is": "positive on charge" if seen.series else None,
        "notes": list(seen.notes),
        "left_out_columns": sorted(set(map(str, columns)) - set(LABELS)),
    }
    side = goal.with_name(goal.name + ".json")
    side.write_text(json.dumps(about, indent=2, default=np.ndarray.tolist) + "\n", encoding="utf-8")
    return goal, side
