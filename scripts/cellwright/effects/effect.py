"""What an effect is: one entry of the closed vocabulary, everything about it in one place."""

from collections.abc import Callable
from typing import NamedTuple

STAGES = ("current", "counting", "resistance", "ocv", "overpotential", "reading")


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
    """One effect.

    id : of the contract. sentence : for people, after "What was missing: ". parameters : tuple of
    Parameter. stage : where it enters the model, one of STAGES. act : function (fields, stack, p)
    → fields, p being a dict of its parameters by name; see `base.Fields`.
    starts : tuple of dicts, parameters from which it is tried. held : what it changes is no
    straight line in its size. bends : a model without it has moved its resistances and time
    constants so far that they are to be found anew beside it.
    needs : names of `excitation.FACTORS` without which data cannot show it.
    shows : the test that shows it, in words. consequence : what it changes for the user.
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

    @property
    def names(self):
        """Names of its parameters within a model: id.parameter."""
        return tuple(f"{self.id}.{p.name}" for p in self.parameters)

    def given(self, start):
        """Names of the parameters whose first values its own starts state."""
        stated = {name for one in self.starts for name in one}
        return {name for name in start if name.split(".")[1] in stated}
