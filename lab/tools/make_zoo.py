"""Make one part of the zoo: `make_zoo.py PART FOLDER OPTIONS`, options as JSON, with the seed.

At the end FOLDER/made.json says why the part was not made; its `skipped` is empty where it was.
"""

import json
import sys
from pathlib import Path

from virtual_lab.zoo import parts

if __name__ == "__main__":
    part, folder, options = sys.argv[1:]
    Path(folder).mkdir(parents=True, exist_ok=True)
    skipped = parts.make_part(part, folder, **json.loads(options))
    (Path(folder) / "made.json").write_text(json.dumps({"skipped": skipped}) + "\n")
