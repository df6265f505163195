"""Effects of one branch of a parallel group; `Effect.position` says which branch.

An effect is by how much the free parameters that it `replaces` are beyond those of a healthy
branch: its one parameter is added to them, a share by multiplication, to a logarithm as one.
"""

from cellwright.effects.library.vocabulary import Effect, Parameter, Tie

OTHER_TEMPERATURE = "the group's drive at a chamber temperature 20 K away"
EFFECTS = (
    Effect(
        id="branch_wire_resistance",
        short="wire resistance",
        sentence="the connection of one branch has another resistance than stated",
        parameters=(
            Parameter(
                "excess_ohm", "Ohm", 0.0, -0.05, 0.1, step=2e-4, plausible=5e-3, material=3e-4
            ),
        ),
        stage="resistance",
        replaces=("wire",),
        shows="the voltage across each connection under load",
        consequence="the branch takes less of every load and is used less",
    ),
    Effect(
        id="branch_initial_soc",
        short="initial soc",
        sentence="one cell was at another state of charge when the group was joined",
        parameters=(
            Parameter("excess_soc", "1", 0.0, -0.5, 0.5, step=2e-3, plausible=0.02, material=2e-3),
        ),
        stage="counting",
        replaces=("soc",),
        shows="the branch currents in the first minutes after joining",
        consequence="balancing currents flow while the group rests",
    ),
    Effect(
        id="branch_capacity",
        short="capacity",
        sentence="one cell has another capacity than its own or its type's tests say",
        parameters=(
            Parameter(
                "excess_relative", "1", 0.0, -0.6, 0.6, step=5e-3, plausible=0.1, material=0.01
            ),
        ),
        stage="counting",
        replaces=("capacity",),
        needs=("soc_range",),
        shows="a capacity test of the cell by itself",
        consequence="the cell runs ahead of the others towards empty and full",
    ),
    Effect(
        id="branch_cell_resistance",
        short="cell resistance",
        sentence="one cell has another resistance than its own or its type's tests say",
        parameters=(
            Parameter(
                "excess_relative", "1", 0.0, -0.7, 3.0, step=5e-3, plausible=0.2, material=0.02
            ),
        ),
        stage="resistance",
        replaces=("log_r0", "log_slow"),
        shows="pulses on the cell by itself, or drives of the group at two temperatures",
        ties=(Tie("branch_temperature", OTHER_TEMPERATURE, one_temperature=True),),
        consequence="the branch takes less of every load; the others age faster",
    ),
    Effect(
        id="branch_temperature",
        short="temperature",
        sentence="one cell is at another temperature than was measured",
        parameters=(
            Parameter(
                "warmer_kelvin", "K", 0.0, -40.0, 40.0, step=0.2, plausible=5.0, material=0.5
            ),
        ),
        stage="resistance",
        replaces=("celsius",),
        shows="a sensor on each cell, or drives of the group at two temperatures",
        # A hotter cell looks like a less resistive one.
        ties=(Tie("branch_cell_resistance", OTHER_TEMPERATURE, one_temperature=True),),
        consequence="the warm cell takes more of every load and ages faster",
    ),
    Effect(
        id="branch_current_offset",
        short="current offset",
        sentence="the current reading of one branch is off by a constant",
        parameters=(
            Parameter(
                "offset_ampere", "A", 0.0, -2.0, 2.0, step=5e-3, plausible=0.1, material=0.01
            ),
        ),
        stage="current",
        replaces=("offset",),
        shows="the branch readings while the group is open and long at rest",
        consequence="charge counted in this branch drifts with time",
    ),
    Effect(
        id="branch_current_gain",
        short="current gain",
        sentence="the current reading of one branch is off by a factor",
        parameters=(
            Parameter(
                "gain_relative", "1", 0.0, -0.5, 0.5, step=2e-3, plausible=0.05, material=5e-3
            ),
        ),
        stage="current",
        replaces=("gain",),
        shows="the sum of the branch readings beside the total under load",
        consequence="the share of this branch is misread, though it carries what it should",
    ),
)
GROUP_LIBRARY = {effect.id: effect for effect in EFFECTS}
