"""Traces and logs of controllers and of the programs beside them."""

from historians import marked
from payloads import BERLIN, NEW_YORK, TOKYO, Family, bracketed, lines, names_of, stamp, table, wide

ZONE = {"tz": "Europe/Berlin"}


def pairs_of(t, time, heads):
    """A time column beside each signal."""
    return [[cell for c in t.columns for cell in heads(c)]] + [
        [cell for c in t.columns for cell in (time(k), c.values[k])] for k in t.rows
    ]


def tia_portal():
    family = Family("siemens_tia_trace")
    t = table("PT101 SC104", step="0.004", titles=('"Drive_DB".pressure', '"Drive_DB".speed'))
    bare = t.truth(False, units=["", ""])
    micro = lambda k: str(round(k * 4000))
    rows = [[micro(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add(
        "microseconds",
        "clean",
        lines([["Time [µs]", *(c.name.replace('"', "") for c in t.columns)]] + rows),
        t.truth(False, units=["", ""], names=["Drive_DB.pressure", "Drive_DB.speed"]),
    )
    counted = [["Sample", "Time [ms]", *names_of(t)]] + [
        [str(k), str(4 * k), *(c.values[k] for c in t.columns)] for k in t.rows
    ]
    family.add(
        "sample_numbers",
        "typical",
        lines(counted, ";"),
        bare,
        answers={"time": "Time [ms]", "ignore": "Sample"},
        harmless=("Sample",),
    )
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S.%f", BERLIN, 3)
    family.add(
        "absolute",
        "typical",
        wide(t, day, names_of(t), ";", ",", time_title="Timestamp"),
        t.truth(units=["", ""]),
        answers=ZONE,
        must_ask=("tz",),
    )
    top = [["Trace name", "Trace_1"], ["CPU", "PLC_1"], ["Trigger", "immediate"], ["Sampling", "OB30, 4 ms"], [""]]
    family.add(
        "head_with_facts",
        "nasty",
        lines(top + [["Time [µs]", *names_of(t)]] + rows, ";"),
        bare,
        answers={"header_row": "6"},
    )
    dtl = lambda k: "DTL#" + stamp(t.clock(k), "%Y-%m-%d-%H:%M:%S.%f", digits=6)
    family.add(
        "dtl_literals",
        "nasty",
        wide(t, dtl, names_of(t), ";", time_title="Time"),
        t.truth(units=["", ""]),
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    data_log = (
        [["Record", "Date", "UTC Time", "PT101", "SC104"]]
        + [
            [
                str(k + 1),
                stamp(t.clock(k), "%m/%d/%Y"),
                stamp(t.clock(k), "%H:%M:%S.%f", digits=3),
                *(f"{float(c.values[k]):.6E}" for c in t.columns),
            ]
            for k in t.rows
        ]
        + [["//END", "", "", "", ""]]
    )
    log = table("PT101 SC104", step="0.004")
    for column in log.columns:
        column.values = [f"{float(v):.6e}" for v in column.values]
    family.add(
        "s7_data_log",
        "nasty",
        lines(data_log),
        log.truth(units=["", ""]),
        answers={"tz": "UTC", "time_unit": "mdy", "time": "Date", "ignore": "Record"},
        harmless=("Record",),
    )
    return family.variants


def wincc():
    family = Family("wincc")
    t = table("PT101 TT102", step="1", titles=("Pump\\PT101", "Pump\\TT102"))
    bare = t.truth(units=["", ""])
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S", BERLIN)
    advanced = [["VarName", "TimeString", "VarValue", "Validity", "Time_ms"]]
    serial = lambda k: f"{(stamp_days(t, k)) * 1e6:.5f}".replace(".", ",")
    rows = [[c.name, day(k), c.values[k].replace(".", ","), "1", serial(k)] for k in t.rows for c in t.columns]
    family.add(
        "advanced_log",
        "typical",
        lines(advanced + rows, ";", "\r\n", quote=True),
        bare,
        answers={**ZONE, "tag": "VarName", "value": "VarValue", "quality": "none"},
        must_ask=("tz",),
        harmless=(".*Validity", ".*Time_ms"),
    )
    text = lines(advanced, ";", "\r\n", quote=True) + "".join(
        f'"{r[0]}";"{r[1]}";{r[2]};{r[3]};{r[4]}\r\n' for r in rows
    )
    text += '"$RT_OFF$";"02.03.2026 09:15:20";0;2;46083385648,14815\r\n'
    family.add(
        "runtime_off_rows",
        "nasty",
        text,
        bare,
        answers={**ZONE, "tag": "VarName", "value": "VarValue", "quality": "none"},
        must_ask=("tz",),
        harmless=(".*Validity", ".*Time_ms", ".*RT_OFF.*"),
    )
    trend = pairs_of(
        t,
        lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S.%f", BERLIN, 3),
        lambda c: (f"{c.name} X-axis", f"{c.name} Y-axis"),
    )
    family.add(
        "trend_control_pairs",
        "nasty",
        lines(
            [
                [cell.replace(".", ",") if k % 2 else cell for k, cell in enumerate(row)] if p else row
                for p, row in enumerate(trend)
            ],
            ";",
        ),
        bare,
        answers=ZONE,
        must_ask=("tz",),
    )
    table_control = [["Date/Time", *bracketed(table("PT101 TT102"))]] + [
        [day(k), *(c.values[k].replace(".", ",") for c in t.columns)] for k in t.rows
    ]
    plain = table("PT101 TT102", step="1")
    family.add("table_control", "clean", lines(table_control, ";"), plain.truth(), answers=ZONE, must_ask=("tz",))
    bad = marked(table("PT101 TT102", step="1"), {(4, 0), (8, 1)})
    archive = [["Timestamp", "Variable", "Value", "Quality"]] + [
        [stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=3), c.name, c.values[k], "128" if c.qualities[k] else "0"]
        for k in bad.rows
        for c in bad.columns
    ]
    family.add(
        "tag_logging_quality_128",
        "nasty",
        lines(archive),
        bad.truth(units=["", ""]),
        answers={"tz": "UTC", "quality_scheme": "fieldbus"},
        must_ask=("tz",),
    )
    return family.variants


def stamp_days(t, k):
    """Serial days of a spreadsheet, in the zone of Berlin in winter."""
    return 46083 + (9.25 * 3600 + float(t.instants[k])) / 86400


def twincat():
    family = Family("beckhoff_twincat_scope")
    t = table("PT101 SC104", step="0.002", titles=("MAIN.fPressure", "MAIN.fSpeed"))
    bare = t.truth(False, units=["", ""])
    filetime = (t.milliseconds(0) + 11644473600000) * 10000
    top = [
        ["Name", "Scope Project"],
        ["File", "C:\\Scope\\run.svdx"],
        ["Starttime of export", str(filetime), "Monday, 2 March 2026"],
        ["Endtime of export", str(filetime + 380000), "Monday, 2 March 2026"],
        [""],
    ]
    facts = [
        ["Name", "MAIN.fPressure", "Name", "MAIN.fSpeed"],
        ["SymbolComment", "", "SymbolComment", ""],
        ["Data-Type", "REAL64", "Data-Type", "REAL64"],
        ["SampleTime[ms]", "2", "SampleTime[ms]", "2"],
        ["VariableSize", "8", "VariableSize", "8"],
        ["Unit", "bar", "Unit", "rpm"],
        [""],
    ]
    body = [[cell for c in t.columns for cell in (str(2 * k), c.values[k])] for k in t.rows]
    for name, separator, mark in (("tabs", "\t", "."), ("semicolons_commas", ";", ",")):
        text = lines(top + facts + [[c.replace(".", mark) for c in row] for row in body], separator, "\r\n")
        family.add(f"full_head_{name}", "nasty", text, t.truth())
    short = [["Name", "MAIN.fPressure", "MAIN.fSpeed"]] + [
        [str(2 * k), *(c.values[k] for c in t.columns)] for k in t.rows
    ]
    family.add("one_time_column", "typical", lines(short, ";"), bare, answers={"time_unit": "ms"})
    family.add("milliseconds", "clean", lines([["Time [ms]", *names_of(t)]] + short[1:], ";"), bare)
    ticks = [["Time", *names_of(t)]] + [
        [str(filetime + 20000 * k), *(c.values[k] for c in t.columns)] for k in t.rows
    ]
    family.add("filetime", "nasty", lines(ticks, ";"), t.truth(units=["", ""]), answers={"time_unit": "filetime"})
    return family.variants


def rockwell():
    trend, view = Family("rockwell_studio_trend"), Family("factorytalk_view_datalog")
    t = table("PT101 TT102", step="0.5", titles=("PT101.Val", "TT102.Val"))
    bare = t.truth(units=["", ""])
    mdy = {"tz": "America/New_York", "time_unit": "mdy"}
    head = [
        ["Controller Name:", "Line1"],
        ["Trend Name:", "Pump"],
        ["Trend Tags:", "2"],
        ["PT101.Val"],
        ["TT102.Val"],
        ["Sample Period:", "500 ms"],
        ["Description:", ""],
        [""],
    ]
    rows = [
        [
            "Data",
            stamp(t.clock(k), "%m/%d/%Y", NEW_YORK),
            stamp(t.clock(k), "%H:%M:%S;%f", NEW_YORK, 3),
            *(c.values[k] for c in t.columns),
        ]
        for k in t.rows
    ]
    titles = [["Header:", "Date", "Time", *names_of(t)]]
    answers = {**mdy, "time": "Date", "header_row": "9", "ignore": "Header:"}
    trend.add("full", "nasty", lines(head + titles + rows), bare, answers=answers, must_ask=("tz",))
    trend.add(
        "titles_and_rows",
        "typical",
        lines(titles + rows),
        bare,
        answers={**answers, "header_row": "1"},
        must_ask=("tz",),
    )
    plain = [["Date", "Time", *names_of(t)]] + [[row[1], row[2].replace(";", "."), *row[3:]] for row in rows]
    trend.add("date_time_point", "clean", lines(plain), bare, answers=mdy, must_ask=("tz",))
    float_log = [["Date", "Time", "Millitm", "TagIndex", "Value", "Status", "Marker"]]
    rows = [
        [
            stamp(t.clock(k), "%m/%d/%Y", NEW_YORK),
            stamp(t.clock(k), "%H:%M:%S", NEW_YORK),
            stamp(t.clock(k), "%f", digits=3),
            str(p),
            c.values[k],
            "",
            "B" if k == 0 else "",
        ]
        for k in t.rows
        for p, c in enumerate(t.columns)
    ]
    indexed = t.truth(units=["", ""], names=["0", "1"])
    view.add(
        "tag_index",
        "nasty",
        lines(float_log + rows),
        indexed,
        answers={**mdy, "tag": "TagIndex", "value": "Value", "quality": "none"},
        must_ask=("tz",),
    )
    named = [["Date", "Time", "Millitm", "Tagname", "Value", "Status", "Marker"]] + [
        [*r[:3], t.columns[int(r[3])].name, *r[4:]] for r in rows
    ]
    view.add("tag_name", "typical", lines(named), bare, answers={**mdy, "quality": "none"}, must_ask=("tz",))
    semicolons = lines([[cell for cell in row] for row in named], ";", quote=True)
    view.add("quoted_semicolons", "typical", semicolons, bare, answers={**mdy, "quality": "none"}, must_ask=("tz",))
    excel = [["Timestamp", *names_of(t)]] + [
        [stamp(t.clock(k), "%-m/%-d/%Y %-I:%M:%S.%f %p", NEW_YORK, 3), *(c.values[k] for c in t.columns)]
        for k in t.rows
    ]
    view.add("trend_export", "clean", lines(excel), bare, answers=mdy, must_ask=("tz",))
    status = marked(table("PT101 TT102", step="0.5", titles=("PT101.Val", "TT102.Val")), {(3, 0), (6, 1)})
    rows = [
        [
            stamp(t.clock(k), "%m/%d/%Y", NEW_YORK),
            stamp(t.clock(k), "%H:%M:%S", NEW_YORK),
            stamp(t.clock(k), "%f", digits=3),
            c.name,
            c.values[k] if c.qualities[k] else "0",
            "" if c.qualities[k] else "E",
            "",
        ]
        for k in t.rows
        for c in status.columns
    ]
    view.add(
        "error_status",
        "nasty",
        lines([named[0], *rows]),
        status.truth(units=["", ""]),
        answers={**mdy, "quality_scheme": "factorytalk"},
        must_ask=("tz",),
    )
    return trend.variants + view.variants


def codesys():
    family = Family("codesys_trace")
    t = table("PT101 SC104", step="0.01", titles=("PLC_PRG.rPressure", "PLC_PRG.rSpeed"))
    bare = t.truth(False, units=["", ""])
    body = [[str(10000 * k), *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add("microseconds_named", "clean", lines([["Time [us]", *names_of(t)]] + body, ";"), bare)
    family.add(
        "time_alone",
        "typical",
        lines([["time", *names_of(t)]] + body, ";"),
        bare,
        answers={"time_unit": "us"},
        must_ask=("time_unit",),
    )
    pairs = pairs_of(t, lambda k: f"{10 * k}", lambda c: (f"{c.name} Time [ms]", c.name))
    family.add("time_for_each", "typical", lines(pairs, ";"), bare)
    literals = [["Time", *names_of(t)]] + [
        [f"T#{10 * k}ms" if k < 100 else "", *(c.values[k] for c in t.columns)] for k in t.rows
    ]
    family.add("time_literals", "nasty", lines(literals, ";"), bare)
    return family.variants


def asian_controllers():
    omron, mitsubishi, keyence = Family("omron_sysmac"), Family("mitsubishi_logging"), Family("keyence_logging")
    t = table("PT101 SC104", step="0.1")
    bare = t.truth(False, units=["", ""])
    rows = [[str(k), f"{100000 * k}", *(c.values[k] for c in t.columns)] for k in t.rows]
    omron.add(
        "data_trace",
        "typical",
        lines([["Index", "Time(us)", *names_of(t)]] + rows),
        bare,
        answers={"time": "Time(us)", "ignore": "Index"},
        harmless=("Index",),
    )
    omron.add(
        "trace_head",
        "nasty",
        lines(
            [
                ["Data Trace"],
                ["Version", "1.0"],
                ["Sampling interval", "100 ms"],
                [""],
                ["Index", "Time(us)", *names_of(t)],
            ]
            + rows
        ),
        bare,
        answers={"header_row": "5", "time": "Time(us)", "ignore": "Index"},
        harmless=("Index",),
    )
    omron.add("microseconds", "clean", lines([["Time[us]", *names_of(t)]] + [row[1:] for row in rows]), bare)
    slow = table("PT101 SC104", step="1")
    tokyo = {"tz": "Asia/Tokyo"}
    logged = [
        ["DATETIME", "INDEX", *names_of(slow)],
        ["[LOGGING]", "RD81DL96_1", "2", "3"],
        ["DATETIME[YYYY/MM/DD hh:mm:ss]", "INDEX", "FLOAT[3]", "FLOAT[1]"],
    ]
    body = [
        [stamp(slow.clock(k), "%Y/%m/%d %H:%M:%S", TOKYO), str(k + 1), *(c.values[k] for c in slow.columns)]
        for k in slow.rows
    ]
    both = slow.truth(units=["", ""])
    mitsubishi.add(
        "three_head_lines",
        "nasty",
        lines([logged[1], logged[2], ["TIME", "INDEX", *names_of(slow)]] + body),
        both,
        answers={**tokyo, "header_row": "3", "ignore": "INDEX", "unit_row": "none"},
        must_ask=("tz",),
        harmless=("INDEX",),
    )
    mitsubishi.add(
        "plain",
        "clean",
        lines([["TIME", *names_of(slow)]] + [[r[0], *r[2:]] for r in body]),
        both,
        answers=tokyo,
        must_ask=("tz",),
    )
    mitsubishi.add(
        "with_index",
        "typical",
        lines([["TIME", "INDEX", *names_of(slow)]] + body),
        both,
        answers={**tokyo, "ignore": "INDEX"},
        must_ask=("tz",),
        harmless=("INDEX",),
        encoding="cp932",
    )
    apart = [["No.", "Year", "Month", "Day", "Hour", "Min", "Sec", *names_of(slow)]] + [
        [
            str(k + 1),
            *stamp(slow.clock(k), "%Y-%m-%d-%H-%M-%S", TOKYO).split("-"),
            *(c.values[k] for c in slow.columns),
        ]
        for k in slow.rows
    ]
    keyence.add("six_time_columns", "nasty", lines(apart), both, answers={**tokyo, "ignore": "No."}, must_ask=("tz",))
    keyence.add(
        "date_and_time",
        "typical",
        lines(
            [["No.", "Date", "Time", *names_of(slow)]]
            + [
                [
                    str(k + 1),
                    stamp(slow.clock(k), "%Y/%m/%d", TOKYO),
                    stamp(slow.clock(k), "%H:%M:%S", TOKYO),
                    *(c.values[k] for c in slow.columns),
                ]
                for k in slow.rows
            ]
        ),
        both,
        answers={**tokyo, "time": "Date", "ignore": "No."},
        must_ask=("tz",),
        harmless=("No.",),
    )
    compact = lambda k: stamp(slow.clock(k), "%Y%m%d%H%M%S", TOKYO)
    keyence.add(
        "digits_alone",
        "nasty",
        wide(slow, compact, names_of(slow), time_title="DateTime"),
        both,
        answers=tokyo,
        must_ask=("tz",),
    )
    return omron.variants + mitsubishi.variants + keyence.variants


def variants():
    return tia_portal() + wincc() + twincat() + rockwell() + codesys() + asian_controllers()
