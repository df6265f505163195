"""Tables of many makers: small samples in their layout, and everybody's files where they lie."""

import numpy as np
import pandas as pd
import pytest

import cellwright as cw
from cellwright import formats
from cellwright.refusal import Refusal


def read(text, *, name="file", instrument=None):
    data = text if isinstance(text, bytes) else text.encode()
    return formats.read(data, name=name, instrument=instrument)


MACCOR = """Today's Date 01/02/2024\tDate of Test:\t01/01/2024
Rec#\tCyc#\tStep\t{clock}\tStepTime\tAmp-hr\tWatt-hr\tAmps\tVolts\tState\tES\tDPt Time
1\t0\t1\t{t0}\t0\t0\t0\t0.0\t3.5\tR\t0\t01/13/2024 10:00:00
2\t0\t2\t{t1}\t0\t0.5\t0\t1.0\t3.6\tC\t0\t01/13/2024 10:30:00
3\t0\t2\t{t2}\t0\t1.0\t0\t1.0\t3.7\tC\t0\t01/13/2024 11:00:00
4\t0\t3\t{t3}\t0\t0.25\t0\t0.5\t3.4\tD\t0\t01/13/2024 11:30:00
"""
CLOCKS = {  # as written, and the seconds that they mean
    "days": ("TestTime", ("0d 00:00:0", "0d 00:30:0.5", "0d 01:00:0", "1d 01:30:0"), 91800.0),
    "seconds": ("Test (Sec)", ("0", "1800.5", "3600", "5400"), 5400.0),
    "minutes": ("Test (Min)", ("0", "30.1", "60", "90"), 5400.0),
    "by the dates": ("TestTime", ("0", "30", "60", "90"), 5400.0),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_maccor_by_letters_and_clock(clock):
    label, times, last = CLOCKS[clock]
    columns = read(
        MACCOR.format(clock=label, **dict(zip(("t0", "t1", "t2", "t3"), times, strict=True)))
    ).columns
    assert columns["test_time_second"][-1] == last
    np.testing.assert_array_equal(columns["current_ampere"], [0, 1, 1, -0.5])
    np.testing.assert_allclose(columns["net_capacity_ampere_hour"], [0, 0.5, 1.0, 0.75])


def test_the_clock_tells_days_from_months():
    """3, 4, 5 and 6 November as day/month, which month/day reads as four months."""
    day = 86400
    text = MACCOR.format(clock="Test (Sec)", t0=0, t1=day, t2=2 * day, t3=3 * day)
    for k, hour in enumerate(("10:00", "10:30", "11:00", "11:30")):
        text = text.replace(f"01/13/2024 {hour}:00", f"{3 + k:02d}/11/2024 {hour}:00")
    unix = read(text).columns["unix_time_second"]
    np.testing.assert_array_equal(np.diff(unix), 3 * [day + 1800])


def test_a_current_under_an_unknown_letter_is_refused():
    text = MACCOR.format(clock="Test (Sec)", t0=0, t1=1800, t2=3600, t3=5400)
    with pytest.raises(Refusal, match=r"row 4 of data: a current of 0.5 A in a step of state 'X'"):
        read(text.replace("\tD\t", "\tX\t"))


def test_a_clock_whose_unit_nothing_tells_is_refused():
    text = MACCOR.format(clock="TestTime", t0=0, t1=7, t2=14, t3=21)
    with pytest.raises(Refusal, match="'TestTime' of a Maccor text file does not say its unit"):
        read(text)


def test_a_last_row_that_is_cut_off_is_left_out_and_told():
    text = MACCOR.format(clock="Test (Sec)", t0=0, t1=1800, t2=3600, t3=5400)
    reading = read(text[:-40])
    assert len(reading.columns["voltage_volt"]) == 3
    assert reading.notes == (
        "the last row is cut off (5 of 12 fields) and was left out",
        "columns that are not read: Rec#, StepTime, ES",
    )


BIOLOGIC = "time/s\tEcell/V\tI/mA\t(Q-Qo)/mA.h\tTemperature/°C\t\n" + "".join(
    f"{t:.1f}\t{3.5 + t / 1000:.4f}\t{-250.0:.1f}\t{-250 * t / 3600:.6f}\t24.5\n" for t in range(5)
)


@pytest.mark.parametrize("written", ["plain", "decimal commas", "UTF-16"])
def test_biologic_text(written):
    text = "EC-Lab ASCII FILE\nNb header lines : 3\n" + BIOLOGIC
    text = text.replace(".", ",") if written == "decimal commas" else text
    text = text.replace("mA,h", "mA.h")
    data = text.encode("utf-16") if written == "UTF-16" else text.encode("cp1252")
    reading = read(data)
    assert reading.instrument == "biologic"
    assert reading.columns["current_ampere"][0] == -0.25
    assert reading.columns["voltage_volt"][-1] == pytest.approx(3.504, abs=1e-12)
    assert reading.columns["net_capacity_ampere_hour"][-1] == pytest.approx(
        -0.25 * 4 / 3600, abs=1e-9
    )


NEWARE_REPORT = """Cycle Index,Chg. Cap.(Ah),DChg. Cap.(Ah)
,Step Index,Step Number,Step Type
,,DataPoint,Time,Total Time,Current(mA),Voltage(V),Date
1,0.1,0.2,1,1,Rest
,,1,00:00:00,00:00:00,0,3.5,2024-01-01 00:00:00
,,2,00:00:30,00:00:30,0,3.5,2024-01-01 00:00:30
,2,2,CC Chg
,,3,00:00:00,26:00:31,1500,3.6,2024-01-02 02:00:31
"""


def test_neware_report_with_lines_of_cycles_and_steps_between():
    columns = read(NEWARE_REPORT).columns
    np.testing.assert_array_equal(columns["test_time_second"], [0, 30, 93631])
    np.testing.assert_array_equal(columns["current_ampere"], [0, 0, 1.5])


def test_a_fault_names_the_line_of_the_file():
    with pytest.raises(Refusal, match=r"^file: line 8: column 'Voltage\(V\)': found '3x6'"):
        read(NEWARE_REPORT.replace("3.6", "3x6"))


@pytest.mark.parametrize("label", ["Time (h)", "time_h", "Time [h]", "Test Time/h"])
def test_a_table_of_nobody_in_particular(label):
    rows = "".join(f"{t};{2000};3700\n" for t in (0, 0.5, 1))
    reading = read(f"an export;\n{label};Current (mA);Voltage/mV\n{rows};;\n")
    assert reading.instrument == "table"
    np.testing.assert_allclose(reading.columns["test_time_second"], [0, 1800, 3600])
    np.testing.assert_allclose(reading.columns["current_ampere"], 2)
    np.testing.assert_allclose(reading.columns["voltage_volt"], 3.7)


def discharge():
    """Time [s], current [A], voltage [V] and number of the step: rest, discharge, rest, charge."""
    time = np.arange(0, 400.0, 10)
    step = np.arange(40) // 10
    return time, np.choose(step, [0.0, -2.0, 0.0, 1.0]), 3.7 + 0.01 * np.sin(time / 99), step


def written(columns, delimiter=",", point=".", above=""):
    """A text of columns by label; numbers with two decimals, texts as they are."""
    rows = [
        delimiter.join(x if isinstance(x, str) else f"{x:.2f}".replace(".", point) for x in row)
        for row in zip(*columns.values(), strict=True)
    ]
    return above + "\n".join([delimiter.join(columns), *rows]) + "\n"


def clock(seconds):
    return [f"{s // 3600 % 24:02.0f}:{s // 60 % 60:02.0f}:{s % 60:04.1f}" for s in seconds]


def dated(seconds, form, zone=""):
    start = np.datetime64("2024-03-01T22:59:00")
    return [
        pd.Timestamp(start + np.timedelta64(int(s), "s")).strftime(form) + zone for s in seconds
    ]


TIME, AMPERE, VOLT, STEP = discharge()
IN_STEP = 10.0 * (np.arange(40) % 10 + 1)
CHARGED = np.abs(AMPERE) * IN_STEP / 3600
MODES = np.array(["Rest", "CC_DChg", "Rest", "CC_Chg"])[STEP].tolist()
VOLTAGE = {"Voltage (V)": VOLT}
NOBODYS = {
    "German": written({"Zeit [s]": TIME, "Strom [A]": AMPERE, "Spannung [V]": VOLT}, ";", ","),
    "French": written({"Temps (s)": TIME, "Courant (A)": AMPERE, "Tension (V)": VOLT}, ";", ","),
    "Chinese": written(
        {"总时间(h:min:s)": clock(TIME), "电流(mA)": 1e3 * AMPERE, "电压(V)": VOLT}
    ).encode("gb18030"),
    "symbols": written({"t/s": TIME, "I/A": AMPERE, "U/V": VOLT}, "\t", above="# cell 1\n\n"),
    "units in a line": written({"Time": ["s", *TIME], "I": ["A", *AMPERE], "V": ["V", *VOLT]}),
    "zones": written(
        {"Timestamp": dated(TIME, "%Y-%m-%dT%H:%M:%S", "+01:00"), "Current (A)": AMPERE} | VOLTAGE
    ),
    "halves of a day": written(
        {"Date": dated(TIME, "%m/%d/%Y %I:%M:%S %p"), "Current (A)": AMPERE} | VOLTAGE
    ),
    "milliseconds": written({"timestamp_ms": 1.7e12 + 1e3 * TIME, "Current (A)": AMPERE} | VOLTAGE),
    "dates under s": written({"Time (s)": 1.7e12 + 1e3 * TIME, "Current (A)": AMPERE} | VOLTAGE),
    "over midnight": written({"Time": clock(86300 + TIME), "Current (A)": AMPERE} | VOLTAGE),
    "clock of steps": written({"Step": STEP, "Step Time (s)": IN_STEP, "I (A)": AMPERE} | VOLTAGE),
    "restarts at edges": written({"Time (s)": IN_STEP, "Current (A)": AMPERE} | VOLTAGE),
    "letters": written(
        {"Time (s)": TIME, "Status": MODES, "Current (A)": np.abs(AMPERE)} | VOLTAGE
    ),
    "counter of steps": written(
        {"Time (s)": TIME, "Current (A)": AMPERE, "Capacity (mAh)": 1e3 * CHARGED} | VOLTAGE
    ),
}


@pytest.mark.parametrize("form", NOBODYS)
def test_a_table_is_read_by_what_its_columns_are_called(form):
    columns = read(NOBODYS[form]).columns
    shown = columns["test_time_second"]
    np.testing.assert_allclose(shown - shown[0], TIME, atol=0.01)
    np.testing.assert_allclose(columns["current_ampere"], AMPERE, atol=0.005)
    np.testing.assert_allclose(columns["voltage_volt"], VOLT, atol=0.006)
    if form == "counter of steps":
        counted = columns["net_capacity_ampere_hour"]
        assert counted[-1] - counted[0] == pytest.approx((100 - 200) / 3600, abs=1e-4)


def test_of_several_names_of_one_thing_the_plainest_is_read_and_the_others_are_named():
    two = {"Time (s)": IN_STEP, "Total Time (s)": TIME, "V": 2 * VOLT, "I": 0 * AMPERE}
    reading = read(written(two | {"Current (A)": AMPERE} | VOLTAGE))
    np.testing.assert_allclose(reading.columns["test_time_second"], TIME)
    np.testing.assert_allclose(reading.columns["voltage_volt"], VOLT, atol=0.006)
    assert "columns that are not read: Time (s), V, I" in reading.notes


def test_a_clock_that_begins_anew_within_a_step_stays_as_it_is():
    anew = np.where(TIME < 150, TIME, TIME - 150)
    columns = read(
        written({"Time (s)": anew, "Step": STEP, "Current (A)": AMPERE} | VOLTAGE)
    ).columns
    np.testing.assert_array_equal(columns["test_time_second"], anew)


def test_what_no_column_says_is_asked_for_by_the_labels_of_the_file():
    with pytest.raises(Refusal, match=r"its columns \('Time \(s\)', 'C-rate', 'Voltage \(V\)'\)"):
        read(written({"Time (s)": TIME, "C-rate": AMPERE} | VOLTAGE))


HERTZ = np.geomspace(1e3, 0.1, 21)
OHM = 0.02 + 0.015 / (1 + 1j * HERTZ * 0.05)
PLAIN = {"Frequency (Hz)": HERTZ, "Z' (Ohm)": OHM.real}
SPECTRA = {
    "minus": PLAIN | {"-Z'' (Ohm)": -OHM.imag},
    "milliohm": {"freq/Hz": HERTZ, "Re(Z)/mOhm": 1e3 * OHM.real, "Im(Z)/mOhm": 1e3 * OHM.imag},
    "polar": {"Frequency": HERTZ, "|Z|": np.abs(OHM), "Phase (deg)": np.angle(OHM, deg=True)},
}


@pytest.mark.parametrize("form", SPECTRA)
def test_a_spectrum_of_nobody_in_particular(form):
    columns = read(pd.DataFrame(SPECTRA[form]).to_csv(index=False)).columns
    np.testing.assert_allclose(columns["impedance_real_ohm"], OHM.real, rtol=1e-9)
    np.testing.assert_allclose(columns["impedance_imaginary_ohm"], OHM.imag, atol=1e-12)


def test_a_spectrum_that_is_inverted_or_is_several_is_refused():
    inverted = pd.DataFrame(PLAIN | {"Z'' (Ohm)": -OHM.imag})
    with pytest.raises(Refusal, match="the column holds -Im"):
        read(inverted.to_csv(index=False))
    one = pd.DataFrame(SPECTRA["minus"])
    with pytest.raises(Refusal, match="more than once through its range"):
        read(pd.concat([one, one]).to_csv(index=False))


def zahner(frequency, impedance):
    rows = [frequency, np.abs(impedance), np.angle(impedance), np.arange(len(frequency))]
    count = (len(frequency) - 1).to_bytes(6, "big")
    return b"\x00\x00\xff\xff\xff\xff" + count + np.array(rows).astype(">f8").tobytes()


def test_zahner_counts_one_way_from_end_to_end():
    frequency = np.array([100.0, 1000, 10000, 1000, 100, 10, 1])
    impedance = 0.02 + 0.01 / (1 + 1j * frequency * 0.1)
    reading = read(zahner(frequency, impedance))
    np.testing.assert_array_equal(reading.columns["frequency_hertz"], frequency[2:])
    np.testing.assert_allclose(reading.columns["impedance_imaginary_ohm"], impedance.imag[2:])
    with pytest.raises(Refusal, match="Zahner file is cut off"):
        read(zahner(frequency, impedance)[:-1])


def test_a_spectrum_without_labels():
    frequency = np.geomspace(1e3, 0.1, 9)
    impedance = 0.02 + 0.01 / (1 + 1j * frequency)
    rows = zip(frequency, impedance.real, impedance.imag, strict=True)
    text = "".join(f"{f!r},{re!r},{im!r}\n" for f, re, im in np.array(list(rows)).tolist())
    assert read(text).kind == "impedance"
    with pytest.raises(Refusal, match="no instrument known"):
        read("".join(f"{t},3.7,-1.0\n" for t in range(1, 9)))  # a clock is no frequency


# Files that hold no readings, or not all of a reading, and why each is refused.
REFUSED = {
    "arbin/2017-05-09_test-TC-contact_CH33_Metadata.csv": "no instrument known",
    "arbin/FastCharge_000025_CH8_Metadata.csv": "no instrument known",
    "maccor/xTESLADIAG_000004_CH69.000": "XML",
    "neware/Experiment_Record.xlsx": "workbook of no instrument",
    "novonix/test_Nova_Form-CH01-01_short_metadata.csv": "no instrument known",
    "labview/Temperature-3C-discharge.lvm": "no instrument known",
    "bdf/test_missing_required.bdf": "no column 'Current / A'",
    "neware/filetype14-0.ndax": "voltages around 0.00332303 V",
}


def manifest(shared):
    return pd.read_csv(shared / "formats/manifest.tsv", sep="\t").set_index("file")


def test_every_file_is_read_or_refused_for_its_reason(shared):
    unread = []
    for file in manifest(shared).index:
        data = (shared / "formats" / file).read_bytes()
        try:
            formats.read(data, name=file)
        except Refusal as reason:
            of_kind = "mpr" if file.endswith(".mpr") else "none"
            if REFUSED.get(file, of_kind) not in str(reason):
                unread.append(str(reason))
        else:
            assert file not in REFUSED
    assert unread == []


GOLDEN = {"test_time": "test_time_second", "voltage": "voltage_volt", "current": "current_ampere"}
# Of the landt file: the source project's own conversion.
GOLDEN |= {"test_time_second": "test_time_second", "voltage_volt": "voltage_volt"}
GOLDEN |= {"current_ampere": "current_ampere"}


def test_other_peoples_readings_are_equal(shared):
    rows = manifest(shared)["golden"].dropna()
    compared = 0
    for file, golden in rows.items():
        if golden.endswith(".ftr"):
            continue  # see test_binaries
        path = shared / "formats" / golden
        wanted = pd.read_csv(path) if golden.endswith("gz") else pd.read_parquet(path)
        columns = formats.read((shared / "formats" / file).read_bytes(), name=file).columns
        wanted = wanted.dropna(subset=[name for name in GOLDEN if name in wanted], how="all")
        for theirs, ours in GOLDEN.items():
            if theirs in wanted:
                compared += 1
                np.testing.assert_allclose(columns[ours], wanted[theirs], rtol=0, atol=6e-8)
    assert compared >= 15


def test_cut_files_give_right_values_or_a_refusal(shared):
    for file in manifest(shared).index:
        if file.endswith((".gz", ".res", ".xlsx", ".ndax", ".nda", ".mpr")):
            continue
        data = (shared / "formats" / file).read_bytes()
        whole = _or_none(data)
        for end in range(4096, len(data), 4096):
            cut = _or_none(data[:end])
            if whole is None or cut is None:
                continue
            for name, values in cut.columns.items():
                # A cut number in the last row cannot be seen; all rows before it are the file's.
                kept = slice(0, len(values) - 1)
                np.testing.assert_array_equal(
                    values[kept], whole.columns[name][kept], f"{file} {end}"
                )


def _or_none(data):
    try:
        return formats.read(data, name="file")
    except Refusal:
        return None


def with_counters(current, charge, discharge):
    time = 60.0 * np.arange(len(current))
    rows = zip(time, current, charge, discharge, strict=True)
    labels = "Time (s);Current (A);Voltage (V);Charge_Capacity (Ah);Discharge_Capacity (Ah)\n"
    return labels + "".join(f"{t};{i};3.7;{c:.9f};{d:.9f}\n" for t, i, c, d in rows)


CHARGE = np.array([0.0, *np.arange(11), *[10.0] * 11]) / 60
DISCHARGE = np.array([*[0.0] * 12, *np.arange(11)]) / 60
SIGNED = np.array([0.0, *[1.0] * 11, *[-1.0] * 11])


@pytest.mark.parametrize("sign", [1, -1])
def test_a_counter_of_discharge_that_falls_on_charge_is_net_and_tells_the_sign(sign):
    table = {"Time [s]": 60.0 * np.arange(len(SIGNED)), "Current [A]": sign * SIGNED}
    table |= {
        "Terminal voltage [V]": 3.7 + 0 * SIGNED,
        "Discharge capacity [A.h]": DISCHARGE - CHARGE,
    }
    reading = read(pd.DataFrame(table).to_csv(index=False))
    assert reading.sign == sign
    np.testing.assert_allclose(reading.columns["net_capacity_ampere_hour"], CHARGE - DISCHARGE)
    table["Discharge capacity [A.h]"] = DISCHARGE  # stands still on charge: no net counter
    reading = read(pd.DataFrame(table).to_csv(index=False))
    assert reading.sign == 0
    assert "net_capacity_ampere_hour" not in reading.columns


@pytest.mark.parametrize("sign", [1, -1])
def test_counters_tell_the_sign_of_the_current(sign):
    reading = read(with_counters(sign * SIGNED, CHARGE, DISCHARGE))
    assert reading.sign == sign
    np.testing.assert_allclose(reading.columns["net_capacity_ampere_hour"], CHARGE - DISCHARGE)


def test_magnitudes_take_their_signs_from_the_counters():
    reading = read(with_counters(np.abs(SIGNED), CHARGE, DISCHARGE))
    np.testing.assert_array_equal(reading.columns["current_ampere"], SIGNED)
    assert reading.sign == 1


def test_counters_that_do_not_move_tell_no_sign():
    assert read(with_counters(SIGNED, 0 * CHARGE, 0 * CHARGE)).sign == 0


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e-3, "milliseconds"), (60, "minutes"), (3600, "hours")]
)
def test_a_clock_in_another_unit_is_converted_where_dates_prove_it(factor, unit):
    second = 10.0 * np.arange(500)
    rows = zip(second / factor, 1.7e9 + np.floor(second), strict=True)
    text = "Test Time / s,Current / A,Voltage / V,Unix Time / s\n"
    text += "".join(
        f"{t!r},1.0,{3.6 + t * factor / 1e5:.6f},{u}\n" for t, u in np.array(list(rows)).tolist()
    )
    reading = read(text)
    np.testing.assert_allclose(reading.columns["test_time_second"], second)
    assert reading.notes == (
        f"the clock counts {unit}, as its dates prove, not seconds: converted",
    )


