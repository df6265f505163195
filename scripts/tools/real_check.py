"""Fails where a number of real cells is worse than recorded: `real_check.py [--demo]`.

Numbers come from the last run of the target `real`; --demo holds the finished demo campaign
against its truth, --from takes a folder of finished campaigns.
"""

import sys

from real_cells import record

if __name__ == "__main__":
    given = record.command_line(__doc__.partition("\n")[0]).parse_args()
    recorded = record.read(record.RECORDED)
    if faults := record.faults_of(recorded):
        sys.exit("\n".join([f"{record.RECORDED.name}:", *faults]))
    try:
        measured = record.of_command_line(given)
    except FileNotFoundError as missing:
        sys.exit(str(missing))
    rows = record.compare(recorded, measured)
    lacking = record.not_recorded(recorded, measured)
    print("\n".join([*record.differences(rows), *lacking]))
    sys.exit(bool(lacking) or bool(rows["outcome"].isin(record.FAILING).any()))
