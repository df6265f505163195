"""The verdict on a parallel group in plain language."""

from cellwright.effects.words import millivolt, name_of, number

SHARED = "each current times its cell's resistance"
BLIND = (
    "Branch currents were not logged, and the group's voltage alone tells no branch from another: "
    "a name is only what would explain that voltage, and a fault of a branch's sensor cannot show."
)


def paragraph(verdict, library):
    """A paragraph for people about one group.

    Parameters
    ----------
    verdict : dict, as `group_verdict.group_verdict` makes it. library : dict of Effect by id.

    Returns
    -------
    text : str.
    """
    opening = {"none": _none, "unknown": _unknown}.get(verdict["verdict"], _named)
    parts = [opening(verdict, library), *_remainder(verdict)]
    if not verdict["branch_currents"]:
        parts.append(BLIND)
    if verdict["next_test"]:
        parts.append(f"To test next: {verdict['next_test']}.")
    return " ".join(parts)


def _what(verdict):
    return f"branch currents ({SHARED})" if verdict["branch_currents"] else "the group's voltage"


def _none(verdict, library):
    return (
        "Nothing is missing that these data could show: healthy cells within the declared spread "
        f"explain {_what(verdict)} of tests that took no part in the fit to "
        f"{millivolt(verdict['validation_rmse_volt']['before'])}, and the noise alone is "
        f"{millivolt(verdict['floor_volt'])}."
    )


def _unknown(verdict, library):
    both = verdict["validation_rmse_volt"]
    text = (
        f"Something is missing that the library does not know: in {_what(verdict)} of tests that "
        f"took no part in the fit, healthy cells within the declared spread leave "
        f"{millivolt(both['before'])} where the noise is {millivolt(verdict['floor_volt'])}"
    )
    if not verdict["partial"]:
        return f"{text}, and no effect of one branch explains it."
    names = [f"{library[e['effect']].sentence} (branch {e['branch']})" for e in verdict["partial"]]
    return (
        f"{text}. The nearest explanation ({'; '.join(names)}) leaves {millivolt(both['after'])} "
        f"and so is not the name of it."
    )


def _named(verdict, library):
    both = verdict["validation_rmse_volt"]
    steps = " Then: ".join(_step(one, library) for one in verdict["effects"])
    changes = [library[one["effect"]].consequence for one in verdict["effects"]]
    return (
        f"{steps[0].upper()}{steps[1:]} All in all the error in {_what(verdict)} of tests that "
        f"took no part in the fit fell from {millivolt(both['before'])} (healthy cells within the "
        f"declared spread) to {millivolt(both['after'])}; the noise is "
        f"{millivolt(verdict['floor_volt'])}. What it changes: {'; '.join(dict.fromkeys(changes))}."
    )


def _step(one, library):
    name, p = next(iter(one["parameters"].items()))
    size = f"{name_of(name, p['unit'])} {number(p)}"
    text = f"in branch {one['branch']} ({one['cell']}) {library[one['effect']].sentence} ({size})."
    if one["alternatives"]:
        others = "; or ".join(library[name].sentence for name in one["alternatives"])
        text += f" These data cannot tell it from: {others}."
    if one["branch_alternatives"]:
        others = " or ".join(str(branch) for branch in one["branch_alternatives"])
        text += f" As well it could be branch {others}."
    if p["at_bound"]:
        text += " Its size ended on a bound: take it with care."
    if not one["same_without_validation"]:
        text += " The fitted tests alone would have named another effect: not a clear case."
    return text


def _remainder(verdict):
    place = verdict["located_at"]
    if place is None:
        return []
    low, high = (round(100 * soc) for soc in place["soc"])
    branch = f"branch {place['branch']} in " if place["branch"] else ""
    return [
        f"What is left sits mostly ({100 * place['share']:.0f} % of it) in "
        f"{branch}{place['file']}, {low} to {high} % state of charge, {place['current']}, "
        f"at {place['temperature_celsius'][0]:.0f} °C."
    ]