def test_kelvin_under_degrees_is_left_out_and_told():
    text = "Test Time / s,Current / A,Voltage / V,Ambient Temperature / degC\n"
    reading = read(text + "".join(f"{t},1.0,3.7,298.15\n" for t in range(9)))
    assert "ambient_temperature_celsius" not in reading.columns
    assert reading.notes == (
        "ambient_temperature_celsius reads 298.1 °C: kelvin under degC? left out",
    )


@pytest.mark.parametrize("start", ["0d 00:00:00.5", "00:00:00.5"])
def test_a_time_of_day_in_the_interchange_format(start):
    text = f"Test Time / s,Current / A,Voltage / V\n{start},1.0,3.7\n"
    text += f"{start.replace(':00.5', ':10.5')},1,3.7\n"
    np.testing.assert_array_equal(read(text).columns["test_time_second"], [0.5, 10.5])


def test_a_date_beside_it_makes_no_clock_of_an_elapsed_time():
    text = "Test Time / s,Current / A,Voltage / V,Date Time ISO\n"
    text += "".join(f"{t},1,3.7,2024-01-01 10:00:0{t}\n" for t in range(5))
    np.testing.assert_array_equal(read(text).columns["test_time_second"], range(5))


def test_units_that_no_label_says_are_taken_and_told():
    reading = read("time,current,voltage\n0,1,3.7\n1,1,3.7\n")
    assert reading.notes == (
        "labels without a unit are taken as it is usual: time in s, current in A, voltage in V",
    )


