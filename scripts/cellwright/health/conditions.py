"""When two tests of a life were made alike: rates and temperatures that are one."""

SAME_CELSIUS = 3.0  # chamber temperatures this near are one
SAME_RATE = 1.12  # rates this near are one


def same_rate(first, second):
    """Whether two rates are one: within 12 % of each other.

    Parameters
    ----------
    first, second : above zero, of one unit.
    """
    return max(first / second, second / first) <= SAME_RATE
