"""`snakemake --logger progress`: one line of jobs, cells, time left and the longest job.

Warnings and errors stand above it as they come; of a file or a pipe it makes a line every half
minute instead. The complete log stays in `.snakemake/log`. Dry runs and `--verbose`, `--debug-dag`,
`--printshellcmds` or `--quiet host` show every message, as Snakemake does.

Imports nothing of this repository: Snakemake loads it before it knows of which clone the rules are.
"""

import sys
import threading
import time
from collections import Counter

from snakemake_interface_logger_plugins.base import LogHandlerBase
from snakemake_interface_logger_plugins.common import LogEvent

# Snakemake's messages that tell no user anything; what it may say beside them is shown.
NOISE = (
    *("Using profile", "Assuming unrestricted", "Building DAG", "Using shell", "Group jobs"),
    *("Select jobs", "Execute ", "Provided cores", "Rules claiming", "Provided resources"),
    *("host: ", "Complete log", "SNAKEMAKE", "Conda environments", "Singularity", "Runtime"),
)
# These events are counted, not shown.
COUNTED = {
    *(LogEvent.JOB_INFO, LogEvent.JOB_STARTED, LogEvent.JOB_FINISHED, LogEvent.PROGRESS),
    *(LogEvent.RUN_INFO, LogEvent.RESOURCES_INFO, LogEvent.SHELLCMD, LogEvent.WORKFLOW_STARTED),
    *(LogEvent.GROUP_INFO, LogEvent.RULEGRAPH),
}
TERMINAL_SECOND, FILE_SECOND = 0.5, 30.0


class Jobs:
    """The jobs of a run: which run, how many are done, and what time that leaves.

    Parameters
    ----------
    now : clock [s]
    """

    def __init__(self, now=time.monotonic):
        self.now = now
        self.mean_second, self.waiting, self.running = {}, Counter(), {}
        self.jobs_of_cell, self.cells = Counter(), 0
        self.done, self.total = 0, 0
        self.took, self.ended = Counter(), Counter()  # seconds and number of jobs done, by rule
        self.started = now()

    def plan(self, jobs, costs):
        """Take up the jobs that a run has to do, and what such jobs took when they were measured.

        Parameters
        ----------
        jobs : Snakemake's
        costs : of each rule, with `mean_cpu_second`
        """
        jobs = list(jobs)
        self.mean_second = {rule: cost.mean_cpu_second for rule, cost in costs.items()}
        self.waiting = Counter(job.rule.name for job in jobs)
        self.jobs_of_cell = Counter(filter(None, (cell_of(job.wildcards_dict) for job in jobs)))
        self.total, self.cells = len(jobs), len(self.jobs_of_cell)
        self.started = self.now()

    def start(self, job, rule, wildcards):
        """A job starts; one that is tried again does not count twice."""
        if job not in self.running:
            self.waiting[rule] -= 1
        self.running[job] = (rule, wildcards, self.now())

    def finish(self, job):
        """A job is done."""
        self.done += 1
        if job in self.running:
            rule, wildcards, since = self.running.pop(job)
            self.took[rule] += self.now() - since
            self.ended[rule] += 1
            self.jobs_of_cell[cell_of(wildcards)] -= 1

    def cost(self, rule) -> float:
        """Seconds of a job of a rule as measured; a tenth of a second where nobody did."""
        return self.mean_second.get(rule, 0.1)

    def second_left(self) -> float | None:
        """Time left; None before a fiftieth of the work is done.

        A job takes what those of its rule took in this run, else what was measured times what
        others take of that here. As many run at once as did so far, and the longest ends last.
        """
        now = self.now()
        spent = [(rule, now - since) for rule, _, since in self.running.values()]
        late = [(rule, second) for rule, second in spent if second > self.cost(rule)]
        took = sum(self.took.values()) + sum(second for _, second in late)
        cost = sum(self.cost(rule) * count for rule, count in self.ended.items())
        cost += sum(self.cost(rule) for rule, _ in late)
        times = took / cost if cost else 1.0

        def expected(rule):
            count = self.ended[rule]
            return self.took[rule] / count if count else self.cost(rule) * times

        rest = [max(expected(rule) - second, 0.1) for rule, second in spent]
        waiting = sum(n * expected(rule) for rule, n in self.waiting.items() if n > 0)
        busy = sum(self.took.values()) + sum(second for _, second in spent)
        if not self.done or not busy or busy < 0.02 * (busy + waiting + sum(rest)):
            return None
        at_once = busy / max(now - self.started, 1e-9)
        return max(*rest, 0.0, (waiting + sum(rest)) / at_once)

    def line(self) -> str:
        """The state of the run in one line."""
        words = [f"{self.done} of {self.total} jobs"]
        if self.cells:
            finished = self.cells - sum(count > 0 for count in self.jobs_of_cell.values())
            words.append(f"{finished} of {self.cells} cells")
        left = self.second_left()
        words.append("time left not known yet" if left is None else f"about {in_words(left)} left")
        if self.running:
            rule, wildcards, since = min(self.running.values(), key=lambda job: job[2])
            owner = cell_of(wildcards) or wildcards.get("owner")
            of = f" of {owner}" if owner else ""
            words.append(f"longest running: {rule}{of}, {in_words(self.now() - since)}")
        return " · ".join(words)


