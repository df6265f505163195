# A plain `snakemake` begins here; the workflow itself, for others to use as a module, is below.
include: "workflow/Snakefile"


rule campaign:
    input:
        rules.all.input,
    message:
        "The whole campaign."
