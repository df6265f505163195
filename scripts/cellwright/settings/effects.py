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
    ocv_volt_tolerance [V] : Tolerance of the OCV table, standard deviation: an error below it is
        no effect. Too narrow raises alarms, 5 mV hides effects. Source: repeats of a C/20 test
        on good cyclers.
    capacity_tolerance : Tolerance of the measured capacity, relative standard deviation. Source:
        repeats of a capacity test on good cyclers.
    soc_tolerance : Tolerance of the SoC that a test starts from, standard deviation. Source:
        docs/missing-effect.md.
    kelvin_tolerance [K] : Tolerance of a test's temperature that the sheet states and no sensor
        told, standard deviation: the cell's beside its chamber's. Source:
        docs/missing-effect.md.
    """

    material_volt: float = 0.001
    unknown_volt: float = 0.003
    ocv_volt_tolerance: float = 0.0015
    capacity_tolerance: float = 0.003
    soc_tolerance: float = 0.02
    kelvin_tolerance: float = 2.0