def in_words(second: float) -> str:
    """A duration as people say it: `40 s`, `3 min`, `2 h 5 min`."""
    if second < 90:
        return f"{second:.0f} s"
    minute = round(second / 60)
    return f"{minute} min" if minute < 60 else f"{minute // 60} h {minute % 60} min"


def cell_of(wildcards) -> str | None:
    """The cell or group that a job analyses; none of a job that draws what it is about, last."""
    return next((wildcards[key] for key in ("cell", "group") if key in wildcards), None)


# What a run has to do is known to the workflow, which tells it here before the first job starts.
JOBS = Jobs()


class LogHandler(LogHandlerBase):
    """Snakemake's messages as one line of progress, warnings and errors in full."""

    def __post_init__(self):
        asked = self.common_settings
        self.everything = bool(
            asked.dryrun or asked.verbose or asked.debug_dag or asked.printshellcmds
        ) or "reason" not in {str(kind) for kind in asked.quiet or ()}
        self.stream = sys.stdout if asked.stdout else sys.stderr
        self.on_terminal = self.stream.isatty()
        self.shown = time.monotonic()
        self.ended = threading.Event()
        if not self.everything:
            threading.Thread(target=self._tick, daemon=True).start()

    writes_to_stream = True
    writes_to_file = False
    has_filter = False
    has_formatter = False
    needs_rulegraph = False

    def emit(self, record):
        """Show a message, or count the job that it is about."""
        event = getattr(record, "event", None)
        if self.everything:
            self._write(self.format(record))
        elif event in COUNTED:
            self._count(event, record)
            self._show()
        elif record.levelno > 20 or not str(record.msg or "").startswith(NOISE):
            self._write(self.format(record))

    def close(self):
        """End with an empty line of progress."""
        self.ended.set()
        if self.on_terminal and not self.everything:
            self.stream.write("\r\x1b[K")
            self.stream.flush()
        super().close()

    def _count(self, event, record):
        if event == LogEvent.JOB_INFO:
            JOBS.start(record.jobid, record.rule_name, record.wildcards or {})
        elif event == LogEvent.JOB_FINISHED:
            JOBS.finish(record.job_id)
        elif event == LogEvent.PROGRESS:
            # A checkpoint may have added jobs.
            JOBS.done, JOBS.total = record.done, record.total

    def _tick(self):
        while not self.ended.wait(TERMINAL_SECOND):
            # Messages come in another thread, under the same lock.
            self.acquire()
            try:
                self._show()
            finally:
                self.release()

    def _show(self):
        pause = TERMINAL_SECOND if self.on_terminal else FILE_SECOND
        if not JOBS.total or time.monotonic() - self.shown < pause:
            return
        self.shown = time.monotonic()
        line = JOBS.line()
        self.stream.write(f"\r\x1b[K{line}"[:200] if self.on_terminal else f"{line}\n")
        self.stream.flush()

    def _write(self, text):
        if text:
            self.stream.write(f"\r\x1b[K{text}\n" if self.on_terminal else f"{text}\n")
            self.stream.flush()
