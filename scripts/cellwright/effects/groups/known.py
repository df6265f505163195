"""What is known of a healthy group before its fit, and when an effect of a branch counts."""

from typing import NamedTuple


class Spread(NamedTuple):
    """How healthy branches scatter about what is known of them, standard deviations.

    Only what is beyond counts: without it every healthy group raises an alarm. capacity,
    resistance, time_constant : relative, of a cell about its own tests; type_* of a cell of which
    only the type is known. ocv_volt, type_ocv_volt : of its OCV, smooth over `ocv_soc` [V].
    soc : beside the others when the group was joined [1]. celsius : beside the others [K].
    wire_ohm : of a connection beside what groups.tsv says [ohm]. current_offset_c_rate,
    current_gain : of a branch's current sensor [1/h], [1]. widest : no healthy branch is farther
    out than so many of these.
    """

    soc: float = 0.002
    celsius: float = 0.2
    wire_ohm: float = 0.0001
    current_offset_c_rate: float = 0.001
    current_gain: float = 0.001
    capacity: float = 0.004  # repeats of a capacity test
    resistance: float = 0.008  # repeats of a pulse test; contacts moved
    time_constant: float = 0.03
    ocv_volt: float = 0.001  # repeats of a C/20 test on good cyclers
    type_capacity: float = 0.05  # 5 % within a batch, study of 1,500 simulated cells
    type_resistance: float = 0.17  # 15 to 20 % within a batch, the same study
    type_time_constant: float = 0.2
    type_ocv_volt: float = 0.002
    ocv_soc: float = 0.12
    widest: float = 3.0


class Shared(NamedTuple):
    """What all branches may be off by together, standard deviations.

    resistance, time_constant, capacity : of all cells beside their own tests, relative; type_*
    where a branch is known by its type only. soc : of the whole group at the start of a test [1].
    ocv_volt : error that all OCV curves share, smooth over `ocv_soc` [V].
    activation_joule_per_mole : of the resistances beside the cells' own; type_* where a branch was
    never tested over temperature.
    """

    resistance: float = 0.01  # a group's record weeks after its cells'
    type_resistance: float = 1.0
    time_constant: float = 0.03
    type_time_constant: float = 0.5
    capacity: float = 0.004  # repeats of a capacity test
    type_capacity: float = 0.05  # 5 % within a batch
    soc: float = 0.005
    ocv_volt: float = 0.001  # repeats of a C/20 test on good cyclers
    ocv_soc: float = 0.03
    activation_joule_per_mole: float = 1000.0
    type_activation_joule_per_mole: float = 10000.0


class GroupGates(NamedTuple):
    """When an effect of a branch counts; meanings as those of a cell's gates.

    price : fall of the fit's cost, beside a gain of density that is sure: eight deviations of the
    readings. What tests of its own leave unsure of a cell has taken 54 (a wire of 0.5 mOhm, of the
    laboratory); the smallest true effect took 86.
    elsewhere : the other parts must only not contradict: what an offset of a branch's sensor
    changes is little beside what healthy branches may differ by. material_volt : none, for of a
    branch the size counts, in its own unit [V]. unknown_volt : error of the branch currents, times
    their cells' ohmic resistance, beyond the floor, up to which there is no unknown effect [V].
    most_slow_volt : largest slow noise of a branch current, times its cell's ohmic resistance [V].
    shared_slow_volt : slow error of the model's voltage that all branches share, and that must not
    move their currents [V].
    """

    visible_chi_square: float = 25.0
    joins: float = 2.0
    price: float = 64.0
    counts: float = 3.0
    apart: float = 1.645
    elsewhere: float = 0.0
    material_volt: float = 0.0
    unknown_volt: float = 0.001
    unknown_share: float = 0.5
    most_slow_volt: float = 0.0003
    shared_slow_volt: float = 0.002
