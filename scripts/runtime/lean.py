"""Imports without what is not used of them: a job's start is paid hundreds of times in a run."""

import sys
from contextlib import contextmanager


class _Hidden:
    """An entry of `sys.meta_path` by which some packages are not installed."""

    def __init__(self, names):
        self.names = names

    def find_spec(self, name, path=None, target=None):
        if name in self.names:
            raise ModuleNotFoundError(f"{name} is not looked for here")


@contextmanager
def without(*names):
    """Within the block these packages cannot be imported, unless they already were."""
    hidden = _Hidden(names)
    sys.meta_path.insert(0, hidden)
    try:
        yield
    finally:
        sys.meta_path.remove(hidden)


def import_lmfit():
    """Import lmfit for a fit to come, in half the time.

    It takes pandas along to read data frames and matplotlib to draw, where they are installed;
    the fits of this pipeline give it neither.
    """
    with without("pandas", "matplotlib"):
        import lmfit  # noqa: F401
