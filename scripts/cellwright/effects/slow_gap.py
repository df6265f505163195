"""When the gap between a slow test's branches is hysteresis: where no resistance explains it."""

HYSTERESIS = {"hysteresis_one_state", "hysteresis_instant"}
LEAST_VOLT = 5e-3  # of half the gap, the design's limit of what an OCV error swallows
LEAST_SHARE = 0.5  # of half the gap that a resistance may leave


def shows_hysteresis(gap, resistance_ohm):
    """Whether a resistance at the slow test's current leaves most of the gap unexplained.

    A relaxation, however slow, drives the branches apart by no more than current times its
    resistance; a hysteresis does so at any current.

    Parameters
    ----------
    gap : models.slow_gap.SlowGap.
    resistance_ohm : all that the model has, ohmic and relaxing [ohm].

    Source: W. Dreyer et al., Nature Materials 9 (2010) 448: the gap of LFP stays at vanishing
    current.
    """
    left = gap.half_gap_volt - gap.current_ampere * resistance_ohm
    return bool(left > max(LEAST_VOLT, LEAST_SHARE * gap.half_gap_volt))
