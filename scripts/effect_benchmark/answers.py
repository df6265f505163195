"""What is said of one cell, as the contract's verdict: by the search, and by other rankings."""

from cellwright.effects.verdict import gap_closed, outcome, verdict_of


def verdict(cell: str, rounds, gates) -> dict:
    """The verdict of a search, without the maps and plots of the pipeline.

    Parameters
    ----------
    cell : its name. rounds : list of search.Round. gates : case.Gates.
    """
    return verdict_of(cell, outcome(rounds, gates), rounds, None)


def plain_names(names) -> dict:
    """A verdict that only names, or says that nothing is missing: of the controls."""
    said = "named" if names else "none"
    return {"verdict": said, "effects": [{"effect": name} for name in names]}


def bic_alone(one, gates) -> dict:
    """What the criterion on the records fitted would say of the first round, with its own gate."""
    best = max(one.trials, key=lambda t: t.delta_bic, default=None)
    return plain_names([best.effect.id] if best and best.delta_bic > gates.bic else [])


def validation_alone(one, gates) -> dict:
    """What the smallest error on validation data would say of the first round, with its gate."""
    best = min(one.trials, key=lambda t: t.state.validation_rmse_volt, default=None)
    most = (1.0 - gates.validation_fall) * one.before.validation_rmse_volt
    falls = best is not None and best.state.validation_rmse_volt <= most
    return plain_names([best.effect.id] if falls else [])


def closed(before, after, floor_volt: float) -> float:
    """Share of the gap on validation data that is closed between two States; NaN without a gap."""
    share = gap_closed(before.validation_rmse_volt, after.validation_rmse_volt, floor_volt)
    return float("nan") if share is None else share
