"""Models that are ready for use: what stands on several rooms at once."""

from cellwright.circuits.inputs import model as model_content
from cellwright.circuits.model_file import in_use
from cellwright.circuits.parameters import parameter_rows
from cellwright.circuits.particle import NAME as PARTICLE
from cellwright.effects.member import finished
from cellwright.filters.learnt import with_learnt_noise
from cellwright.identification.compensation import with_laws
from cellwright.identification.in_use import (
    beside_particle,
    fitted_records,
    marked,
    particle_task,
    proved,
    with_parts,
)
from cellwright.identification.intervals import with_intervals
from cellwright.records import inputs
from cellwright.result import Result
from cellwright.settings import Models

MODELS = Models()


def finish_model(
    cell,
    model,
    basis=None,
    tests=(),
    *,
    left_out=(),
    left_out_temperatures=(),
    effects=None,
    split_rest_second=MODELS.split_rest_second,
):
    """A model ready for use: the effects found, its member chosen, its laws over temperature.

    model : result of `identify`, of `borrow_model` or of `identify_branches`, or path of its file.
    basis, tests : only for a model of the cell's own tests.
    left_out : whole tests for validation; a member with effects is chosen only if it wins there.
    The chosen member learns the noise of the filters from `tests` (docs/soc-filters.md).
    left_out_temperatures : results of `predict_left_out` on fitted tests, or none.
    effects : `model` of the result of `missing_effect`, or None. Where they are given a
        particle in use says what each of its parts is worth (docs/particle.md).

    Returns content: schema cellwright-model/2; parameters, choice. Raises Refusal: a group's
    document that has no model of the cell. Source: docs/models.md.
    """
    facts = inputs.cell_facts(cell)
    content = model_content(model, cell=facts.cell)
    content, choice = finished(
        content,
        None if basis is None else inputs.basis(basis),
        facts,
        inputs.tests(tests),
        inputs.content(effects),
        split_rest_second=split_rest_second,
    )
    proof = inputs.tests(left_out), facts
    rest = {"split_rest_second": split_rest_second}
    content, choice = proved(content, choice, *proof, **rest)
    if content.get("left_out"):
        measured = inputs.basis(basis), facts, inputs.tests(tests)
        fitted = fitted_records(content, *measured, **rest)
        content, choice = beside_particle(content, choice, fitted)
        if effects is not None and in_use(content) == PARTICLE:
            task, conditions = particle_task(content, fitted, *measured, **rest)
            content, choice = with_parts(content, choice, task, conditions)
        records = [[one.record for one in condition] for condition in fitted]
        content = with_learnt_noise(with_intervals(content, fitted), records)
    errors = [row for result in left_out_temperatures for row in inputs.rows(result)]
    return _with_choice(with_laws(content, errors), choice)


def _with_choice(content, choice):
    """Result of a model whose member was chosen: rows of the choice, none where there was none."""
    tables = {"parameters": parameter_rows(content), "choice": marked(content, choice)}
    words = content.get("choice"), (content.get("particle") or {}).get("choice")
    return Result(tables, content, tuple(filter(None, words)) if choice else ())
