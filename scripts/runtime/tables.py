"""Tables of the results contract over all cells, and what lies in the results."""

import traceback
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from cellwright.circuits.model_file import in_use
from cellwright.health.summary import latest_health, reference_resistance, slowest_capacity
from cellwright.messages import Said, doubt_columns, doubts_in
from cellwright.numerics.statistics import pooled_rms
from cellwright.records.facts import stated_capacity
from runtime import artefact
from runtime.contract import stage_of
from runtime.csv_cells import frame_as_written

if TYPE_CHECKING:  # its import is paid for only by the jobs that make tables for people
    from pandas import DataFrame


def excluded(paths, files) -> "DataFrame":
    """Refused files and analyses, one row each, at the stage that refused them, what others left
    out of a record, and tables (.csv) that could not be made.

    A step of several outputs refuses all of them for one reason: it has one row.
    """
    from pandas import DataFrame

    rows = []
    for path in paths:
        about = artefact.read_about(path)
        reasons = about.get("facts", {}).get("left_out", [])
        # Passed-on reasons are told where they arose: one bad file is one row, not one a stage.
        if about["reason"] is not None:
            reasons = [about["reason"]] if about["origin"] == path else []
        wildcards = about["wildcards"]
        name, test = wildcards.get("cell") or wildcards.get("group", ""), wildcards.get("test", "")
        if Path(path).suffix == ".csv":  # of all cells
            reasons = [f"{Path(path).name} could not be made: {reason}" for reason in reasons]
        file = ";".join(files.get(f"{name}/{test}", []))
        step = about["rule"], about["step"]
        rows += [(name, test, file, stage_of(path), reason, *step) for reason in reasons]
    names = ["cell", "test", "file", "stage", "reason", "rule", "step"]
    table = DataFrame(rows, columns=names)
    once = table.drop_duplicates(["cell", "test", "reason", "rule", "step"])
    return once.drop(columns=["rule", "step"])


def verdicts(documents, witnesses=(), own=None, external=None) -> list[dict]:
    """Rows of tables/missing_effect from verdict files: one an effect, one where there is none.

    `witnesses` are rows of all cells, each with its cell; those of effects that are not named stand
    in the row of a cell's first effect. `own` are verdicts on the models in use, `external` on the
    user's simulator, by cell.
    """
    from cellwright.effects.story.words import lacks_nothing_above, one_line

    rows = []
    for verdict in documents:
        mine = [row for row in witnesses if row["cell"] == verdict["cell"]]
        further = ((found or {}).get(verdict["cell"]) for found in (own, external))
        line = one_line(verdict, *further)
        for place, effect in enumerate(verdict["effects"] or [NO_EFFECT | verdict]):
            others = [row for row in mine if not row["named"] and place == 0]
            named = verdict["effects"] or verdict.get("partial", [])
            names = {effect["effect"]} if verdict["effects"] else {one["effect"] for one in named}
            said = [row for row in mine if row["named"] and row["effect"] in names]
            above = lacks_nothing_above((own or {}).get(verdict["cell"]))
            row = _verdict_row(verdict, effect) | _errors_of(verdict, own)
            row |= {"in_one_line": line, "lacks_nothing_above_volt": above}
            row |= _in_use(verdict, effect["effect"], (own or {}).get(verdict["cell"]))
            rows.append(row | _sure(effect, said) | _counts([*said, *others]))
    return rows


def fleet_rows(documents, types, witnesses=()) -> list[dict]:
    """Rows of tables/fleet from verdict files: one a cell and effect that its type shows.

    A type of which no cell shows an effect has one row, without a cell. `types` are names of types
    by cell; `witnesses` as in `verdicts`.
    """
    from cellwright.effects.story.fleet import fleet

    found = fleet(documents, types, witnesses)
    rows = [entry._asdict() | {"sentence": found.sentences[entry.type]} for entry in found.entries]
    blank = {"cell": None, "effect": None, "shown": "no", "size_volt": None}
    silent = set(found.sentences) - {row["type"] for row in rows}
    rows += [
        {"type": name} | blank | {"sentence": found.sentences[name]} for name in sorted(silent)
    ]
    return rows


