"""Relaxation slower than both RC pairs."""

from cellwright.effects.base import relaxed
from cellwright.effects.effect import Effect, Parameter


def _slow(fields, stack, p):
    drive = p["resistance_ohm"] * fields.current
    more = relaxed(stack, drive, p["time_constant_second"])
    return fields._replace(volt=fields.volt + more)


# A third RC pair and a finite-length Warburg element are one class: no protocol of eleven tells
# them apart (missing-effect study); the pair is the simpler of the two.
EFFECTS = (
    Effect(
        id="slow_diffusion",
        sentence="slow diffusion: polarisation that takes tens of minutes to build up and decay",
        parameters=(
            Parameter("resistance_ohm", "Ohm", 0.0, 0.0, 0.2, step=1e-3, plausible=0.01),
            Parameter("time_constant_second", "s", 2000.0, 600.0, 3e4, step=100.0, shape=True),
        ),
        stage="overpotential",
        act=_slow,
        starts=tuple({"time_constant_second": t} for t in (800.0, 2500.0, 8000.0)),
        needs=("long_rest",),
        shows="a rest of two hours after a long load",
        consequence="rests of minutes end before the open-circuit voltage is reached",
    ),
)
