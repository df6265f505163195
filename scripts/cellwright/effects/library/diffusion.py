"""Relaxation slower than both RC pairs."""

from cellwright.circuits.circuit import PLANE_MODES, SPHERE_MODES
from cellwright.effects.base import relaxed
from cellwright.effects.effect import Effect, Parameter

# One RC pair; a layer of finite length; a sphere (time constant: length² over diffusivity).
MODES = (((1.0, 1.0),), PLANE_MODES, SPHERE_MODES)


def _slow(fields, stack, p):
    modes = MODES[int(p["finite_length"])]
    seconds = p["time_constant_second"]
    ohms = p["resistance_ohm"]
    lags = (relaxed(stack, fields.current, c * seconds, gain=share * ohms) for c, share in modes)
    return fields._replace(volt=fields.volt + sum(lags))


# A third RC pair and a finite-length Warburg element are one class: no protocol of eleven tells
# them apart (missing-effect study). The one that fits better is taken.
EFFECTS = (
    Effect(
        id="slow_diffusion",
        sentence="slow diffusion: polarisation that takes tens of minutes to build up and decay",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.2, step=1e-3, plausible=0.01),
            Parameter("time_constant_second", "s", 2000.0, 100.0, 1e5, step=20.0, shape=True),
            # 0: one RC pair; 1, 2: diffusion in a layer, in a sphere. Tried, not fitted.
            Parameter("finite_length", "1", 0.0, 0.0, 2.0, step=0.0, shape=True),
        ),
        stage="overpotential",
        act=_slow,
        starts=tuple(
            {"time_constant_second": second, "finite_length": form}
            for form, seconds in (
                (0.0, (800.0, 2500.0, 8000.0)),
                (1.0, (300.0, 1200.0, 5000.0)),
                (2.0, (2000.0, 8000.0, 30000.0)),
            )
            for second in seconds
        ),
        bends=True,
        needs=("long_rest",),
        shows="a rest of two hours after a long load",
        consequence="rests of minutes end before the open-circuit voltage is reached",
    ),
)
