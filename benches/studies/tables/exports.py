"""Exports of further historians, of distributed control systems and of programs that look at their data."""

import json

from historians import iso, marked
from payloads import BERLIN, NEW_YORK, Family, bracketed, lines, names_of, stamp, table, wide

MDY = {"tz": "America/New_York", "time_unit": "mdy"}


def ignition():
    family = Family("ignition")
    t = table("PT101 TT102", step="1", titles=("Pump/PT101", "Pump/TT102"))
    bare = t.truth(units=["", ""])

    def dataset(time, kind="date", values=("F", "F")):
        return (
            '"#NAMES"\n"t_stamp",'
            + ",".join(f'"{c.name}"' for c in t.columns)
            + '\n"#TYPES"\n"'
            + kind
            + '",'
            + ",".join(f'"{v}"' for v in values)
            + '\n"#ROWS","20"\n'
            + "".join(
                ",".join(f'"{cell}"' for cell in [time(k), *(c.values[k] for c in t.columns)]) + "\n" for k in t.rows
            )
        )

    family.add(
        "names_types_rows",
        "clean",
        dataset(lambda k: str(t.milliseconds(k)), "date"),
        bare,
        answers={"time_unit": "ms"},
    )
    family.add(
        "two_types",
        "typical",
        dataset(lambda k: str(t.milliseconds(k)), "date", ("F", "D")),
        bare,
        answers={"time_unit": "ms"},
    )
    family.add(
        "dataset_dates",
        "typical",
        dataset(lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=3)),
        bare,
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    family.add(
        "java_date",
        "nasty",
        dataset(lambda k: stamp(t.clock(k), "%a %b %d %H:%M:%S CET %Y", BERLIN)),
        bare,
        answers={"tz": "Europe/Berlin"},
    )
    family.add(
        "power_chart_csv",
        "typical",
        wide(t, lambda k: stamp(t.clock(k), "%m/%d/%Y %I:%M:%S %p", NEW_YORK), names_of(t), time_title="t_stamp"),
        bare,
        answers=MDY,
        must_ask=("tz",),
    )
    sql = [["tagid", "intvalue", "floatvalue", "stringvalue", "datevalue", "dataintegrity", "t_stamp"]]
    rows = [
        [str(p + 4), "", c.values[k], "", "", "192", str(t.milliseconds(k))]
        for k in t.rows
        for p, c in enumerate(t.columns)
    ]
    family.add(
        "sqlth_data_rows",
        "nasty",
        lines(sql + rows),
        t.truth(units=["", ""], names=["4", "5"]),
        answers={
            "tag": "tagid",
            "value": "floatvalue",
            "quality": "dataintegrity",
            "time": "t_stamp",
            "time_unit": "ms",
            "quality_scheme": "ignition_legacy",
        },
    )
    tall = [["path", "value", "quality", "timestamp"]] + [
        [c.name, c.values[k], "Good", iso(t, k, 3)] for k in t.rows for c in t.columns
    ]
    family.add("tall", "typical", lines(tall), bare)
    return family.variants


def honeywell():
    family = Family("honeywell_phd")
    t = table("PT101 TT102", step="60", titles=("21PT101.PV", "21TT102.PV"))
    clock = lambda k: stamp(t.clock(k), "%m/%d/%Y %H:%M:%S", NEW_YORK)
    bare = t.truth(units=["", ""])
    rows = [[c.name, clock(k), c.values[k], "100"] for c in t.columns for k in t.rows]
    family.add(
        "confidence",
        "typical",
        lines([["TagName", "TimeStamp", "Value", "Confidence"], *rows]),
        bare,
        answers={**MDY, "quality": "none", "value": "Value"},
        must_ask=("tz",),
        harmless=(r".*\.Confidence",),
    )
    family.add(
        "uniformance_wide",
        "clean",
        wide(t, clock, bracketed(t), time_title="Time"),
        t.truth(),
        answers=MDY,
        must_ask=("tz",),
    )
    day = lambda k: stamp(t.clock(k), "%d-%b-%y %H:%M:%S", NEW_YORK).upper()
    family.add(
        "upper_case_months",
        "typical",
        wide(t, day, bracketed(t), time_title="TIME"),
        t.truth(),
        answers={"tz": "America/New_York"},
        must_ask=("tz",),
    )
    low = marked(table("PT101 TT102", step="60", titles=("21PT101.PV", "21TT102.PV")), {(4, 0), (9, 1)})
    rows = [
        [c.name, clock(k), c.values[k] if c.qualities[k] else "-9999", "100" if c.qualities[k] else "-1"]
        for c in low.columns
        for k in low.rows
    ]
    family.add(
        "confidence_minus_one",
        "nasty",
        lines([["TagName", "TimeStamp", "Value", "Confidence"], *rows]),
        low.truth(units=["", ""]),
        answers={**MDY, "missing": "-9999", "value": "Value", "quality": "none"},
        must_ask=("tz", "missing"),
        harmless=(r".*\.Confidence",),
    )
    return family.variants


