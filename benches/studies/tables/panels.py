"""Logs of operator panels and of systems for buildings, energy and analysis."""

from historians import iso
from payloads import BERLIN, NEW_YORK, Family, bracketed, lines, names_of, number, stamp, table, wide

ZONE = {"tz": "Europe/Berlin"}


def schneider():
    family = Family("schneider")
    t = table("PT101 TT102", step="1")
    bare = t.truth(units=["", ""])
    day = lambda k: stamp(t.clock(k), "%d/%m/%Y %H:%M:%S", BERLIN)
    dmy = {**ZONE, "time_unit": "dmy"}
    family.add(
        "vijeo_trend",
        "typical",
        wide(t, day, names_of(t), ";", ",", time_title="Date/Time"),
        bare,
        answers=dmy,
        must_ask=("tz",),
    )
    apart = lambda k: [stamp(t.clock(k), "%d/%m/%Y", BERLIN), stamp(t.clock(k), "%H:%M:%S", BERLIN), "0"]
    family.add(
        "vijeo_data_logging",
        "typical",
        wide(t, apart, names_of(t), time_title=("Date", "Time", "ms")),
        bare,
        answers=dmy,
        must_ask=("tz",),
        harmless=("ms",),
    )
    family.add(
        "control_expert_trend",
        "clean",
        wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", BERLIN, 3), bracketed(t), ";", time_title="Time"),
        t.truth(),
        answers=ZONE,
        must_ask=("tz",),
    )
    family.add(
        "power_monitoring",
        "nasty",
        lines(
            [
                ["Device", "Plant.Main"],
                ["Report", "Trend"],
                [""],
                ["Timestamp", "PT101 (bar)", "Data Quality", "TT102 (°C)", "Data Quality"],
            ]
            + [[iso(t, k, 3), t.columns[0].values[k], "", t.columns[1].values[k], ""] for k in t.rows]
        ),
        t.truth(),
        answers={"header_row": "4"},
        harmless=("Data Quality.*",),
    )
    geo = [["Time", "Variable", "Value", "Quality"]] + [
        [stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=3), c.name, c.values[k], "Good"]
        for k in t.rows
        for c in t.columns
    ]
    family.add("geo_scada_historic", "typical", lines(geo), bare, answers={"tz": "UTC"}, must_ask=("tz",))
    return family.variants


def weintek():
    family = Family("weintek_panel")
    t = table("PT101 TT102", step="1")
    bare = t.truth(units=["", ""])
    rows = [
        [
            str(k + 1),
            stamp(t.clock(k), "%d/%m/%y", BERLIN),
            stamp(t.clock(k), "%H:%M:%S", BERLIN),
            *(c.values[k] for c in t.columns),
        ]
        for k in t.rows
    ]
    dmy = {**ZONE, "time_unit": "dmy", "time": "Date"}
    family.add(
        "data_sampling",
        "typical",
        lines([["Index", "Date", "Time", *names_of(t)]] + rows),
        bare,
        answers=dmy,
        must_ask=("tz",),
        harmless=("Index",),
    )
    family.add(
        "milliseconds_apart",
        "nasty",
        lines([["Date", "Time", "Millisecond", *names_of(t)]] + [[*r[1:3], "0", *r[3:]] for r in rows]),
        bare,
        answers=dmy,
        must_ask=("tz",),
        harmless=("Millisecond",),
    )
    family.add(
        "two_date_columns",
        "clean",
        lines([["Date", "Time", *names_of(t)]] + [r[1:] for r in rows], "\t"),
        bare,
        answers=dmy,
        must_ask=("tz",),
    )
    return family.variants


