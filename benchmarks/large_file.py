"""CPU time and peak memory from a large Arbin csv to its clean series.

    PYTHONPATH=benchmarks ./run python benchmarks/large_file.py MB [gz]

The text is read in blocks and cleaned in pieces: what is held grows with its columns alone.
"""

import gzip
import multiprocessing
import resource
import shutil
import sys

from reading import arbin_file
from timing import cpu_second

import cellwright as cw
from cellwright.formats.content import BLOCK

BYTE_ROW = 143  # of the file that is written


def main(megabyte, packed=""):
    """Print rows, seconds of CPU and megabytes, of a plain file or its .gz."""
    rows = int(megabyte * 1e6 / BYTE_ROW)
    # Making the file takes more memory than reading it.
    maker = multiprocessing.get_context("spawn").Process(target=arbin_file, args=(rows,))
    maker.start()
    maker.join()
    path = arbin_file(rows)
    if packed == "gz":
        target = path.with_suffix(".csv.gz")
        with path.open("rb") as plain, gzip.open(target, "wb", compresslevel=1) as file:
            shutil.copyfileobj(plain, file, BLOCK)
        path = target
    before, begin = _peak_megabyte(), cpu_second()
    series = cw.read(str(path), largest_megabyte=1e5)
    read, after = cpu_second() - begin, _peak_megabyte()
    columns = cw.clean(series).columns
    cleaned = cpu_second() - begin - read
    rows, held = len(columns["voltage_volt"]), sum(c.nbytes for c in columns.values()) / 1e6
    size, peak = path.stat().st_size / 1e6, _peak_megabyte()
    print(f"{path.name}: {size:.0f} MB, {rows:,} rows")
    print(f"CPU: read {read:.2f} s, cleaned {cleaned:.2f} s")
    print(f"peak memory: {before:.0f} MB at the start, {after:.0f} read, {peak:.0f} cleaned")
    print(f"columns: {held:.0f} MB, {1e6 * held / rows:.0f} bytes a row")


def _peak_megabyte():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main(float(sys.argv[1]), *sys.argv[2:])
