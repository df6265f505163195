"""Cells and parallel groups that can be tested, by physics or by the fast generator.

A specimen that is cycled has `run(steps, *, chamber, initial_soc)`, which gives one behaviour per
step, and `full_ampere_hour`, the charge of the full cell to which SoC refers. One that is measured
with an impedance analyser has `spectrum(frequency_hertz, *, celsius, soc)`. `facts(name)` gives
rows of truth tables about the specimen itself.
"""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np

from virtual_lab import fast
from virtual_lab.behaviour import Behaviour
from virtual_lab.chamber import Chamber

CURVE_SOC = np.linspace(0.0, 1.0, 101)
MODEL_SOC = np.round(np.arange(0.1, 0.95, 0.1), 2)
AFTER_SECOND = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0)  # a step of the current


class Behavioural(NamedTuple):
    """A cell of the fast generator, built when it is first needed (plans have thousands).

    `known` gives rows of truth tables about it.
    """

    make: Callable[[], fast.Cell]
    temperatures_celsius: tuple[float, ...] = (25.0,)
    known: Callable[[], dict[str, list[dict]]] | None = None

    @property
    def cell(self) -> fast.Cell:
        """The cell's parameters."""
        return _built(self.make)

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] between the ends of its open-circuit voltage, at 25 °C."""
        return self.cell.capacity_ampere_hour

    @property
    def capacity_per_kelvin(self) -> float:
        """Relative growth of that charge with temperature [1/K]."""
        return self.cell.capacity_per_kelvin

    def run(self, steps, *, chamber: Chamber, initial_soc: float = 1.0):
        """Take the cell through a protocol; see `fast.run`."""
        return fast.run(steps, self.cell, chamber=chamber, initial_soc=initial_soc)

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm], linearised at rest."""
        return fast.impedance(self.cell, frequency_hertz, soc=soc, celsius=celsius)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`: the ohmic resistance."""
        ohmic = fast.resistances(self.cell, np.array([soc]), celsius=celsius)["r0"][0]
        return {"r_ohmic_ohm": round(float(ohmic), 7)}

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Truth: open-circuit voltage and resistances over SoC at the temperatures of its tests."""
        temperatures, more = self.temperatures_celsius, self.known() if self.known else {}
        curves = [
            curve_rows(name, t, fast.rested_volt(self.cell, CURVE_SOC, celsius=t))
            for t in temperatures
        ]
        return {
            "ocv": [row for curve in curves for row in curve],
            "models": [row for t in temperatures for row in self._resistance_rows(name, t)],
            **{table: [{"cell": name, **row} for row in rows] for table, rows in more.items()},
        }

    def _resistance_rows(self, name, celsius):
        resistances = fast.resistances(
            self.cell, MODEL_SOC, celsius=celsius, after_second=AFTER_SECOND
        )
        return [
            {
                "cell": name,
                "ambient_temperature_celsius": celsius,
                "soc": float(soc),
                "parameter": parameter,
                "value": float(f"{value:.6g}"),
            }
            for parameter, values in resistances.items()
            for soc, value in zip(MODEL_SOC, values, strict=True)
        ]


class Physical(NamedTuple):
    """A porous-electrode cell, solved by PyBaMM."""

    cell: object

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the cell after a full CCCV charge."""
        from virtual_lab.physics import porous

        return porous.full_charge_ampere_hour(self.cell)

    def run(self, steps, *, chamber: Chamber, initial_soc: float = 1.0):
        """Take the cell through a protocol; see `physics.simulate.run`."""
        from virtual_lab.physics import simulate

        return simulate.run(steps, self.cell, chamber=chamber, initial_soc=initial_soc)

    def spectrum(self, frequency_hertz, *, celsius: float, soc: float):
        """Impedance [ohm] of the model, linearised at rest."""
        from virtual_lab.physics import simulate

        setting = {"ambient_celsius": celsius, "soc": soc}
        return simulate.spectrum(self.cell, frequency_hertz, **setting)

    def circuit(self, *, celsius: float, soc: float) -> dict:
        """Row of the truth table `eis`: the ohmic resistance, which physics and circuits share."""
        from virtual_lab.physics.simulate import OHMIC_FREQUENCY_HERTZ

        end = self.spectrum(np.array([OHMIC_FREQUENCY_HERTZ]), celsius=celsius, soc=soc)[0]
        return {"r_ohmic_ohm": round(float(end.real), 7)}

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Truth: open-circuit voltage at 25 °C, and the losses of the cell."""
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
    """Cells of the fast generator in parallel, each in series with its wire."""

    names: tuple[str, ...]
    members: tuple[Behavioural, ...]
    wire_ohm: tuple[float, ...]
    initial_soc: tuple[float, ...]

    @property
    def cells(self) -> tuple[fast.Cell, ...]:
        """Parameters of each cell."""
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
        """Take the group through a protocol of its current; each cell begins at its own SoC."""
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


class SeriesString(NamedTuple):
    """Cells of the fast generator in series, each in its own place of the chamber.

    A step with a voltage at which it ends is ended by the first cell that meets it: the voltage is
    one cell's. `sensors` are the positions (1, 2, …) of the cells whose temperature is logged.
    """

    names: tuple[str, ...]
    members: tuple[Behavioural, ...]
    chambers: tuple[Chamber, ...]
    initial_soc: tuple[float, ...]
    sensors: tuple[int, ...] = ()

    @property
    def capacities_ampere_hour(self) -> list[float]:
        """Charge [Ah] of each full cell."""
        return [member.full_ampere_hour for member in self.members]

    @property
    def full_ampere_hour(self) -> float:
        """Charge [Ah] of the smallest cell."""
        return min(self.capacities_ampere_hour)

    def run_cells(self, steps, *, initial_soc=None) -> list[list[Behaviour]]:
        """Behaviours of each cell under the one current of the string."""
        fixed = []
        for step in steps:
            if step.until_volt is not None:
                last = [one[-1] for one in self._each([*fixed, step], initial_soc)]
                first = min(behaviour.duration_second for behaviour in last)
                step = step._replace(duration_second=round(first, 3), until_volt=None)
            fixed.append(step)
        return self._each(fixed, initial_soc)

    def _each(self, steps, initial_soc):
        places = zip(self.members, self.chambers, initial_soc or self.initial_soc, strict=True)
        return [one.run(steps, chamber=around, initial_soc=soc) for one, around, soc in places]

    def run(self, steps, *, chamber: Chamber, initial_soc=None):
        """Take the string through a protocol of its current, without held voltages."""
        cells = self.run_cells(steps, initial_soc=initial_soc)
        return [self._together(of_step) for of_step in zip(*cells, strict=True)]

    def _together(self, of_step):
        volts = tuple(behaviour.voltage for behaviour in of_step)
        return of_step[0]._replace(
            voltage=partial(_sum_of, functions=volts),
            cell_voltages=volts,
            cell_temperatures={k: of_step[k - 1].temperature for k in self.sensors},
            cell_soc=tuple(behaviour.soc for behaviour in of_step),
        )

    def facts(self, name: str) -> dict[str, list[dict]]:
        """Rows of groups.tsv."""
        none = (None,) * len(self.names)
        rows = branch_rows(name, self.names, none, self.initial_soc)
        return {"groups": [row | {"connection": "series"} for row in rows]}


def _sum_of(second, functions):
    return np.sum([function(second) for function in functions], axis=0)


@lru_cache(maxsize=256)
def _built(make):
    return make()


class PhysicalPair(NamedTuple):
    """Two porous-electrode cells in parallel, each rested at one voltage [V] before."""

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
        """SoC [1] of each cell, rounded as in the sheet."""
        from virtual_lab.physics import porous

        return tuple(round(porous.soc_at(cell, self.rested_volt), 4) for cell in self.cells)

    def run(self, steps, *, chamber: Chamber, initial_soc=None):
        """Take the pair through a protocol of its total current at one temperature."""
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
    """Rows of the truth table of open-circuit voltage [V] over CURVE_SOC."""
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
    """Rows of groups.tsv: wires [ohm] and initial SoC [1], as the laboratory assumes them."""
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
