"""Snakemake's executor for one machine, whose Python scripts start with their packages loaded.

A job of one thread with a Python `script:` runs in a process forked from a server that has imported
the packages of `--warm-preload`. All other jobs, and all that surrounds a job (files, log,
benchmark, retries, messages), are those of the local executor, of which this one is a subclass.
"""

from dataclasses import dataclass, field
from functools import partial

from snakemake.executors.local import Executor as LocalExecutor
from snakemake.executors.local import common_settings, run_wrapper
from snakemake_interface_executor_plugins.executors.base import SubmittedJobInfo
from snakemake_interface_executor_plugins.settings import ExecutorSettingsBase

from .client import Server, scripts_start_in

__all__ = ["Executor", "ExecutorSettings", "common_settings"]


@dataclass
class ExecutorSettings(ExecutorSettingsBase):
    """What the user may set: `--warm-preload`, or `warm-preload:` in a profile, and so on."""

    preload: list[str] = field(
        default_factory=list,
        metadata={
            "help": "Modules that are imported once, before the first script, in this order. "
            "`package.*` names a package with all its modules. None of them may start a thread "
            "when it is imported.",
            "nargs": "+",
            "metavar": "MODULE",
        },
    )
    least_scripts: int = field(
        default=1,
        metadata={
            "help": "Runs with fewer scripts to run start them as the local executor does, because "
            "importing the modules beforehand would take longer than it saves.",
            "metavar": "N",
        },
    )


class Executor(LocalExecutor):
    """The local executor with a server of processes for Python scripts."""

    def __post_init__(self):
        super().__post_init__()
        self.server = Server(self.executor_settings.preload)
        scripts = sum(bool(job.is_script) for job in self.dag.needrun_jobs())
        self.pays = scripts >= self.executor_settings.least_scripts

    def run_job(self, job):
        """Start a job: a script from the server, any other as the local executor does."""
        if not (self.pays and self._is_plain_script(job)):
            super().run_job(job)
            return
        future = self.pool.submit(
            self.cached_or_run, job, self._run_script, *self.job_args_and_prepare(job)
        )
        submitted = SubmittedJobInfo(job=job)
        future.add_done_callback(partial(self._callback, submitted))
        self.report_job_submission(submitted)

    def _is_plain_script(self, job) -> bool:
        """Whether a job is a script outside groups, shadow folders and debuggers."""
        settings = self.workflow.execution_settings
        special = job.is_group() or job.is_shadow or settings.debug or settings.edit_notebook
        return not special and bool(job.is_script)

    def _run_script(self, *arguments):
        with scripts_start_in(self.server):
            run_wrapper(*arguments)

    def shutdown(self):
        """Wait for the running jobs, then end the server."""
        super().shutdown()
        self.server.close()

    def cancel(self):
        """End the running scripts, wait for the other jobs, then end the server."""
        self.server.end_scripts()
        super().cancel()
        self.server.close()
