"""Tables of data loggers and of programs for test benches."""

from payloads import BERLIN, NEW_YORK, TOKYO, Family, bracketed, lines, names_of, number, stamp, table


def rows_of(t, time, mark=".", missing=""):
    return [
        [
            *([time(k)] if isinstance(time(k), str) else time(k)),
            *(number(c.values[k], mark, missing) for c in t.columns),
        ]
        for k in t.rows
    ]


def labview():
    family = Family("labview_text", "text/plain")
    t = table(step="0.1")
    titled = [["Time (s)", *bracketed(t, "{name} ({unit})")]] + rows_of(t, lambda k: t.seconds(k, 6))
    family.add("tabs", "clean", lines(titled, "\t", "\r\n"), t.truth(False))
    family.add(
        "comma_marks",
        "typical",
        lines(
            [["Zeit [s]", *bracketed(t)]] + rows_of(t, lambda k: t.seconds(k, 6).replace(".", ","), ","), "\t", "\r\n"
        ),
        t.truth(False),
    )
    bare = rows_of(t, lambda k: t.seconds(k, 3))
    family.add(
        "no_titles",
        "nasty",
        lines(bare, "\t", "\r\n"),
        t.truth(False, units=["", "", ""], names=["column_2", "column_3", "column_4"]),
        answers={"header_row": "none", "time_unit": "s"},
    )
    since = lambda k: f"{t.milliseconds(k) / 1000 + 2082844800:.3f}"
    truth = t.truth()
    truth.tolerance = 1e-5
    family.add(
        "seconds_since_1904",
        "nasty",
        lines([["Timestamp", *bracketed(t)]] + rows_of(t, since), "\t", "\r\n"),
        truth,
        answers={"time_unit": "labview", "tz": "UTC"},
    )
    day = lambda k: stamp(t.clock(k), "%m/%d/%Y %I:%M:%S.%f %p", NEW_YORK, 3)
    family.add(
        "get_date_string",
        "typical",
        lines([["Timestamp", *bracketed(t)]] + rows_of(t, day), "\t", "\r\n"),
        t.truth(),
        answers={"tz": "America/New_York", "time_unit": "mdy"},
        must_ask=("tz",),
    )
    gaps = table(step="0.1", missing=((4, 1),))
    family.add(
        "not_a_number",
        "typical",
        lines(
            [["Time (s)", *bracketed(gaps, "{name} ({unit})")]]
            + rows_of(gaps, lambda k: gaps.seconds(k), missing="NaN"),
            "\t",
            "\r\n",
        ),
        gaps.truth(False),
    )
    return family.variants


def lvm_head(separator, mark, headers=True):
    pairs = [
        ("LabVIEW Measurement", ""),
        ("Writer_Version", "2"),
        ("Reader_Version", "2"),
        ("Separator", "Tab" if separator == "\t" else "Comma"),
        ("Decimal_Separator", mark),
        ("Multi_Headings", "No"),
        ("X_Columns", "One"),
        ("Time_Pref", "Absolute"),
        ("Operator", "lab"),
        ("Date", "2026/03/02"),
        ("Time", f"08:15:00{mark}0000000"),
        ("***End_of_Header***", ""),
    ]
    return [list(pair) for pair in pairs]


def lvm():
    family = Family("labview_lvm", "text/plain")
    t = table("PT101 TT102", step="0.01")

    def block(separator, mark, x=lambda k: k, is_last_comment=True):
        count = str(len(t.instants))
        head = lvm_head(separator, mark) + [[""]]
        segment = [
            ["Channels", "2", ""],
            ["Samples", count, count],
            ["Date", "2026/03/02", "2026/03/02"],
            ["Time", f"08:15:00{mark}0", f"08:15:00{mark}0"],
            ["Y_Unit_Label", "bar", "degC"],
            ["X_Dimension", "Time", "Time"],
            ["X0", f"0{mark}0", f"0{mark}0"],
            ["Delta_X", f"0{mark}01", f"0{mark}01"],
            ["***End_of_Header***", "", ""],
            ["X_Value", "PT101", "TT102", "Comment"],
        ]
        body = [
            [f"{k / 100:.6f}".replace(".", mark), *(number(c.values[k], mark) for c in t.columns)] for k in t.rows
        ]
        return lines(head + segment + body, separator, "\r\n")

    family.add("one_x_column", "clean", block("\t", "."), t.truth(), answers={"tz": "UTC", "header_row": "23"})
    family.add("comma_marks", "typical", block("\t", ","), t.truth(), answers={"tz": "UTC", "header_row": "23"})
    family.add("commas", "typical", block(",", "."), t.truth(), answers={"tz": "UTC", "header_row": "23"})
    plain = [["X_Value", "PT101", "TT102", "Comment"]] + [
        [f"{k / 100:.6f}", *(c.values[k] for c in t.columns), ""] for k in t.rows
    ]
    family.add(
        "header_cut_off",
        "nasty",
        lines(plain, "\t", "\r\n"),
        t.truth(False, units=["", ""]),
        answers={"time_unit": "s", "units": "PT101:,TT102:"},
        harmless=("Comment",),
    )
    return family.variants


