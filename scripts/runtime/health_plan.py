"""Which cells age, and by which methods their health is told: by the sheets alone."""

from runtime.plan import CAPACITY_KINDS, PULSE_KINDS, SIZE_KINDS, of_cell, owner

SLOW_CURVE_KINDS = ("ocv", "ica")
HALF_CELLS = ("chemistry", "negative_half_cell", "positive_half_cell")
LEAST_CHECK_UPS = 8  # of cells cycled between them without a record: of fewer no law is told
LEAST_CALIBRATING = 4  # capacities known beside charges for dQ/dV: of fewer no peak is calibrated


class HealthPlan:
    """The health of a campaign's cells.

    Parameters
    ----------
    plan : Plan
    fits : ModelPlan

    Attributes
    ----------
    followed : cells whose peaks of dQ/dV are followed: with several charges, or an ageing record
    aged_slowly : cells with slow curves of several check-ups
    degraded : those, and cells that a fresh one stands beside or whose rests tell of two check-ups
    peak_types : cells of one type that calibrate peaks of dQ/dV, by the first of them
    first_of_type : that first cell, of each of them
    cycled, checked_often : cells with an ageing record; without one, with many check-ups
    aged : both; checked : cells with a capacity or resistance that counts
    healthy : cells of which a state of health is told
    protocol_of : ageing protocol of each aged cell
    fleets, arms : cells by the words of their type, where several are checked; have a protocol
    """

    def __init__(self, plan, fits):
        self.plan, self.fits = plan, fits
        where = plan.cells_where
        self.followed = where(lambda c: len(plan.rows(c, "ica")) >= 2 or plan.rows(c, "ageing"))
        self.aged_slowly = where(lambda c: len(plan.cycles(c, *SLOW_CURVE_KINDS)) >= 2)
        self.degraded = where(
            lambda c: c in self.aged_slowly or self.fresh_cells(c) or self.aged_by_rests(c)
        )
        self.peak_types = self._peak_types()
        self.first_of_type = {c: first for first, cells in self.peak_types.items() for c in cells}
        self.cycled = where(lambda c: plan.rows(c, "ageing"))
        self.checked_often = where(self._has_many_check_ups, self.cycled)
        self.aged = self.cycled | self.checked_often
        self.checked = where(lambda c: plan.rows(c, *SIZE_KINDS, *PULSE_KINDS, roles=["fit"]))
        self.healthy = where(
            lambda c: (
                c in self.aged
                or plan.rows(c, *SIZE_KINDS, roles=["fit"])
                or (c in self.checked and plan.cells[c]["state_of_health"])
            )
        )
        self.protocol_of = {cell: plan.cells[cell]["ageing_protocol"] for cell in self.aged}
        self.fleets = fits.types_of(self.checked)
        self.arms = fits.types_of({c for c, protocol in self.protocol_of.items() if protocol})

    def fresh_cells(self, cell):
        """The marked cell of the type that stands for the fresh state of one with one check-up."""
        if len(self.plan.cycles(cell, *SLOW_CURVE_KINDS)) != 1:
            return []
        others = self.fits.references(cell)
        return [c for c in others if self.plan.cycles(c, *SLOW_CURVE_KINDS)][:1]

    def aged_by_rests(self, cell):
        """Whether pulse tests of several check-ups have rests that are an open-circuit voltage."""
        return len({row["cycle"] or 0 for row in self.fits.resting(cell)}) >= 2

    def _has_many_check_ups(self, cell):
        return len(self.plan.cycles(cell, *SIZE_KINDS)) >= LEAST_CHECK_UPS

    def _peak_types(self):
        """Cells of one type with charges for dQ/dV that can be calibrated, by the first of them."""
        alike = {}
        for cell, row in self.plan.cells.items():
            if self.plan.rows(cell, "ica", "ageing", roles=["fit"]):
                window = row["lower_cutoff_volt"], row["upper_cutoff_volt"]
                alike.setdefault((*self.fits.type_of(cell), *window), []).append(cell)
        return {cells[0]: cells for cells in alike.values() if self._calibrate(cells)}

    def _calibrate(self, cells):
        """Whether enough capacities of these cells are known beside charges for dQ/dV."""
        plan = self.plan
        known = [plan.cycles(cell, "ica") & plan.cycles(cell, *CAPACITY_KINDS) for cell in cells]
        cycled = any(plan.rows(cell, "ageing", roles=["fit"]) for cell in cells)
        return cycled or sum(map(len, known)) >= LEAST_CALIBRATING

    def half_cells_of(self, cell):
        """What the sheet says of a cell's half cells, and its chemistry."""
        return {name: self.plan.cells[cell].get(name) for name in HALF_CELLS}

    def rated_capacities(self, cell):
        """Capacities of check-ups: of charges for dQ/dV where no test is for the capacity."""
        of_kinds = self.plan.fitted("capacity", cell, *CAPACITY_KINDS)
        return of_kinds or self.plan.fitted("capacity", cell, "ica")

    # Functions of a job.

    def followed_of_type(self, wildcards):
        """Those cells of a job's type whose peaks are followed: their tracks."""
        cells = [cell for cell in self.peak_types[owner(wildcards)] if cell in self.followed]
        return [f"results/stages/ica_tracks/{cell}.parquet" for cell in cells]

    def calibration_of(self, wildcards):
        """The calibration of the type of a job's cell."""
        return f"results/stages/peak_calibration/{self.first_of_type[owner(wildcards)]}.parquet"

    def inputs_of_health(self, wildcards):
        """What the state of health of a cell is gathered from."""
        cell = owner(wildcards)
        stages = {
            "life": ("life", self.aged),
            "course": ("fade_course", self.aged),
            "check_ups": ("checkups", self.checked),
            "modes": ("degradation_modes", self.degraded),
            "peaks": ("health_from_peaks", self.first_of_type),
        }
        return of_cell(cell, **{name: st for name, (st, cells) in stages.items() if cell in cells})
