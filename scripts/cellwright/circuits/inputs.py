"""Models that a user gives to a public step, as the science takes them."""

from collections.abc import Mapping

from cellwright.circuits.model_check import refuse_unusable
from cellwright.circuits.model_file import model_of
from cellwright.records.inputs import content, in_words, is_path, with_fields
from cellwright.refusal import Refusal

# Fields by which a document is known for a model: any JSON file has the right suffix.
MODEL = ("cell", "capacity_ampere_hour", "ocv", "members", "chosen")


def model(document, *, cell=None):
    """Content of a model: of a result, a document, or the path of results/models/<cell>.json.

    Of a document that holds the models of a group that of `cell`. Anything else than a model is
    refused with what it is, and a model that cannot be simulated with what is wrong in it.
    """
    found = content(document)
    if cell is not None and isinstance(found, Mapping):
        found = model_of(found, cell)
    wanted = "a model: a result of `identify` or `finish_model`, or its results/models/<cell>.json"
    found = with_fields(document, found, MODEL, wanted)
    refuse_unusable(found)
    return found


def models(documents) -> list:
    """Content of each of several models, see `model`; one document instead is refused."""
    # A dict is iterable: its keys would be taken for models, and the message be about a text.
    if is_path(documents) or isinstance(getattr(documents, "content", documents), Mapping):
        raise Refusal(f"found {in_words(documents)}, wanted a list of models, one a cell")
    return [model(document) for document in documents]
