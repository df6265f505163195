"""Cells and parallel groups that can be tested, by physics or by the fast generator.

A specimen that is cycled has `run(steps, *, chamber, initial_soc)`, which gives one behaviour per
step, and `full_ampere_hour`, the charge of the full cell to which SoC refers. One that is measured
with an impedance analyser has `spectrum(frequency_hertz, *, celsius, soc)`. `facts(name)` gives
rows of truth tables about the specimen itself.
"""

from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from virtual_lab import fast
from virtual_lab.chamber import Chamber

CURVE_SOC = np.linspace(0.0, 1.0, 101)
MODEL_SOC = np.round(np.arange(0.1, 0.95, 0.1), 2)


class Behavioural(NamedTuple):
    """A cell of the fast generator, made when it is first needed: plans are written in no time.

    `known` gives rows of truth tables about it.
    """

    make: Callable[[], fast.Cell]
    temperatures_celsius: tuple[float, ...] = (25.0,)
    known: Callable[[], dict[str, list[dict]]] | None = None

    @property
    def cell(self) -> fast.Cell:
        """The cell itself."""
        return _built(self.make)

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] between the ends of its open-circuit voltage, at 25 °C."""
        return self.cell.capacity_ampere_hour

    @property
    def capacity_per_kelvin(self) -> float:
        """By what share that charge grows with temperature [1/K]."""
        return self.cell.capacity_per_kelvin

    def run(self, steps, *, chamber: Chamber, initial_soc: float = 1.0):
        """Through a protocol; see `fast.run`."""
        return fast.run(steps, self.cell, chamber=chamber, initial_soc=initial_soc)

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm], linearised at rest."""
        return fast.impedance(self.cell, frequency_hertz, soc=soc, celsius=celsius)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`: the ohmic end."""
        found = fast.resistances(self.cell, np.array([soc]), celsius=celsius)
        return {"r_ohmic_ohm": round(float(found["r0"][0]), 7)}

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Open-circuit voltage and resistances over SoC at the temperatures of its tests."""
        told = self.known() if self.known else {}
        return {
            "ocv": [row for t in self.temperatures_celsius for row in self._curve(name, t)],
            "models": [row for t in self.temperatures_celsius for row in self._circuit(name, t)],
            **{table: [{"cell": name, **row} for row in rows] for table, rows in told.items()},
        }

    def _curve(self, name, celsius):
        volt = fast.rested_volt(self.cell, CURVE_SOC, celsius=celsius)
        return curve_rows(name, celsius, volt)

    def _circuit(self, name, celsius):
        found = fast.resistances(self.cell, MODEL_SOC, celsius=celsius)
        return [
            {
                "cell": name,
                "ambient_temperature_celsius": celsius,
                "soc": float(soc),
                "parameter": parameter,
                "value": float(f"{value:.6g}"),
            }
            for parameter, values in found.items()
            for soc, value in zip(MODEL_SOC, values, strict=True)
        ]


class Physical(NamedTuple):
    """A porous-electrode cell (PyBaMM)."""

    cell: object

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the cell after a full charge as the laboratory makes it."""
        from virtual_lab.physics import porous

        return porous.full_charge_ampere_hour(self.cell)

    def run(self, steps, *, chamber: Chamber, initial_soc: float = 1.0):
        """Through a protocol; see `simulate.run`."""
        from virtual_lab.physics import simulate

        return simulate.run(steps, self.cell, chamber=chamber, initial_soc=initial_soc)

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm] of the physics, linearised at rest."""
        from virtual_lab.physics import simulate

        setting = {"ambient_celsius": celsius, "soc": soc}
        return simulate.spectrum(self.cell, frequency_hertz, **setting)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`: the ohmic end is all that physics and circuits share."""
        from virtual_lab.physics.simulate import OHMIC_FREQUENCY_HERTZ

        end = self.spectrum(np.array([OHMIC_FREQUENCY_HERTZ]), celsius=celsius, soc=soc)[0]
        return {"r_ohmic_ohm": round(float(end.real), 7)}

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Open-circuit voltage at 25 °C and what the cell has lost."""
        from virtual_lab.physics import porous

        volt = porous.rested_volt(self.cell, CURVE_SOC)
        health = {
            "cell": name,
            "cycle": self.cell.cycle,
            "capacity_ampere_hour": round(self.full_ampere_hour, 5),
            "lli": self.cell.lli,
            "lam_negative": self.cell.lam_negative,
            "lam_positive": self.cell.lam_positive,
        }
        return {"ocv": curve_rows(name, 25.0, volt), "health": [health]}


