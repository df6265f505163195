# Every campaign of real cells run whole, its numbers in one table and on one page.

from real_cells import campaigns as real_campaigns

REAL = real_campaigns.options(config.get("real", {}))
REAL_FOLDER = Path(real_campaigns.ROOT, REAL["folder"]).resolve()
DOCS_OF_REAL = real_campaigns.ROOT / "docs" / "real-cells"


# A run of the pipeline inside this one: it is called whenever a file of the campaign or any code of
# the pipeline has changed, and decides itself, by content, which of its jobs run again.
rule real_campaign:
    input:
        campaign=lambda w: real_campaigns.files(REAL_FOLDER, w.campaign),
    output:
        "real/{campaign}/numbers.csv",
    log:
        "logs/real_campaign/{campaign}.log",
    wildcard_constraints:
        campaign="[A-Za-z0-9_-]+",
    # Long ones begin first, so that none is left over at the end.
    priority: lambda w: real_campaigns.expected_second(w.campaign)
    retries: 0
    threads: 1
    params:
        campaign=str(REAL_FOLDER / "{campaign}"),
        whole=REAL["to"] == "report",
        pipeline=lambda w: real_campaigns.code_hash(),
    message:
        "Run the real cells of {wildcards.campaign}, minutes; what it says: {log}."
    script:
        "../real/real_campaign.py"


rule real:
    input:
        numbers=lambda w: [
            f"real/{name}/numbers.csv"
            for name in real_campaigns.wanted(REAL_FOLDER, REAL["names"])
        ],
        published=DOCS_OF_REAL / "published.csv",
        before=DOCS_OF_REAL / "before.csv",
    output:
        numbers="real/numbers.csv",
        page="real/real-cells.md",
    log:
        "logs/real.log",
    message:
        "All numbers of real cells: {output.page}; reports: real/<campaign>/results/report.html."
    script:
        "../real/real.py"
