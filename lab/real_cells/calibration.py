"""A fixed load by which figures of speed are compared between machines and days.

One machine is three times as fast as another, and half as fast when a neighbour works: so CPU
seconds are told over those of this load, measured in the same minutes.
"""

import math
import time

SIZE, PRODUCTS = 1200, 8
SAMPLES, PASSES = 2_000_000, 20
STEPS = 10_000_000


def calibration_second() -> float:
    """CPU seconds of the load, about half a second: geometric mean of its three parts.

    Products of matrices, a recursion over samples and a loop of plain Python, as jobs are mixed of.
    """
    import numpy as np

    random = np.random.default_rng(0)
    parts = _products(random.normal(size=(SIZE, SIZE))), _recursions(random.normal(size=SAMPLES))
    return math.prod(_cpu_second(part) for part in (*parts, _loop)) ** (1.0 / 3.0)


def _cpu_second(work) -> float:
    start = time.process_time()
    work()
    return time.process_time() - start


def _products(matrix):
    def work():
        for _ in range(PRODUCTS):
            matrix @ matrix

    return work


def _recursions(samples):
    from scipy.signal import lfilter

    def work():
        for _ in range(PASSES):
            lfilter([0.1], [1.0, -0.9], samples)

    return work


def _loop():
    total = 0
    for number in range(STEPS):
        total += number & 7
    return total
