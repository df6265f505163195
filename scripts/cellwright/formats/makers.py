"""Instruments whose files are tables of text, each told in a few lines: see `text_table.Format`.

A column is named by a pattern of its label (case ignored) and means a column of the house, with its
unit: as text here, or, where the pattern has a group `unit`, as the label itself says.
"""

from cellwright.formats.dates import ZONED
from cellwright.formats.fields import ENERGIES, MINUS, NET, SERIES, probe_column
from cellwright.formats.text_table import (
    COUNTER,
    STEP_CHARGE,
    STEP_ENERGY,
    STEP_TIME,
    UNIX,
    WORKING,
    Format,
)

PUT_IN, TAKEN_OUT = ENERGIES
TIME, AMPERE, VOLT = SERIES
SURFACE, AMBIENT = "surface_temperature_celsius", "ambient_temperature_celsius"
# Maccor's letters. Of all others (P pause, S suspended, O between steps, FRA) the current is zero.
MACCOR_SIGNS = {"C": 1.0, "D": -1.0, "R": 0.0}
US_DATES = ("%m/%d/%Y %H:%M:%S", "%m/%d/%Y %I:%M:%S %p", "%d/%m/%Y %H:%M:%S")
ISO_DATES = ("%Y-%m-%d %H:%M:%S", "%Y-%m-%d %I:%M:%S %p")

SPECTRUM = {  # Freq (Hz), Z' and Z'' as most makers spell them
    r"freq(?:uency)?\s*(?:[(/]?\s*(?P<unit>k?hz)\)?)?": ("frequency_hertz", "frequency", "Hz"),
    r"(?:z'|zre|zreal|z real)\s*(?:[(/]?\s*(?P<unit>ohms?)\)?|\(a\))?": (
        "impedance_real_ohm",
        "impedance",
        "ohm",
    ),
    r"(?:z''|z\"|zimg?|zimag|z imag)\s*(?:[(/]?\s*(?P<unit>ohms?)\)?|\(b\))?": (
        "impedance_imaginary_ohm",
        "impedance",
        "ohm",
    ),
}

