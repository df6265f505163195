"""A limit of the time in which a job reads files: one that never ends holds up no other.

What is counted is the CPU time of the job's own process, by a timer of the system. A busy machine,
a laptop that sleeps and a slow disk take no part of it, so that it is the file that is at fault.
"""

import signal
import threading
from contextlib import contextmanager

from cellwright.refusal import Refusal

SETTING = "files.longest_reading_minute"


class _TimeIsUp(BaseException):
    """No `Exception`: what comes between any two steps of Python is no fault of these."""


@contextmanager
def within(minute, files):
    """Stop what is done in the block after so much CPU time [min].

    Python looks at the timer between its steps and in patterns; a library's call ends first.

    Parameters
    ----------
    minute : the limit [min]. files : names of the files that are read, for the message.

    Raises
    ------
    Refusal
        The time is up.
    RuntimeError
        In another thread than the first, to which the system's signal would not come.
    """
    if threading.current_thread() is not threading.main_thread():
        raise RuntimeError("a limit of time holds in the first thread of a process alone")

    def stop(number, frame):
        raise _TimeIsUp

    before = signal.signal(signal.SIGVTALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_VIRTUAL, 60.0 * minute)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    except _TimeIsUp:
        raise Refusal(
            f"{', '.join(files or ())}: took more than {minute:g} min of CPU time, where a million "
            "rows take seconds; left out, so that it holds up nothing else. Look at what it holds; "
            f"of a record that needs longer raise {SETTING}"
        ) from None
    finally:
        signal.signal(signal.SIGVTALRM, before)
