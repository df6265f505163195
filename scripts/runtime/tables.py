"""Tables of the results contract from artefacts: rows of all tests under one header."""

from pathlib import Path

from runtime import artefact
from runtime.artefact import stage_of

# What a row that is from several tests, in a table with others that are from one, says of its own.
OF_NO_TEST = {"test": "", "cycle": None, "ambient_temperature_celsius": None, "soc": None}


def rows_of(paths, tests) -> list[dict]:
    """Rows of all artefacts with content, each with its cell, test and facts of the sheet."""
    found = []
    for columns, about in artefact.load_all(paths):
        who = dict(about["wildcards"])
        none = {} if "test" in who else OF_NO_TEST
        facts = tests.get(f"{who.get('cell') or who.get('group')}/{who.get('test')}", none)
        found += [who | facts | row for row in artefact.rows(columns)]
    # Stages that share a table may have columns that the others lack: not known there.
    names = dict.fromkeys(name for row in found for name in row)
    return [dict.fromkeys(names) | row for row in found]


def excluded(paths, files) -> list[dict]:
    """What was refused, once, at the stage where it arose; never where it was passed on.

    A job of several outputs refuses all of them for one reason: the first one tells it.
    """
    found, told = [], set()
    for path in paths:
        about = artefact.read_about(path)
        if about["reason"] is None or about["origin"] != path:
            continue
        who = about["wildcards"]
        name, test = who.get("cell") or who.get("group"), who.get("test", "")
        if (name, test, about["rule"], about["reason"]) in told:
            continue
        told.add((name, test, about["rule"], about["reason"]))
        found.append(
            {
                "cell": name,
                "test": test,
                "file": ";".join(files.get(f"{name}/{test}", [])),
                "stage": stage_of(path),
                "reason": about["reason"],
            }
        )
    return found


def verdicts(found) -> list[dict]:
    """Rows of tables/missing_effect from verdict files: one an effect, one where there is none."""
    return [_verdict_row(v, effect) for v in found for effect in v["effects"] or [NO_EFFECT | v]]


NO_EFFECT = {"effect": None, "alternatives": [], "rmse_volt": {}, "validation_rmse_volt": {}}


def _verdict_row(verdict, effect) -> dict:
    fit, proof = effect["rmse_volt"], effect["validation_rmse_volt"]
    return {
        "cell": verdict["cell"],
        "verdict": verdict["verdict"],
        "effect": effect["effect"],
        "alternatives": ";".join(effect["alternatives"]),
        "rmse_before_volt": fit.get("before"),
        "rmse_after_volt": fit.get("after"),
        "validation_before_volt": proof.get("before"),
        "validation_after_volt": proof.get("after"),
        "gap_closed": effect.get("gap_closed"),
        "floor_volt": verdict["floor_volt"],
        "next_test": verdict["next_test"],
    }


def summary(cells, tables, models) -> list[dict]:
    """One row per cell from the tables (name → rows of text) and the models (cell → document)."""
    return [_summary_row(row, tables, models.get(row["cell"], {})) for row in cells]


def _summary_row(facts, tables, model) -> dict:
    cell = facts["cell"]
    mine = {name: [r for r in rows if r.get("cell") == cell] for name, rows in tables.items()}
    capacity = model.get("capacity_ampere_hour") or _slowest(mine["capacity"])
    rated = facts["rated_capacity_ampere_hour"]
    missing = mine.get("missing_effect", [])
    scored = [row for row in mine["validation"] if row["chosen"] == "True"]
    return {
        "cell": cell,
        "capacity_ampere_hour": capacity,
        "soh": capacity / rated if capacity and rated else None,
        "r0_50_25_ohm": _resistance(mine["resistance"]),
        "best_model": model.get("chosen"),
        "validation_rmse_volt": _pooled_rmse(scored),
        "soc_rmse": _filter_rmse(mine.get("soc", [])),
        "verdict": next((row["verdict"] for row in missing), None),
        "missing_effect": ";".join(row["effect"] for row in missing),
        "exclusions": len(mine["excluded"]),
        "notes": "; ".join(model.get("notes", [])),
    }


def _slowest(rows):
    full = [row for row in rows if row["direction"] == "discharge"] or rows
    rates = [float(row["c_rate"]) for row in full]
    # Cycles of one ageing test differ in the last digits of their rate: the first of them counts.
    alike = [row for row, rate in zip(full, rates, strict=True) if rate <= 1.05 * min(rates)]
    slow = min(alike, key=lambda row: float(row.get("cycle") or 0), default=None)
    return float(slow["capacity_ampere_hour"]) if slow else None


def _resistance(rows):
    """First-sample resistance of the discharge pulse nearest 50 % SoC within 10 %, at 20–30 °C."""
    near = [
        row
        for row in rows
        if row["direction"] == "discharge"
        and row["soc"]
        and float(row["delay_second"]) == 0
        and row["ambient_temperature_celsius"]
        and abs(float(row["ambient_temperature_celsius"]) - 25) <= 5
        and abs(float(row["soc"]) - 0.5) <= 0.1
    ]
    best = min(
        near,
        key=lambda row: (
            float(row.get("cycle") or 0),
            abs(float(row["soc"]) - 0.5),
            abs(float(row["c_rate"]) - 1),
        ),
        default=None,
    )
    return float(best["resistance_ohm"]) if best else None


def _pooled_rmse(rows):
    samples = sum(int(row["samples"]) for row in rows)
    if not samples:
        return None
    squares = sum(int(row["samples"]) * float(row["rmse_volt"]) ** 2 for row in rows)
    return (squares / samples) ** 0.5


def _filter_rmse(rows):
    """Root mean square of the adaptive filter's errors: every test and start alike, no fault."""
    mine = [r for r in rows if (r["filter"], r["scenario"]) == ("aekf", "nominal")]
    squares = [float(row["rmse_soc"]) ** 2 for row in mine]
    return (sum(squares) / len(squares)) ** 0.5 if squares else None


def manifest(paths) -> str:
    """`sha256<tab>path` of each file, sorted by path."""
    from runtime.provenance import sha256_of

    return "".join(f"{sha256_of(path)}\t{path}\n" for path in sorted(set(paths)))


def changed(manifest_path) -> list[str]:
    """What of a manifest is missing or has other bytes than it says."""
    from runtime.provenance import sha256_of

    found = []
    for line in Path(manifest_path).read_text(encoding="utf-8").splitlines():
        digest, path = line.split("\t")
        if not Path(path).is_file():
            found.append(f"{path}: missing")
        elif sha256_of(path) != digest:
            found.append(f"{path}: changed since the run that made it")
    return found
