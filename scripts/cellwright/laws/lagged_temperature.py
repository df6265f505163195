"""The temperature that a cell feels of its room's: later, smoother, and read with an error."""

import numpy as np

LAGS_HOUR = np.array([*np.arange(11) / 10, 1.25, 1.5, 2.0, 2.5, 3.0])
NEIGHBOURS = 4  # through which a cubic says what the reading between them should be


def felt_temperatures(course_hour, course_celsius, hour):
    """What a cell may feel at some hours of a course of temperature, for every lag that is tried.

    Both extremes of how a cell follows: at once but later (a delay), and as one heat capacity
    behind one resistance does (an exponential memory). A slope by dT/dt beside T knows neither:
    over a day it loses (2π lag/24 h)² of a slope, 7 % at one hour.

    Parameters
    ----------
    course_hour, course_celsius : (m,) rising hours of the readings, and readings [h], [°C].
    hour : (n,) when the cell is asked [h].

    Returns
    -------
    felt : list of (n,), one a lag and kind of following, the first without any lag.
    """
    from scipy.interpolate import Akima1DInterpolator

    # Unlike a cubic spline it does not swing across the pauses of a record.
    spline = Akima1DInterpolator(course_hour, course_celsius)
    # Before its first reading the course is held.
    asked = [spline(np.maximum(hour - lag, course_hour[0])) for lag in LAGS_HOUR]
    places, weights = np.polynomial.laguerre.laggauss(8)
    for lag in LAGS_HOUR[1:]:
        back = np.maximum(hour[:, None] - lag * places, course_hour[0])
        asked.append(spline(back) @ weights)
    return asked


def reading_noise(hour, celsius):
    """Scatter of single readings about the cubic through their four neighbours in time.

    Parameters
    ----------
    hour, celsius : (m,) rising hours and readings [h], [°C].

    Returns
    -------
    std : of one reading, if all that its neighbours do not foretell is an error of it [K]; part of
        it may be the temperature itself. NaN where there are fewer than five readings.
    """
    errors = []
    for k in range(NEIGHBOURS // 2, len(hour) - NEIGHBOURS // 2):
        near = [k + step for step in (-2, -1, 1, 2)]
        # Weights of the neighbours in the cubic's value here, from its value at 0.
        weights = np.linalg.inv(np.vander(hour[near] - hour[k]))[-1]
        errors.append((celsius[k] - weights @ celsius[near]) ** 2 / (1 + weights @ weights))
    return float(np.sqrt(np.mean(errors))) if errors else np.nan