MAKERS = (
    Format(
        "maccor",
        "Maccor text",
        mark=r"^Today's Date|^Name:\t|^Rec#?[\t,]",
        header=r"^Rec#?[\t,]",
        columns={
            r"test\s?time": (TIME, "time", None),
            r"test(?: time)? \((?P<unit>sec|min|hr?)\)": (TIME, "time", None),
            r"amps|current(?: \[(?P<unit>m?A)\])?": (AMPERE, "current", "A"),
            r"volts|voltage(?: \[(?P<unit>m?V)\])?": (VOLT, "voltage", "V"),
            r"(?P<unit>ma)mps": (AMPERE, "current", None),
            r"(?P<unit>mv)olts": (VOLT, "voltage", None),
            r"mamp-hr": (STEP_CHARGE, "charge", "mAh"),
            r"mwatt-hr": (STEP_ENERGY, "energy", "mWh"),
            r"amp-hr|cap\. \[(?P<unit>m?Ah)\]|capacity": (
                STEP_CHARGE,
                "charge",
                "Ah",
            ),
            r"watt-hr|energy": (STEP_ENERGY, "energy", "Wh"),
            r"step": ("step_index", "count", "1"),
            r"cyc#|cycle c": ("cycle_count", "count", "1"),
            r"(?:aux #1|temp 1)": (SURFACE, "temperature", "degC"),
        },
        state=r"state|md",
        signs=MACCOR_SIGNS,
        date=r"dpt time",
        dates=(*US_DATES, "%d-%b-%y %I:%M:%S %p"),
    ),
    Format(
        "neware",
        "Neware csv",
        mark=r"^DataPoint,Cycle Index,|^Cycle Index,Chg\. Cap\.",
        header=r"^(?:,,)?DataPoint,",
        columns={
            r"(?:cumulative|total) time(?:\((?P<unit>h|min|s|ms)\))?": (TIME, "time", None),
            r"current\((?P<unit>m?A)\)": (AMPERE, "current", None),
            r"voltage\((?P<unit>m?V)\)": (VOLT, "voltage", None),
            r"chg\. cap\.\((?P<unit>m?Ah)\)": ("charge_counter", "charge", None),
            r"dchg\. cap\.\((?P<unit>m?Ah)\)": ("discharge_counter", "charge", None),
            r"chg\. energy\((?P<unit>m?Wh)\)": (PUT_IN, "energy", None),
            r"dchg\. energy\((?P<unit>m?Wh)\)": (TAKEN_OUT, "energy", None),
            r"step index": ("step_index", "count", "1"),
            r"cycle index": ("cycle_count", "count", "1"),
            r"t1\(.{1,2}\)": (SURFACE, "temperature", "degC"),
        },
        rows_begin=b",,",
        date=r"date",
        dates=ISO_DATES,
    ),
    Format(
        "biologic",
        "BioLogic text (EC-Lab, BT-Lab)",
        mark=r"^(?:EC|BT)-Lab ASCII FILE|^(?:TimeStamp[\t,;])?mode[\t,;]ox[/_]red[\t,;]"
        r"|^freq/Hz\tRe\(Z\)",
        header=r"^(?=[^\n]*(?:time/s|freq/Hz)[\t,;])[^\n:]*[\t,;]",
        columns={
            r"time/(?P<unit>s)": (TIME, "time", None),
            r"(?:<i>|i)/(?P<unit>[mµu]?a)": (AMPERE, "current", None),
            # Of three electrodes the cell is the difference of both against the reference.
            r"(?:ecell|<?ewe-ece>?)/(?P<unit>m?v)": (VOLT, "voltage", None),
            r"(?:ewe|<ewe>)/(?P<unit>m?v)": (WORKING, "voltage", None),
            r"(?:ece|<ece>)/(?P<unit>m?v)": (COUNTER, "voltage", None),
            r"\(q-qo\)/(?P<unit>m?a\.h)": (NET, "charge", None),
            r"q charge/(?P<unit>m?a\.h)": ("charge_counter", "charge", None),
            r"q discharge/(?P<unit>m?a\.h)": ("discharge_counter", "charge", None),
            r"energy charge/(?P<unit>m?w\.h)": (PUT_IN, "energy", None),
            r"energy discharge/(?P<unit>m?w\.h)": (TAKEN_OUT, "energy", None),
            r"ns": ("step_index", "count", "1"),
            r"temperature/.{1,2}c": (SURFACE, "temperature", "degC"),
            r"freq/(?P<unit>hz)": ("frequency_hertz", "frequency", None),
            r"re\(z\)/(?P<unit>ohm)": ("impedance_real_ohm", "impedance", None),
            r"-im\(z\)/(?P<unit>ohm)": (MINUS, "impedance", None),
        },
        date=r"timestamp",
        dates=("%m/%d/%Y %H:%M:%S", *ISO_DATES),
    ),
    Format(
        "novonix",
        "Novonix csv",
        mark=r"^\"?\[Summary\]",
        header=r"^\"?Date and Time,",
        columns={
            r"run time \((?P<unit>h|min|s)\)": (TIME, "time", None),
            r"current \((?P<unit>m?A)\)": (AMPERE, "current", None),
            r"potential \((?P<unit>m?V)\)": (VOLT, "voltage", None),
            r"capacity \((?P<unit>m?Ah)\)": (STEP_CHARGE, "charge", None),
            r"step number": ("step_index", "count", "1"),
            r"cycle number": ("cycle_count", "count", "1"),
            r"temperature \(.{1,3}c\)": (SURFACE, "temperature", "degC"),
        },
        date=r"date and time",
        dates=ISO_DATES,
    ),
    Format(
        "basytec",
        "BaSyTec text",
        mark=r"^~Resultfile from Basytec",
        header=r"^~Time\[",
        columns={
            r"~?time\[(?P<unit>h|min|s)\]": (TIME, "time", None),
            r"i\[(?P<unit>m?a)\]": (AMPERE, "current", None),
            r"u\[(?P<unit>m?v)\]": (VOLT, "voltage", None),
            r"ah\[(?P<unit>m?ah)\]": (NET, "charge", None),
            r"line": ("step_index", "count", "1"),
            r"cyc-count": ("cycle_count", "count", "1"),
            r"t1\[.{1,2}c\]": (SURFACE, "temperature", "degC"),
        },
    ),
    Format(
        "landt",
        "Landt csv",
        mark=r"^cell model:",
        header=r"^channel_index,",
        columns={
            r"test_time_(?P<unit>s)": (TIME, "time", None),
            r"current_(?P<unit>m?a)": (AMPERE, "current", None),
            r"voltage_(?P<unit>m?v)": (VOLT, "voltage", None),
            r"charge_capacity_(?P<unit>m?ah)": ("charge_counter", "charge", None),
            r"discharge_capacity_(?P<unit>m?ah)": ("discharge_counter", "charge", None),
            r"charge_energy_(?P<unit>m?wh)": (PUT_IN, "energy", None),
            r"discharge_energy_(?P<unit>m?wh)": (TAKEN_OUT, "energy", None),
            r"step_index": ("step_index", "count", "1"),
            r"cycle_index": ("cycle_count", "count", "1"),
            r"temperature_1_c": (SURFACE, "temperature", "degC"),
        },
        date=r"date_time_iso_string",
        dates=("%m/%d/%Y %H:%M:%S", *ISO_DATES),
    ),
    Format(
        "pec",
        "PEC csv",
        mark=r"^Request Year:,",
        header=r"^Test,Cell,Rack,",
        columns={
            r"total time \((?:(?P<unit>seconds)|hours in hh:mm:ss\.xxx)\)": (TIME, "time", "clock"),
            r"current \((?P<unit>m?a)\)": (AMPERE, "current", None),
            r"voltage \((?P<unit>m?v)\)": (VOLT, "voltage", None),
            r"charge capacity \((?P<unit>m?ah)\)": ("charge_counter", "charge", None),
            r"discharge capacity \((?P<unit>m?ah)\)": ("discharge_counter", "charge", None),
            r"step": ("step_index", "count", "1"),
            r"cycle": ("cycle_count", "count", "1"),
            r"(?:temp|cell surface temperature) \(.{1,3}c\)": (SURFACE, "temperature", "degC"),
            r"ambient temperature \(.{1,3}c\)": (AMBIENT, "temperature", "degC"),
        },
        date=r"real time",
        dates=US_DATES,
        channel=r"test|rack|shelf|position",
    ),
    Format(
        "gamry",
        "Gamry DTA",
        mark=r"^EXPLAIN",
        header=r"^ZCURVE\s+TABLE[^\n]*\n\tPt\t",
        header_lines=1,
        units_lines=1,
        columns=SPECTRUM,
        delimiter="\t",
        end=r"^[A-Za-z]",
        aborted=r"^EXPERIMENTABORTED\b",
    ),
    Format(
        "zplot",
        "ZPlot, ZPlotW or Autolab impedance text",
        mark=r'^ZPLOT2 ASCII|^"ZPlotW Data File|^"Z60W Data File',
        header=r"^[ \t]*\"?[ \t]*Freq\s?\(Hz\)",
        labels=("freq", "ampl", "bias", "time", "z'", "z''", "gd", "err", "range"),
        rows_are=r"^\s*[\d.]+(?:E[+-]\d+)?[,\t]",
        columns=SPECTRUM,
    ),
    Format(
        "chi",
        "CH Instruments impedance text",
        mark=r"^A\.C\. Impedance|^Instrument Model:\s+CHI",
        header=r"^Freq/Hz,",
        columns=SPECTRUM,
    ),
    Format(
        "versastudio",
        "VersaStudio par",
        mark=r"^<Application>\s*\n?Name=VersaStudio",
        header=r"^Definition=Segment #,.*Z Real",
        columns=SPECTRUM,
        end=r"^</Segment",
        short_rows=True,
    ),
    Format(
        "parstat",
        "Parstat or PowerSuite impedance text",
        mark=r"^Potential \(V\)\tCurrent \(A\)\tElapsed Time|^Frequency\s+Zre\s+Zimg",
        header=r"Zre\b",
        columns=SPECTRUM,
    ),
    Format(
        "maccor_impedance",
        "Maccor impedance part",
        mark=r"^MACCOR, INC\.\s+AC Impedance Test",
        header=r"^Freq\(Hz\)\t",
        columns=SPECTRUM,
        short_rows=True,
    ),
)

