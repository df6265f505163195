"""Settings of every step as typed values: units, meanings, defaults of a campaign.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from cellwright.settings.effects import (
    MissingEffect,
)
from cellwright.settings.models import (
    Models,
    PackDecisions,
    Soc,
)
from cellwright.settings.tests import (
    Clean,
    FastCharge,
    Files,
    Health,
    Impedance,
    Instrument,
    Ocv,
    Resistance,
    Segment,
    Temperature,
)

__all__ = [
    "Clean",
    "FastCharge",
    "Files",
    "Health",
    "Impedance",
    "Instrument",
    "MissingEffect",
    "Models",
    "Ocv",
    "PackDecisions",
    "Resistance",
    "Segment",
    "Soc",
    "Temperature",
]
