"""What a cell does in a step of a protocol, before anybody measures it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Behaviour(NamedTuple):
    """What a cell really did in one step; times are counted from the start of the step.

    The functions take times [s] and give a current [A] positive on charge, a voltage [V] and a
    temperature [°C]; of cells in parallel also the current [A] of each branch. Where the generator
    knows them: `charge`, what has flowed in since the start of the step [Ah], and `soc`, the true
    state of charge [1] (of cells in parallel, those of the first).
    """

    duration_second: float
    current: Callable[[np.ndarray], np.ndarray]
    voltage: Callable[[np.ndarray], np.ndarray]
    temperature: Callable[[np.ndarray], np.ndarray]
    branches: tuple[Callable[[np.ndarray], np.ndarray], ...] = ()
    charge: Callable[[np.ndarray], np.ndarray] | None = None
    soc: Callable[[np.ndarray], np.ndarray] | None = None
