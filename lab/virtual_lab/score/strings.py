"""Series packs: what a string is said to give, and how each of its cells ends, against truth."""

import pandas as pd

from virtual_lab.score import comparison, files

KEYS = ["group", "test"]
OF_PACK = {
    "usable_ampere_hour": ("discharged_ampere_hour", "Ah"),
    "usable_watt_hour": ("discharged_watt_hour", "Wh"),
}
OF_CELLS = {
    "capacity_ampere_hour": ("capacity_ampere_hour", "Ah"),
    "soc_at_pack_end": ("soc_at_end_of_discharge", "1"),
    "volt_at_pack_end": ("volt_at_end_of_discharge", "V"),
}


def series_packs(place: files.Campaign) -> pd.DataFrame:
    """Charge, energy and end of discharge of strings, of tests that end at a cell's cut-off.

    Of other tests, such as drives, the pipeline says what the string would give, which no truth of
    the test tells; of their cells only the capacity is compared.
    """
    true = files.true(place, "series_packs")
    if true is None or not len(true):
        return comparison.nothing()
    packs = files.with_columns(
        files.found(place, "series_packs"), [*KEYS, "measured_ended_by", *OF_PACK]
    )
    ended = packs.loc[packs["measured_ended_by"].notna(), KEYS]
    cells = files.with_columns(
        files.found(place, "series_pack_cells"), [*KEYS, "cell", "position", *OF_CELLS]
    )
    whole = true.drop_duplicates(KEYS).merge(ended, on=KEYS)
    parts = [
        _quantity("series_packs", packs.merge(ended, on=KEYS), whole, KEYS, name, *OF_PACK[name])
        for name in OF_PACK
    ]
    for name, (column, unit) in OF_CELLS.items():
        mine, theirs = cells, true
        if name != "capacity_ampere_hour":
            mine, theirs = (table.merge(ended, on=KEYS) for table in (cells, true))
        keys = [*KEYS, "cell"]
        parts.append(_quantity("series_pack_cells", mine, theirs, keys, name, column, unit))
    return comparison.gathered(parts)


def _quantity(table, found, true, keys, name, column, unit):
    wanted = true[keys].assign(true=true[column])
    mine = found[keys].assign(found=found[name])
    rows = wanted.merge(mine, on=keys, how="outer")
    at = rows.get("cell", "the pack")
    return comparison.errors(table, name, unit, rows.assign(cell=rows["group"], at=at))
