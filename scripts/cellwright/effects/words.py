"""The verdict in plain language: what was missing, how sure, what it changes, what to test next."""


def paragraph(verdict, library):
    """A paragraph for people about one cell.

    Parameters
    ----------
    verdict : dict, as `verdict.verdict_of` makes it. library : dict of Effect by id.

    Returns
    -------
    text : str.
    """
    parts = [_OPENINGS[verdict["verdict"]](verdict, library), *_remainder(verdict)]
    if verdict["next_test"]:
        parts.append(f"To test next: {verdict['next_test']}")
    return " ".join(parts)


def millivolt(volt):
    """A voltage in words."""
    return f"{1e3 * volt:.1f} mV"


def _none(verdict, library):
    both = verdict["validation_rmse_volt"]["before"]
    return (
        f"Nothing is missing that these data could show: on records that took no part in the fit "
        f"the plain model (open-circuit voltage, a resistance, two RC pairs) is off by "
        f"{millivolt(both)}, and the noise alone is {millivolt(verdict['floor_volt'])}."
    )


def _unknown(verdict, library):
    both = verdict["validation_rmse_volt"]
    text = (
        f"Something is missing that the library does not know: the plain model is off by "
        f"{millivolt(both['before'])} where the noise is {millivolt(verdict['floor_volt'])}"
    )
    names = [library[one["effect"]].sentence for one in verdict["partial"]]
    if not names:
        return f"{text}, and no effect of the vocabulary explains it."
    return (
        f"{text}. The nearest explanation ({'; '.join(names)}) leaves {millivolt(both['after'])} "
        f"and so is not the name of it."
    )


def _named(verdict, library):
    both = verdict["validation_rmse_volt"]
    steps = [_step(one, library) for one in verdict["effects"]]
    steps[0] = steps[0][0].upper() + steps[0][1:]
    text = (
        f"{' Then: '.join(steps)} All in all the error on records that took no part in the fit "
        f"fell from {millivolt(both['before'])} to {millivolt(both['after'])}; the noise is "
        f"{millivolt(verdict['floor_volt'])}."
    )
    changes = [library[one["effect"]].consequence for one in verdict["effects"]]
    return f"{text} What it changes: {'; '.join(filter(None, changes))}."


def _step(one, library):
    effect = library[one["effect"]]
    sizes = [
        f"{name_of(name, p['unit'])} {number(p)}"
        for name, p in one["parameters"].items()
        if p["std"] is not None
    ]
    text = f"what was missing: {effect.sentence} ({', '.join(sizes)})."
    if one["alternatives"]:
        others = " or ".join(library[name].sentence for name in one["alternatives"])
        text += f" These data cannot tell it from: {others}."
    return text + _sureness(one)


def name_of(name, unit):
    """A parameter's name in words, without the unit, which stands behind the number."""
    words = name.split("_")
    spelt = [part for part in _SPELT.get(unit, "").split() if part]
    return " ".join(words[: -len(spelt)] if spelt and words[-len(spelt) :] == spelt else words)


_SPELT = {
    "V": "volt",
    "A": "ampere",
    "Ohm": "ohm",
    "s": "second",
    "1/A": "per ampere",
    "K/W": "kelvin per watt",
    "V/K": "volt per kelvin",
    "1/K": "per kelvin",
    "J/mol": "joule per mole",
}


def number(p):
    """Value of a parameter of a verdict, with standard deviation and unit."""
    unit = "" if p["unit"] == "1" else f" {p['unit']}"
    return f"{p['value']:.3g} ± {p['std']:.1g}{unit}"


def _sureness(one):
    both = one["validation_rmse_volt"]
    # Fitted anew with the noise of the next round, an effect may lose what it had gained.
    goes = "falls" if both["after"] < both["before"] else "does not fall: it goes"
    text = (
        f" With it the error on those records {goes} from {millivolt(both['before'])} to "
        f"{millivolt(both['after'])}."
    )
    bounds = [name for name, p in one["parameters"].items() if p["at_bound"]]
    if bounds:
        names = ", ".join(bounds).replace("_", " ")
        text += f" Its {names} ended on a bound: take its size with care."
    if not one["same_without_validation"]:
        text += " The fitted records alone would have named another effect: not a clear case."
    return text


def _remainder(verdict):
    place = verdict["located_at"]
    if place is None:
        return []
    low, high = (round(100 * soc) for soc in place["soc"])
    return [
        f"What is left sits mostly ({100 * place['share']:.0f} % of it) in {place['file']}, "
        f"{low} to {high} % state of charge, {place['current'].replace('_', ', ')}, "
        f"at {place['temperature_celsius'][0]:.0f} °C."
    ]


_OPENINGS = {"none": _none, "unknown": _unknown, "named": _named, "ambiguous": _named}
