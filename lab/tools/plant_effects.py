"""Plant effects of known size in a campaign of real cells, beside the same records unplanted.

python lab/tools/plant_effects.py CAMPAIGN FOLDER --cells A123 --seed 0
    --effects leakage time_skew --sizes 6mV 0.5base --proof hppc_40C
"""

import argparse

from virtual_lab.zoo import planted

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("campaign", help="folder of the campaign with the real records")
    parser.add_argument("folder", help="where the planted campaign is written")
    parser.add_argument("--cells", nargs="*", default=(), help="its cells; all where not given")
    parser.add_argument("--seed", type=int, default=0, help="of signs and further parameters")
    parser.add_argument("--effects", nargs="*", default=tuple(planted.EFFECTS))
    parser.add_argument("--sizes", nargs="*", default=planted.SIZES, help="6mV, or 0.5base")
    parser.add_argument("--proof", nargs="*", help="tests that are set aside to judge")
    given = vars(parser.parse_args())
    rows = planted.make(given.pop("campaign"), given.pop("cells"), given.pop("folder"), **given)
    print(f"{len(rows)} cells, {sum(row['visible'] for row in rows)} of them with a visible effect")
