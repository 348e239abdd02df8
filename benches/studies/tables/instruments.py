"""Tables of oscilloscopes, recorders and programs for measurements of vehicles and test benches."""

from payloads import BERLIN, TOKYO, Family, bracketed, lines, names_of, number, stamp, table


def centred(t):
    """The truth of a scope's table: its trigger is at zero and stands in the middle."""
    return t.truth(False)


def tektronix():
    family = Family("tektronix_scope")
    t = table("ET108 IT109", step="0.0001", rows=24, titles=("CH1", "CH2"), units=("V", "V"))
    lone = table("ET108", step="0.0001", rows=24, titles=("CH1",), units=("V",))
    x = lambda k: f"{k * 1e-4 - 1e-3:.6e}"
    top = [
        ["Model", "MSO44"],
        ["Firmware Version", "1.28.3"],
        [""],
        ["Waveform Type", "ANALOG"],
        ["Point Format", "Y"],
        ["Horizontal Units", "s"],
        ["Horizontal Scale", "0.0004"],
        ["Sample Interval", "0.0001"],
        ["Record Length", "24"],
        ["Vertical Units", "V", "V"],
        ["Label", "", ""],
    ]
    body = [[x(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    answers = {"header_row": "12", "time_unit": "s", "units": "CH1:V,CH2:V"}
    family.add("mso_series", "typical", lines(top + [["TIME", "CH1", "CH2"]] + body), centred(t), answers=answers)
    family.add(
        "mso_tek_mark",
        "typical",
        lines([["Model", "MSO58"], ["Vertical Units", "V", "V"], [""], ["TIME", "CH1", "CH2"]] + body),
        centred(t),
        answers={**answers, "header_row": "4"},
    )
    facts = [
        ["Record Length", "2.400000e+01"],
        ["Sample Interval", "1.000000e-04"],
        ["Trigger Point", "1.000000e+01"],
        ["", ""],
        ["", ""],
        ["", ""],
        ["Source", "CH1"],
        ["Vertical Units", "V"],
        ["Vertical Scale", "1.000000e+00"],
        ["Vertical Offset", "0.000000e+00"],
        ["Horizontal Units", "s"],
        ["Horizontal Scale", "2.500000e-04"],
        ["Pt Fmt", "Y"],
        ["Yzero", "0"],
        ["Probe Atten", "1.000000e+00"],
        ["Model Number", "TDS2024B"],
        ["Serial Number", "C012345"],
        ["Firmware Version", "FV:v22.01"],
    ]
    beside = [
        (facts[k] if k < len(facts) else ["", ""]) + ["", f"{k * 1e-4 - 1e-3:014.12f}", lone.columns[0].values[k], ""]
        for k in lone.rows
    ]
    family.add(
        "tds_facts_beside",
        "nasty",
        lines(beside),
        centred(lone),
        answers={
            "header_row": "none",
            "time": "column_4",
            "time_unit": "s",
            "units": "column_5:V",
            "rename": "column_5:CH1",
            "ignore": "column_1,column_2,column_3,column_6",
        },
    )
    family.add(
        "tbs_short",
        "clean",
        lines([["TIME", "CH1", "CH2"]] + body),
        t.truth(False, units=["", ""]),
        answers={"time_unit": "s"},
    )
    return family.variants


def keysight():
    family = Family("keysight_scope")
    t = table("ET108 IT109", step="0.0001", rows=24, titles=("1", "2"), units=("V", "V"))
    body = [[f"{k * 1e-4 - 1e-3:.6E}", *(f"{float(c.values[k]):+.4E}" for c in t.columns)] for k in t.rows]
    truth = table("ET108 IT109", step="0.0001", rows=24, titles=("1", "2"), units=("V", "V"))
    for column in truth.columns:
        column.values = [f"{float(v):.4e}" for v in column.values]
    family.add(
        "infiniivision",
        "typical",
        lines([["x-axis", "1", "2"], ["second", "Volt", "Volt"]] + body, end="\r\n"),
        truth.truth(False),
        answers={"unit_row": "2"},
    )
    family.add(
        "infiniivision_short",
        "clean",
        lines([["x-axis", "1"], ["second", "Volt"]] + [r[:2] for r in body]),
        table_of(truth, 1).truth(False),
        answers={"unit_row": "2"},
    )
    top = [
        ["Type", "raw"],
        ["Points", "24"],
        ["Count", "1"],
        ["XInc", "1.0000E-04"],
        ["XOrg", "-1.0E-03"],
        ["YUnits", "Volt", "Volt"],
        ["XUnits", "second"],
    ]
    family.add(
        "infiniium_head",
        "nasty",
        lines(top + [["Time", "1", "2"]] + body),
        truth.truth(False),
        answers={"header_row": "8", "time_unit": "s", "units": "1:V,2:V"},
    )
    return family.variants


def table_of(t, count):
    from dataclasses import replace

    return replace(t, columns=t.columns[:count])


def rigol():
    family = Family("rigol_scope")
    t = table("ET108 IT109", step="0.0001", rows=24, titles=("CH1", "CH2"), units=("V", "V"))
    values = lambda k: [f"{float(c.values[k]):.4e}" for c in t.columns]
    for column in t.columns:
        column.values = [f"{float(v):.4e}" for v in column.values]
    counter = [
        ["X", "CH1", "CH2", "Start", "Increment"],
        ["Sequence", "Volt", "Volt", "-1.000000e-03", "1.000000e-04"],
    ]
    family.add(
        "ds1000z_sequence",
        "typical",
        lines(counter + [[str(k), *values(k), "", ""] for k in t.rows]),
        t.truth(False),
        answers={"time_unit": "0.1ms", "unit_row": "2", "header_row": "1", "ignore": "Start,Increment"},
        harmless=("Start", "Increment"),
    )
    seconds = [[f"{k * 1e-4 - 1e-3:.6e}", *values(k), ""] for k in t.rows]
    family.add(
        "ds1000e",
        "clean",
        lines([["X", "CH1", "CH2", ""], ["Second", "Volt", "Volt", ""]] + seconds),
        t.truth(False),
        answers={"unit_row": "2"},
    )
    family.add(
        "mso5000", "typical", lines([["Time(s)", "CH1(V)", "CH2(V)"]] + [r[:3] for r in seconds]), t.truth(False)
    )
    family.add(
        "mso5000_t0",
        "nasty",
        lines(
            [["CH1V", "CH2V", "t0 =-1.000000e-03", "tInc = 1.000000e-04"]] + [[*values(k), "", ""] for k in t.rows]
        ),
        t.truth(False, names=["CH1V", "CH2V"]),
        answers={"time_unit": "0.1ms"},
    )
    family.add(
        "two_semicolons",
        "typical",
        lines([["Time(s)", "CH1(V)", "CH2(V)"]] + [[c.replace(".", ",") for c in r[:3]] for r in seconds], ";"),
        t.truth(False),
    )
    return family.variants


def picoscope():
    family = Family("picoscope")
    t = table("ET108 IT109", step="0.001", rows=24, titles=("Channel A", "Channel B"), units=("V", "mV"))
    head = [["Time", "Channel A", "Channel B"], ["(ms)", "(V)", "(mV)"], [""]]
    body = [[f"{k:.8f}", *(f"{float(c.values[k]):.8f}" for c in t.columns)] for k in t.rows]
    family.add("milliseconds", "clean", lines(head + body, end="\r\n"), t.truth(False), answers={"unit_row": "2"})
    family.add(
        "comma_marks",
        "typical",
        lines(head + [[c.replace(".", ",") for c in r] for r in body], ";", "\r\n"),
        t.truth(False),
        answers={"unit_row": "2"},
    )
    micro = [[f"{k * 1000 - 4000:.3f}", *r[1:]] for k, r in zip(t.rows, body)]
    family.add(
        "microseconds",
        "typical",
        lines([head[0], ["(µs)", "(V)", "(mV)"], [""]] + micro, end="\r\n"),
        t.truth(False),
        answers={"unit_row": "2"},
    )
    over = table(
        "ET108 IT109",
        step="0.001",
        rows=24,
        titles=("Channel A", "Channel B"),
        units=("V", "mV"),
        missing=((5, 0), (6, 0)),
    )
    clipped = [[f"{k:.4f}", *(number(c.values[k], ".", "∞") for c in over.columns)] for k in over.rows]
    family.add(
        "over_range",
        "nasty",
        lines(head + clipped, end="\r\n"),
        over.truth(False),
        answers={"missing": "∞", "unit_row": "2"},
    )
    return family.variants


def yokogawa():
    family = Family("yokogawa")
    t = table("PT101 TT102", step="1", units=("V", "°C"), titles=("CH0001", "CH0002"))
    body = lambda t, missing="": [
        [
            stamp(t.clock(k), "%Y/%m/%d", TOKYO),
            stamp(t.clock(k), "%H:%M:%S", TOKYO),
            "0",
            *(number(c.values[k], ".", missing) for c in t.columns),
        ]
        for k in t.rows
    ]
    top = [
        ["Device", "GX20"],
        ["Serial No.", "S5T123456"],
        ["Sampling Interval", "1.000 s"],
        ["Start Time", "2026/03/02 17:15:00"],
        [""],
        ["Channel", "", "", "CH0001", "CH0002"],
        ["Tag", "", "", "Feed", "Outlet"],
        ["Unit", "", "", "V", "°C"],
        ["Date", "Time", "msec", "", ""],
    ]
    answers = {"tz": "Asia/Tokyo", "header_row": "6", "unit_row": "8"}
    family.add(
        "gx20_standard", "nasty", lines(top + body(t), end="\r\n"), t.truth(), answers=answers, must_ask=("tz",)
    )
    simple = [["Date", "Time", "ms", "CH0001[V]", "CH0002[°C]"]]
    family.add(
        "ga10",
        "typical",
        lines(simple + body(t), end="\r\n"),
        t.truth(),
        answers={"tz": "Asia/Tokyo"},
        must_ask=("tz",),
    )
    over = table("PT101 TT102", step="1", units=("V", "°C"), titles=("CH0001", "CH0002"), missing=((3, 1), (9, 0)))
    for word in ("+OVER", "-OVER", "BURNOUT", "ERROR"):
        family.add(
            f"ga10_{word}",
            "nasty",
            lines(simple + body(over, word), end="\r\n"),
            over.truth(),
            answers={"tz": "Asia/Tokyo", "missing": word},
            must_ask=("tz",),
        )
    scope = table("ET108 IT109", step="0.001", titles=("CH1", "CH2"), units=("V", "A"))
    facts = [
        ['"Model Name"', '"DL850E"'],
        ['"BlockNumber"', "1"],
        ['"TraceName"', '"CH1"', '"CH2"'],
        ['"BlockSize"', "20", "20"],
        ['"VUnit"', '"V"', '"A"'],
        ['"SampleRate"', "1.0E+03", "1.0E+03"],
        ['"HResolution"', "1.0E-03", "1.0E-03"],
        ['"HOffset"', "0.0E+00", "0.0E+00"],
        ['"HUnit"', '"s"', '"s"'],
        ['"Date"', '"2026/03/02"', '"2026/03/02"'],
        ['"Time"', '"17:15:00.00"', '"17:15:00.00"'],
        ['""'],
    ]
    text = "\r\n".join(",".join(row) for row in facts) + "\r\n"
    text += "\r\n".join(",".join(["", *(c.values[k] for c in scope.columns)]) for k in scope.rows) + "\r\n"
    family.add(
        "dl850_no_time_column",
        "nasty",
        text,
        scope.truth(),
        answers={"time_unit": "1ms", "header_row": "3", "unit_row": "5", "tz": "Asia/Tokyo"},
    )
    return family.variants


def test_benches():
    dewesoft, catman, control, vehicle = (
        Family("dewesoft_csv"),
        Family("hbm_catman"),
        Family("dspace_controldesk"),
        Family("vector_mdf_export"),
    )
    t = table("PT101 WT110 SC104", step="0.01")
    body = [[t.seconds(k, 4), *(c.values[k] for c in t.columns)] for k in t.rows]
    top = [["File name:", "run_17.dxd"], ["Sample rate:", "100 Hz"], ["Start time:", "2026-03-02 09:15:00.000"], [""]]
    dewesoft.add(
        "time_and_units", "clean", lines([["Time (s)", *bracketed(t, "{name} ({unit})")]] + body), t.truth(False)
    )
    dewesoft.add(
        "head",
        "typical",
        lines(top + [["Time (s)", *bracketed(t, "{name} ({unit})")]] + body),
        t.truth(False),
        answers={"header_row": "5"},
    )
    dewesoft.add(
        "statistics",
        "nasty",
        lines([["Time (s)", "PT101/AVE (bar)", "WT110/RMS (Nm)", "SC104/MAX (rpm)"]] + body, "\t"),
        t.truth(False, names=["PT101/AVE", "WT110/RMS", "SC104/MAX"]),
    )
    day = lambda k: stamp(t.clock(k), "%d.%m.%Y %H:%M:%S,%f", BERLIN, 3)
    dewesoft.add(
        "absolute",
        "typical",
        lines(
            [["Data1 time", *bracketed(t, "{name} ({unit})")]]
            + [[day(k), *(number(c.values[k], ",") for c in t.columns)] for k in t.rows],
            "\t",
        ),
        t.truth(),
        answers={"tz": "Europe/Berlin"},
        must_ask=("tz",),
    )
    comma = [[cell.replace(".", ",") for cell in row] for row in body]
    info = [["HBM_CATMAN_DATAFILE_5"], ["CHANNELS=4"], ["MAXLENGTH=20"], ["T0 = 02.03.2026 09:15:00"], [""]]
    names = ["Time  1 - default sample rate", *names_of(t)]
    units = ["s", *(c.unit for c in t.columns)]
    catman.add(
        "names_units",
        "typical",
        lines([names, units] + comma, "\t", "\r\n"),
        t.truth(False),
        answers={"unit_row": "2", "time_unit": "s"},
    )
    catman.add(
        "head",
        "nasty",
        lines(info + [names, units] + comma, "\t", "\r\n"),
        t.truth(False),
        answers={"unit_row": "7", "header_row": "6", "time_unit": "s"},
    )
    catman.add("bracketed", "clean", lines([["Time [s]", *bracketed(t)]] + comma, "\t", "\r\n"), t.truth(False))
    quoted = [[f"Platform()://Model Root/Plant/{c.name}[{c.unit}]" for c in t.columns]]
    control.add("paths", "typical", lines([["Time", *quoted[0]]] + body), t.truth(False), answers={"time_unit": "s"})
    control.add(
        "rows_of_facts",
        "nasty",
        lines([["XAxis", *names_of(t)], ["unit", *(c.unit for c in t.columns)]] + body),
        t.truth(False),
        answers={"unit_row": "2", "time_unit": "s"},
    )
    control.add("seconds", "clean", lines([["time [s]", *bracketed(t)]] + body, ";"), t.truth(False))
    vehicle.add(
        "canape",
        "typical",
        lines([["time", *names_of(t)], ["s", *(c.unit for c in t.columns)]] + body),
        t.truth(False),
        answers={"unit_row": "2"},
    )
    vehicle.add(
        "canape_comma", "typical", lines([["Zeit[s]", *bracketed(t, "{name}[{unit}]")]] + comma, ";"), t.truth(False)
    )
    source = [["timestamps", *(f"{c.name} [{c.unit}]" for c in t.columns)]]
    vehicle.add("asammdf", "clean", lines(source + body), t.truth(False), answers={"time_unit": "s"})
    vehicle.add(
        "inca",
        "nasty",
        lines(
            [
                ["ETASAsciiItemFile", "record", "Format", "1.5"],
                ["sampleCount", "20"],
                ["time", *(f"{c.name}\\XCP:1" for c in t.columns)],
                ["", "f8", "f8", "f8"],
                ["s", *(c.unit for c in t.columns)],
            ]
            + body,
            "\t",
        ),
        t.truth(False),
        answers={"header_row": "3", "unit_row": "5"},
    )
    return dewesoft.variants + catman.variants + control.variants + vehicle.variants


def variants():
    return tektronix() + keysight() + rigol() + picoscope() + yokogawa() + test_benches()
