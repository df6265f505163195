# Every campaign of real cells run whole, its numbers in one table and on one page.
# No part of the main job: `snakemake real`.

from real_cells import campaigns

REAL = config["real"]
REAL_FOLDER = Path(PIPELINE, REAL["folder"]).resolve()
DOCS_OF_REAL = PIPELINE / "docs" / "real-cells"


# A run of the pipeline inside this one: it is called whenever a file of the campaign or any code of
# the pipeline has changed, and decides itself, by content, which of its jobs run again.
rule real_campaign:
    input:
        campaign=lambda w: campaigns.files(REAL_FOLDER, w.campaign),
    output:
        "real/{campaign}/numbers.csv",
    log:
        "logs/real_campaign/{campaign}.log",
    wildcard_constraints:
        campaign="[A-Za-z0-9_-]+",
    # Long ones begin first, so that none is left over at the end.
    priority: lambda w: campaigns.expected_second(w.campaign)
    retries: 0
    threads: 1
    params:
        campaign=str(REAL_FOLDER / "{campaign}"),
        whole=REAL["to"] == "report",
        pipeline=lambda w: campaigns.code_hash(),
    message:
        "Run the real cells of {wildcards.campaign}, minutes; what it says: {log}."
    script:
        "../../scripts/real/real_campaign.py"


rule real:
    input:
        numbers=lambda w: [
            f"real/{name}/numbers.csv" for name in campaigns.wanted(REAL_FOLDER, REAL["names"])
        ],
        published=DOCS_OF_REAL / "published.csv",
        before=DOCS_OF_REAL / "before.csv",
    output:
        numbers="real/numbers.csv",
        page="real/real-cells.md",
    log:
        "logs/real.log",
    message:
        "All numbers of real cells: {output.page}; real_check.py holds them against the record."
    script:
        "../../scripts/real/real.py"