def iba():
    family = Family("iba_analyzer")
    t = table("PT101 SC104", step="0.01")
    rows = [[f"{k * 0.01:.6f}", *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add(
        "units_below",
        "clean",
        lines([["time", *names_of(t)], ["s", *(c.unit for c in t.columns)]] + rows, "\t"),
        t.truth(False),
        answers={"unit_row": "2"},
    )
    family.add(
        "head_lines",
        "nasty",
        lines([["time", "[0:0]", "[0:1]"], ["sec", *names_of(t)], ["", *(c.unit for c in t.columns)]] + rows, "\t"),
        t.truth(False),
        answers={"header_row": "2", "unit_row": "3", "time_unit": "s"},
    )
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S.%f", BERLIN)
    family.add(
        "absolute",
        "typical",
        lines(
            [["Time", *names_of(t)], ["", *(c.unit for c in t.columns)]]
            + [[day(k), *(c.values[k] for c in t.columns)] for k in t.rows],
            ";",
        ),
        t.truth(),
        answers={**ZONE, "unit_row": "2"},
        must_ask=("tz",),
    )
    return family.variants


def buildings():
    family = Family("building_systems")
    t = table("TT102 XV107", step="900", units=("°C", "%"), titles=("AHU1.SupplyTemp", "AHU1.Valve"))
    york = {"tz": "America/New_York"}
    niagara = lambda k: stamp(t.clock(k), "%d-%b-%y %I:%M:%S %p", NEW_YORK) + " EST"
    cells = [["Timestamp", "Trend Flags", "Status", "Value (°C)"]] + [
        [niagara(k), "{ }", "{ok}", t.columns[0].values[k]] for k in t.rows
    ]
    lone = table("TT102", step="900", titles=("Value",))
    family.add(
        "niagara_history",
        "nasty",
        lines([["history:/Station/SupplyTemp"]] + cells),
        lone.truth(),
        answers={**york, "header_row": "2"},
    )
    family.add(
        "metasys_trend",
        "clean",
        wide(t, lambda k: stamp(t.clock(k), "%-m/%-d/%Y %-I:%M:%S %p", NEW_YORK), bracketed(t), time_title="Time"),
        t.truth(),
        answers={**york, "time_unit": "mdy"},
        must_ask=("tz",),
    )
    desigo = wide(
        t, lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S", BERLIN), bracketed(t), ";", ",", time_title="Datum/Zeit"
    )
    family.add("desigo_trend", "typical", desigo, t.truth(), answers=ZONE, must_ask=("tz",))
    cells = [
        ["Key", "Name:Suffix", "Trend Definitions Used"],
        ["Point_1:", "AHU1.SupplyTemp", "15 minutes"],
        ["Point_2:", "AHU1.Valve", "15 minutes"],
        ["Time Interval:", "15 Minutes"],
        [""],
        ["<>Date", "Time", "Point_1", "Point_2"],
    ]
    rows = [
        [
            stamp(t.clock(k), "%m/%d/%Y", NEW_YORK),
            stamp(t.clock(k), "%H:%M:%S", NEW_YORK),
            *(c.values[k] for c in t.columns),
        ]
        for k in t.rows
    ]
    family.add(
        "apogee_report",
        "nasty",
        lines(cells + rows, quote=True),
        t.truth(units=["", ""], names=["Point_1", "Point_2"]),
        answers={**york, "time_unit": "mdy", "header_row": "6"},
        must_ask=("tz",),
    )
    haystack = [["ts", "AHU1.SupplyTemp", "AHU1.Valve"]] + [
        [
            stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S-05:00 New_York", NEW_YORK),
            f"{t.columns[0].values[k]}°C",
            f"{t.columns[1].values[k]}%",
        ]
        for k in t.rows
    ]
    family.add(
        "haystack_grid", "nasty", lines(haystack), t.truth(), answers={"units": "AHU1.SupplyTemp:°C,AHU1.Valve:%"}
    )
    return family.variants


def energy():
    family = Family("energy_meters")
    t = table("JT106 ET108", step="900", units=("kW", "V"), titles=("P_total", "U_L1"))
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M", BERLIN)
    family.add(
        "quarter_hours",
        "typical",
        wide(t, day, bracketed(t), ";", ",", time_title="Zeitstempel"),
        t.truth(),
        answers=ZONE,
        must_ask=("tz",),
    )
    span = [["Von", "Bis", *bracketed(t)]] + [
        [
            day(k),
            stamp(t.clock(k) + (t.clock(1) - t.clock(0)), "%d.%m.%Y %H:%M", BERLIN),
            *(c.values[k].replace(".", ",") for c in t.columns),
        ]
        for k in t.rows
    ]
    family.add(
        "from_and_to",
        "nasty",
        lines(span, ";"),
        t.truth(),
        answers={**ZONE, "time": "Von", "ignore": "Bis"},
        must_ask=("tz",),
    )
    inverter = [
        ["#SMA Sunny Explorer"],
        [";SN: 1234567890"],
        ["sep=;"],
        ["Version CSV1|Tool SE|Linebreaks CR/LF|Delimiter semicolon|Decimalpoint comma|Precision 3"],
        [""],
        ["", "P_total", "U_L1"],
        ["dd.MM.yyyy HH:mm:ss", "kW", "V"],
    ]
    family.add(
        "inverter_log",
        "nasty",
        lines(
            inverter
            + [
                [stamp(t.clock(k), "%d.%m.%Y %H:%M:%S", BERLIN), *(c.values[k].replace(".", ",") for c in t.columns)]
                for k in t.rows
            ],
            ";",
            "\r\n",
        ),
        t.truth(),
        answers={**ZONE, "header_row": "6", "unit_row": "7"},
        must_ask=("tz",),
    )
    offset = wide(
        t, lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M", BERLIN) + " +0100", bracketed(t), time_title="time"
    )
    family.add("offset_after_blank", "typical", offset, t.truth())
    autumn = table(
        "JT106 ET108",
        rows=16,
        step="900",
        units=("kW", "V"),
        titles=("P_total", "U_L1"),
        begin=t.begin.replace(month=10, day=24, hour=23, minute=30),
    )
    family.add(
        "hour_that_comes_twice",
        "nasty",
        wide(
            autumn,
            lambda k: stamp(autumn.clock(k), "%d.%m.%Y %H:%M", BERLIN),
            bracketed(autumn),
            ";",
            ",",
            time_title="Zeit",
        ),
        autumn.truth(),
        answers=ZONE,
        must_ask=("tz",),
    )
    spring = table(
        "JT106 ET108",
        rows=12,
        step="900",
        units=("kW", "V"),
        titles=("P_total", "U_L1"),
        begin=t.begin.replace(month=3, day=29, hour=0, minute=15),
    )
    family.add(
        "hour_that_is_left_out",
        "nasty",
        wide(
            spring,
            lambda k: stamp(spring.clock(k), "%d.%m.%Y %H:%M", BERLIN),
            bracketed(spring),
            ";",
            ",",
            time_title="Zeit",
        ),
        spring.truth(),
        answers=ZONE,
        must_ask=("tz",),
    )
    return family.variants


def copa_data():
    family = Family("zenon_and_citect")
    t = table("PT101 TT102", step="5")
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S", BERLIN)
    zenon = [["VARIABLE", "TIMESTAMP_S", "TIMESTAMP_MS", "VALUE", "STATUS", "STRVALUE"]]
    rows = [
        [c.name, str(t.milliseconds(k) // 1000), "0", c.values[k], "262144", ""] for k in t.rows for c in t.columns
    ]
    family.add(
        "zenon_sql_archive",
        "nasty",
        lines(zenon + rows, ";"),
        t.truth(units=["", ""]),
        answers={"tag": "VARIABLE", "value": "VALUE", "time": "TIMESTAMP_S", "time_unit": "s", "quality": "none"},
        harmless=(".*STATUS", ".*_MS"),
    )
    family.add(
        "zenon_extended_trend",
        "typical",
        wide(t, day, bracketed(t), ";", ",", time_title="Zeit"),
        t.truth(),
        answers=ZONE,
        must_ask=("tz",),
    )
    citect = [["Date", "Time", *names_of(t)]] + [
        [
            stamp(t.clock(k), "%d/%m/%Y", BERLIN),
            stamp(t.clock(k), "%H:%M:%S.%f", BERLIN, 3),
            *(c.values[k] for c in t.columns),
        ]
        for k in t.rows
    ]
    family.add(
        "citect_process_analyst",
        "typical",
        lines(citect, "\t"),
        t.truth(units=["", ""]),
        answers={**ZONE, "time_unit": "dmy"},
        must_ask=("tz",),
    )
    gated = table("PT101 TT102", step="5", missing=((3, 0), (4, 0)))
    rows = [
        [
            stamp(gated.clock(k), "%d/%m/%Y", BERLIN),
            stamp(gated.clock(k), "%H:%M:%S", BERLIN),
            *(number(c.values[k], ".", "<Gated>") for c in gated.columns),
        ]
        for k in gated.rows
    ]
    family.add(
        "citect_gated",
        "nasty",
        lines([citect[0], *rows], "\t"),
        gated.truth(units=["", ""]),
        answers={**ZONE, "time_unit": "dmy", "missing": "<Gated>"},
        must_ask=("tz",),
    )
    return family.variants


def variants():
    return schneider() + weintek() + iba() + buildings() + energy() + copa_data()
