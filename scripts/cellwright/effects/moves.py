"""Moves between the models of a space: add, drop, swap, and pairs where nothing else helps.

Each raises the sum of the predictive densities, less a price for every effect: what it must be
worth to be told apart from the effects that could stand in its place.
"""

SHORTLIST = 5  # moves that are asked by all blocks, the best by tenths of them
NEIGHBOURS = 12  # rivals that are asked, the same way
ADDED, SWAPPED, PAIRED = 12, 8, 8  # terms that are tried, the most promising first
LEAST_OF_SWAP = 1.0  # nats: two that differ by less are the same to anyone
PAIR_Z = 2.0  # standard errors of the gain of two that join at once: they are looked for among many
MANY = 99  # effects, more than any library has: no limit
MOST_MOVES = 40


def best_model(space, begun, gates, *, most=MANY, barred=(), fitted=()):
    """The model that moves from some others lead to: frozenset of numbers of terms.

    Parameters
    ----------
    space : space.Space. begun : models to set out from. gates : case.Gates.
    most : effects that a model may have beyond the fitted one: farther off its columns hold less.
    barred : keys of effects that no model may have. fitted : models, by their labels, that were
    fitted already and are not asked for again.
    """
    about = gates, most, set(barred), set(fitted)
    ends = [_walk(space, frozenset(model), *about) for model in begun]
    return max(ends, key=space.worth)


def _walk(space, model, gates, most, barred, fitted):
    for _ in range(MOST_MOVES):
        now = space.worth(model)
        offers = _near(space, _single(space, model, barred), most)
        chosen = _best(space, model, now, offers, gates.joins, fitted)
        if chosen is None:
            offers = _near(space, _pairs(space, model, barred), most)
            chosen = _best(space, model, now, offers, PAIR_Z, fitted)
        if chosen is None:
            return model
        model = chosen
    return model


def _near(space, offers, most):
    """Offers with at most so many effects beyond the fitted model."""
    return {one: least for one, least in offers.items() if len(one - space.inside) <= most}


def _single(space, model, barred):
    """Models one move away, with the least that each must gain: dict."""
    added = space.further(model, barred)[:ADDED]
    offers = {model | {k}: 0.0 for k in added if _together(space, model, k)}
    for k in model:
        rest = model - {k}
        offers[rest] = 0.0
        for other in space.further(rest, barred)[:SWAPPED]:
            if other != k and _together(space, rest, other):
                offers[rest | {other}] = LEAST_OF_SWAP
    return offers


def _pairs(space, model, barred):
    """Models with two effects more, with the least that each must gain: dict."""
    added = [k for k in space.further(model, barred)[:PAIRED] if _together(space, model, k)]
    return {
        model | {one, other}: 0.0
        for n, one in enumerate(added)
        for other in added[n + 1 :]
        if _together(space, model | {one}, other)
    }


def _together(space, model, term):
    """Whether a term can be beside those of a model: not the same effect, and none that no test
    tells from it."""
    one = space.terms[term].effect
    for other in (space.terms[k].effect for k in model):
        ties = [(tie, other.id) for tie in one.ties] + [(tie, one.id) for tie in other.ties]
        if one.key == other.key or any(tie.exact and tie.partner == name for tie, name in ties):
            return False
    return True


def _best(space, model, now, offers, least_z, fitted):
    """The offer that gains most by tenths of the blocks, of those that gain by all blocks, or None;
    one that only adds must be surely better, too."""
    offers = {m: least for m, least in offers.items() if space.label(m) not in fitted}
    for offer in sorted(offers, key=space.roughly, reverse=True)[:SHORTLIST]:
        gains = space.worth(offer) > now + offers[offer]
        if gains and not (offer > model and space.difference(offer, model).z < least_z):
            return offer
    return None


def rivals(space, model, gates, *, barred=(), fitted=()):
    """Models beside one that are worth an exact fit, the best first: list.

    Those with one effect swapped or left out that are not surely worse. About the plain model
    little is linear, and what is no line in its sizes is worth more than its columns promise: there
    also single effects that the model has not.

    Parameters
    ----------
    space, gates, barred, fitted : as in `best_model`. model : numbers of terms.
    """
    value, mine, offers = space.worth(model), set(space.keys(model)), []
    if not space.inside:
        offers += [frozenset({k}) for k in space.further(space.inside, {*barred, *mine})]
    singles = sorted(_single(space, model, barred), key=space.roughly, reverse=True)
    for one in singles[:NEIGHBOURS]:
        near = value - space.worth(one) < LEAST_OF_SWAP
        if not one > model and one and (near or space.difference(model, one).z < gates.apart):
            offers.append(one)
    best = {}
    for one in sorted(offers, key=space.worth, reverse=True):
        if space.label(one) not in fitted and one != model:
            best.setdefault(space.label(one), one)
    return list(best.values())


def other_forms(space, model, *, barred=(), fitted=()):
    """Models with one further effect in another of its forms: list.

    Beside misfit no column tells one form from another (a third pair from diffusion in particles):
    resistances and time constants have to be fitted again with each.

    Parameters
    ----------
    space, barred, fitted : as in `best_model`. model : numbers of terms.
    """
    found = []
    for k in sorted(model - space.inside):
        rest = model - {k}
        for j in space.further(rest, barred):
            one = rest | {j}
            alike = space.terms[j].effect.key == space.terms[k].effect.key
            if alike and space.label(one) not in {*fitted, space.label(model)}:
                found.append(one)
    return found
