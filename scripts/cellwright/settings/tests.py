"""Settings of what is read from the tests of a cell, and of the laws over them.

Made by scripts/tools/settings_module.py from workflow/schemas/config.schema.yaml.
Do not edit.
"""

from typing import NamedTuple


class Files(NamedTuple):
    """Which files are read.

    largest_megabyte [MB] : A raw file that is longer, or unpacks to more, is refused. Large
        texts are read in blocks, of which a job keeps the numbers; 8000 MB are four years at one
        row a second and 60 bytes a row.
    longest_reading_minute [min] : CPU time within which the files of a test must be read and
        cleaned; a test that takes longer is left out with that reason. 5 GB of text take one to
        two minutes.
    """

    largest_megabyte: float = 8000.0
    longest_reading_minute: float = 120.0


class Clean(NamedTuple):
    """What counts as a corrupt sample.

    spike_limit_volt [V] : A sample whose voltage lies further than this from both neighbours, on
        the same side, may be a spike.
    gap_second [s] : An interval between two samples may be a gap if it is longer than this.
    """

    spike_limit_volt: float = 0.01
    gap_second: float = 120.0


class Segment(NamedTuple):
    """How steps are found.

    rest_c_rate [1/h] : Currents below this rate count as rest.
    pulse_max_second [s] : A constant-current step that is not longer than this is a pulse.
    """

    rest_c_rate: float = 0.004
    pulse_max_second: float = 120.0


class Ocv(NamedTuple):
    """Open-circuit voltage from slow tests, else from rests.

    least_hour [h] : A charge or discharge is slow enough to stand for the open-circuit voltage
        if it takes longer than this.
    """

    least_hour: float = 12.0


class Instrument(NamedTuple):
    """What no record tells of the instrument that made it.

    current_accuracy_share [1] : Largest error of the current as a share of its range, as the
        maker states it (testers 0.0002 to 0.001). The range is taken to be the largest current
        of a record.
    clock_error_share [1] : Largest error of the clock as a share of the time that passed (quartz
        of testers and data loggers 0.00002 to 0.0001).
    """

    current_accuracy_share: float = 0.0005
    clock_error_share: float = 0.0001


class Resistance(NamedTuple):
    """Pulse resistance.

    delay_second [s] : Times after the edge of a pulse at which its resistance is read; 0 is the
        first sample of the pulse.
    """

    delay_second: tuple[float, ...] = (0.0, 1.0, 10.0, 30.0)


class Temperature(NamedTuple):
    """Which pulse resistances are followed over temperature.

    soc [1] : States of charge at which pulse resistances are compared; interpolated between
        pulses.
    delay_second [s] : Delays into the pulse that are followed; each must be one of
        resistance.delay_second.
    """

    soc: tuple[float, ...] = (0.2, 0.5, 0.8)
    delay_second: tuple[float, ...] = (0.0, 10.0)


class FastCharge(NamedTuple):
    """Fast charge.

    minutes [min] : Time after which the charge put in is read (thesis 30 min).
    """

    minutes: float = 30.0


class Health(NamedTuple):
    """Fade of a life, its knee, and the cycles that remain.

    end_of_life [1] : Share of the capacity at the start of the life at which it ends.
    """

    end_of_life: float = 0.8


class Impedance(NamedTuple):
    """Impedance spectra.

    circuit : First circuit that is fitted, the one that `constraints` and `choose: circuit`
        mean: `-` in series, `|` in parallel; R, C, L, CPE, W (semi-infinite Warburg), FLW and
        FSW (finite-length and finite-space Warburg), G (Gerischer). `L-` is put in front where a
        spectrum shows inductance. Source: thesis sec. 3.2.
    candidates : Circuits that are compared with it. What a spectrum does not tell of one is
        taken out.
    choose : `bic` and `cross_validation` take the circuit that does best on all spectra of a
        cell together, by the Bayesian information criterion, or on points left out of its fit;
        `circuit` keeps the one above.
    constraints : Parameters of `circuit` that are not free: `cpe_p = 0.8` fixes one, `r3_ohm = 2
        * r2_ohm` ties one to another.
    inductance : What becomes of inductive points (positive imaginary part); `model` adds an
        inductance to the circuit, `cut` leaves them out of the fit.
    """

    circuit: str = "R-(CPE|(R-W))"
    candidates: tuple[str, ...] = (
        "R-(CPE|(R-W))",
        "R-(CPE|(R-FSW))",
        "R-(CPE|R)-(CPE|(R-W))",
        "R-(CPE|R)-(CPE|R)-W",
        "R-(CPE|R)-(CPE|R)-CPE",
        "R-(CPE|R)-(CPE|R)-(CPE|(R-W))",
    )
    choose: str = "bic"
    constraints: tuple[str, ...] = ()
    inductance: str = "model"
