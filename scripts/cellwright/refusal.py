"""The one way the science says no."""


class Refusal(ValueError):
    """What was asked cannot be known from, or done with, the data at hand.

    The message is the reason that a person reads in the report: what is wrong, what was found,
    what was wanted. It is a result, not a crash: the caller writes it down and goes on.
    """
