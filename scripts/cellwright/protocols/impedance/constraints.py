"""Constraints on a circuit's parameters as text: `cpe_p = 0.8`, `r3_ohm = 2 * r2_ohm`."""

import re

from cellwright.refusal import Refusal

NUMBER = r"\d+\.?\d*(?:[eE][+-]?\d+)?"
FORM = re.compile(rf"(\w+)\s*=\s*(?:({NUMBER})\s*\*\s*)?({NUMBER}|[A-Za-z]\w*)")


def parse_constraints(texts):
    """Constraints as `fit_circuit` takes them.

    Parameters
    ----------
    texts : "name = value" fixes a parameter, in its own unit; "name = other" and
        "name = ratio * other" tie it to another.

    Returns
    -------
    fixed : dict, name → value. tied : dict, name → (other name, ratio).

    Raises
    ------
    Refusal : a text of another form.
    """
    fixed, tied = {}, {}
    for text in texts:
        found = FORM.fullmatch(text.strip())
        if not found or (found[2] and found[3][0].isdigit()):
            raise Refusal(
                f"constraint {text!r}; wanted is 'name = value' or 'name = ratio * other'"
            )
        name, ratio, other = found.groups()
        if other[0].isdigit():
            fixed[name] = float(other)
        else:
            tied[name] = (other, float(ratio or 1))
    return fixed, tied
