"""The figures of the search for a missing effect, by name, from its artefacts."""

from drawing import (
    effect_confounding,
    effect_evidence,
    effect_map,
    effect_ranking,
    effect_validation,
)


def draw(name, parts, settings):
    """Figure `name` of one cell; parts: content of its artefacts, settings: of the search."""
    figures = {
        "validation": lambda: effect_validation.draw(parts["verdict"], parts["series"]),
        "map": lambda: effect_map.draw(parts["map"]),
        "evidence": lambda: effect_evidence.draw(parts["evidence"]),
        "ranking": lambda: effect_ranking.draw(parts["ranking"], settings),
        "confounding": lambda: effect_confounding.draw(parts["confounding"]),
    }
    return figures[name]()