def diadem():
    family = Family("ni_tdms_export")
    t = table(step="0.02")
    head = [["Time", *names_of(t)], ["s", *(c.unit for c in t.columns)]]
    body = rows_of(t, lambda k: t.seconds(k, 6))
    family.add("names_and_units", "clean", lines(head + body, ";"), t.truth(False), answers={"unit_row": "2"})
    grouped = [[f"Measurement/{name}" for name in ("Time", *names_of(t))], head[1]]
    family.add("group_paths", "typical", lines(grouped + body, "\t"), t.truth(False), answers={"unit_row": "2"})
    top = [["Root name", "rig_7"], ["Title", ""], ["Author", "lab"], ["Group name", "Measurement"], [""]]
    family.add(
        "properties_on_top",
        "typical",
        lines(top + head + body),
        t.truth(False),
        answers={"header_row": "6", "unit_row": "7"},
    )
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S.%f", BERLIN, 4)
    family.add(
        "absolute_time",
        "typical",
        lines([["Time", *names_of(t)], ["", *(c.unit for c in t.columns)]] + rows_of(t, day, ","), ";"),
        t.truth(),
        answers={"tz": "Europe/Berlin"},
        must_ask=("tz",),
    )
    noval = table(step="0.02", missing=((5, 0), (6, 0)))
    family.add(
        "novalue",
        "nasty",
        lines(
            [["Time", *names_of(noval)], head[1]] + rows_of(noval, lambda k: noval.seconds(k, 6), missing="NOVALUE"),
            ";",
        ),
        noval.truth(False),
        answers={"missing": "NOVALUE"},
    )
    return family.variants


def campbell():
    family = Family("campbell_toa5")
    t = table("PT101 TT102 ET108", step="60", missing=((4, 1),), units=("mbar", "Deg C", "volts"))
    clock = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S")

    def dat(missing, digits=None, names=None):
        top = [
            ["TOA5", "station", "CR1000X", "12345", "CR1000X.Std.05.01", "CPU:prog.CR1X", "4711", "OneMin"],
            ["TIMESTAMP", "RECORD", *(names or names_of(t))],
            ["TS", "RN", *(c.unit for c in t.columns)],
            ["", "", "Avg", "Avg", "Smp"],
        ]
        quoted = lines(top, quote=True, end="\r\n")
        body = "".join(
            f'"{clock(k)}",{k + 17},' + ",".join(number(c.values[k], ".", missing) for c in t.columns) + "\r\n"
            for k in t.rows
        )
        return quoted + body

    answers = {"tz": "UTC", "missing": "NAN", "header_row": "2", "unit_row": "3", "ignore": "RECORD"}
    family.add("standard", "clean", dat('"NAN"'), t.truth(), answers=answers, harmless=("RECORD",), must_ask=("tz",))
    family.add(
        "array_names",
        "typical",
        dat('"NAN"', names=["BP_Avg", "T_Avg(1)", "Batt_V(2)"]),
        t.truth(names=["BP_Avg", "T_Avg(1)", "Batt_V(2)"]),
        answers=answers,
        harmless=("RECORD",),
        must_ask=("tz",),
    )
    family.add(
        "loggernet_code",
        "nasty",
        dat("-7999"),
        t.truth(),
        answers={**answers, "missing": "-7999"},
        harmless=("RECORD",),
        must_ask=("tz", "missing"),
    )
    family.add("plain_nan", "typical", dat("NAN"), t.truth(), answers=answers, harmless=("RECORD",), must_ask=("tz",))
    return family.variants


