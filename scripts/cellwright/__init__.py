"""Characterisation of lithium-ion cells: `import cellwright as cw`; docs/api.md shows each step.

Importing the package loads nothing else: a step's module is loaded when the step is first used.
"""

from importlib import import_module

MODULE_OF = {
    "CellFacts": "cellwright.records.facts",
    "TestFacts": "cellwright.records.facts",
    "Refusal": "cellwright.refusal",
    "read": "cellwright.api.series",
    "read_simulated": "cellwright.api.series",
    "clean": "cellwright.api.series",
    "segment": "cellwright.api.series",
    "repeats": "cellwright.api.series",
    "course": "cellwright.api.protocols",
    "capacity": "cellwright.api.protocols",
    "ocv": "cellwright.api.protocols",
    "ocv_from_load": "cellwright.api.charge",
    "ocv_from_rests": "cellwright.api.protocols",
    "chamber_steps": "cellwright.api.protocols",
    "resistance": "cellwright.api.protocols",
    "relaxation": "cellwright.api.protocols",
    "ica": "cellwright.api.protocols",
    "ica_peaks": "cellwright.api.protocols",
    "impedance": "cellwright.api.protocols",
    "thermometer": "cellwright.api.protocols",
    "fast_charge": "cellwright.api.protocols",
    "ageing_cycles": "cellwright.api.protocols",
    "temperature_laws": "cellwright.api.laws",
    "temperature_laws_of_type": "cellwright.api.laws",
    "fast_charge_laws": "cellwright.api.laws",
    "cold_limit": "cellwright.api.laws",
    "resistance_surface": "cellwright.api.laws",
    "polarisation_laws": "cellwright.api.laws",
    "ocv_over_temperature": "cellwright.api.laws",
    "ocv_shifts": "cellwright.api.laws",
    "capacity_loss": "cellwright.api.laws",
    "ica_over_temperature": "cellwright.api.laws",
    "health_from_peaks": "cellwright.api.health_peaks",
    "ica_life": "cellwright.api.tracks",
    "ica_tracks": "cellwright.api.tracks",
    "ageing_over_temperature": "cellwright.api.laws",
    "fade": "cellwright.api.health",
    "check_ups": "cellwright.api.health",
    "state_of_health": "cellwright.api.health",
    "fleet_resistance": "cellwright.api.health",
    "compare_protocols": "cellwright.api.health",
    "degradation_modes": "cellwright.api.degradation",
    "plateau_losses": "cellwright.api.degradation",
    "basis": "cellwright.api.charge",
    "basis_at": "cellwright.api.charge",
    "lender": "cellwright.api.charge",
    "state_of_charge": "cellwright.api.charge",
    "identify": "cellwright.api.models",
    "identify_without": "cellwright.api.models",
    "compare_temperature_laws": "cellwright.api.models",
    "predict_left_out": "cellwright.api.models",
    "finish_model": "cellwright.api.models",
    "refuse_model": "cellwright.api.models",
    "thermal_constants": "cellwright.api.laws",
    "borrow_model": "cellwright.api.models",
    "model_of_table": "cellwright.api.models",
    "compare_bias_ways": "cellwright.api.models",
    "worst_corrected": "cellwright.api.models",
    "corrected_voltages": "cellwright.api.models",
    "export_model": "cellwright.api.export",
    "simulate": "cellwright.api.models",
    "validate": "cellwright.api.models",
    "estimate_soc": "cellwright.api.models",
    "missing_effect": "cellwright.api.effects",
    "add_own_effects": "cellwright.api.effects",
    "missing_effect_stability": "cellwright.api.effects",
    "witnesses": "cellwright.api.effects",
    "prepared_case": "cellwright.api.effects",
    "missing_group_effect": "cellwright.api.effects",
    "identify_branches": "cellwright.api.effects",
    "simulate_group": "cellwright.api.effects",
    "validate_group": "cellwright.api.packs",
    "simulate_pack": "cellwright.api.packs",
    "run_pack_phases": "cellwright.api.packs",
    "Phase": "cellwright.packs.phases",
    "Thermal": "cellwright.packs.thermal",
    "assemble_pack": "cellwright.api.pack_model",
    "pack_model": "cellwright.api.pack_model",
    "series_pack": "cellwright.api.packs",
    "nested_pack": "cellwright.api.packs",
    "pack_decisions": "cellwright.api.packs",
    "match_cells": "cellwright.api.packs",
    "check_group": "cellwright.api.effects",
}

__all__ = list(MODULE_OF)


def __getattr__(name: str):
    """The step or type of this name, its module loaded now."""
    if name == "settings":
        return import_module("cellwright.settings")
    if name not in MODULE_OF:
        raise AttributeError(f"cellwright has no {name!r}; it has {', '.join(MODULE_OF)}")
    return getattr(import_module(MODULE_OF[name]), name)


def __dir__():
    return sorted([*globals(), *MODULE_OF])
