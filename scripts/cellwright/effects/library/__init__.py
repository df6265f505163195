"""The closed vocabulary of effects. To add one, add an entry to a module here (docs/add-an-effect.md).

The order is that in which effects of one stage act: the sensor's before the cell's own.
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
