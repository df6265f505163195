"""Plant effects of known strength in a campaign of real cells, beside the same records unplanted.

python lab/tools/plant_effects.py CAMPAIGN FOLDER --cells A123 --effects leakage --millivolts 6 15
CAMPAIGN is one whose results/clean have been made; FOLDER is run and scored as any campaign.
"""

import argparse

from virtual_lab.hidden import planted

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign")
    parser.add_argument("folder")
    parser.add_argument("--cells", nargs="*", default=(), help="all where not given")
    parser.add_argument("--effects", nargs="*", default=planted.PLANTED, choices=planted.PLANTED)
    parser.add_argument("--millivolts", nargs="*", type=float, default=(6.0,))
    parser.add_argument("--seed", type=int, default=0, help="of signs and further parameters")
    given = vars(parser.parse_args())
    print(planted.make(given.pop("campaign"), given.pop("folder"), **given), "copies")
