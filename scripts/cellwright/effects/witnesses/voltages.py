"""What rests and slow tests tell: slow diffusion, polarisation, hysteresis, the OCV itself."""

import numpy as np

from cellwright.effects.base import LOGARITHMS
from cellwright.effects.library.quantities import EARLIER_SECOND, QUANTITIES
from cellwright.effects.witnesses.resistances import SOC_ENDS, SOC_SPAN
from cellwright.effects.witnesses.statement import (
    LEAST_VOLT,
    Measured,
    celsius_of,
    cycle_of,
    is_material,
    silent,
    spread,
)
from cellwright.protocols.ocv.gap import shows_hysteresis, slow_gap
from cellwright.records.conditions import REFERENCE_CELSIUS, SAME_CELSIUS, same_temperature

LONG_SECOND = 1800.0  # of a rest that shows what relaxes later than ten minutes
MIDDLE = (0.2, 0.8)  # of SoC
INSIDE = "temperature_celsius"  # of a rest
USUAL_KELVIN = 20.0  # over which a laboratory tests


def of_rests(rows, values, *, capacity_ampere_hour):
    """What relaxations after loads tell.

    Parameters
    ----------
    rows : list of dict, of the relaxations of one cell. values : dict of the model's parameters.
    capacity_ampere_hour : of the cell [Ah].

    Returns
    -------
    measured : list of Measured: slow diffusion, and polarisation over SoC.
    """
    kept = [row for row in rows if row.get("chosen") in (True, "True") and _follows_a_load(row)]
    near = min((abs(celsius_of(row, INSIDE) - REFERENCE_CELSIUS) for row in kept), default=0.0)
    kept = [
        r for r in kept if abs(celsius_of(r, INSIDE) - REFERENCE_CELSIUS) <= near + SAME_CELSIUS
    ]
    return [_slow_resistance(kept, values), _relaxing_over_soc(kept, capacity_ampere_hour)]


def _follows_a_load(row):
    current = row.get("current_before_ampere")
    return current is not None and abs(current) > 0 and row.get("load_second", 0) > 0


def _slow_resistance(rows, values):
    """Voltage that relaxes later than ten minutes after a load, per ampere of the load."""
    quantity = "slow_resistance"
    long = [row for row in rows if row["rest_second"] >= LONG_SECOND and row["load"] == "CC"]
    if not long:
        return silent("relaxations", quantity, "no rest of half an hour after a steady load")
    late = np.array([_late_ohm(row) for row in long])
    row = long[int(np.argmin(np.abs(late - np.median(late))))]
    at = float(min(row["load_second"], 2e4)), float(row["rest_second"])
    own = values if all(name in values for name in LOGARITHMS) else None
    alone = 0.0 if own is None else QUANTITIES[quantity](None, {}, values, at)
    words = f"what relaxes between 10 and {at[1] / 60:.0f} min of a rest, per ampere of its load"
    measured = float(np.median(late))
    return Measured(
        *("relaxations", quantity, words, at),
        *(measured, spread(late), "Ohm", alone),
        material=bool((measured - alone) * abs(row["current_before_ampere"]) > LEAST_VOLT),
    )


def _late_ohm(row):
    pairs = [(row["a_volt"], row["tau1_second"]), (row["b_volt"], row["tau2_second"])]
    pairs = [pair for pair in pairs if np.isfinite(pair).all()]
    ends = np.array([EARLIER_SECOND, row["rest_second"]])
    volt = sum(a * np.subtract(*np.exp(-ends / tau)) for a, tau in pairs)
    return float(volt / row["current_before_ampere"])


def _relaxing_over_soc(rows, ampere):
    """Resistance of what relaxes, at the lower over that at the upper end of SoC."""
    quantity = "relaxing_over_soc"
    known = [r for r in rows if np.isfinite([r["soc"], r["r1_ohm"]]).all() and r["r1_ohm"] > 0]
    pairs = [(r["soc"], r["r1_ohm"] + np.nan_to_num(r["r2_ohm"])) for r in known]
    soc, ohm = np.array(sorted(pairs)).reshape(-1, 2).T
    low, high = (max(SOC_ENDS[0], soc[0]), min(SOC_ENDS[1], soc[-1])) if len(soc) else (0, 0)
    if len(soc) < 3 or high - low < SOC_SPAN:
        return silent("relaxations", quantity, "rests at fewer than three SoC over half the range")
    at_low, at_high = np.interp([low, high], soc, ohm)
    words = f"resistance that relaxes at {100 * low:.0f} % over that at {100 * high:.0f} % SoC"
    return Measured(
        *("relaxations", quantity, words, (float(low), float(high))),
        *(float(at_low / at_high), np.nan, "1", 1.0),
        material=is_material(at_low / at_high, ampere * (at_low - at_high)),
    )