@pytest.mark.parametrize(
    ("label", "sign", "said"),
    [
        ("-Im(Z)/Ohm", -1, "holds Im\\(Z\\) under a label of -Im"),
        ("Im(Z)/Ohm", 1, "holds -Im\\(Z\\)"),
    ],
)
def test_a_spectrum_of_the_wrong_sign_is_blamed_on_what_its_label_says(label, sign, said):
    rows = "".join(f"{10.0**k},{0.02:g},{sign * 0.01 * 0.5**k:g}\n" for k in range(5))
    with pytest.raises(Refusal, match=said):
        read(f"freq/Hz,Re(Z)/Ohm,{label}\n{rows}")


@pytest.mark.parametrize(("unit", "note"), [(1.0, "in Ah"), (1e3, "in mAh"), (7.7, "left out")])
@pytest.mark.parametrize("label", ["Capacity", "Q"])
def test_a_counter_without_a_unit_is_one_where_it_counts_what_the_current_moves(label, unit, note):
    rows = "".join(f"{60 * k},-3,{4 - 0.01 * k:g},{unit * 0.05 * k:.6f}\n" for k in range(60))
    reading = read(f"Time (s),Current (A),Voltage (V),{label}\n{rows}")
    assert any(note in told for told in reading.notes)
    if note == "left out":
        assert "net_capacity_ampere_hour" not in reading.columns
    else:
        assert reading.columns["net_capacity_ampere_hour"][-1] == pytest.approx(-0.05 * 59)