UNIT = r"(?:\s*(?:[\[(/_ ]|\bin\s)\s*(?P<unit>{})\s*[\])]?)?"
HOURS, AMPERES = UNIT.format("s|sec|seconds|ms|min|h|hours?|秒"), UNIT.format("m?a")
VOLTS, CHARGE = UNIT.format("m?v"), UNIT.format("m?a[h.]{1,2}")
DEGREES, OHMS = UNIT.format("deg[cf]|°[cf]|[ck]"), UNIT.format("m?ohms?|m?Ω|m?ω")
ANGLE, ENERGIES = UNIT.format("deg|°|rad"), UNIT.format("m?wh")
# Names of time, current and voltage in the languages of laboratories, and their symbols.
CLOCKS = r"time|zeit|temps|tiempo|tempo|时间"
WHOLE_CLOCKS = r"(?:test|total|elapsed|run)[ _]?time|(?:test|lauf|prüf)zeit|(?:总|测试)时间"
CURRENTS = r"current|amps|strom(?:stärke)?|courant|intensité|corriente|corrente|电流"
VOLTAGES = r"voltage|potential|volts|spannung|tension|tensión|voltaje|tensione|电压"
CHARGING = "chg|charge|charging|laden|ladung|(?:恒流|恒压|恒功率|恒阻|倍率)*充电"
DISCHARGING = (
    "d(?:is)?chg|discharge|discharging|entladen|entladung|(?:恒流|恒压|恒功率|恒阻|倍率)*放电"
)
DATES = (
    r"date(?:[ _/-]?time)?|datum(?:[ /_-]?(?:zeit|uhrzeit))?|time[ _]?stamp|zeitstempel"
    r"|absolute[ _]time|绝对时间|系统时间|日期"
)
TEMPERATURE = r"temp(?:erature|eratur|érature)?"
ON_CELL = r"(?:(?:volume-averaged )?cell|battery|batt|surface|zell(?:e|en)?)"
AROUND = r"(?:environment|chamber|ambient|umgebungs?|kammer)"
# Tables of nobody in particular, tried where no maker is recognised: names of time, current and
# voltage, or of frequency and impedance, in one line. Of several the one that stands first here.
GENERIC = Format(
    "table",
    "a table of time, current and voltage",
    mark="",
    header="",
    columns={
        rf"(?:{WHOLE_CLOCKS}){HOURS}(?:\(?h+:m\S*\)?)?": (TIME, "time", "s"),
        rf"(?:{CLOCKS}){HOURS}(?:\(?h+:m\S*\)?)?": (TIME, "time", "s"),
        rf"(?:(?:step|relative)[ _]?time|schrittzeit|步骤?时间){HOURS}(?:\(?h+:m\S*\)?)?": (
            STEP_TIME,
            "time",
            "s",
        ),
        rf"(?:unix[ _]?time|epoch|time[ _]?stamp){HOURS}": (UNIX, "time", "s"),
        rf"(?:{CURRENTS}){AMPERES}": (AMPERE, "current", "A"),
        rf"(?:{VOLTAGES}){VOLTS}": (VOLT, "voltage", "V"),
        # Symbols: a small t is a time, a capital one a temperature.
        rf"(?-i:t){HOURS}": (TIME, "time", "s"),
        rf"<?i>?{AMPERES}": (AMPERE, "current", "A"),
        rf"(?:(?:cell|battery|terminal)[ _]voltage|ecell|ewe|[uv]){VOLTS}": (VOLT, "voltage", "V"),
        rf"(?:charge|chg\.?)[ _]cap(?:acity|\.)?{CHARGE}": ("charge_counter", "charge", "Ah"),
        rf"d(?:is)?ch(?:ar)?g(?:e|\.)?[ _]cap(?:acity|\.)?{CHARGE}": (
            "discharge_counter",
            "charge",
            "Ah",
        ),
        rf"net[ _]capacity{CHARGE}": (NET, "charge", "Ah"),
        rf"charge[ _]energy{ENERGIES}": (PUT_IN, "energy", "Wh"),
        rf"discharge[ _]energy{ENERGIES}": (TAKEN_OUT, "energy", "Wh"),
        rf"(?:capacity|kapazität|capacité|capacidad|容量){CHARGE}": (STEP_CHARGE, "charge", None),
        rf"(?:cap\.?|q|charge|ladung){CHARGE}": (STEP_CHARGE, "charge", None),
        r"(?P<unit>m?ah)": (STEP_CHARGE, "charge", None),
        r"step(?:[ _](?:index|number|id))?|schritt": ("step_index", "count", "1"),
        r"cycle(?:[ _](?:index|number))?|zyklus": ("cycle_count", "count", "1"),
        rf"(?:{ON_CELL}[ _])?{TEMPERATURE}{DEGREES}": (SURFACE, "temperature", "degC"),
        rf"(?-i:T){DEGREES}": (SURFACE, "temperature", "degC"),
        **{
            rf"(?:{ON_CELL}[ _])?(?:{TEMPERATURE}|(?-i:T))[ _]?{k}{DEGREES}": (
                probe_column(k),
                "temperature",
                "degC",
            )
            for k in range(1, 10)
        },
        rf"{AROUND}[ _]?{TEMPERATURE}{DEGREES}": (AMBIENT, "temperature", "degC"),
        rf"freq(?:uency|uenz)?{UNIT.format('m?hz|khz')}": ("frequency_hertz", "frequency", "Hz"),
        rf"(?:z'|z_?re(?:al)?|re\(z\)|z real){OHMS}": ("impedance_real_ohm", "impedance", "ohm"),
        rf"(?:z''|z\"|z_?im(?:ag|g)?|im\(z\)|z imag){OHMS}": (
            "impedance_imaginary_ohm",
            "impedance",
            "ohm",
        ),
        rf"-\s?(?:z''|z\"|z_?im(?:ag|g)?|im\(z\)|z imag){OHMS}": (
            MINUS,
            "impedance",
            "ohm",
        ),
        rf"(?:\|z\||zmod|z_?abs|impedance){OHMS}": ("impedance_ohm", "impedance", "ohm"),
        rf"(?:phase|phase\(z\)|zphz|theta){ANGLE}": ("phase_degree", "angle", "deg"),
    },
    state=r"status|state|mode|step[ _]?(?:type|name)|zustand|状态|工步类型",
    signs={
        rf"(?:c[cvp]){{0,2}}[ _-]*(?:{CHARGING}|c)": 1.0,
        rf"(?:c[cvp]){{0,2}}[ _-]*(?:{DISCHARGING}|d)": -1.0,
        r"rest|pause|ruhe|ocv|r|p|idle|静置|搁置": 0.0,
    },
    date=DATES,
    dates=(*ISO_DATES, ZONED, "%d.%m.%Y %H:%M:%S", *US_DATES, "%Y/%m/%d %H:%M:%S"),
    units_taken=True,
)
