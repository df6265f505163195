"""Instruments: how a cell's behaviour is sampled, measured, spoiled and written to files.

A writer takes the columns of `measurement.measured` (or of a spectrum) and gives bytes, the same
each time; with `discharge_positive` the file's current is positive on discharge.
"""

from virtual_lab.instruments.formats import (
    arbin_csv,
    bdf_csv,
    bdf_parquet,
    bitrode_csv,
    digatron_csv,
    digatron_german_csv,
    digatron_spectrum_csv,
    plett_csv,
    spectrum_csv,
)
from virtual_lab.instruments.text import START, UNIX_START_SECOND

__all__ = ["START", "UNIX_START_SECOND", "WRITERS", "arbin_csv", "bdf_csv", "bdf_parquet",
           "bitrode_csv", "digatron_csv", "digatron_german_csv", "digatron_spectrum_csv",
           "plett_csv", "spectrum_csv"]  # fmt: skip

WRITERS = {
    "arbin": arbin_csv,
    "bdf": bdf_csv,
    "parquet": bdf_parquet,
    "bitrode": bitrode_csv,
    "digatron": digatron_csv,
    "digatron_german": digatron_german_csv,
    "plett": plett_csv,
    "eis": spectrum_csv,
    "digatron_eis": digatron_spectrum_csv,
}
