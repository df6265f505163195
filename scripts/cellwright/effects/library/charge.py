"""Effects of the charge balance: losses, leak and capacity."""

import numpy as np

from cellwright.circuits.instrument import leak_at, stored
from cellwright.effects.library.quantities import fields_with
from cellwright.effects.library.sizes import DAY_HOUR, THIRDS, as_is, at_thirds
from cellwright.effects.library.vocabulary import SLOW_TEST, Effect, Parameter, numbers_of, worded

# ASSUME: No lithium-ion cell loses a tenth of its charge: measured are less than 1 % a cycle (A.
# Smith et al., J. Electrochem. Soc. 158 (2011) A1136).
MOST_LOST = 0.1
CAPACITY_TESTS = ("capacity", SLOW_TEST)  # kinds of tests that a capacity is measured by


def _inefficiency(fields, stack, p):
    return fields._replace(moved=stored(fields.moved, lost_share=p["lost_share_of_charge"]))


def _leakage(fields, stack, p):
    """The leak at the SoC as it is counted without it: over a record they hardly differ."""
    moved = np.cumsum(fields.moved / fields.capacity)
    soc = moved + (stack.soc_at_start - moved[stack.first])[stack.file]
    leak = leak_at(soc, p["leak_ampere"], p["log_leak_to_full"]) * stack.step_second / 3600.0
    return fields._replace(moved=stored(fields.moved, leak=leak))


def _capacity_error(fields, stack, p):
    """Capacity that has changed since it was measured, in all other records."""
    later = np.array([kind not in CAPACITY_TESTS for kind in stack.kinds], float)[stack.file]
    return fields._replace(capacity=fields.capacity * (1.0 + p["relative"] * later))


def _capacity_error_block(p, blocks):
    """The member's capacity is that of its capacity tests times one plus the error."""
    tested = 1.0 + blocks["counting"]["capacity_test_relative"]
    now = {"capacity_relative": tested * (1.0 + p["relative"]) - 1.0}
    return blocks | {"counting": blocks["counting"] | now}


def _change_of_capacity(effect, p, values):
    now, before = (fields_with(one, p, values).capacity[0] for one in (effect, None))
    sizes = [("", 100 * (now / before - 1), "% of capacity")]
    return [*sizes, ("", now - before, "Ah")] if "capacity_ampere_hour" in values else sizes


def _leaks(effect, p, values):
    """Self-discharge at three states of charge, and what of a full cell's capacity it takes."""
    leaks = leak_at(np.array(THIRDS), p["leak_ampere"], p["log_leak_to_full"])
    sizes = [(name, 1e3 * one, "mA") for name, one in zip(at_thirds(), leaks, strict=True)]
    if "capacity_ampere_hour" not in values:
        return sizes
    share = 100 * leaks[-1] * DAY_HOUR / values["capacity_ampere_hour"]
    return [*sizes, (at_thirds()[-1], share, "% of SoC a day")]


EFFECTS = worded(
    Effect(
        id="coulombic_inefficiency",
        parameters=(
            Parameter("lost_share_of_charge", "1", 0.0, 0.0, MOST_LOST, step=1e-3, plausible=0.01),
        ),
        stage="counting",
        act=_inefficiency,
        blocks=numbers_of("counting", lost_share_of_charge="lost_share_of_charge"),
        needs=("both_directions",),
        sizes_in_words=as_is("lost_share_of_charge", "% of what is charged", factor=100),
    ),
    Effect(
        id="leakage",
        parameters=(
            Parameter("leak_ampere", "A", 0.0, 0.0, 0.5, step=1e-3, plausible=0.02),
            # Self-discharge of full and empty cells differs by a decade: two deviations.
            Parameter(
                "log_leak_to_full", "1", 0.0, -4.6, 4.6, step=0.05, shape=True, prior_std=1.15
            ),
        ),
        stage="counting",
        act=_leakage,
        blocks=numbers_of(
            "counting", leak_ampere="leak_ampere", log_leak_to_full="log_leak_to_full"
        ),
        in_rest_log=False,
        quantity="no_current_at_rest",
        sizes_in_words=_leaks,
    ),
    Effect(
        id="capacity_error",
        parameters=(Parameter("relative", "1", 0.0, -0.4, 0.4, step=2e-3, plausible=0.02),),
        stage="counting",
        act=_capacity_error,
        blocks=_capacity_error_block,
        needs=("soc_range",),
        quantity="capacity_change",
        sizes_in_words=_change_of_capacity,
        of_branch=True,
        in_particle="scale",
    ),
)
