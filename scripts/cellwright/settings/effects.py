"""Settings of the search for missing effects.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from typing import NamedTuple


class MissingEffect(NamedTuple):
    """The search for what a plain model of a cell lacks: an OCV, an ohmic resistance and two RC
    pairs, against every effect of the library.

    material_volt [V] : An error that nobody acts on: a name takes the square of this or more off
        the mean square error, of the records fitted or of those for validation. Source: accuracy
        of a voltage channel of a good cycler.
    unknown_volt [V] : An error left beyond noise and stated tolerances that is larger than this
        is told: as unknown, or as the remainder of what was named. Source: what models of cells
        are used for; resistance to 3 % at 0.1 V of overpotential.
    """

    material_volt: float = 0.001
    unknown_volt: float = 0.003
