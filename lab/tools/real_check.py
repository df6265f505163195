"""Fails where a number of real cells is worse than recorded: `real_check.py [--demo]`.

Of the demo also where a rule costs a quarter more CPU or memory than recorded, where its last run
was measured (job_costs.py).

Numbers come from the last run of the target `real`; --demo holds the finished demo campaign
against its truth, --from takes a folder of finished campaigns.
"""

import sys

from real_cells import campaigns, costs, record

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
    failed = bool(lacking) or bool(rows["outcome"].isin(record.FAILING).any())
    if given.demo:
        found = costs.read(costs.MEASURED, code=campaigns.code_hash())
        more, other = costs.compare(costs.read(costs.RECORDED), found)
        print(f"What {len(found)} rules cost" if found else f"Costs not measured: {costs.MEASURE}")
        print("\n".join([*(f"  more: {line}" for line in more), *(f"  {line}" for line in other)]))
        failed = failed or bool(more)
    sys.exit(failed)
