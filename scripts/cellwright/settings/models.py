"""Settings of equivalent circuits, of the methods that find them, and of filters.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from typing import NamedTuple


class Models(NamedTuple):
    """Equivalent circuits, their identification and their validation.

    members : Members of the family that are identified: a number of RC pairs, or DRT
        (resistances on a fixed series of time constants); +H with hysteresis, +K with kinetics,
        +D with diffusion in the particles.
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
    )
    split_rest_second: float = 120.0


class IdentificationMethods(NamedTuple):
    """Pulses on which identification methods are compared (thesis 2.3).

    pulses_per_cell : At most so many pulses of a cell, evenly over its tests and in each over
        SoC.
    samples : Each pulse with its rest is thinned to so many samples, dense at their beginnings.
    rest_lengths [1] : The rest after a pulse counts up to so many lengths of the pulse.
    """

    pulses_per_cell: int = 16
    samples: int = 200
    rest_lengths: float = 30.0


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
    convergence_band : A filter has converged when its error stays below this.
    convergence_hold_second [s] : It has to stay there for so long.
    sensor_volt [V] : White noise of the voltage, standard deviation.
    current_error_c_rate [1/h] : Error of the current sensor over the capacity, as a filter
        assumes it.
    resistance_error : Relative error of the model's overpotentials.
    resistance_error_second [s] : For how long an error of what acts at once lasts; 0 takes it
        for white noise.
    model_error_factor : Error of a model on another record, over its error on the blocks that
        were left out of its fit.
    model_error_volt [V] : Smallest error that a model is credited with.
    model_error_second [s] : For how long the error of the model's circuit stays what it is; 0
        takes it for white noise.
    skew_second [s] : For how long after a step of the current the voltage may be that of the
        current before; 0 trusts every sample alike.
    model_error_soc : Over how much of the charge the model's error at rest stays what it is; 0
        lets it change as that of the circuit.
    track_resistance : Estimate a scale of the ohmic resistance along with the SoC.
    window_second [s] : Window of the adaptive law.
    slope_window_soc : Width over which the slope of the OCV is taken.
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
    convergence_band: float = 0.03
    convergence_hold_second: float = 600.0
    sensor_volt: float = 0.002
    current_error_c_rate: float = 0.005
    resistance_error: float = 0.1
    resistance_error_second: float = 5.0
    model_error_factor: float = 1.0
    model_error_volt: float = 0.005
    model_error_second: float = 150.0
    skew_second: float = 0.2
    model_error_soc: float = 0.3
    track_resistance: bool = True
    window_second: float = 600.0
    slope_window_soc: float = 0.02


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
    power_points : Points of the discharge at which the power is told.
    current_spread [1] : Largest deviation of a branch current from its share by capacity within
        the safe window of SoC. Source: thesis 5.2: 125 to 130 % below 15 % SoC.
    draws : Draws of the Monte Carlo over the uncertainties of the cells.
    assemblies : Random assemblies of a fleet that a matched one is compared with.
    group_size : Cells in a parallel group that a fleet is matched into.
    string_length : Cells, or parallel groups, in a series string that a fleet is matched into.
    matching_celsius [°C] : Temperatures at which parallel groups are compared; a group counts by
        the worst of them.
    initial_soc_std [1] : SoC of a cell at the start beside what the sheet says, standard
        deviation.
    wire_relative_std [1] : Resistance of a connection beside what groups.tsv says, relative
        standard deviation.
    capacity_relative_std [1] : Least relative standard deviation of a cell's capacity; repeats
        of its capacity test may say more.
    resistance_relative_std [1] : Least relative standard deviation of a cell's resistance; its
        model may say more.
    random_seed : Seed of all draws.
    """

    c_rate: float = 0.5
    group_c_rate: float = 1.0
    pulse_second: float = 10.0
    largest_c_rate: float = 3.0
    power_points: int = 21
    current_spread: float = 0.2
    draws: int = 200
    assemblies: int = 200
    group_size: int = 2
    string_length: int = 10
    matching_celsius: tuple[float, ...] = (25.0,)
    initial_soc_std: float = 0.005
    wire_relative_std: float = 0.1
    capacity_relative_std: float = 0.003
    resistance_relative_std: float = 0.02
    random_seed: int = 17
