"""Commands beside a run: `inspect FILE...`, `init FOLDER`, `check FOLDER`, `convert FILE`,
`explain TABLE ROW`, `compare BEFORE AFTER`, `plan FOLDER`."""

import argparse
import sys

from cellwright.refusal import Refusal
from first_look import check, compare, interchange, lineage, next_tests, one_file, sheets, words


def main(arguments=None) -> int:
    """Run one command; 1 where a file or folder was refused, with the reason."""
    parser = argparse.ArgumentParser(prog="./run cellwright", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    inspect = commands.add_parser(
        "inspect", help="say what files hold and what tests they could be"
    )
    inspect.add_argument("file", nargs="+")
    init = commands.add_parser("init", help="draft the sheets of a folder of instruments' files")
    init.add_argument("folder")
    look = commands.add_parser("check", help="say what a run will make of a campaign's tests")
    look.add_argument("folder")
    convert = commands.add_parser("convert", help="write a file as Battery Data Format")
    convert.add_argument("file")
    convert.add_argument("--to", help=f"a path that ends in {', '.join(interchange.MEDIA)}")
    explain = commands.add_parser("explain", help="say what a row of a table was made from")
    explain.add_argument("table", help="such as results/tables/capacity.csv")
    explain.add_argument("row", nargs="*", help="of a table: number of the line, or COLUMN=VALUE")
    two = commands.add_parser("compare", help="say what differs between two runs, and why")
    two.add_argument("before", help="folder of a campaign that was run")
    two.add_argument("after", help="another, or a later state of the same")
    two.add_argument("--to", default=".", help="folder for comparison.csv and comparison.html")
    next_tests.add_arguments(
        commands.add_parser("plan", help="say which tests would lower a model's error most")
    )
    options = parser.parse_args(arguments)
    if options.command == "inspect":
        return max([_looked_at(file, k > 0) for k, file in enumerate(options.file)])
    return _printed(_lines(options))


def _printed(lines) -> int:
    """Print lines as they come; 1 where they end in a refusal, which is printed too."""
    try:
        for line in lines:
            print(line, flush=True)
    except (Refusal, OSError) as reason:
        print(reason, file=sys.stderr)
        return 1
    return 0


def _looked_at(file, follows) -> int:
    """Print what one of several files holds; a refused one does not take the next ones down."""
    if follows:
        print(flush=True)
    return _printed(_about(file))


def _about(file):
    yield from words.lines_of(one_file.look(file))


def _lines(options):
    if options.command == "init":
        yield from sheets.write(options.folder)
    elif options.command == "check":
        yield from check.check(options.folder)
    elif options.command == "convert":
        yield from (f"written: {path}" for path in interchange.convert(options.file, options.to))
    elif options.command == "explain":
        yield from lineage.explain(options.table, options.row)
    elif options.command == "plan":
        yield from next_tests.lines_of(options)
    else:
        changes = compare.compare(options.before, options.after)
        yield from compare.in_words(changes)
        yield from (f"written: {path}" for path in compare.write(changes, options.to))


if __name__ == "__main__":
    sys.exit(main())
