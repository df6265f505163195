"""How far a rest is from its end, by its own slope."""

import numpy as np
import pytest

from cellwright.numerics.relaxing import still_to_go_volt

TIME = np.arange(1.0, 601.0)


def test_a_rest_that_goes_with_the_logarithm_of_time_goes_on_so():
    """5 mV a factor of e, from ten minutes to ten hours: 5 mV × ln 60."""
    ahead, std = still_to_go_volt(TIME, 3.7 + 0.005 * np.log(TIME), 0.0)
    assert ahead == pytest.approx(0.005 * np.log(60), rel=1e-6)
    assert std < 1e-6


def test_a_slow_exponential_has_farther_to_go_than_a_rest_that_has_ended():
    slow = still_to_go_volt(TIME, 3.7 - 0.1 * np.exp(-TIME / 3600), 0.0)[0]
    # 85 mV are ahead: the law of the logarithm tells that within half.
    assert 0.04 < slow < 0.13
    ended = still_to_go_volt(TIME, 3.7 - 0.1 * np.exp(-TIME / 30), 0.0)[0]
    assert abs(ended) < 1e-4
    assert still_to_go_volt(TIME * 100, 3.7 + 0.005 * np.log(TIME), 0.0)[0] == 0.0  # 16 hours


def test_two_rows_tell_nothing():
    assert still_to_go_volt(TIME[:2], np.array([3.7, 3.8]), 0.0) == (0.0, 0.0)
