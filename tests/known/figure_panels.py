"""What tests read off a figure: its panels, and their titles, labels and lines."""

import io

import numpy as np

SOC = np.linspace(0, 1, 11)
TIME = np.arange(0.0, 7200.0, 60.0)
WITHOUT_UNIT = ("all tests", "10 s into a pulse, SoC 44–56 %", "validation tests, chosen model")
WITHOUT_UNIT += ("cycle", "R", "capacity at 1C")


def about(test="t", celsius=25.0, **facts):
    """What an artefact of a test says of itself, as far as figures read it."""
    facts = {"ambient_temperature_celsius": celsius, "cycle": None, "soc": None} | facts
    return {"wildcards": {"cell": "A", "test": test}, "params": {"test": facts}}


def rendered(figure):
    """Panels of a figure that can be written as SVG."""
    figure.savefig(io.BytesIO(), format="svg")
    return figure.get_axes()


def panels(figure):
    """The same where each axis that has a label must say its unit."""
    for panel in figure.get_axes():
        for label in (panel.get_xlabel(), panel.get_ylabel()):
            assert not label or "[" in label or label in WITHOUT_UNIT, label
    return rendered(figure)


def drawn(axes):
    """Data of the lines of a panel that hold any."""
    lines = [line.get_xydata() for line in axes.get_lines()]
    return [data for data in lines if len(data)]


def labels(axes):
    """Labels of a panel's legend."""
    return [text.get_text() for text in axes.get_legend().get_texts()]


def title(axes):
    """Title of a panel."""
    return axes.get_title(loc="left")


def columns(rows):
    """Columns of rows."""
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def law(quantity, name, *values, chosen=False, valid=(-np.inf, np.inf)):
    """Rows of a law over temperature: one a parameter."""
    limits = {"valid_from_celsius": valid[0], "valid_to_celsius": valid[1]}
    return [
        {"quantity": quantity, "law": name, "value": value, "chosen": chosen} | limits
        for value in values
    ]