def test_maccor_in_milliampere():
    text = MACCOR.format(clock="Test (Sec)", t0=0, t1=1800, t2=3600, t3=5400)
    milli = text.replace("Amp-hr\tWatt-hr\tAmps", "mAmp-hr\tmWatt-hr\tmAmps")
    columns, wanted = (read(each).columns for each in (milli, text))
    for name in ("current_ampere", "net_capacity_ampere_hour"):
        np.testing.assert_allclose(columns[name], wanted[name] / 1e3, rtol=1e-12)
    np.testing.assert_array_equal(columns["voltage_volt"], wanted["voltage_volt"])


GAMRY = """EXPLAIN
TAG\tEISPOT
ZCURVE\tTABLE
\tPt\tTime\tFreq\tZreal\tZimag\tZsig
\t#\ts\tHz\tohm\tohm\tV
"""


def gamry(hertz):
    ohm = 0.02 + 0.01 / (1 + 1j * hertz / 50)
    rows = zip(range(len(hertz)), *(x.tolist() for x in (hertz, ohm.real, ohm.imag)), strict=True)
    return GAMRY + "".join(f"\t{k}\t{k}\t{f!r}\t{re!r}\t{im!r}\t1\n" for k, f, re, im in rows), ohm


@pytest.mark.parametrize("behind", ["", "\n", "ENDED\tLABEL\tby hand\tx\nNOTES\t1\n\ta note\n"])
def test_of_a_sweep_that_was_broken_off_the_good_points_are_read_with_a_doubt(behind):
    text, ohm = gamry(np.geomspace(1e3, 1, 10).round(3))
    whole = read(text)
    assert (whole.doubt, whole.notes) == ("", ("columns that are not read: Pt, Time, Zsig",))
    found = read(text + "EXPERIMENTABORTED\tTOGGLE\tT\tExperiment Aborted\n" + behind)
    np.testing.assert_array_equal(found.columns["impedance_real_ohm"], ohm.real)
    assert found.doubt == ("the sweep was broken off, as its file says: its points end at 1 Hz")
    assert found.doubt in found.notes
    row = cw.impedance(found.columns, doubt=found.doubt).rows[0]
    assert row["doubt"].startswith(found.doubt)


