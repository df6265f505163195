# A plain `snakemake` begins here; the workflow itself, for others to use as a module, is below.
include: "workflow/Snakefile"


rule campaign:
    default_target: True
    input:
        rules.all.input,
    message:
        "The whole campaign."