def deltav():
    family = Family("deltav_history")
    t = table("PT101 TT102", step="10", titles=("FIC-101/PV.CV", "TIC-102/PV.CV"))
    am = lambda k: stamp(t.clock(k), "%-m/%-d/%Y %-I:%M:%S.%f %p", NEW_YORK, 3)
    head = [["Date/Time", *names_of(t)], ["", *(c.unit for c in t.columns)]]
    family.add(
        "process_history_view",
        "typical",
        lines(head + [[am(k), *(c.values[k] for c in t.columns)] for k in t.rows]),
        t.truth(),
        answers={**MDY, "unit_row": "2"},
        must_ask=("tz",),
    )
    status = [["Date/Time", "FIC-101/PV.CV", "Status", "TIC-102/PV.CV", "Status"]]
    family.add(
        "status_beside",
        "nasty",
        lines(status + [[am(k), t.columns[0].values[k], "Good", t.columns[1].values[k], "Good"] for k in t.rows]),
        t.truth(units=["", ""]),
        answers=MDY,
        must_ask=("tz",),
    )
    family.add(
        "brackets",
        "clean",
        lines([["Date/Time", *bracketed(t)]] + [[am(k), *(c.values[k] for c in t.columns)] for k in t.rows]),
        t.truth(),
        answers=MDY,
        must_ask=("tz",),
    )
    cell = lambda text, k: f"{text} (Good NonSpecific)"
    family.add(
        "status_in_cells",
        "nasty",
        lines([["Date/Time", *bracketed(t)]] + [[am(k), *(cell(c.values[k], k) for c in t.columns)] for k in t.rows]),
        t.truth(),
        answers=MDY,
        must_ask=("tz",),
    )
    return family.variants


