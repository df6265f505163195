"""`plan [FOLDER]`: which tests lower the error of a cell's model most, for a wanted use and hours.

What is known of the cell comes from the results of a campaign that was run, or, without one, from
its rating and cut-offs.
"""

import csv
from contextlib import chdir
from pathlib import Path

from cellwright.identification import planning
from cellwright.records import inputs
from cellwright.refusal import Refusal
from runtime import artefact, job_inputs


def add_arguments(parser):
    """The arguments of the command."""
    parser.add_argument("folder", nargs="?", help="campaign that was run; none: by the rating")
    parser.add_argument("--cell", help="of the campaign; may be left out where it has one model")
    parser.add_argument("--rating", type=float, metavar="AH", help="of a cell without a campaign")
    parser.add_argument("--cutoffs", type=float, nargs=2, metavar=("LOW", "HIGH"), help="volts")
    parser.add_argument("--celsius", type=float, nargs="+", required=True, help="of the use")
    parser.add_argument("--c-rates", type=float, nargs="+", required=True, help="of its loads")
    parser.add_argument("--soc", type=float, nargs=2, default=(0.05, 1.0), metavar=("LOW", "HIGH"))
    parser.add_argument("--hours", type=float, required=True, help="that all tests may take")
    parser.add_argument("--chamber", type=float, nargs="+", help="what it reaches; else as the use")
    parser.add_argument("--drives", action="store_true", help="drives may be fitted too")
    parser.add_argument("--csv", help="write the plan there")


def lines_of(options):
    """The plan in words, one line after another.

    Parameters
    ----------
    options : what was given for `add_arguments`.

    Raises
    ------
    Refusal : neither a campaign nor a rating with cut-offs, or both; no model with a particle; or
        what `planning.plan` refuses.
    """
    use = planning.Use(tuple(options.celsius), tuple(options.c_rates), tuple(options.soc))
    known, words, misfit_volt = _known(options)
    chamber = options.chamber or options.celsius
    candidates = planning.candidates_of(known, chamber, use, drives=options.drives)
    steps, _ = planning.plan(known, candidates, use, hours=options.hours)
    yield words
    yield f"{'test':<28}{'°C':>6}{'hours':>8}{'before':>9}{'after':>8} mV   of other such cells"
    for step in steps:
        numbers = f"{step.ambient_temperature_celsius:6g}{step.hours:8.1f}"
        numbers += f"{1e3 * step.before_volt:9.3g}{1e3 * step.after_volt:8.3g}"
        span = f"{1e3 * step.after_low_volt:.3g} to {1e3 * step.after_high_volt:.3g}"
        yield f"{step.test:<28}{numbers}      {span}"
    spent = sum(step.hours for step in steps)
    yield (
        f"{spent:.1f} of {options.hours:g} h, of which {planning.READY_HOUR:g} h a test for the "
        "full charge and the chamber. Error: expected RMS of the voltage over the use, by what the "
        "tests leave open of the model's numbers"
    )
    if misfit_volt is not None:
        yield (
            "The model's structure misses blocks left out of its fit by "
            f"{1e3 * misfit_volt:.2g} mV beside that; no test lowers it"
        )
    if options.csv:
        with open(options.csv, "w", encoding="utf-8", newline="") as file:
            rows = csv.writer(file, lineterminator="\n")
            rows.writerow(planning.PlannedTest._fields)
            rows.writerows(steps)
        yield f"written: {options.csv}"


def _known(options):
    """What is known of the cell, in words too, and RMS error of left-out blocks [V] or None."""
    by_rating = options.rating is not None or options.cutoffs is not None
    if options.folder and by_rating:
        raise Refusal(
            "a campaign's folder and --rating or --cutoffs were given; wanted one of both"
        )
    if options.folder:
        return _of_campaign(Path(options.folder), options.cell)
    if options.rating is None or options.cutoffs is None:
        raise Refusal("wanted a campaign's folder, or --rating AH and --cutoffs LOW HIGH")
    known = planning.knowledge_from_rating(options.rating, options.cutoffs)
    return known, f"a cell of {options.rating:g} Ah by its rating and cut-offs alone", None


def _of_campaign(folder, cell):
    names = sorted(path.stem for path in (folder / "results/models").glob("*.json"))
    if not names:
        raise Refusal(f"{folder}: found no results/models/*.json, wanted a campaign that was run")
    if cell is None and len(names) > 1:
        raise Refusal(f"{folder}: found models of {', '.join(names)}; wanted one with --cell")
    cell = cell or names[0]
    if cell not in names:
        raise Refusal(f"{folder}: found no model of {cell}; there are {', '.join(names)}")
    with chdir(folder):
        path = f"results/models/{cell}.json"
        model, about = artefact.load(path), artefact.read_about(path)
        series = [source for source in about["inputs"] if "/clean/" in source]
        basis = artefact.load_first([p for p in about["inputs"] if "/basis/" in p])
        known = planning.knowledge_from_model(
            model,
            basis,
            inputs.cell_facts(about["params"]["cell"]),
            job_inputs.tests(series),
            split_rest_second=about["params"]["split_rest_second"],
        )
    tests = [test for entry in model["members"][0]["conditions"] for test in entry["tests"]]
    words = f"{cell}: what is known from {', '.join(tests)}"
    return known, words, model["particle"].get("left_out_rmse_volt")
