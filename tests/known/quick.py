"""Which members of a family of tests the usual run takes; the others are marked as slow."""

import pytest


def slow_but(quick, values):
    """Values to parametrize by, all but those in `quick` marked as slow."""
    values = list(values)
    quick = {quick} if isinstance(quick, str) else set(quick)
    assert quick <= set(values), "a quick one that is not there"
    return [one if one in quick else pytest.param(one, marks=pytest.mark.slow) for one in values]
