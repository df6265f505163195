"""The test report after ISO/IEC 17025:2017, clause 7.8.2.1, of what a laboratory states.

Nobody but the laboratory knows who asked for the tests, when the cells came and who answers for the
results. It states that in `test_report` of config.yaml; without it there is no such page.
"""

from runtime.page_tables import Cell, link, measured, plain_table

COVERAGE = 2.0  # factor of the expanded uncertainty: about 95 % of a normal distribution
# What a laboratory may state: letter of clause 7.8.2.1, in words, and whether the clause asks for
# it always.
FIELDS = {
    "laboratory": ("b", "Laboratory", True),
    "address": ("b, c", "Its address, and where the tests were made if elsewhere", True),
    "number": ("d", "Number of this report", True),
    "customer": ("e", "Customer, with contact", True),
    "method": ("f", "Method", True),
    "items": ("g", "Items tested: identification and condition", True),
    "received": ("h", "Items received on", True),
    "tested": ("i", "Tested on", True),
    "issued": ("j", "Report issued on", True),
    "sampling": ("k", "Sampling", False),
    "deviations": ("n", "Additions to, deviations and exclusions from the method", True),
    "authorised_by": ("o", "Authorised by", True),
    "external_providers": ("p", "Results of external providers", False),
    "from_customer": ("7.8.2.2", "Stated by the customer", False),
}
ONLY_ITEMS = "The results relate only to the items tested."
IN_FULL = "This report shall not be reproduced except in full without the laboratory's approval."
# Of a row of the summary: what is reported, its number and deviation, its unit and the scale to it.
RESULTS = (
    ("capacity", "capacity_ampere_hour", "capacity_std_ampere_hour", "Ah", 1.0),
    ("state of health", "soh", "soh_std", "%", 1e2),
    ("R0, 50 % SoC, 25 °C", "r0_50_25_ohm", "r0_50_25_std_ohm", "mΩ", 1e3),
)
READ = (
    "± is the expanded measurement uncertainty, two standard deviations (k = 2, about 95 %); what "
    "goes into each is in the methods. Conditions of every single reading: capacity and resistance "
    "by test on the pages of the cells."
)


def section(stated, cells, summary, excluded, version):
    """What the page of the test report shows; None where the laboratory has stated nothing.

    Parameters
    ----------
    stated : dict of FIELDS → text, those that the settings have.
    cells : rows of cells.tsv. summary, excluded : rows of the tables so named, as text.
    version : of this program.

    Returns
    -------
    found : dict with `missing` (a sentence, or ""), `lines` (clause, what, list of texts),
        `results` (Table), `closing` (sentences) and `number`.
    """
    stated = {name: text.strip() for name, text in (stated or {}).items() if text.strip()}
    if not stated:
        return None
    missing = [name for name, (_, _, needed) in FIELDS.items() if needed and name not in stated]
    texts = {name: [stated[name]] if name in stated else [] for name in FIELDS}
    texts["method"] += [f"Evaluated with Cellwright {version}, see Methods."]
    texts["items"] += ["; ".join(map(_item, cells))]
    left_out = [f"{row['cell']} {row['test']}: {row['reason']}" for row in excluded]
    texts["deviations"] += [f"Excluded: {'; '.join(left_out)}."] if left_out else []
    return {
        "number": stated.get("number", ""),
        "missing": _missing(missing),
        "lines": [
            (clause, words, texts[name] if name in stated else ["not stated", *texts[name]])
            for name, (clause, words, needed) in FIELDS.items()
            if needed or name in stated
        ],
        "results": _results(summary),
        "closing": [ONLY_ITEMS, IN_FULL],
    }


def _missing(names) -> str:
    if not names:
        return ""
    keys = ", ".join(f"test_report.{name}" for name in names)
    return f"Not yet a report after ISO/IEC 17025, 7.8.2: config.yaml lacks {keys}."


def _item(row) -> str:
    about = [row.get("chemistry"), row.get("note")]
    told = ", ".join(filter(None, about))
    return f"{row['cell']} ({told})" if told else row["cell"]


def _results(summary):
    """Results of each item with their units and expanded uncertainties."""
    lines = []
    for row in summary:
        for words, name, std_name, unit, scale in RESULTS:
            if not row.get(name):
                continue
            std = row.get(std_name)
            spread = str(COVERAGE * float(std)) if std else None
            size = measured(row[name], spread, scale)
            doubt = row.get("doubt") or ("" if std else "uncertainty not known")
            lines.append([link(row["cell"]), words, size, unit, Cell(doubt, mark="wrong")])
    columns = ["item", "quantity", "result", "unit", "remark"]
    title = "Results"
    return plain_table("results", title, READ, columns, lines, made="results/summary.csv")