def hioki():
    family = Family("hioki_logger")
    t = table("PT101 TT102", step="0.5", titles=("CH1-1", "CH1-2"), units=("V", "°C"))
    top = [["HIOKI 8430/8431", "1.20"], ["Title", "rig"], ["Trigger Time", "'26-03-02 17:15:00"], [""]]
    head = [["Time", "CH1-1[V]", "CH1-2[°C]"]]
    clock = lambda k: stamp(t.clock(k), "'%y-%m-%d %H:%M:%S.%f", TOKYO, 1)
    answers = {"tz": "Asia/Tokyo", "header_row": "5", "encoding": "windows-1252"}
    family.add(
        "date",
        "typical",
        lines(top + head + rows_of(t, clock), quote=True, end="\r\n"),
        t.truth(),
        answers=answers,
        must_ask=("tz",),
        encoding="cp1252",
    )
    slashes = lambda k: stamp(t.clock(k), "%Y/%m/%d %H:%M:%S.%f", TOKYO, 1)
    family.add(
        "date_full",
        "typical",
        lines(head + rows_of(t, slashes), end="\r\n"),
        t.truth(),
        answers=answers,
        must_ask=("tz",),
    )
    signed = [[f"{k * 0.5:+.9E}", *(f"{float(c.values[k]):+.5E}" for c in t.columns)] for k in t.rows]
    truth = table("PT101 TT102", step="0.5", titles=("CH1-1", "CH1-2"), units=("V", "°C"))
    for column in truth.columns:
        column.values = [f"{float(v):.5e}" for v in column.values]
    family.add(
        "exponents", "clean", lines([["Time[s]", "CH1-1[V]", "CH1-2[°C]"]] + signed, end="\r\n"), truth.truth(False)
    )
    over = table("PT101 TT102", step="0.5", titles=("CH1-1", "CH1-2"), units=("V", "°C"), missing=((3, 1), (4, 1)))
    for word in ("OVER", "+OVER", "BURNOUT"):
        family.add(
            f"range_{word}",
            "nasty",
            lines(
                [["Time[s]", "CH1-1[V]", "CH1-2[°C]"]] + rows_of(over, lambda k: over.seconds(k, 1), missing=word),
                end="\r\n",
            ),
            over.truth(False),
            answers={"missing": word},
        )
    return family.variants


def graphtec():
    family = Family("graphtec_gl")
    t = table("TT102 PT101", step="1", units=("degC", "V"), titles=("CH1", "CH2"))
    top = [
        ["Vendor", "GRAPHTEC Corporation"],
        ["Model", "GL840"],
        ["Sampling interval", "1s"],
        ["Total data points", "20"],
        ["Start time", "2026/03/02", "17:15:00"],
        ["AMP settings"],
        ["CH", "Signal name", "Input", "Range"],
        ["CH1", "Pipe", "TEMP", "TC_K"],
        ["CH2", "Feed", "DC", "10V"],
        ["Data"],
    ]
    head = [["Number", "Date&Time", "ms", "CH1", "CH2"], ["NO.", "Time", "ms", "degC", "V"]]

    def body(t, missing=""):
        return [
            [
                str(k + 1),
                stamp(t.clock(k), "%Y/%m/%d %H:%M:%S", TOKYO),
                "0",
                *(f"{number(c.values[k], '.', missing)}" for c in t.columns),
            ]
            for k in t.rows
        ]

    answers = {"tz": "Asia/Tokyo", "time": "Date&Time", "header_row": "11", "unit_row": "12", "units": "Number:1"}
    family.add(
        "gl840",
        "typical",
        lines(top + head + body(t), end="\r\n"),
        t.truth(),
        answers=answers,
        must_ask=("tz",),
        harmless=("Number", "NO.", "ms"),
    )
    signed = [row[:3] + [f"+ {cell}" for cell in row[3:]] for row in body(t)]
    family.add(
        "signs_apart",
        "nasty",
        lines(top + head + signed, end="\r\n"),
        t.truth(),
        answers=answers,
        must_ask=("tz",),
        harmless=("Number", "NO.", "ms"),
    )
    open_wire = table("TT102 PT101", step="1", units=("degC", "V"), titles=("CH1", "CH2"), missing=((2, 0), (3, 0)))
    family.add(
        "burnout",
        "nasty",
        lines(top + head + body(open_wire, "BURNOUT"), end="\r\n"),
        open_wire.truth(),
        answers={**answers, "missing": "BURNOUT"},
        must_ask=("tz",),
        harmless=("Number", "NO.", "ms"),
    )
    family.add(
        "head_cut_off",
        "clean",
        lines(head + body(t), end="\r\n"),
        t.truth(),
        answers={**answers, "header_row": "1", "unit_row": "2"},
        must_ask=("tz",),
        harmless=("Number", "NO.", "ms"),
    )
    return family.variants


