"""What an effect is: one entry of the closed vocabulary, everything about it in one place."""

from collections.abc import Callable
from typing import NamedTuple


class Parameter(NamedTuple):
    """One number of an effect.

    unit : as in the verdict. neutral : its value where the effect is absent, or, for a shape
    (`shape` true: without meaning while the effect is absent), where a search begins.
    lower, upper : physical bounds. step : a change that is small but plain, for derivatives; also
    the unit in which a search walks. plausible : a size that a laboratory may well meet.
    material : a size below which nobody would act on it.
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


class Effect(NamedTuple):
    """One effect: its equation, its numbers, its words, and how it stands in a model file.

    id : of the contract. sentence : for people, a clause. parameters : tuple of
    Parameter. stage : where it enters the model, one of `base.STAGES`. act : its equation, function
    (fields, stack, p) → fields, p being a dict of its parameters by name; see `base.Fields`.
    starts : tuple of dicts, parameters from which it is tried. held : what it changes is no
    straight line in its size. bends : a model without it has moved its resistances and time
    constants so far that they have to be estimated again together with it.
    needs : names of `records.FACTORS` without which data cannot show it.
    shows : the test that shows it, in words. consequence : what it changes for the user.
    circuit : function (p, r0_ohm, capacity_ampere_hour) → (r0_ohm, kind, parameters): the branch
    of `circuits.circuit.KINDS` that it is in a model file, and the ohmic resistance beside it.
    blocks : function (p, blocks) → blocks: the blocks of `circuits.instrument` with its numbers.
    One without either, of stage "resistance" or "ocv", is in the courses of a model file over SoC
    and temperature; of any other stage it has no place there.
    position : of an effect of a parallel group, number of its branch, from 0; of a cell's, None.
    replaces : names of the parameters of a healthy branch whose place it takes in a group.
    """

    id: str
    sentence: str
    parameters: tuple
    stage: str
    act: Callable
    starts: tuple = ({},)
    needs: tuple = ()
    shows: str = ""
    consequence: str = ""
    held: bool = False
    bends: bool = False
    circuit: Callable | None = None
    blocks: Callable | None = None
    position: int | None = None
    replaces: tuple = ()

    @property
    def key(self):
        """Its name within a model: the id, in a group with the number of the branch."""
        return self.id if self.position is None else f"{self.id}[{self.position}]"

    @property
    def names(self):
        """Names of its parameters within a model: key.parameter."""
        return tuple(f"{self.key}.{p.name}" for p in self.parameters)

    def sizes_of(self, values):
        """Its parameters by their own names, from the values of a model."""
        own = zip(self.parameters, self.names, strict=True)
        return {p.name: values[name] for p, name in own}

    def given(self, start):
        """Names of the parameters whose first values its own starts state."""
        stated = {name for one in self.starts for name in one}
        return {name for name in start if name.rpartition(".")[2] in stated}


def numbers_of(block, **names):
    """Function for `Effect.blocks` that writes parameters into one block of a model file.

    Parameters
    ----------
    block : name of the block. names : name within the block by name of the parameter.
    """

    def written(p, blocks):
        own = {within: p[name] for name, within in names.items()}
        return blocks | {block: blocks.get(block, {}) | own}

    return written


def in_order(effects, library):
    """Effects in the order of the library, in which those of one stage act.

    Parameters
    ----------
    effects : sequence of Effect. library : dict of Effect by key.
    """
    keys = {effect.key for effect in effects}
    return tuple(effect for key, effect in library.items() if key in keys)
