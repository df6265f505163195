"""Missing effects of a cell, or of a branch of a parallel group."""

from cellwright.api import inputs, results
from cellwright.settings import MissingEffect, Models

MODELS = Models()


def missing_effect(
    cell,
    basis,
    tests,
    settings=None,
    *,
    references=(),
    model=None,
    simulated=None,
    library=None,
    measurements=None,
    ambient_celsius=None,
    split_rest_second=MODELS.split_rest_second,
    **changes,
):
    """Effects that a model of a cell lacks, proved on tests that were not fitted.

    Of the plain circuit; of a model of the cell (`model`); or of any other (`simulated`).

    tests : of roles fit, split and validation. settings : `settings.MissingEffect`.
    references : (cell, basis, tests) of healthy cells of the type; from three on, the cell is
        compared with them.
    model : result of `finish_model`, or path of its file: what does its chosen member still lack?
    simulated : dict test → (time (n,) [s], voltage (n,) [V]) by any simulator, on the test's own
        clock, or the result of `read_simulated`: what does that one lack? Tests without a simulated
        voltage take no part; one whose simulation does not fit is left out with a note.
    library : effects by id that are tried, None: all of `effects.library.LIBRARY`.
    measurements, ambient_celsius : other measurements of the cell, as `tables` and
        `ambient_celsius` of `witnesses` without `series`: an effect that one of them contradicts is
        not named. None: there are none.

    Returns ranking, residual_map, evidence, series; content: model, and verdict, the document of
    docs/missing-effect.md. Raises Refusal: no OCV, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    from cellwright.effects.finding import missing_effect as searched
    from cellwright.effects.given.external import Simulated
    from cellwright.effects.witnesses.collected import Others

    curves = None if simulated is None else {k: Simulated(*v) for k, v in simulated.items()}
    searched_in, chosen = _searched_in(cell, basis, tests, library, references, model)
    settings = _search(settings, split_rest_second, changes)
    if measurements is not None:
        rows = {name: inputs.rows(table) for name, table in measurements.items()}
        chosen["others"] = Others(rows, searched_in[1], ambient_celsius or {})
    return _missing_effect(searched(*searched_in, settings=settings, simulated=curves, **chosen))


def _searched_in(cell, basis, tests, library, references, model):
    """What a search goes through: its arguments by position, and by name."""
    from cellwright.effects.finding import Reference
    from cellwright.effects.library import LIBRARY

    def record_of(cell, basis, tests):
        return inputs.cell_facts(cell), inputs.basis(basis), inputs.tests(tests)

    # Healthy cells of the type go the same way as the cell itself, so that errors of method cancel.
    about = (*record_of(cell, basis, tests), LIBRARY if library is None else library)
    healthy = [Reference(*record_of(*reference)) for reference in references]
    given = None if model is None else inputs.model(model)
    return about, {"references": healthy, "model": given}


def _search(settings, split_rest_second, changes) -> dict:
    search = inputs.settings_of(MissingEffect, settings, changes)
    return search._asdict() | {"split_rest_second": split_rest_second}


def _missing_effect(finding):
    """Result of a search: its tables (of a group fewer), verdict and model as content."""
    # A group has no map of its own: such tables are empty.
    names = ("ranking", "residual_map", "evidence", "series")
    tables = {name: getattr(finding, name, {}) for name in names}
    content = {"verdict": finding.verdict, "model": finding.model}
    return results.Result(tables, content, finding.notes)


def witnesses(verdict, model, basis, tables, *, ambient_celsius=None, library=None):
    """Which independent measurements of a cell agree with a verdict, contradict it, or are silent.

    verdict, model : of `missing_effect`.
    tables : rows or DataFrames by name, what is absent was not measured: resistance, eis,
        relaxation, capacity and ocv_entropic, with the test's temperature, SoC and cycle beside
        each row, and of capacities `started`, its date, where it is known; `series`, that of
        `missing_effect`.
    ambient_celsius : chamber's temperature by test [°C].
    library : effects by id, None: all of `effects.library.LIBRARY`.

    Returns rows, one a witness: what is measured, what the verdict implies, which it says.
    Source: docs/missing-effect.md.
    """
    from cellwright.effects.library import LIBRARY
    from cellwright.effects.witnesses.collected import measured_of
    from cellwright.effects.witnesses.collected import witnesses as compared

    content, known = inputs.basis(basis), dict(tables)
    verdict, model = inputs.content(verdict), inputs.content(model)
    series = inputs.columns(known.pop("series", {}))
    rows = {name: inputs.rows(table) for name, table in known.items()} | {"series": series}
    measured = measured_of(rows, content, model, ambient=ambient_celsius or {})
    return results.Result({"rows": compared(verdict, model, measured, library or LIBRARY)})


def prepared_case(
    cell, basis, tests, settings=None, *, split_rest_second=MODELS.split_rest_second, **changes
):
    """The records and the plain model of a cell, as the search for missing effects takes them.

    tests : those of other kinds than are searched are skipped. settings : `settings.MissingEffect`.

    Returns `effects.case.Case`. Raises Refusal: no OCV, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    from cellwright.effects.finding import settings_of
    from cellwright.effects.preparing import KINDS, SLOW_TEST, prepared

    plain = _search(settings, split_rest_second, changes)
    gates, tolerance = settings_of(plain)
    options = {"tolerance": tolerance, "gates": gates, "settings": plain}
    # Read before the kinds are chosen: impedance spectra have no columns of a series.
    known = [(inputs.test_facts(facts), series) for facts, series in tests]
    mine = inputs.tests([one for one in known if one[0].kind in (SLOW_TEST, *KINDS)])
    return prepared(inputs.cell_facts(cell), inputs.basis(basis), mine, **options).case


def missing_group_effect(group, branches, known_cells, tests):
    """Effects that one branch of a parallel group has and the others have not.

    group : its name. branches : in order of position.
    known_cells : `effects.groups.finding.KnownCell` of each branch.
    tests : of the group, with branch currents.

    Returns as `missing_effect`, with empty residual_map and evidence. Raises
    Refusal: a branch without a model, no test to fit, or none for validation.
    Source: docs/missing-effect.md.
    """
    from cellwright.effects.groups.finding import missing_group_effect as searched

    rows = [inputs.branch_facts(branch) for branch in branches]
    known = [one._replace(model=inputs.content(one.model)) for one in known_cells]
    return _missing_effect(searched(group, rows, known, inputs.tests(tests)))