def onset():
    family = Family("onset_hobo")
    t = table("TT102 XV107", step="300", units=("°C", "%"), titles=("Temp", "RH"))
    title = ["Plot Title: Hall 3"]
    head = [
        "#",
        "Date Time, GMT+01:00",
        "Temp, °C (LGR S/N: 20471234, SEN S/N: 20471234)",
        "RH, % (LGR S/N: 20471234, SEN S/N: 20471234)",
        "Coupler Detached (LGR S/N: 20471234)",
    ]
    body = [
        [
            str(k + 1),
            stamp(t.clock(k), "%m/%d/%y %I:%M:%S %p", BERLIN),
            *(c.values[k] for c in t.columns),
            "Logged" if k == 19 else "",
        ]
        for k in t.rows
    ]
    answers = {
        "tz": "Europe/Berlin",
        "time": "Date Time, GMT+01:00",
        "time_unit": "mdy",
        "header_row": "2",
        "units": "Temp:°C,RH:%",
    }
    family.add(
        "hoboware",
        "typical",
        "\ufeff" + lines([title, head, *body]),
        t.truth(),
        answers=answers,
        harmless=("#", "Coupler.*"),
    )
    family.add(
        "without_title",
        "typical",
        lines([head, *body]),
        t.truth(),
        answers={**answers, "header_row": "1"},
        harmless=("#", "Coupler.*"),
    )
    new = ["#", "Date-Time (CET)", "Temperature (°C) ", "RH (%) "]
    body = [
        [str(k + 1), stamp(t.clock(k), "%m/%d/%Y %H:%M:%S", BERLIN), *(c.values[k] for c in t.columns)]
        for k in t.rows
    ]
    family.add(
        "hoboconnect",
        "typical",
        lines([new, *body]),
        t.truth(names=["Temperature", "RH"]),
        answers={"tz": "Europe/Berlin", "time": "Date-Time (CET)", "time_unit": "mdy"},
        harmless=("#",),
        must_ask=("tz",),
    )
    return family.variants


def benchlink():
    family = Family("keysight_benchlink")
    t = table("PT101 TT102", step="2", units=("V", "C"), titles=("101", "102"))
    top = [["Scan Sweep Time (Sec): 0.5"], [""]]
    head = [["Scan", "Time", "101 (VDC)", "102 (C)"]]
    body = [
        [str(k + 1), stamp(t.clock(k), "%m/%d/%Y %H:%M:%S:%f", NEW_YORK, 3), *(c.values[k] for c in t.columns)]
        for k in t.rows
    ]
    answers = {"tz": "America/New_York", "time": "Time", "time_unit": "mdy", "units": "101 (VDC):V", "ignore": "Scan"}
    family.add(
        "colon_before_milliseconds",
        "nasty",
        lines(head + body, "\t", "\r\n"),
        t.truth(),
        answers=answers,
        must_ask=("tz",),
        harmless=("Scan",),
        encoding="utf-16",
    )
    family.add(
        "with_head",
        "nasty",
        lines(top + head + body, ",", "\r\n"),
        t.truth(),
        answers={**answers, "header_row": "3"},
        must_ask=("tz",),
        harmless=("Scan",),
    )
    seconds = [[str(k + 1), f"{2 * k}.0", *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add(
        "seconds",
        "typical",
        lines([["Scan", "Time (s)", "101 (V)", "102 (C)"]] + seconds),
        t.truth(False),
        answers={"time": "Time (s)", "ignore": "Scan"},
        harmless=("Scan",),
    )
    return family.variants


def variants():
    return labview() + lvm() + diadem() + campbell() + hioki() + graphtec() + onset() + benchlink()
