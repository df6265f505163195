"""A limit of the CPU time in which files are read ends what never would, leaving no trace."""

import re
import signal
import threading
import time

import pytest

from cellwright.refusal import Refusal
from runtime import time_limit

SHORT_MINUTE = 0.2 / 60


def endless():
    """Steps that take every exception for a fault of their own."""
    while True:
        try:
            sum(range(1000))
        except Exception:
            continue


def backtracking():
    """A pattern that tries as many ways as there are subsets of letters."""
    re.match(r"(a+)+$", "a" * 60 + "b")


@pytest.mark.parametrize("work", [endless, backtracking])
def test_what_never_ends_is_stopped_and_named(work):
    begin = time.process_time()
    with (
        pytest.raises(Refusal) as told,
        time_limit.within(SHORT_MINUTE, ["raw/a.csv", "raw/b.csv"]),
    ):
        work()
    assert 0.15 < time.process_time() - begin < 2.0
    assert str(told.value).startswith(f"raw/a.csv, raw/b.csv: took more than {SHORT_MINUTE:g} min")
    assert time_limit.SETTING in str(told.value)


def test_what_ends_in_time_goes_on_and_the_timer_is_off():
    before = signal.getsignal(signal.SIGVTALRM)
    with time_limit.within(SHORT_MINUTE, ["raw/a.csv"]):
        found = sum(range(10))
    with pytest.raises(KeyError), time_limit.within(SHORT_MINUTE, ["raw/a.csv"]):
        {}["a fault of the program stays one"]
    begin = time.process_time()
    while time.process_time() - begin < 0.4:
        pass
    assert found == 45
    assert signal.getitimer(signal.ITIMER_VIRTUAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGVTALRM) == before


def test_waiting_is_no_time_of_the_file():
    with time_limit.within(SHORT_MINUTE, ["raw/a.csv"]):
        time.sleep(0.5)


def test_another_thread_is_told_that_no_limit_would_hold():
    said = []

    def work():
        try:
            with time_limit.within(1.0, ["raw/a.csv"]):
                said.append("read")
        except RuntimeError as fault:
            said.append(str(fault))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert said == ["a limit of time holds in the first thread of a process alone"]
