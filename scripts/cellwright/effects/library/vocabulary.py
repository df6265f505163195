"""The types of an entry of the library: an effect, its parameters and its ties."""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from cellwright.effects.library.messages import say

SLOW_TEST = "ocv"  # kind of test that an OCV is from, and a capacity


class Parameter(NamedTuple):
    """One parameter of an effect: its unit, bounds and usual sizes.

    unit : as in the verdict. neutral : its value where the effect is absent, or, for a shape
    (`shape` true: without meaning while the effect is absent), where a search begins.
    lower, upper : physical bounds. step : for derivatives, and the unit of a step of the fit; 0:
    set by the starts, not fitted. plausible : a size usual in a laboratory.
    material : a size below which nobody would act on it. prior_std : what
    is known of it before the fit, about its neutral value; infinite: nothing.
    """

    name: str
    unit: str
    neutral: float
    lower: float
    upper: float
    step: float
    plausible: float = 0.0
    material: float = 0.0
    shape: bool = False
    prior_std: float = np.inf


class Tie(NamedTuple):
    """Another explanation that records of current and voltage cannot tell from an effect.

    partner : id of an effect, or the parameter that takes its place, in words. check : what does
    separate them, for people. always : no fit weighs one against the other. exact : no test of the
    cell by this instrument ever does. same_size : both have one size, so that the bounds of one
    rule out the other. one_order : they are one where the tests were made in the order of their
    temperatures. one_temperature : they are one as long as all records are at one temperature;
    where each is tried, tests at another are what tells them apart.
    """

    partner: str
    check: str
    always: bool = False
    exact: bool = False
    same_size: bool = False
    one_temperature: bool = False
    one_order: bool = False


class Effect(NamedTuple):
    """One effect: its equation, numbers, words, ties, witness, and how it stands in a model file.

    Equation and fit. id : of the contract. parameters : tuple of Parameter. stage : where it enters
    the model, one of `base.STAGES`. act : its equation, function (fields, stack, p) → fields, p
    being a dict of its parameters by name; see `base.Fields`. starts : tuple of dicts, parameters
    from which it is tried.

    What excites it. needs : names of `records.FACTORS` without which data cannot show it. shows :
    the test that shows it, in words. asked_if_unseen : where nothing is missing, but the records
    could not show this effect, its test is the next (most cells have it).

    Words. sentence : a clause. short : its name in a report; "": its id in words. consequence :
    what it changes for the user. Of the library these and `shows` stand in messages.toml, see
    `worded`. sizes_in_words : function (effect, p, values) → list of (name, value, unit), its sizes
    as people use them, values being those of the model; None: its parameters as they are.
    sizes_need_model : these are changes of the model's own resistances.
    assumed_relative : standard deviation of each size by what its equation assumes, over the size.

    Ties. ties : tuple of Tie. in_rest_log : whether the current logged at rest shows it (True) or
    must not (False), so that the log can decide between the two; None: it says nothing of it.
    slow_gap : how it parts the two branches of a slow test: "hysteresis", by the same voltage at
    any current; "resistance", by its leading size times the current; "": not at all.
    hold_imitates : the other hold of the current between rows looks like it.

    Witness. quantity : name in `quantities.QUANTITIES` of what other measurements read of it.

    Model. circuit : function (p, r0_ohm, capacity_ampere_hour, soc) → (r0_ohm, kind, parameters):
    the branch of `circuits.circuit.KINDS` that it is in a model file, its parameters scalars or one
    value a SoC, and the ohmic resistance beside it. blocks : function (p, blocks) → blocks: the
    blocks of `circuits.instrument` with its numbers. One without either, of stage "resistance" or
    "ocv", is in the courses of a model file over SoC and temperature; of any other stage it has no
    place there. bent_over_temperature : it moves the OCV or time constants with temperature, which
    a look-up takes straight in 1/T: conditions of a model file may not lie far apart.
    warms_core : its size tells how much warmer the core is than was measured. in_healthy_cells :
    the resistances of any healthy cell follow it. of_branch : it is the cell's own and follows from
    charge, temperature and current: the cell keeps it in a parallel group. in_particle : the part
    of a particle that it is (`identification.particle.WITHOUT`); "": none, and table `no_part` of
    the words says why.

    Of a parallel group. position : number of its branch, from 0; of a cell's effect None.
    replaces : names of the parameters of a healthy branch whose place it takes; it has no `act`.
    """

    id: str
    parameters: tuple
    stage: str
    act: Callable | None = None
    starts: tuple = ({},)
    needs: tuple = ()
    shows: str = ""
    asked_if_unseen: bool = False
    sentence: str = ""
    short: str = ""
    consequence: str = ""
    sizes_in_words: Callable | None = None
    sizes_need_model: bool = False
    assumed_relative: tuple = ()
    ties: tuple = ()
    in_rest_log: bool | None = None
    slow_gap: str = ""
    hold_imitates: bool = False
    quantity: str = ""
    circuit: Callable | None = None
    blocks: Callable | None = None
    bent_over_temperature: bool = False
    warms_core: bool = False
    in_healthy_cells: bool = False
    of_branch: bool = False
    in_particle: str = ""
    position: int | None = None
    replaces: tuple = ()

    @property
    def key(self):
        """Name of the effect within a model: its id, in a group with the number of the branch."""
        return self.id if self.position is None else f"{self.id}[{self.position}]"

    @property
    def names(self):
        """Names of the parameters within a model: key.parameter."""
        return _names_within(self.key, *[p.name for p in self.parameters])

    @property
    def invisible(self):
        """Whether a tie holds always and for good: no record of current and voltage shows it."""
        return any(tie.always and tie.exact for tie in self.ties)

    def sizes_of(self, values):
        """Values of its parameters by their names within the effect, from those of a model."""
        return {p.name: values[n] for p, n in zip(self.parameters, self.names, strict=True)}


def worded(*effects):
    """Effects with their words, those that an entry does not bring itself from messages.toml."""
    return tuple(effect._replace(**_words_of(effect)) for effect in effects)


def _words_of(effect):
    codes = {
        "sentence": f"sentence.{effect.id}",
        "short": f"short.{effect.id}",
        "shows": f"shows.{effect.id}",
        "consequence": f"consequence.{effect.id}",
    }
    return {field: getattr(effect, field) or say(code) for field, code in codes.items()}


def why_no_part(effect):
    """Why an effect is no part of a particle, a clause."""
    return say(f"no_part.{effect.id}")


def since_slow_test(stack):
    """1 in all rows (n,) but those of the slow test that the OCV is from, 0 there.

    The OCV is what that test read: of what moves either, only what came later shows.

    Parameters
    ----------
    stack : records.Stack.
    """
    return np.array([kind != SLOW_TEST for kind in stack.kinds], float)[stack.file]


@cache
def _names_within(key, *names):
    """Names within a model of the parameters of an effect; a fit asks for them at every step."""
    return tuple(f"{key}.{name}" for name in names)


def numbers_of(block, **names):
    """Function for `Effect.blocks` that writes parameters into one block of a model file.

    Parameters
    ----------
    block : name of the block. names : name within the block by name of the parameter.
    """

    def written(p, blocks):
        numbers = {within: p[name] for name, within in names.items()}
        return blocks | {block: blocks.get(block, {}) | numbers}

    return written


def in_order(effects, library):
    """Effects sorted as in the library, the order in which those of one stage act.

    Parameters
    ----------
    effects : sequence of Effect. library : dict of Effect by key.
    """
    keys = {effect.key for effect in effects}
    return tuple(effect for key, effect in library.items() if key in keys)
