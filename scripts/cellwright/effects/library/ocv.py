"""Effects of the open-circuit voltage."""

import numpy as np

from cellwright.effects.library.sizes import THIRDS, at_thirds, ocv
from cellwright.effects.library.vocabulary import Effect, Parameter, since_slow_test, worded

WAVES = 5
EDGE_SOC = 0.08


def _shift(fields, stack, p):
    waves = (
        p[f"wave_{m}_volt"] * np.cos(np.pi * m * np.clip(fields.soc, 0.0, 1.0))
        for m in range(1, WAVES + 1)
    )
    return fields._replace(ocv=fields.ocv + since_slow_test(stack) * sum(waves))


def _edge(fields, stack, p):
    empty = p["empty_volt"] * np.exp(-np.maximum(fields.soc, 0.0) / EDGE_SOC)
    full = p["full_volt"] * np.exp(-np.maximum(1.0 - fields.soc, 0.0) / EDGE_SOC)
    return fields._replace(ocv=fields.ocv + empty + full)


def _volts(names, plausible):
    return tuple(
        Parameter(name, "V", 0.0, -0.2, 0.2, step=1e-3, plausible=plausible) for name in names
    )


# Electrodes that have moved against each other (LLI, LAM) bend the OCV in broad waves; which of
# the two electrodes it was, incremental capacity says, not these data.
EFFECTS = worded(
    Effect(
        id="ocv_shift",
        parameters=_volts([f"wave_{m}_volt" for m in range(1, WAVES + 1)], 0.01),
        stage="ocv",
        act=_shift,
        needs=("soc_range",),
        quantity="ocv_change",
        sizes_in_words=ocv(THIRDS, at_thirds()),
        of_branch=True,
        in_particle="shift",
    ),
    Effect(
        id="ocv_edge",
        parameters=_volts(["empty_volt", "full_volt"], 0.02),
        stage="ocv",
        act=_edge,
        needs=("soc_range",),
        sizes_in_words=ocv([0.0, 1.0], ("when empty", "when full")),
        of_branch=True,
        in_particle="shift",
    ),
)
