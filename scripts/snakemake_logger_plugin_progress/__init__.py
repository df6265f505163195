"""`snakemake --logger progress`: one line of what runs, and warnings and errors as they come.

The complete log stays in `.snakemake/log`. Dry runs and `--verbose`, `--debug-dag`,
`--printshellcmds` or `--quiet host` show every message, as Snakemake does.
"""

from runtime.progress import ProgressHandler as LogHandler

__all__ = ["LogHandler"]
