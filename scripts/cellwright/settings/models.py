"""Settings of equivalent circuits, of filters, and of packs.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from typing import NamedTuple


class Models(NamedTuple):
    """Equivalent circuits, their identification and their validation.

    members : Members of the family that are identified: a number of RC pairs, or DRT
        (resistances on a fixed series of time constants); +H with hysteresis, +K with kinetics,
        +D with diffusion in the particles. P is one particle with charge transfer, of one set of
        numbers for all temperatures: it predicts voltages where it is better beyond chance,
        beside a member that serves filters, packs and exports.
    split_rest_second [s] : Tests of role `split` are cut into blocks at rests that last at least
        this long; those without one into parts, each at least twice as long.
    """

    members: tuple[str, ...] = (
        "1RC",
        "2RC",
        "2RC+H",
        "DRT",
        "DRT+H",
        "DRT+K",
        "DRT+D",
        "DRT+K+D",
        "DRT+H+K+D",
        "P",
    )
    split_rest_second: float = 120.0


class Soc(NamedTuple):
    """State of charge by counting, look-up and filters on tests that took no part in any fit.

    filters : Coulomb counting, OCV look-up, extended Kalman filter, adaptive one, adaptive one
        with the capacity as a state.
    initial_soc_error : Errors of the SoC that a filter starts from; the first also runs through
        every scenario. Starts are kept within 0 to 1.
    initial_soc : Further starts, as SoC itself.
    initial_soc_std : Standard deviation that a filter is told of its start.
    scenarios : Faults that filters are run with beside the record as it is; mid_drive starts
        them a third into the record, the cell not at rest.
    current_offset_c_rate [1/h] : Offset of the current in scenario current_offset, over the
        capacity.
    voltage_bias_volt [V] : Offset of the voltage in scenario voltage_bias.
    capacity_error : Relative error of the capacity in scenarios capacity_high and capacity_low.
    sensor_volt [V] : White noise of the voltage, standard deviation, where the records that the
        model was fitted to do not tell it.
    current_error_c_rate [1/h] : Error of the current sensor over the capacity, as a filter
        assumes it.
    """

    filters: tuple[str, ...] = ("coulomb", "ocv", "ekf", "aekf", "dual")
    initial_soc_error: tuple[float, ...] = (-0.3,)
    initial_soc: tuple[float, ...] = (0.0, 0.2, 0.4, 0.6, 0.8, 0.98)
    initial_soc_std: float = 0.5
    scenarios: tuple[str, ...] = (
        "current_offset",
        "voltage_bias",
        "capacity_high",
        "capacity_low",
        "mid_drive",
    )
    current_offset_c_rate: float = 0.01
    voltage_bias_volt: float = 0.005
    capacity_error: float = 0.1
    sensor_volt: float = 0.002
    current_error_c_rate: float = 0.005


class PackDecisions(NamedTuple):
    """What a pack can give and what is best done with it: capability of series packs, matching,
    replacement, safe windows, Monte Carlo.

    c_rate [1/h] : Rate of the discharges by which the capacity and energy of a pack are told,
        over the median capacity of its cells.
    group_c_rate [1/h] : Rate of the discharge of a parallel group whose branch currents are
        looked at. Source: thesis 5.2.
    pulse_second [s] : Length of the pulses of which the power of a series pack is told.
    largest_c_rate [1/h] : Largest current of such a pulse, over the median capacity of the
        cells: models are not asked what no test has shown.
    draws : Draws of the Monte Carlo over the uncertainties of the cells, and random assemblies
        of a fleet that a matched one is compared with.
    group_size : Cells in a parallel group that a fleet is matched into.
    string_length : Cells, or parallel groups, in a series string that a fleet is matched into.
    matching_celsius [°C] : Temperatures at which parallel groups are compared; a group counts by
        the worst of them.
    initial_soc_std [1] : SoC of a cell at the start beside what the sheet says, standard
        deviation.
    wire_relative_std [1] : Resistance of a connection beside what groups.tsv says, relative
        standard deviation.
    """

    c_rate: float = 0.5
    group_c_rate: float = 1.0
    pulse_second: float = 10.0
    largest_c_rate: float = 3.0
    draws: int = 200
    group_size: int = 2
    string_length: int = 10
    matching_celsius: tuple[float, ...] = (25.0,)
    initial_soc_std: float = 0.005
    wire_relative_std: float = 0.1
