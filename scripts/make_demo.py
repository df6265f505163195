"""Make the demo campaign with the virtual laboratory: `make_demo.py test CELL TEST`, then `sheets`.

python scripts/make_demo.py test C1 hppc_25C     one raw file, and the truth about it
python scripts/make_demo.py sheets               config/*.tsv from the raw files that lie there
python scripts/make_demo.py truth                tests/truth/truth.json from the tests' truths
"""

import sys

from virtual_lab import workshop

if __name__ == "__main__":
    command, *names = sys.argv[1:]
    {"test": workshop.make_test, "sheets": workshop.make_sheets, "truth": workshop.make_truth}[
        command
    ](*names)