def abb():
    family = Family("abb_800xa")
    t = table("PT101 TT102", step="10", titles=("PT101:PV,VALUE", "TT102:PV,VALUE"))
    clock = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", BERLIN, 3)
    zone = {"tz": "Europe/Berlin"}
    family.add(
        "trend_display",
        "typical",
        wide(t, clock, names_of(t), ";", time_title="TimeStamp", quote=True),
        t.truth(units=["", ""]),
        answers=zone,
        must_ask=("tz",),
    )
    quality = [["Time", "PT101 [bar]", "PT101 Quality", "TT102 [°C]", "TT102 Quality"]]
    bad = marked(table("PT101 TT102", step="10"), {(4, 0), (6, 1)})
    rows = [
        [clock(k), *(cell for c in bad.columns for cell in (c.values[k], "Good" if c.qualities[k] else "Bad"))]
        for k in bad.rows
    ]
    family.add("quality_beside", "nasty", lines(quality + rows, ";"), bad.truth(), answers=zone, must_ask=("tz",))
    codes = [
        [*row[:2], "192" if row[2] == "Good" else "24", row[3], "192" if row[4] == "Good" else "24"] for row in rows
    ]
    family.add(
        "quality_codes_beside",
        "nasty",
        lines(quality + codes, ";"),
        bad.truth(),
        answers={**zone, "quality_scheme": "opc_da"},
        must_ask=("tz",),
    )
    data_direct = [
        ["", *names_of(t)],
        ["Unit", *(c.unit for c in t.columns)],
        ["Description", *(c.description for c in t.columns)],
    ]
    family.add(
        "data_direct",
        "nasty",
        lines(data_direct + [[clock(k), *(c.values[k] for c in t.columns)] for k in t.rows], ";"),
        t.truth(),
        answers={**zone, "unit_row": "2", "header_row": "1"},
        must_ask=("tz",),
    )
    plain = table("PT101 TT102", step="10")
    family.add(
        "clean",
        "clean",
        wide(plain, clock, bracketed(plain), ";", time_title="Time"),
        plain.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    return family.variants


def aspen():
    family = Family("aspen_ip21")
    t = table("PT101 TT102", step="30")
    clock = lambda k: stamp(t.clock(k), "%d-%b-%y %H:%M:%S.%f", NEW_YORK, 1).upper()
    head = [["TS", "NAME", "VALUE", "STATUS"]]
    rows = [[clock(k), c.name, c.values[k], "Good"] for c in t.columns for k in t.rows]
    zone = {"tz": "America/New_York"}
    family.add("history_rows", "typical", lines(head + rows), t.truth(units=["", ""]), answers=zone, must_ask=("tz",))
    family.add(
        "excel_add_in",
        "clean",
        wide(t, clock, bracketed(t), time_title="Time"),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    codes = [["IP_TREND_TIME", "NAME", "IP_TREND_VALUE", "IP_TREND_QSTATUS"]]
    answers = {**zone, "tag": "NAME", "value": "IP_TREND_VALUE", "quality": "none"}
    family.add(
        "trend_columns",
        "typical",
        lines(codes + [[*r[:3], "0"] for r in rows]),
        t.truth(units=["", ""]),
        answers=answers,
        must_ask=("tz",),
        harmless=(".*QSTATUS",),
    )
    bad = marked(table("PT101 TT102", step="30"), {(4, 0)})
    rows = [[clock(k), c.name, c.values[k], "0" if c.qualities[k] else "2"] for c in bad.columns for k in bad.rows]
    family.add(
        "bad_trend_status",
        "nasty",
        lines(codes + rows),
        bad.truth(units=["", ""]),
        answers=answers,
        must_ask=("tz",),
        harmless=(".*QSTATUS",),
    )
    return family.variants


def seeq():
    family = Family("seeq_export")
    t = table("PT101 TT102", step="60", missing=((5, 1),))
    offset = lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S") + "Z"
    family.add("csv", "clean", wide(t, offset, bracketed(t, "{name} ({unit})"), time_title="Date-Time"), t.truth())
    family.add(
        "spy_frame",
        "typical",
        wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S") + "+00:00", names_of(t), time_title=""),
        t.truth(units=["", ""]),
    )
    family.add(
        "named_zone",
        "nasty",
        wide(
            t,
            lambda k: stamp(t.clock(k), "%-m/%-d/%Y %-I:%M:%S %p", NEW_YORK),
            bracketed(t),
            time_title="Date-Time (America/New_York)",
        ),
        t.truth(),
        answers=MDY,
    )
    family.add(
        "cells_with_quotes",
        "typical",
        wide(t, offset, [f'{c.name} "{c.description}" [{c.unit}]' for c in t.columns], time_title="Date-Time"),
        t.truth(names=[f'{c.name} "{c.description}"' for c in t.columns]),
    )
    return family.variants


def opc_ua():
    family = Family("opc_ua_clients")
    t = table("PT101 TT102", step="1")
    expert = [["Node Id", "Display Name", "Value", "Datatype", "Source Timestamp", "Server Timestamp", "Statuscode"]]
    rows = [
        [f"ns=2;s={c.name}", c.name, c.values[k], "Double", iso(t, k, 3), iso(t, k, 3), "Good"]
        for k in t.rows
        for c in t.columns
    ]
    bare = t.truth(units=["", ""])
    family.add(
        "data_access_rows",
        "typical",
        lines(expert + rows),
        bare,
        answers={"tag": "Display Name", "value": "Value", "quality": "Statuscode", "time": "Source Timestamp"},
    )
    history = [["SourceTimestamp", "NodeId", "Value", "StatusCode"]]
    rows = [[iso(t, k, 3), f"ns=2;s={c.name}", c.values[k], "0x00000000"] for k in t.rows for c in t.columns]
    family.add("history_status_codes", "typical", lines(history + rows), bare, answers={"quality_scheme": "opc_ua"})
    bad = marked(table("PT101 TT102", step="1"), {(3, 0), (8, 1)})
    rows = [
        [iso(bad, k, 3), f"ns=2;s={c.name}", c.values[k], "Good" if c.qualities[k] else "BadNoCommunication"]
        for k in bad.rows
        for c in bad.columns
    ]
    family.add("status_words", "nasty", lines(history + rows), bad.truth(units=["", ""]))
    codes = [[*r[:3], "0" if r[3] == "Good" else "2150694912"] for r in rows]
    family.add(
        "status_numbers",
        "nasty",
        lines(history + codes),
        bad.truth(units=["", ""]),
        answers={"quality_scheme": "opc_ua", "tag": "NodeId", "value": "Value", "quality": "StatusCode"},
    )
    values = {
        c.name: [
            {
                "Value": {"Type": 11, "Body": c.number(k)},
                "StatusCode": {"Code": 0},
                "SourceTimestamp": iso(t, k, 3),
                "ServerTimestamp": iso(t, k, 3),
            }
            for k in t.rows
        ]
        for c in t.columns
    }
    family.add("json_variants", "clean", json.dumps(values), bare, content_type="application/json")
    publish = [
        {
            "MessageId": str(k),
            "MessageType": "ua-data",
            "Messages": [
                {
                    "DataSetWriterId": 1,
                    "Timestamp": iso(t, k, 3),
                    "Payload": {c.name: {"Value": c.number(k), "SourceTimestamp": iso(t, k, 3)} for c in t.columns},
                }
            ],
        }
        for k in t.rows
    ]
    family.add("pub_sub_messages", "nasty", json.dumps(publish), bare, content_type="application/json")
    family.add(
        "pub_sub_lines",
        "nasty",
        "\n".join(map(json.dumps, publish)) + "\n",
        bare,
        content_type="application/x-ndjson",
    )
    publisher = [
        {
            "NodeId": f"nsu=urn:plant;s={c.name}",
            "EndpointUrl": "opc.tcp://plc",
            "Value": {"Value": c.number(k), "SourceTimestamp": iso(t, k, 3)},
        }
        for k in t.rows
        for c in t.columns
    ]
    family.add("publisher_samples", "typical", json.dumps(publisher), bare, content_type="application/json")
    return family.variants


def databases():
    family = Family("sql_clients")
    t = table("PT101 TT102", step="1", missing=((4, 1),))
    short = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S") + "+00"
    family.add("psql_csv", "clean", wide(t, short, bracketed(t), time_title="time"), t.truth())
    aligned = (
        " time | PT101 | TT102 \n"
        + "-" * 24
        + "+-------+-------\n"
        + "".join(
            f" {short(k)} | {c0} | {c1 or ''}\n"
            for k, c0, c1 in zip(t.rows, t.columns[0].values, t.columns[1].values)
        )
    )
    family.add("psql_aligned", "nasty", aligned + "(20 rows)\n\n", t.truth(units=["", ""]), content_type="text/plain")
    family.add(
        "copy_text",
        "typical",
        wide(t, short, bracketed(t), "\t", missing="\\N"),
        t.truth(),
        answers={"missing": "\\N"},
    )
    family.add(
        "management_studio",
        "typical",
        "\ufeff"
        + wide(
            t,
            lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=3),
            bracketed(t),
            missing="NULL",
            time_title="LogTime",
        ),
        t.truth(),
        answers={"tz": "UTC", "missing": "NULL"},
        must_ask=("tz",),
    )
    family.add(
        "oracle",
        "typical",
        wide(
            t,
            lambda k: stamp(t.clock(k), "%d-%b-%y %I.%M.%S.%f", digits=6).upper() + "000 AM",
            bracketed(t),
            time_title="TS",
            quote=True,
        ),
        t.truth(),
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    rows = [[str(k), c.name, short(k), c.values[k] or ""] for k in t.rows for c in t.columns]
    family.add(
        "long_with_ids",
        "nasty",
        lines([["id", "sensor_id", "ts", "val"], *rows]),
        t.truth(units=["", ""]),
        answers={"tag": "sensor_id", "value": "val", "time": "ts"},
    )
    return family.variants


def variants():
    return ignition() + honeywell() + deltav() + abb() + aspen() + seeq() + opc_ua() + databases()