def _sure(effect, witnesses) -> dict:
    """Whether nothing speaks against a name; of no name it is not asked."""
    if not effect["effect"]:
        return {"sure": None, "doubts": "", "doubt_codes": ""}
    from cellwright.effects.story.words import doubts

    against = doubts(effect, witnesses)
    words, codes = "; ".join(against.values()), ";".join(against)
    return {"sure": not against, "doubts": words, "doubt_codes": codes}


def _counts(witnesses) -> dict:
    words = [row["says"] for row in witnesses]
    names = {"agrees": "agree", "contradicts": "contradict", "silent": "silent"}
    return {f"witnesses_{name}": words.count(word) for word, name in names.items()}


NO_EFFECT = {"effect": None, "alternatives": [], "rmse_volt": {}, "validation_rmse_volt": {}}


def _verdict_row(verdict, effect) -> dict:
    fit, proof = effect["rmse_volt"], effect["validation_rmse_volt"]
    branches = [effect["branch"], *effect["branch_alternatives"]] if "branch" in effect else []
    return {
        "cell": verdict["cell"],
        "verdict": verdict["verdict"],
        "effect": effect["effect"],
        "branch": ";".join(map(str, branches)),
        "alternatives": ";".join(effect["alternatives"]),
        "rmse_before_volt": fit.get("before"),
        "rmse_after_volt": fit.get("after"),
        "validation_before_volt": proof.get("before"),
        "validation_after_volt": proof.get("after"),
        "gap_closed": effect.get("gap_closed"),
        "contradicted": ";".join(one["effect"] for one in verdict.get("contradicted", [])),
        "floor_volt": verdict["floor_volt"],
        "next_test": verdict["next_test"],
        "next_question": (verdict.get("next_question") or {}).get("code"),
    }


def _errors_of(verdict, own) -> dict:
    """Errors on tests for proof: of the names, of the whole model, and of the model in use."""
    kinds = {"names": verdict, "model": verdict, "member": (own or {}).get(verdict["cell"])}
    return {
        f"validation_{kind}_volt": ((of or {}).get("errors", {}).get(kind) or {}).get(
            "validation_volt"
        )
        for kind, of in kinds.items()
    }


def _in_use(verdict, effect, own) -> dict:
    """The model in use on the same tests, and what the part of it that an effect is is worth."""
    from cellwright.effects.story.in_use import part_of, sentences_in_use

    known, part = (own or {}).get("in_use") or {}, part_of(effect, own)
    return {
        "in_use": known.get("model"),
        "in_use_fit_volt": own["as_given_rmse_volt"]["fit"] if known else None,
        "part": part.get("part"),
        "part_worth": part.get("worth"),
        "with_part_volt": known["left_out_rmse_volt"] if part else None,
        "without_part_volt": part.get("left_out_rmse_volt"),
        "of_model_in_use": " ".join(sentences_in_use(verdict, own)),
    }


def load_frame(path) -> "DataFrame":
    """A CSV table with its numbers as numbers; cells and tests stay text, unknown is NaN."""
    from pandas import read_csv

    # Only an empty cell is unknown: a test may be called NA.
    settings = {"keep_default_na": False, "na_values": [""]}
    return frame_as_written(
        read_csv(
            path, dtype={"cell": str, "test": str, "doubt": str, "doubt_codes": str}, **settings
        )
    )


def load_frames(paths) -> dict:
    """CSV tables by their names."""
    return {Path(path).stem: load_frame(path) for path in paths}


def load_models(paths) -> dict:
    """Models that could be made, by the name of their cell."""
    loaded = [(path, artefact.load_all([path])) for path in paths]
    return {Path(path).stem: model for path, found in loaded for model, _ in found}


def summary(cells, tables, models, log=print) -> "DataFrame":
    """One row per cell from the tables (name → DataFrame) and the models (cell → document).

    A cell that cannot be summed up has a row that says so, and `log` is told why in full: one row
    costs no other.
    """
    from pandas import DataFrame

    # Tables of whole types of cells have no column `cell`.
    tables = {name: frame for name, frame in tables.items() if "cell" in frame}
    # Each table is divided once: a look through it for every cell would grow with their square.
    parts = {name: dict(iter(frame.groupby("cell", sort=False))) for name, frame in tables.items()}
    rows = []
    for facts in cells:
        of_cell = {
            name: parts[name].get(facts["cell"], frame.iloc[:0]) for name, frame in tables.items()
        }
        try:
            rows.append(_summary_row(facts, of_cell, models.get(facts["cell"], {})))
        except Exception as error:
            said = artefact.failure(error, "to sum up this cell")
            rows.append({"cell": facts["cell"], "exclusions": len(of_cell["excluded"])})
            rows[-1]["notes"] = said
            log("".join(traceback.format_exception(error)))
    return DataFrame(rows, dtype=object)