class BehaviouralGroup(NamedTuple):
    """Cells of the fast generator in parallel, each behind its wire."""

    names: tuple[str, ...]
    members: tuple[Behavioural, ...]
    wire_ohm: tuple[float, ...]
    initial_soc: tuple[float, ...]

    @property
    def cells(self) -> tuple[fast.Cell, ...]:
        """The cells themselves."""
        return tuple(member.cell for member in self.members)

    @property
    def capacities_ampere_hour(self) -> list[float]:
        """Charge [Ah] of each full cell."""
        return [cell.capacity_ampere_hour for cell in self.cells]

    @property
    def full_ampere_hour(self) -> float:
        """Sum of the cells' charges [Ah]."""
        return sum(self.capacities_ampere_hour)

    def run(self, steps, *, chamber: Chamber, initial_soc=None):
        """Through a protocol of the group's current; each cell begins at its own SoC."""
        return fast.run_group(
            steps,
            self.cells,
            wire_ohm=self.wire_ohm,
            initial_soc=initial_soc or self.initial_soc,
            chambers=(chamber,) * len(self.cells),
        )

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Rows of groups.tsv."""
        return {"groups": branch_rows(name, self.names, self.wire_ohm, self.initial_soc)}


@lru_cache(maxsize=256)
def _built(make):
    return make()


class PhysicalPair(NamedTuple):
    """Two porous-electrode cells in parallel that rested at one voltage [V]."""

    names: tuple[str, str]
    cells: tuple[object, object]
    wire_ohm: tuple[float, float]
    rested_volt: float

    @property
    def capacities_ampere_hour(self) -> list[float]:
        """Charge [Ah] of each full cell."""
        return [round(Physical(cell).full_ampere_hour, 5) for cell in self.cells]

    @property
    def full_ampere_hour(self) -> float:
        """Sum of both charges [Ah]."""
        return sum(self.capacities_ampere_hour)

    @property
    def initial_soc(self) -> tuple[float, ...]:
        """Each cell's SoC, as precise as the sheet says it."""
        from virtual_lab.physics import porous

        return tuple(round(porous.soc_at(cell, self.rested_volt), 4) for cell in self.cells)

    def run(self, steps, *, chamber: Chamber, initial_soc=None):
        """Through a protocol of the pair's current, in a steady chamber; see `parallel.run`."""
        from virtual_lab.physics import simulate

        celsius = float(chamber.celsius[0])
        if np.ptp(chamber.celsius) > 0:
            raise ValueError("a pair by physics needs a chamber that holds its temperature")
        return simulate.run_pair(
            steps,
            self.cells,
            wire_ohm=self.wire_ohm,
            initial_soc=initial_soc or self.initial_soc,
            ambient_celsius=celsius,
        )

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Rows of groups.tsv."""
        return {"groups": branch_rows(name, self.names, self.wire_ohm, self.initial_soc)}


def curve_rows(name: str, celsius: float, volt: np.ndarray) -> list[dict]:
    """Rows of the truth's open-circuit voltage [V] over CURVE_SOC."""
    return [
        {
            "cell": name,
            "ambient_temperature_celsius": celsius,
            "soc": round(float(soc), 4),
            "ocv_volt": round(float(v), 6),
        }
        for soc, v in zip(CURVE_SOC, volt, strict=True)
    ]


def branch_rows(group: str, names, wire_ohm, initial_soc) -> list[dict]:
    """Rows of groups.tsv: wires [ohm] and initial SoC [1] as the laboratory believes."""
    return [
        {
            "group": group,
            "position": position,
            "cell": cell,
            "wire_resistance_ohm": wire,
            "initial_soc": soc,
        }
        for position, (cell, wire, soc) in enumerate(
            zip(names, wire_ohm, initial_soc, strict=True), 1
        )
    ]
