"""What is true about a test of the demo: charges, pulse resistances, temperatures."""

import numpy as np

DELAYS_SECOND = (0.1, 1.0, 10.0)
PULSE_SECOND = 10.0


def facts(steps: list, behaviours: list, *, capacity_ampere_hour: float) -> dict:
    """Noise-free facts of one test that began with a full cell.

    Parameters
    ----------
    steps, behaviours : what was asked (`protocols.Step`) and what happened (`behaviour.Behaviour`).
    capacity_ampere_hour : charge of the full cell [Ah], to which SoC refers.

    Returns
    -------
    steps (number, charge, duration, end voltage, highest temperature) and pulses (SoC at the start,
    direction, resistance at each delay).
    """
    table = [_step_facts(behaviour) for behaviour in behaviours]
    charge = np.cumsum([0.0, *[row["charge_ampere_hour"] for row in table]])
    soc = 1 + charge / capacity_ampere_hour
    pulses = [
        {"step": k + 1, "soc": _round(soc[k]), **_pulse(behaviours[k - 1], behaviours[k], step)}
        for k, step in enumerate(steps)
        if step.duration_second == PULSE_SECOND and step.value != 0.0
    ]
    return {"steps": table, **({"pulses": pulses} if pulses else {})}


def pair_facts(behaviours: list) -> dict:
    """Noise-free charges, currents and laws' residuals of two cells in parallel, step by step."""
    return {"steps": [_pair_step_facts(behaviour) for behaviour in behaviours]}


def _pair_step_facts(behaviour) -> dict:
    second = np.linspace(0.0, behaviour.duration_second, 4 * int(behaviour.duration_second) + 1)
    shares = np.array([branch(second) for branch in behaviour.branches])
    charge = np.sum(0.5 * (shares[:, 1:] + shares[:, :-1]) * np.diff(second), axis=1) / 3600
    return {
        **_step_facts(behaviour),
        "branch_charge_ampere_hour": [_round(c) for c in charge],
        "branch_current_max_ampere": [_round(c) for c in np.abs(shares).max(axis=1)],
        "kcl_residual_ampere": float(
            f"{np.abs(shares.sum(axis=0) - behaviour.current(second)).max():.1e}"
        ),
    }


def _step_facts(behaviour) -> dict:
    second = np.linspace(0.0, behaviour.duration_second, max(2, int(behaviour.duration_second)) + 1)
    current = behaviour.current(second)
    charge = np.sum(0.5 * (current[1:] + current[:-1]) * np.diff(second)) / 3600
    return {
        "charge_ampere_hour": _round(charge),
        "duration_second": _round(behaviour.duration_second),
        "voltage_end_volt": _round(behaviour.voltage(second[-1])),
        "temperature_max_celsius": _round(behaviour.temperature(second).max(), digits=2),
    }


def _pulse(before, pulse, step) -> dict:
    start = before.voltage(before.duration_second)
    reached = [delay for delay in DELAYS_SECOND if delay < pulse.duration_second + 0.001]
    return {
        "direction": "charge" if step.value > 0 else "discharge",
        "resistance_ohm": {
            str(delay): _round(
                (pulse.voltage(min(delay, pulse.duration_second)) - start) / step.value, digits=6
            )
            for delay in reached
        },
    }


def _round(value, *, digits: int = 5) -> float:
    return round(float(value), digits)