def _summary_row(facts, of_cell, model) -> dict:
    rated, scored = facts["rated_capacity_ampere_hour"], of_cell["validation"]
    # What models count in goes first: SoC of all tables refers to it.
    counted = slowest_capacity(_known(of_cell["capacity"])) or _first_check_up(of_cell)
    of = model if model.get("capacity_ampere_hour") else counted
    capacity, spread = (of.get(f"capacity_{name}ampere_hour") for name in ("", "std_"))
    notes = model.get("notes", [])
    if capacity is None and facts.get("state_of_health"):
        capacity, source = stated_capacity(rated, facts["state_of_health"])
        notes = [*notes, f"capacity: {source}; no test measures it"]
    fresh = capacity / rated if capacity and rated else None
    if fresh is not None and not isfinite(fresh):
        fresh, said = None, f"{capacity:g} Ah over a rating of {rated:g} Ah is beyond all numbers"
        notes = [*notes, f"no state of health: {said}"]
    if counted.get("of_check_up"):
        notes = [*notes, f"capacity: of the {counted['direction']} at the first check-up"]
    missing, filtered = of_cell["missing_effect"], of_cell["soc"]
    scored = scored[scored["chosen"].eq(True)]
    pulses = of_cell["resistance"][of_cell["resistance"]["soc"].notna()]
    resistance = reference_resistance(_known(pulses)) or {}
    filtered = filtered[filtered["filter"].eq("aekf") & filtered["scenario"].eq("nominal")]
    # Against a count that a rest contradicts no filter is right or wrong.
    filtered = filtered.reindex(columns=["rmse_soc", "reference_off_soc"])
    filtered = filtered[~filtered["reference_off_soc"].gt(0.0)]
    return {
        "cell": facts["cell"],
        "capacity_ampere_hour": capacity,
        "capacity_std_ampere_hour": spread,
        **_health(of_cell, fresh, fresh * spread / capacity if fresh and spread else None),
        "r0_50_25_ohm": resistance.get("resistance_ohm"),
        "r0_50_25_std_ohm": resistance.get("resistance_std_ohm"),
        "best_model": in_use(model) if model.get("chosen") else None,
        "validation_rmse_volt": pooled_rms(scored["rmse_volt"], scored["samples"]),
        # Every test and start of the adaptive filter alike, without the faulty ones.
        "soc_rmse": pooled_rms(filtered["rmse_soc"]),
        "verdict": next(iter(missing["verdict"]), None),
        "missing_effect": _effects_named(missing),
        "in_one_line": _in_one_line(missing, scored),
        "exclusions": len(of_cell["excluded"]),
        **_doubts(of_cell),
        "notes": "; ".join(notes),
    }


def resistances(cells, tables, models, verdicts, note=print) -> "DataFrame":
    """R0 of each cell and all other resistances that are called so, see `resistances_of_cell`.

    `tables` are frames by name, `models` documents by cell, `verdicts` those of cells and groups.
    Of a cell that cannot be told `note` says why: it costs no other.
    """
    from cellwright.health.resistances import resistances_of_cell

    frames = [tables[name][tables[name]["soc"].notna()] for name in ("resistance", "eis")]
    known = (frames, models, verdicts)
    return _of_each_cell(cells, resistances_of_cell, *known, "to relate its resistances", note)


def energies(cells, tables, models, verdicts, note=print) -> "DataFrame":
    """Activation energies of each cell, one for each quantity, see `energies_of_cell`.

    Arguments as of `resistances`.
    """
    from cellwright.health.energies import energies_of_cell

    laws = tables["temperature"]
    # Laws of a type have no cell.
    known = ([laws if "cell" in laws else laws.assign(cell=None)], models, verdicts)
    return _of_each_cell(cells, energies_of_cell, *known, "to relate its activation energies", note)


