"""Effects of one branch of a parallel group; `Effect.position` says which branch.

An effect is by how much the free parameters that it `replaces` are beyond those of a healthy
branch: its one parameter is added to them, a share by multiplication, to a logarithm as one.
"""

from cellwright.effects.library.vocabulary import Effect, Parameter, Tie, worded

OTHER_TEMPERATURE = "the group's drive at a chamber temperature 20 K away"
EFFECTS = worded(
    Effect(
        id="branch_wire_resistance",
        parameters=(
            Parameter(
                "excess_ohm", "Ohm", 0.0, -0.05, 0.1, step=2e-4, plausible=5e-3, material=3e-4
            ),
        ),
        stage="resistance",
        replaces=("wire",),
    ),
    Effect(
        id="branch_initial_soc",
        parameters=(
            Parameter("excess_soc", "1", 0.0, -0.5, 0.5, step=2e-3, plausible=0.02, material=2e-3),
        ),
        stage="counting",
        replaces=("soc",),
    ),
    Effect(
        id="branch_capacity",
        parameters=(
            Parameter(
                "excess_relative", "1", 0.0, -0.6, 0.6, step=5e-3, plausible=0.1, material=0.01
            ),
        ),
        stage="counting",
        replaces=("capacity",),
        needs=("soc_range",),
    ),
    Effect(
        id="branch_cell_resistance",
        parameters=(
            Parameter(
                "excess_relative", "1", 0.0, -0.7, 3.0, step=5e-3, plausible=0.2, material=0.02
            ),
        ),
        stage="resistance",
        replaces=("log_r0", "log_slow"),
        ties=(Tie("branch_temperature", OTHER_TEMPERATURE, one_temperature=True),),
    ),
    Effect(
        id="branch_temperature",
        parameters=(
            Parameter(
                "warmer_kelvin", "K", 0.0, -40.0, 40.0, step=0.2, plausible=5.0, material=0.5
            ),
        ),
        stage="resistance",
        replaces=("celsius",),
        # A hotter cell looks like a less resistive one.
        ties=(Tie("branch_cell_resistance", OTHER_TEMPERATURE, one_temperature=True),),
    ),
    Effect(
        id="branch_current_offset",
        parameters=(
            Parameter(
                "offset_ampere", "A", 0.0, -2.0, 2.0, step=5e-3, plausible=0.1, material=0.01
            ),
        ),
        stage="current",
        replaces=("offset",),
    ),
    Effect(
        id="branch_current_gain",
        parameters=(
            Parameter(
                "gain_relative", "1", 0.0, -0.5, 0.5, step=2e-3, plausible=0.05, material=5e-3
            ),
        ),
        stage="current",
        replaces=("gain",),
    ),
)
GROUP_LIBRARY = {effect.id: effect for effect in EFFECTS}