def of_slow_test(basis, values):
    """Half the gap of the branches of the slow test nearest 25 °C, less the drop of its current.

    Parameters
    ----------
    basis : dict, with `ocv` and `borrowed_from`. values : dict of the model's parameters.

    Returns
    -------
    measured : list of Measured, one.
    """
    quantity = "half_gap"
    if basis.get("borrowed_from") is not None:
        return [silent("slow test", quantity, f"its OCV is that of {basis['borrowed_from']}")]
    known = [(abs(celsius_of(c) - REFERENCE_CELSIUS), slow_gap(c)) for c in basis.get("ocv", ())]
    known = [pair for pair in known if np.isfinite(pair[1].half_gap_volt)]
    if not known or not all(name in values for name in LOGARITHMS):
        return [silent("slow test", quantity, "no slow test with both directions")]
    gap = min(known, key=lambda pair: pair[0])[1]
    ohm = sum(float(np.exp(values[name])) for name in ("log_r0", "log_r1", "log_r2"))
    drop, over = gap.drop_volt(ohm), f"the model's {1e3 * ohm:.3g} mΩ"
    if drop == gap.step_volt:
        over = f"{1e3 * drop / gap.current_ampere:.3g} mΩ that it shows at once, leads and contacts"
    words = (
        f"half the gap of the slow branches, {1e3 * gap.half_gap_volt:.1f} mV, less the drop of "
        f"{gap.current_ampere:.3g} A over {over}"
    )
    return [
        Measured(
            *("slow test", quantity, words, ()),
            *(float(gap.half_gap_volt - drop), np.nan, "V", 0.0),
            material=shows_hysteresis(gap, ohm),
        )
    ]


def of_entropy(rows):
    """Slope of the OCV over temperature between 20 and 80 % SoC.

    Parameters
    ----------
    rows : list of dict, of the entropic coefficients of one cell.

    Returns
    -------
    measured : list of Measured, one.
    """
    quantity = "ocv_per_kelvin"
    used = [r for r in rows if r["used"] in (True, "True") and MIDDLE[0] <= r["soc"] <= MIDDLE[1]]
    if not used:
        return [silent("entropic coefficient", quantity, "no OCV at three temperatures")]
    slopes, stds = (
        1e-3 * np.array([row[name] for row in used], float)
        for name in ("entropic_millivolt_per_kelvin", "std_millivolt_per_kelvin")
    )
    at = float(min(r["soc"] for r in used)), float(max(r["soc"] for r in used))
    mean, std = float(slopes.mean()), float(np.median(stds))
    words = f"slope of the OCV over temperature, {100 * at[0]:.0f} to {100 * at[1]:.0f} % SoC"
    return [
        Measured(
            *("entropic coefficient", quantity, words, at),
            *(mean, std, "V/K", 0.0),
            material=abs(mean) * USUAL_KELVIN > LEAST_VOLT,
        )
    ]


def of_moved_ocv(basis):
    """Change of the OCV from the first to the last slow test, at one temperature.

    Parameters
    ----------
    basis : dict, with `ocv`: curves with cycle, soc, ocv_volt.

    Returns
    -------
    measured : list of Measured, one.
    """
    quantity, curves = "ocv_change", sorted(basis.get("ocv", ()), key=cycle_of)
    alike = [c for c in curves if same_temperature(celsius_of(c), celsius_of(curves[0]))]
    if len({cycle_of(c) for c in alike}) < 2:
        return [silent("check-ups", quantity, "no slow tests of two check-ups")]
    soc = np.linspace(*SOC_ENDS, 41)
    before, after = (np.interp(soc, c["soc"], c["ocv_volt"]) for c in (alike[0], alike[-1]))
    moved = float(np.sqrt(np.mean((after - before) ** 2)))
    return [
        Measured(
            *("check-ups", quantity, "RMS change of the OCV between slow tests"),
            *(SOC_ENDS, moved, np.nan, "V", 0.0),
            material=moved > LEAST_VOLT,
        )
    ]
