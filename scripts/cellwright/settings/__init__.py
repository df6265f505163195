"""Settings of every step as typed values: units, meanings, defaults of a campaign.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from cellwright.settings.effects import (
    MissingEffect,
    MissingEffectGroup,
)
from cellwright.settings.models import (
    Models,
    PackDecisions,
    Soc,
)
from cellwright.settings.tests import (
    CapacityLoss,
    Clean,
    DegradationModes,
    FastCharge,
    Files,
    Health,
    Ica,
    IcaTemperature,
    Impedance,
    Instrument,
    Ocv,
    OcvStep,
    OcvTemperature,
    Relaxation,
    Resistance,
    Segment,
    Temperature,
)

__all__ = [
    "CapacityLoss",
    "Clean",
    "DegradationModes",
    "FastCharge",
    "Files",
    "Health",
    "Ica",
    "IcaTemperature",
    "Impedance",
    "Instrument",
    "MissingEffect",
    "MissingEffectGroup",
    "Models",
    "Ocv",
    "OcvStep",
    "OcvTemperature",
    "PackDecisions",
    "Relaxation",
    "Resistance",
    "Segment",
    "Soc",
    "Temperature",
]
