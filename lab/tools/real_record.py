"""Renews the record of real cells: `real_record.py --why "what made it change"`.

The numbers are those of the last run of the target `real`, of --from FOLDER or of the --demo.
With --before they become what the documentation's page shows as the earlier state. Of the --demo
the costs of its rules are renewed as well, and what jobs ask a cluster for by them, where a run of
today's code measured them (job_costs.py).
"""

import sys

from documentation import pages
from real_cells import campaigns, costs, record

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
    code = "" if given.folder else campaigns.code_hash()
    record.renew(measured, reason, table, code=code)
    if given.demo and not given.before and (found := costs.read(costs.MEASURED, code=code)):
        known = costs.renewed(costs.read(costs.RECORDED), found)
        costs.write(known, costs.RECORDED, code=code)
        costs.write_requests(known)
        of = costs.RECORDED.stem
        record.note_renewal(f"* {of}: {reason} ({len(found)} rules; code {code})\n", of=of)
    pages.renew()  # the tutorial's numbers are those of the record
