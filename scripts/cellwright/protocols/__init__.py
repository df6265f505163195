"""What one test tells: capacity, resistance, relaxation, dQ/dV, OCV, impedance."""


def not_elsewhere(chosen, elsewhere, what, reasons):
    """Those of the chosen steps (k,) that count here; of the others a reason each is counted.

    elsewhere : (steps,) name of the test in which a step counts, being the same measurement; empty
    where it counts here. None: all do. what : the step in words. reasons : Counter.
    """
    if elsewhere is None:
        return chosen
    reasons.update(f"{what} of the same measurement as in {of}" for of in elsewhere[chosen] if of)
    return chosen[elsewhere[chosen] == ""]


def counted(reasons):
    """Sentences of a Counter of reasons, each with its number."""
    return tuple(f"{count} × {reason}" for reason, count in sorted(reasons.items()))
