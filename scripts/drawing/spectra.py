"""How spectra are laid out over panels: by SoC where there are several temperatures."""

import matplotlib
import numpy as np

import figure

MOST_PANELS = 6
COLUMNS = 3


class Layout:
    """Panels and colours of a cell's spectra; `tests` are (columns, about).

    panels : SoC or temperature → (columns, about, facts of the sheet). left : how many more.
    """

    def __init__(self, tests):
        facts = [about["params"]["test"] for _, about in tests]
        celsius = {fact["ambient_temperature_celsius"] for fact in facts}
        self.by_soc = len(celsius) > 1
        self.key = "soc" if self.by_soc else "ambient_temperature_celsius"
        held = {}
        for test, fact in zip(tests, facts, strict=True):
            held.setdefault(fact[self.key], []).append((*test, fact))
        keys = self._chosen(held)
        self.panels = {key: held[key] for key in keys}
        self.left = len(held) - len(keys)

    @staticmethod
    def _chosen(held):
        """Panels that are drawn: all, or evenly spread ones among those with the most spectra."""
        keys = sorted(held, key=lambda key: (key is None, key or 0))
        if len(keys) > MOST_PANELS:
            most = max(map(len, held.values()))
            fullest = [key for key in keys if len(held[key]) == most]
            keys = fullest if len(fullest) >= MOST_PANELS else keys
        places = np.unique(np.linspace(0, len(keys) - 1, MOST_PANELS).round().astype(int))
        return [keys[k] for k in places]

    def title(self, value):
        """Of a panel."""
        return _soc(value) if self.by_soc else figure.temperature_label(value)

    def style(self, fact):
        """Colour and label of one spectrum in its panel."""
        celsius, soc = fact["ambient_temperature_celsius"], fact["soc"]
        if self.by_soc:
            return figure.temperature_colour(celsius), figure.temperature_label(celsius)
        return _soc_colour(soc), _soc(soc)

    def canvas(self, *, height=2.9):
        """Figure and its axes, one a panel; what is left over of the grid is hidden."""
        columns = min(len(self.panels), COLUMNS)
        rows = -(-len(self.panels) // columns)
        canvas, axes = figure.canvas(rows, columns, height=height * rows)
        if self.left:
            canvas.suptitle(f"{self.left} other states not drawn", fontsize=8, color=figure.QUIET)
        for spare in axes.ravel()[len(self.panels) :]:
            spare.axis("off")
        return canvas, axes.ravel()[: len(self.panels)]


def _soc(value):
    return "SoC not stated" if value is None else f"SoC {100 * value:.0f} %"


def _soc_colour(value):
    return figure.QUIET if value is None else matplotlib.colormaps["viridis"](0.9 * value)
