"""Pictures of a report for the documentation, by a browser without a window.

    ./run python scripts/tools/report_pictures.py results/report.html docs/pictures --cell C5
    ./run python scripts/tools/report_pictures.py real/a123/results/report.html docs/pictures \
        --cell A123 --effect 492

writes report.png (the first screen) and report-cell.png (a cell's page, folded); with --effect
report-effect.png alone (of that cell the figure of the missing effect, so many pixels from its top:
the gap before and after, on tests not fitted).
"""

import argparse
import sys
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tools import browser

SCREEN = (1280, 900)  # pixel


def main():
    """Read the arguments and write the pictures."""
    reader = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    reader.add_argument("report", type=Path)
    reader.add_argument("folder", type=Path)
    reader.add_argument("--cell", help="whose page is shown", required=True)
    about = "pixels from the top of its figure of the missing effect, the one picture then"
    reader.add_argument("--effect", type=int, help=about)
    asked = reader.parse_args()
    if not browser.found():
        reader.error(f"found no browser, wanted one of {', '.join(browser.NAMES)}")
    with browser.opened() as tab:
        tab.size(*SCREEN)
        pages = (("report", "overview"), ("report-cell", f"cell-{asked.cell}"))
        for name, place in () if asked.effect else pages:
            tab.go(asked.report, place)
            tab.picture(asked.folder / f"{name}.png")
        if not asked.effect:
            return
        figure = f"cell-{asked.cell}/effect_validation"
        tab.go(asked.report, figure)
        tab.wait(f"document.getElementById({figure!r}).querySelector('img').complete")
        wanted = {"of": f'[id="{figure}"] .scroll', "height": asked.effect}
        tab.picture(asked.folder / "report-effect.png", **wanted)


if __name__ == "__main__":
    main()
