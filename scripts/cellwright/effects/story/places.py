"""Where a model errs, in words, and where an addition has made it worse."""

import numpy as np

from cellwright.effects.story.messages import say

WORSE_VOLT = 2e-3  # of error more than before, in a field of the residual map
WORSE_SHARE = 0.1  # of the error before
NEAR_EMPTY, NEAR_FULL = 0.15, 0.85


def millivolt(volt):
    """A voltage in words."""
    milli = 1e3 * volt
    return f"{milli:.1f} mV" if abs(milli) < 99.5 else f"{milli:.0f} mV"


def worsened(residual_map):
    """Fields of the residual map in which a model with its effects errs more than without.

    A field is a record, a band of SoC and a class of rate; neighbouring bands are one.

    Parameters
    ----------
    residual_map : dict of lists, as `judge.residual_map` makes it; {} where there is none.

    Returns
    -------
    fields : list of dict: role, file, soc [low, high], current, rows, volt (by which the error is
        larger, RMS) [V]; the worst first.
    """
    names = ("role", "test", "rate", "soc_low", "soc_high", "rows")
    if not residual_map:
        return []
    before, after = (np.array(residual_map[f"{one}_rms_volt"]) for one in ("before", "after"))
    more = after - before
    worse = np.flatnonzero((more > WORSE_VOLT) & (more > WORSE_SHARE * before))
    fields = []
    columns = list(zip(*(residual_map[name] for name in names), strict=True))
    for k in sorted(worse, key=lambda k: columns[k][:4]):
        role, test, rate, low, high, rows = columns[k]
        last = fields[-1] if fields else {"soc": [None, None]}
        same = [last.get(name) for name in ("role", "file", "current")] == [role, test, rate]
        if same and abs(last["soc"][1] - low) < 1e-6:
            total = last["rows"] + rows
            mean = (last["rows"] * last["volt"] ** 2 + rows * more[k] ** 2) / total
            last |= {"soc": [last["soc"][0], high], "rows": total, "volt": float(np.sqrt(mean))}
            continue
        one = {"role": role, "file": test, "soc": [float(low), float(high)], "current": rate}
        fields.append(one | {"rows": int(rows), "volt": float(more[k])})
    return sorted(fields, key=lambda one: -one["rows"] * one["volt"] ** 2)


def largest_before(residual_map):
    """A sentence on the field with the largest part of the error before, and what it is now.

    Parameters
    ----------
    residual_map : dict of columns, as of `worsened`; {} where there is none.

    Returns
    -------
    sentence : str; None without a field.
    """
    if not len(residual_map.get("rows", ())):
        return None
    before, after, rows = (
        np.asarray(residual_map[name], float)
        for name in ("before_rms_volt", "after_rms_volt", "rows")
    )
    squares = rows * before**2
    k = int(np.argmax(squares))
    soc = [float(residual_map[name][k]) for name in ("soc_low", "soc_high")]
    place = {"soc": soc, "current": residual_map["rate"][k], "file": residual_map["test"][k]}
    return say(
        "gap.largest",
        share=100 * squares[k] / squares.sum(),
        where=where(place),
        before=millivolt(before[k]),
        after=millivolt(after[k]),
    )


def where(place):
    """A field of the map, or a `located_at` of a verdict, in words.

    Parameters
    ----------
    place : dict: soc, current, file, and temperature_celsius or branch where known.
    """
    parts = [_soc(place), say(f"where.{place['current']}")]
    parts += [say("where.branch", branch=place["branch"])] if place.get("branch") else []
    parts.append(say("where.test", test=place["file"]))
    celsius = place.get("temperature_celsius")
    return " ".join([*parts, *([say("where.celsius", celsius=celsius[0])] if celsius else [])])


def near(place):
    """The same in two or three words: near empty, near full, or the range of SoC."""
    middle = sum(place["soc"]) / 2
    if middle < NEAR_EMPTY:
        return say("where.near_empty")
    return say("where.near_full") if middle > NEAR_FULL else _soc(place)


def _soc(place):
    low, high = place["soc"]
    return say("where.soc", low=100 * low, high=100 * high)
