"""Packs in the overview: worst errors, what they give of their cells, what checks found."""

import pandas as pd

from runtime import pack_page

GROUPS = [
    {"group": "pair", "position": 1, "cell": "A", "connection": "parallel"},
    {"group": "pair", "position": 2, "cell": "B", "connection": "parallel"},
    {"group": "string", "position": 1, "cell": "pair", "connection": "series"},
    {"group": "string", "position": 2, "cell": "C", "connection": "series"},
    {"group": "idle", "position": 1, "cell": "D", "connection": "parallel"},
    {"group": "idle", "position": 2, "cell": "E", "connection": "parallel"},
]


def frame(*rows):
    return pd.DataFrame(list(rows)).astype(object).fillna("").astype(str)


def branch(cell, test, ampere, share, volt=0.004):
    names = ["group", "cell", "test", "current_rmse_ampere", "voltage_rmse_volt"]
    row = dict(zip(names, ["pair", cell, test, ampere, volt], strict=True))
    return row | {"relative_current_rmse_above_15_soc": share}


TABLES = {
    "packs": frame(branch("A", "slow", 0.02, 0.013), branch("B", "fast", 0.3, "", volt=0.0061)),
    "pack_findings": frame(
        {
            "group": "pair",
            "lost_share": 0.05,
            "group_capacity_ampere_hour": 5.7,
            "cells_capacity_ampere_hour": 6.0,
            "current_c_rate": 1.0,
        },
        {"group": "pair", "lost_share": "", "group_capacity_ampere_hour": ""},
    ),
    "series_packs": frame(
        {
            "group": "string",
            "cell_mean_abs_volt": 0.0035,
            "cell_worst_mean_abs_volt": 0.0121,
            "cell_worst": "C",
            "usable_ampere_hour": 2.8,
            "charge_moved_ampere_hour": 3.0,
            "ended_by": "C",
        }
    ),
    "missing_effect": frame({"cell": "pair", "in_one_line": "shows capacity (branch 2)"}),
    "pack_checks": frame(
        {"group": "pair", "test": "slow", "found": True, "sentence": "a sum that is exact"},
        {"group": "pair", "test": "slow", "found": False, "sentence": ""},
    ),
}


def test_each_group_with_results_has_its_worst_numbers_in_one_line():
    pair, string = pack_page.section(TABLES, GROUPS)
    assert pair == {
        "group": "pair",
        "wiring": "A || B",
        "current": "300 mA RMS, B in fast",
        "voltage": "6.1 mV RMS",
        "charge": "5.7 of 6 Ah of its cells at 1C (-5.0%)",
        "verdict": "shows capacity (branch 2)",
    }
    assert string == {
        "group": "string",
        "wiring": "(A || B) + C",
        "current": "",
        "voltage": "cells 3.5 mV in the mean, C 12.1 mV",
        "charge": "2.8 of 3 Ah of its mean cell, ended by C",
        "verdict": "",
    }


def test_a_pack_of_groups_has_the_worst_of_its_channels():
    names = ["group", "test", "channel", "of", "rmse", "unit"]
    rows = [
        ("string", "drive", "pack voltage", "string", 0.02, "V"),
        ("string", "drive", "cell voltage", "C", 0.03, "V"),
        ("string", "drive", "branch current", "pair", 1.25, "A"),
    ]
    nested = frame(*(dict(zip(names, row, strict=True)) for row in rows))
    (line,) = pack_page.section({"nested_packs": nested}, GROUPS)
    assert line["voltage"] == "30 mV RMS, C in drive"
    assert line["current"] == "1.25 A RMS, pair in drive"
