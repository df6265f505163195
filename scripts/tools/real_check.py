"""Fails where a number of real cells is worse than recorded: `real_check.py [--demo]`.

Numbers come from the last run of the target `real`; --demo holds the finished demo campaign
against its truth, --from takes a folder of finished campaigns.
"""

import sys

from real_cells import asked, check, record

if __name__ == "__main__":
    given = asked.options(__doc__.partition("\n")[0]).parse_args()
    recorded = record.read(record.RECORDED)
    if faults := record.faults(recorded):
        sys.exit("\n".join([f"{record.RECORDED.name}:", *faults]))
    try:
        measured = asked.measured(given)
    except FileNotFoundError as missing:
        sys.exit(str(missing))
    rows = check.compared(recorded, measured)
    lacking = check.without_record(recorded, measured)
    print("\n".join([*check.told(rows), *lacking]))
    sys.exit(bool(lacking) or bool(rows["outcome"].isin(check.FAILING).any()))
