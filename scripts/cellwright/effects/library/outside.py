"""What records can show and the vocabulary has no name for: rivals that a name has to beat.

None of them is ever a name, or in a model file. One that predicts better than every name joins the
search's model, so that its error is in no size, and the verdict says what is left looks like it.
"""

import numpy as np

from cellwright.effects.library.vocabulary import Effect, Parameter, worded

LEAST = 0.05  # of a resistance that drifts


def _drift(fields, stack, p):
    hours = stack.second / 3600.0
    return fields._replace(r0=fields.r0 * np.maximum(1.0 + p["relative_per_hour"] * hours, LEAST))


EFFECTS = worded(
    # A contact that warms or works loose, or a cell that is not yet at its temperature.
    Effect(
        id="resistance_drift",
        parameters=(
            Parameter("relative_per_hour", "1/h", 0.0, -1.0, 5.0, step=1e-2, plausible=0.1),
        ),
        stage="resistance",
        act=_drift,
    ),
)
OUTSIDE = {effect.id: effect for effect in EFFECTS}
