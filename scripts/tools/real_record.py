"""Renews the record of real cells: `real_record.py --why "what made it change"`.

The numbers are those of the last run of the target `real`, of --from FOLDER or of the --demo.
With --before they become what the documentation's page shows as the earlier state.
"""

import sys

from real_cells import campaigns, record

if __name__ == "__main__":
    options = record.command_line(__doc__.partition("\n")[0])
    options.add_argument("--why", help="a sentence for the list of renewals")
    options.add_argument("--before", action="store_true", help="write before.csv instead")
    given = options.parse_args()
    try:
        reason = record.reason_of_renewal(given.why)
        measured = record.of_command_line(given)
    except (ValueError, FileNotFoundError) as fault:
        sys.exit(str(fault))
    table = record.BEFORE if given.before else record.RECORDED
    record.renew(measured, reason, table, code="" if given.folder else campaigns.code_hash())
