"""Settings of the search for missing effects.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from typing import NamedTuple


class MissingEffect(NamedTuple):
    """The search for what a plain model of a cell lacks: an OCV, an ohmic resistance and two RC
    pairs, against every effect of the library.

    most_rows : Samples of either side, fit and proof, that are looked at; longer tests are
        averaged over more seconds and steady stretches thinned. Source: docs/missing-effect.md.
    refits : How many effects of each round are fitted in full, the best of the score test first.
        Source: docs/missing-effect.md, the right one is among the first eight.
    rounds : How many effects one cell may be found to lack. Source: docs/missing-effect.md.
    bic : An effect counts only if it lowers the Bayesian information criterion of the fit by
        more than this. Source: Kass and Raftery 1995, doi:10.1080/01621459.1995.10476572, very
        strong evidence.
    validation_chi_square : It must also lower the chi squared of the tests that took no part in
        the fit by more than this. Source: five standard deviations of one parameter.
    visible_chi_square : An effect of plausible size whose chi squared in these tests, after all
        that is free has followed it, stays below this cannot be tested. Source: five standard
        deviations of one parameter.
    material_volt [V] : An error that nobody acts on: an effect counts only if the mean square
        error falls by the square of this or more, and only parts of a test that it changes by as
        much are asked whether it helps. Source: accuracy of a voltage channel of a good cycler.
    unknown_volt [V] : An error left beyond noise and stated tolerances that is larger than this
        is told: as unknown, or as the remainder of what was named. Source: what models of cells
        are used for; resistance to 3 % at 0.1 V of overpotential.
    tie_absolute : Effects whose J (gain of the information criterion plus that of the proof)
        lies within this of the best are told as equally good. Source: Kass and Raftery 1995,
        doi:10.1080/01621459.1995.10476572, strong evidence.
    tie_relative : The same as a part of the best J; the larger of the two holds. Source:
        docs/missing-effect.md, frozen before the cells it was proved on were made.
    most_slow_volt [V] : Largest standard deviation of slow noise that is believed; more would
        swallow hysteresis and slow diffusion. Source: docs/missing-effect.md.
    most_slow_second [s] : Longest correlation time of slow noise that is believed. Source:
        docs/missing-effect.md.
    steep_volt [V] : Samples that steep_soc_tolerance alone moves by more than this count in no
        root mean square error. Source: docs/missing-effect.md.
    ocv_volt_tolerance [V] : Tolerance of the OCV table, standard deviation: an error below it is
        no effect. Too narrow raises alarms, 5 mV hides effects. Source: repeats of a C/20 test
        on good cyclers.
    ocv_soc_tolerance : Width in SoC over which an error of the OCV table stays alike. Source:
        docs/missing-effect.md.
    capacity_tolerance : Tolerance of the measured capacity, relative standard deviation. Source:
        repeats of a capacity test on good cyclers.
    soc_tolerance : Tolerance of the SoC that a test starts from, standard deviation. Source:
        docs/missing-effect.md.
    steep_soc_tolerance : Error of the SoC that no parameter follows, standard deviation; samples
        where the OCV is steep count less by it. Source: docs/missing-effect.md.
    kelvin_tolerance [K] : Tolerance of a test's temperature that the sheet states and no sensor
        told, standard deviation: the cell's beside its chamber's. Source:
        docs/missing-effect.md.
    voltage_reading_tolerance [V] : Error of the voltage's reading in one test alone, its offset
        and what it drifts by until the end, standard deviation. More than three times this,
        where tests like it do not show it, is told and taken off. Source: accuracy of a voltage
        channel of a good cycler.
    current_reading_tolerance : The same of the current's reading, relative, and of its offset as
        a C-rate. Source: 0.1 %, usual shunts.
    clock_tolerance [s] : The same of the time between the readings of voltage and current.
        Source: half of the shortest usual interval between two readings.
    known_tolerance : Beside reference cells of the same protocol, by how much the misfit that
        they share may be larger or smaller in this cell, relative standard deviation. Source:
        docs/missing-effect.md.
    """

    most_rows: int = 20000
    refits: int = 8
    rounds: int = 4
    bic: float = 10.0
    validation_chi_square: float = 25.0
    visible_chi_square: float = 25.0
    material_volt: float = 0.001
    unknown_volt: float = 0.003
    tie_absolute: float = 6.0
    tie_relative: float = 0.03
    most_slow_volt: float = 0.0012
    most_slow_second: float = 300.0
    steep_volt: float = 0.002
    ocv_volt_tolerance: float = 0.0015
    ocv_soc_tolerance: float = 0.12
    capacity_tolerance: float = 0.003
    soc_tolerance: float = 0.02
    steep_soc_tolerance: float = 0.003
    kelvin_tolerance: float = 2.0
    voltage_reading_tolerance: float = 0.001
    current_reading_tolerance: float = 0.001
    clock_tolerance: float = 0.05
    known_tolerance: float = 0.2


class MissingEffectGroupSpread(NamedTuple):
    """How healthy branches scatter about what is known of them. Only what is beyond counts: without
    it every healthy group raises an alarm.

    capacity : Capacity of a cell about its own tests, relative standard deviation. Source:
        repeats of a capacity test.
    resistance : Resistances of a cell about its own tests, relative standard deviation. Source:
        repeats of a pulse test; contacts moved.
    time_constant : Time constants of a cell about its own tests, relative standard deviation.
        Source: docs/missing-effect.md.
    ocv_volt [V] : OCV of a cell about its own curve, standard deviation, smooth over ocv_soc.
        Source: repeats of a C/20 test on good cyclers.
    type_capacity : Capacity of a cell of which only the type is known, relative standard
        deviation. Source: 5 % within a batch, study of 1,500 simulated cells.
    type_resistance : Resistances of a cell of which only the type is known, relative standard
        deviation. Source: 15 to 20 % within a batch, the same study.
    type_time_constant : Time constants of a cell of which only the type is known, relative
        standard deviation. Source: docs/missing-effect.md.
    type_ocv_volt [V] : OCV of a cell of which only the type is known, standard deviation.
        Source: docs/missing-effect.md.
    soc : SoC of a branch beside the others when the group was joined, standard deviation.
        Source: cells brought to one voltage before they are joined.
    celsius [°C] : Temperature of a cell beside the others, standard deviation. Source: cells
        beside each other in a chamber.
    wire_ohm [Ω] : Resistance of a branch's connection beside what groups.tsv says, standard
        deviation. Source: bolted or welded joints.
    current_offset_c_rate [1/h] : Offset of a branch's current sensor, standard deviation, as a
        C-rate of its cell. Source: 0.1 % of 1C, usual shunts.
    current_gain : Gain of a branch's current sensor, relative standard deviation. Source: 0.1 %,
        usual shunts.
    ocv_soc : Width in SoC over which the error of a cell's own OCV stays alike. Source:
        docs/missing-effect.md.
    widest : No healthy branch is farther out than this many standard deviations; what is counts
        as an effect. Source: docs/missing-effect.md.
    """

    capacity: float = 0.004
    resistance: float = 0.008
    time_constant: float = 0.03
    ocv_volt: float = 0.001
    type_capacity: float = 0.05
    type_resistance: float = 0.17
    type_time_constant: float = 0.2
    type_ocv_volt: float = 0.002
    soc: float = 0.002
    celsius: float = 0.2
    wire_ohm: float = 0.0001
    current_offset_c_rate: float = 0.001
    current_gain: float = 0.001
    ocv_soc: float = 0.12
    widest: float = 3.0


class MissingEffectGroupShared(NamedTuple):
    """What all branches may be off by together.

    resistance : Resistances of all cells together, beside their own tests, relative standard
        deviation. Source: a group's record weeks after its cells'.
    type_resistance : The same where a branch is known by its type only. Source:
        docs/missing-effect.md.
    time_constant : Time constants of all cells together, relative standard deviation. Source:
        docs/missing-effect.md.
    type_time_constant : The same where a branch is known by its type only. Source:
        docs/missing-effect.md.
    capacity : Capacity of all cells together, relative standard deviation. Source: repeats of a
        capacity test.
    type_capacity : The same where a branch is known by its type only. Source: 5 % within a
        batch.
    soc : SoC of the whole group at the start of a test, standard deviation. Source:
        docs/missing-effect.md.
    ocv_volt [V] : Error that all OCV curves share, standard deviation, smooth over ocv_soc.
        Source: repeats of a C/20 test on good cyclers.
    ocv_soc : Width in SoC over which the shared error of the OCV stays alike. Source:
        docs/missing-effect.md.
    activation_joule_per_mole [J/mol] : Activation energy of the resistances beside the cells'
        own, standard deviation. Source: docs/missing-effect.md.
    type_activation_joule_per_mole [J/mol] : The same where a branch was never tested over
        temperature. Source: docs/missing-effect.md.
    """

    resistance: float = 0.01
    type_resistance: float = 1.0
    time_constant: float = 0.03
    type_time_constant: float = 0.5
    capacity: float = 0.004
    type_capacity: float = 0.05
    soc: float = 0.005
    ocv_volt: float = 0.001
    ocv_soc: float = 0.03
    activation_joule_per_mole: float = 1000.0
    type_activation_joule_per_mole: float = 10000.0


class MissingEffectGroupGates(NamedTuple):
    """When an effect of a branch counts.

    refits : How many effects of each round are fitted in full, the best of the score test first.
        Source: docs/missing-effect.md.
    bic : An effect counts only if it lowers the Bayesian information criterion of the fit by
        more than this. Source: Kass and Raftery 1995, doi:10.1080/01621459.1995.10476572, very
        strong evidence.
    validation_chi_square : It must also lower the chi squared of the tests that took no part in
        the fit by more than this. Source: five standard deviations of one parameter.
    material_volt [V] : An error of the branch currents, times their cells' resistance, that
        nobody acts on: an effect counts only if the mean square error falls by the square of
        this or more, and only parts of a test that it changes by as much are asked whether it
        helps. Source: 5 mA in a cell of 20 mΩ, a thousandth of 1C: the offset of usual shunts.
    unknown_volt [V] : An error of the branch currents, times their cells' resistance, that is
        left beyond noise and the spread of healthy cells and is larger than this is told: as
        unknown, or as the remainder of what was named. Source: 50 mA in a cell of 20 mΩ, one
        percent of 1C: the accuracy of usual shunts.
    tie_absolute : Effects whose J lies within this of the best are told as equally good. Source:
        Kass and Raftery 1995, doi:10.1080/01621459.1995.10476572, strong evidence.
    tie_relative : The same as a part of the best J; the larger of the two holds. Source:
        docs/missing-effect.md.
    rounds : How many effects one group may be found to have. Source: docs/missing-effect.md.
    most_slow_volt [V] : Largest slow noise of a branch current that is believed, times its
        cell's resistance. Source: docs/missing-effect.md.
    shared_slow_volt [V] : Slow error of the group's voltage that all branches share, and that
        must not move their currents. Source: docs/missing-effect.md.
    """

    refits: int = 6
    bic: float = 10.0
    validation_chi_square: float = 25.0
    material_volt: float = 0.0001
    unknown_volt: float = 0.001
    tie_absolute: float = 6.0
    tie_relative: float = 0.003
    rounds: int = 3
    most_slow_volt: float = 0.0003
    shared_slow_volt: float = 0.002


class MissingEffectGroup(NamedTuple):
    """The search for what one branch of a parallel group has of its own, in tests of kind group;
    whether it runs at all says missing_effect.enabled.

    most_rows : Samples of either side, fit and proof, that are looked at; longer tests are
        averaged over more seconds. Source: docs/missing-effect.md.
    spread : How healthy branches scatter about what is known of them. Only what is beyond
        counts: without it every healthy group raises an alarm.
    shared : What all branches may be off by together.
    gates : When an effect of a branch counts.
    """

    most_rows: int = 20000
    spread: MissingEffectGroupSpread = MissingEffectGroupSpread()
    shared: MissingEffectGroupShared = MissingEffectGroupShared()
    gates: MissingEffectGroupGates = MissingEffectGroupGates()
