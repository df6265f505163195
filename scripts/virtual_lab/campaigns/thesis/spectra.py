"""45 spectra of the circuit of table 3.1: at three states of charge and five temperatures."""

from virtual_lab import ageing
from virtual_lab.plan import Cell, Test
from virtual_lab.tabulated import REPEATS, Tabulated, conditions

NAME = "E5"


def tests_and_cells(seed: int) -> tuple[list[Cell], list[Test]]:
    """The cell and its spectra, every third in an analyser's own format."""
    cell = Cell(NAME, "LMO", ageing.KINDS["E"].rating, Tabulated(), note="circuit of table 3.1")
    tests = [
        Test(
            NAME,
            f"eis_{celsius:.0f}C_soc{100 * soc:.0f}_{repeat}",
            "eis",
            celsius,
            "digatron_eis" if repeat == REPEATS else "eis",
            Tabulated(),
            soc=soc,
            initial_soc=soc,
            batch=NAME,
            seed_of_campaign=seed,
        )
        for soc, celsius in conditions()
        for repeat in range(1, REPEATS + 1)
    ]
    return [cell], tests
