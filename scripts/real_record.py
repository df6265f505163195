"""Renews the record of real cells and its page: `real_record.py --why "what made it change"`.

The numbers are those of the last run of the target `real`, of --from FOLDER or of the --demo.
With --before they become what the page shows as the earlier state; with --page alone nothing is
measured and only the page is made again.
"""

import sys

from real_cells import asked, page, record

if __name__ == "__main__":
    options = asked.options(__doc__.partition("\n")[0])
    options.add_argument("--why", help="a sentence for the list of renewals")
    options.add_argument("--before", action="store_true", help="write before.csv instead")
    options.add_argument("--page", action="store_true", help="only make the page again")
    given = options.parse_args()
    if given.before:
        old = record.read(record.BEFORE)
        record.write(record.renewed(old, asked.measured(given)), record.BEFORE)
    elif not given.page:
        try:
            reason = record.reasoned(given.why)
        except ValueError as fault:
            sys.exit(str(fault))
        record.renew(asked.measured(given), reason)
    page.write(page.text(record.read(record.RECORDED), record.read(record.BEFORE)), record.PAGE)
