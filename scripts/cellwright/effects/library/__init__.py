"""The closed vocabulary of effects. To add one, add an entry here (docs/add-an-effect.md).

Of one stage, effects act in the order in which a search has added them.
"""

from cellwright.effects.library import (
    charge,
    diffusion,
    hysteresis,
    kinetics,
    ocv,
    resistance,
    sensor,
    thermal,
)

MODULES = (resistance, thermal, hysteresis, diffusion, kinetics, charge, ocv, sensor)
LIBRARY = {effect.id: effect for module in MODULES for effect in module.EFFECTS}
