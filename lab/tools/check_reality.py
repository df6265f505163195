"""Set the laboratory's records beside real ones: figures, a table, a page.

python lab/tools/check_reality.py OUT . virtual/thesis --real FOLDER/a123 FOLDER/panasonic
python lab/tools/check_reality.py OUT demo=. --real FOLDER/a123 --celsius 25 --cells 8
A campaign is a folder, or a name for the figures, `=` and a folder; what is absent is skipped.
"""

import argparse
from pathlib import Path

from virtual_lab.reality import check
from virtual_lab.reality.records import named

if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    asked.add_argument("out", type=Path, help="folder for the results; never in the repository")
    asked.add_argument("simulated", nargs="+", help="campaigns of the laboratory")
    asked.add_argument("--real", nargs="*", default=[], help="campaigns of real cells")
    asked.add_argument("--celsius", type=float, default=25.0, help="chamber temperature [°C]")
    asked.add_argument("--cells", type=int, default=8, help="cells of each campaign")
    options = asked.parse_args()
    sources = [named(text, real=False) for text in options.simulated]
    sources += [named(text, real=True) for text in options.real]
    found = check.look(sources, celsius=options.celsius, most_cells=options.cells)
    check.write(found, sources, options.out)
