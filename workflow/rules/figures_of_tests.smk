# Figures of what the tests of one cell tell. Figures are rules, never options of analyses.


rule figure_capacity:
    input:
        lambda w: artefacts("capacity", w.cell, *CAPACITY_KINDS),
    output:
        "results/figures/{cell}/capacity.svg",
    log:
        "logs/figures/{cell}_capacity.log",
    message:
        "Figure: capacity of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_capacity.py"


rule figure_ocv:
    input:
        lambda w: artefacts("ocv", w.cell, "ocv") or rest_curves(w.cell),
    output:
        "results/figures/{cell}/ocv.svg",
    log:
        "logs/figures/{cell}_ocv.log",
    message:
        "Figure: open-circuit voltage of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_ocv.py"


rule figure_resistance:
    input:
        lambda w: artefacts("resistance", w.cell, *PULSE_KINDS),
    output:
        "results/figures/{cell}/resistance.svg",
    log:
        "logs/figures/{cell}_resistance.log",
    message:
        "Figure: resistance of {wildcards.cell} over SoC."
    script:
        "../../scripts/figures_of_tests/figure_resistance.py"


rule figure_ica:
    input:
        curves=lambda w: artefacts("ica_curve", w.cell, "ica"),
        peaks=lambda w: artefacts("ica", w.cell, "ica"),
    output:
        "results/figures/{cell}/ica.svg",
    log:
        "logs/figures/{cell}_ica.log",
    message:
        "Figure: incremental capacity of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_ica.py"


rule figure_impedance:
    input:
        lambda w: artefacts("eis_curve", w.cell, "eis"),
    output:
        "results/figures/{cell}/impedance.svg",
    log:
        "logs/figures/{cell}_impedance.log",
    message:
        "Figure: impedance of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_impedance.py"


rule figure_impedance_fit:
    input:
        lambda w: artefacts("eis_curve", w.cell, "eis"),
    output:
        "results/figures/{cell}/impedance_fit.svg",
    log:
        "logs/figures/{cell}_impedance_fit.log",
    message:
        "Figure: residuals of the circuit fitted to the spectra of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_impedance_fit.py"


rule figure_drt:
    input:
        curves=lambda w: artefacts("drt", w.cell, "eis"),
        peaks=lambda w: artefacts("drt_peaks", w.cell, "eis"),
    output:
        "results/figures/{cell}/drt.svg",
    log:
        "logs/figures/{cell}_drt.log",
    message:
        "Figure: relaxation times in the spectra of {wildcards.cell}."
    script:
        "../../scripts/figures_of_tests/figure_drt.py"


rule figure_relaxation:
    input:
        lambda w: artefacts("relaxation_curve", w.cell, *RELAXATION_KINDS),
    output:
        "results/figures/{cell}/relaxation.svg",
    log:
        "logs/figures/{cell}_relaxation.log",
    message:
        "Figure: rests of {wildcards.cell} and the exponentials through them."
    script:
        "../../scripts/figures_of_tests/figure_relaxation.py"


rule figure_fast_charge:
    input:
        series=lambda w: artefacts("clean", w.cell, "fast_charge"),
        steps=lambda w: artefacts("segment", w.cell, "fast_charge"),
        numbers=lambda w: artefacts("fast_charge", w.cell, "fast_charge"),
    output:
        "results/figures/{cell}/fast_charge.svg",
    log:
        "logs/figures/{cell}_fast_charge.log",
    message:
        "Figure: fast charges of {wildcards.cell} by temperature."
    script:
        "../../scripts/figures_of_tests/figure_fast_charge.py"
