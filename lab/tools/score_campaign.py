"""Score a campaign's results against its truth: `score_campaign.py CAMPAIGN [--markdown FILE]`.

Writes CAMPAIGN/results/score/: score.csv (one row a quantity), errors.csv (one row a comparison),
verdicts.csv (one row a cell) and score.html.
"""

import argparse
from pathlib import Path

from virtual_lab.score import files, page

if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    asked.add_argument("campaign", type=Path, help="folder with results/ and truth/")
    asked.add_argument("--truth", type=Path, help="another folder of truth tables")
    asked.add_argument("--markdown", type=Path, help="also write the summary as a Markdown table")
    asked.add_argument("--title", default="Results against the truth")
    given = asked.parse_args()
    place = files.campaign(given.campaign)
    place = place._replace(truth=given.truth) if given.truth else place
    scored = page.write(place, title=given.title)
    if given.markdown:
        given.markdown.write_text(page.markdown(scored), encoding="utf-8")
    print(f"{place.results / 'score' / 'score.html'}: {len(scored.errors)} comparisons")