def _of_each_cell(cells, told, frames, models, verdicts, aim, note):
    """What is `told` of each cell by its rows of some tables, its model and its verdict."""
    from pandas import DataFrame

    found = {verdict["cell"]: verdict for verdict in verdicts if "cell" in verdict}
    parts = [(dict(iter(frame.groupby("cell", sort=False))), frame.iloc[:0]) for frame in frames]
    rows = []
    for name in (facts["cell"] for facts in cells):
        own = [_known(part.get(name, none)) for part, none in parts]
        try:
            of_cell = told(*own, models.get(name, {}), found.get(name, {}))
        except Exception as error:
            note(f"{name}: {artefact.failure(error, aim)}")
            continue
        rows += [{"cell": name} | row for row in of_cell]
    return DataFrame(rows, dtype=object)


def _first_check_up(of_cell) -> dict:
    """Capacity of the first check-up, of a cell whose tests are no complete cycles; or empty."""
    rows = _known(of_cell.get("checkups", of_cell["capacity"]))
    rows = [row for row in rows if row.get("capacity_ampere_hour")]
    first = min(rows, key=lambda row: row["cycle"] or 0, default=None)
    return {"of_check_up": True} | first if first else {}


def _doubts(of_cell) -> dict:
    """Columns of what speaks against capacities and resistances of a cell, each with its tests."""
    said = {}
    for table in ("capacity", "resistance"):
        if "doubt" not in of_cell[table]:
            continue
        rows = of_cell[table][of_cell[table]["doubt"].notna()]
        for row in rows.to_dict("records"):
            for one in doubts_in(row, table):
                said.setdefault(one, {})[row["test"]] = None
    return doubt_columns(
        Said(f"{', '.join(tests)}: {one}", one.code) for one, tests in said.items()
    )


def _in_one_line(missing, scored) -> str | None:
    """What a cell shows and its model lacks, with the test that contradicts it."""
    from cellwright.effects.story.words import beside_worst_test

    line, above = (
        next(iter(missing[name].dropna()), None)
        for name in ("in_one_line", "lacks_nothing_above_volt")
    )
    known = scored[scored["rmse_volt"].notna()]
    volt_by_test = dict(zip(known["test"], known["rmse_volt"], strict=True))
    return line and beside_worst_test(line, above, volt_by_test)


def _effects_named(missing) -> str:
    """Effects of a cell, joined with ";"; what is as good as one of them stands beside it."""
    named = missing[missing["effect"].notna()]
    # A column without an entry is read as numbers.
    others = named["alternatives"].fillna("").astype(str).str.replace(";", " or ")
    both = named["effect"].astype(str) + others.where(others == "", " or " + others)
    return ";".join(both)


def _health(of_cell, fresh, fresh_std) -> dict:
    """Latest state of health, or that of a cell that was not aged; knee and remaining cycles.

    `fresh` and `fresh_std` are its capacity and their deviation over the rating, or None.
    """
    not_aged = {"soh": fresh, "soh_std": fresh_std}
    latest = latest_health(of_cell["health"].to_dict("records")) or not_aged
    life = next(iter(of_cell["fade"].to_dict("records")), {})
    names = ("knee_cycle", "remaining_cycles", "remaining_lower_cycles", "remaining_upper_cycles")
    return {
        "soh": latest["soh"],
        "soh_std": latest.get("soh_std"),
        "soh_cycle": latest.get("cycle"),
        **{name: life.get(name) for name in names},
    }


def _known(frame) -> list[dict]:
    """Rows of a table, None where a number is not known."""
    return frame.astype(object).where(frame.notna(), None).to_dict("records")


def manifest(paths) -> str:
    """`sha256<tab>path` of each file and of those in each folder, sorted by path."""
    from runtime.provenance import sha256_of

    files = {file for path in paths for file in _files_of(Path(path))}
    return "".join(f"{sha256_of(path)}\t{path}\n" for path in sorted(files))


def _files_of(path):
    """A file itself; of a folder its files without those that Snakemake keeps there."""
    inside = [path] if path.is_file() else path.iterdir()
    return [file.as_posix() for file in inside if not file.name.startswith(".snakemake")]


def changed(manifest_path) -> list[str]:
    """Files of a manifest that are missing or whose bytes have changed."""
    from runtime.provenance import sha256_of

    # All of them: who edits one table by hand has often edited two.
    differences = []
    for line in Path(manifest_path).read_text(encoding="utf-8").splitlines():
        digest, path = line.split("\t")
        if not Path(path).is_file():
            differences.append(f"{path}: missing")
        elif sha256_of(path) != digest:
            differences.append(f"{path}: changed since the run that made it")
    return differences