BT_LAB = {
    "tab": "mode\tox/red\terror\tNs\ttime/s\tEcell/V\tI/mA\n",
    "comma": "mode,ox/red,error,Ns,time/s,Ecell/V,I/mA\n",
    "semicolon": "mode;ox/red;error;Ns;time/s;Ecell/V;I/mA\n",
    "stamped": "TimeStamp,mode,ox_red,error,Ns,time/s,Ecell/V,I/mA\n",
    "head": "BT-Lab ASCII FILE\nNb header lines : 3\nmode,ox/red,Ns,x,time/s,Ecell/V,I/mA\n",
}


@pytest.mark.parametrize("form", BT_LAB)
def test_bt_lab_by_any_delimiter(form):
    labels = BT_LAB[form]
    delimiter = next(x for x in "\t;," if x in labels.splitlines()[-1])
    rows = [[1, 0, 0, 2, 10.0 * k, 3.5 + k / 100, 250.0] for k in range(6)]
    if form == "stamped":
        rows = [[f"2024-03-01 12:00:{10 * k:02}.000", *row] for k, row in enumerate(rows)]
    reading = read(labels + "".join(delimiter.join(map(str, row)) + "\n" for row in rows))
    assert reading.instrument == "biologic"
    np.testing.assert_array_equal(reading.columns["current_ampere"], 0.25)
    np.testing.assert_array_equal(reading.columns["test_time_second"], 10.0 * np.arange(6))
    if form == "stamped":
        assert np.ptp(reading.columns["unix_time_second"]) == 50


