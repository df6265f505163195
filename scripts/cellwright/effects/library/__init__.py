"""The closed vocabulary of effects. To add one, add an entry here (docs/missing-effect-library.md).

Of one stage, effects act in the order of the library. Of the resistance stage self-heating is the
last: its heat is that of the resistances as all other effects leave them.
"""

from cellwright.effects.library import (
    ageing,
    charge,
    groups,
    ocv,
    outside,
    overpotential,
    resistance,
    sensor,
    thermal,
)

MODULES = (resistance, thermal, overpotential, charge, ageing, ocv, sensor)
LIBRARY = {effect.id: effect for module in MODULES for effect in module.EFFECTS}


def known_effects():
    """All entries: of a cell, of a branch of a group, and outside the vocabulary."""
    return (*LIBRARY.values(), *groups.EFFECTS, *outside.EFFECTS)
