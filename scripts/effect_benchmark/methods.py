"""Names of what is asked of each cell."""

SEARCH, LEFT_OUT = "search", "class_left_out"
BIC, VALIDATION = "bic_alone", "validation_rmse_alone"
RANDOM, PERMUTED, EXTRA = "random_term", "permuted_current", "extra_rc"
# Of groups: the search with tests near 25 °C alone, and without branch currents.
ONE_TEMPERATURE, BLIND = "one_temperature", "no_branch_currents"