EC_LAB = (
    "EC-Lab ASCII FILE\nNb header lines : 3\ntime/s\tEwe/V\tI/mA\tfreq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm\n"
)


def ec_lab(swept):
    """A charge of 30 rows and `swept` points of a spectrum after it."""
    hertz = np.geomspace(1e3, 1, swept)
    ohm = 0.02 + 0.01 / (1 + 1j * hertz / 50)
    rows = [[10.0 * k, 3.5 + k / 100, 250.0, 0, 0, 0] for k in range(30)]
    rows += [
        [300.0 + k, 3.7, 0.0, *x]
        for k, x in enumerate(zip(hertz, ohm.real, -ohm.imag, strict=True))
    ]
    return EC_LAB + "".join("\t".join(map(str, row)) + "\n" for row in rows), ohm


@pytest.mark.parametrize("swept", [12, 60])
def test_a_series_and_a_spectrum_in_one_file_are_each_read_by_kind(swept):
    text, ohm = ec_lab(swept)
    series, spectrum, either = (
        formats.read(text.encode(), name="f", kind=kind) for kind in ("series", "impedance", None)
    )
    np.testing.assert_array_equal(series.columns["test_time_second"], 10.0 * np.arange(30))
    assert f"{swept} rows of a spectrum are left out" in series.notes[-1]
    np.testing.assert_allclose(spectrum.columns["impedance_imaginary_ohm"], ohm.imag)
    assert "30 rows without a frequency are left out" in spectrum.notes[-1]
    assert either.kind == ("series" if swept < 30 else "impedance")


def test_a_table_whose_frequency_is_never_above_zero_is_a_series():
    text, _ = ec_lab(0)
    for kind in ("series", None):
        reading = formats.read(text.encode(), name="f", kind=kind)
        assert len(reading.columns["current_ampere"]) == 30
    with pytest.raises(Refusal, match="0 row"):
        formats.read(text.encode(), name="f", kind="impedance")
