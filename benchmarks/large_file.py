"""CPU time and peak memory of reading a large Arbin csv: ./run python benchmarks/large_file.py MB.

The text is read in blocks: what is held grows with its columns, not with its length.
"""

import gzip
import multiprocessing
import resource
import shutil
import sys

from reading import arbin_file
from timing import cpu_second

from cellwright import formats
from cellwright.formats.table import BLOCK

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
    with path.open("rb") as file:
        columns = formats.read(file, name=path.name).columns
    second = cpu_second() - begin
    rows, held = len(columns["voltage_volt"]), sum(c.nbytes for c in columns.values()) / 1e6
    size, peak = path.stat().st_size / 1e6, _peak_megabyte()
    print(f"{path.name}: {size:.0f} MB, {rows:,} rows, {second:.1f} s of CPU")
    print(f"peak memory {peak:.0f} MB ({before:.0f} at the start), columns {held:.0f} MB")


def _peak_megabyte():
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    main(float(sys.argv[1]), *sys.argv[2:])
