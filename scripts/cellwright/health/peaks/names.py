"""Short names of tracked peaks: a number by voltage, and what the chemistry proposes behind it."""

# Where a slow charge (C/20 or slower, 25 °C) of a fresh cell of graphite and this positive
# electrode has its peaks [V], and the reaction that the literature names for it. Names only: no
# peak is found, kept or matched by them.
TEMPLATES = {
    # M. Dubarry, B. Liaw, J. Power Sources 194 (2009) 541; thesis 4.4: peaks 1 to 3.
    "LFP": ((3.24, "graphite 3-2"), (3.34, "graphite 2-2L"), (3.38, "graphite 2-1")),
    # M. Dubarry et al., J. Power Sources 196 (2011) 10336; thesis 4.4.
    "NMC": ((3.50, "graphite 4-3"), (3.70, "graphite 2-1"), (3.95, "NMC"), (4.12, "NMC H2-H3")),
    # Thesis 3.3: 3.75, 3.90, 4.02, 4.07 V.
    "LMO": ((3.75, "graphite 3-2"), (3.90, "graphite 2-1"), (4.02, "LMO"), (4.10, "LMO ordering")),
    # I. Bloom et al., J. Power Sources 139 (2005) 295.
    "NCA": ((3.50, "graphite 4-3"), (3.65, "graphite 2-1"), (3.90, "NCA"), (4.15, "NCA H2-H3")),
    # J. Reimers, J. Dahn, J. Electrochem. Soc. 139 (1992) 2091.
    "LCO": ((3.80, "graphite 3-2"), (3.92, "LCO two phases"), (4.10, "LCO ordering")),
}
NEAR_VOLT = 0.06
SLOW_C_RATE = 0.11  # at more, resistance moves the peaks away from the template


def names_of(places, chemistry):
    """Names of identities: "P1", "P2", … by voltage, with the chemistry's word where one is near.

    Parameters
    ----------
    places : dict of identity to (voltage where first seen [V], rate there [1/h]).
    chemistry : key of TEMPLATES, or anything else for numbers alone.

    Returns
    -------
    names : dict of identity to name.
    """
    order = sorted(places, key=lambda identity: places[identity][0])
    words = _words({k: places[k] for k in order}, TEMPLATES.get(chemistry, ()))
    return {
        identity: f"{words[identity]} / P{number}" if identity in words else f"P{number}"
        for number, identity in enumerate(order, 1)
    }


def _words(places, template):
    """Word of each identity that is the nearest to a place of the template, and slow."""
    words = {}
    for volt, word in template:
        # Polarisation of a faster charge would give a peak its neighbour's word.
        near = {k: abs(v - volt) for k, (v, rate) in places.items() if rate <= SLOW_C_RATE}
        nearest = min(near, key=near.get, default=None)
        if nearest is not None and near[nearest] <= NEAR_VOLT and nearest not in words:
            words[nearest] = word
    return words
