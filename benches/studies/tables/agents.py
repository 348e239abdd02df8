"""What agents, gateways and time series databases send."""

import json

from historians import iso
from payloads import BERLIN, Family, lines, names_of, packed, stamp, table, wide


def prometheus():
    family = Family("prometheus_json", "application/json")
    t = table("PT101 TT102", step="15")
    bare = t.truth(units=["", ""])

    def matrix(t, text=lambda v: v, missing=None):
        series = [
            {
                "metric": {"__name__": c.name, "instance": "plc:9100", "job": "hall3"},
                "values": [
                    [t.milliseconds(k) / 1000, text(c.values[k]) if c.values[k] is not None else missing]
                    for k in t.rows
                    if c.values[k] is not None or missing
                ],
            }
            for c in t.columns
        ]
        return json.dumps({"status": "success", "data": {"resultType": "matrix", "result": series}})

    family.add("query_range", "clean", matrix(t), bare)
    gaps = table("PT101 TT102", step="15", missing=((3, 0),))
    family.add("nan", "typical", matrix(gaps, missing="NaN"), gaps.truth(units=["", ""]))
    same = [
        {
            "metric": {"__name__": "pressure_bar", "sensor": c.name},
            "values": [[t.milliseconds(k) / 1000, c.values[k]] for k in t.rows],
        }
        for c in t.columns
    ]
    family.add(
        "labels_name_the_signal",
        "typical",
        json.dumps({"status": "success", "data": {"resultType": "matrix", "result": same}}),
        bare,
    )
    vector = [{"metric": {"__name__": c.name}, "value": [t.milliseconds(0) / 1000, c.values[0]]} for c in t.columns]
    lone = table("PT101 TT102", rows=1)
    family.add(
        "instant_vector",
        "nasty",
        json.dumps({"status": "success", "data": {"resultType": "vector", "result": vector}}),
        lone.truth(units=["", ""]),
    )
    return family.variants


def influx_csv():
    family = Family("influxdb_annotated_csv")
    t = table("PT101 TT102", step="10")
    bare = t.truth(units=["", ""])

    def annotated(t, extra=()):
        head = [
            "#group,false,false,true,true,false,false,true,true",
            "#datatype,string,long,dateTime:RFC3339,dateTime:RFC3339,dateTime:RFC3339,double,string,string",
            "#default,_result,,,,,,,",
            ",result,table,_start,_stop,_time,_value,_field,_measurement",
        ]
        rows = [
            f",,{p},2026-03-02T08:00:00Z,2026-03-02T09:00:00Z,{iso(t, k, 3)},{c.values[k] or ''},{c.name},pump"
            for p, c in enumerate(t.columns)
            for k in t.rows
        ]
        return "\r\n".join([*head, *rows, "", ""])

    family.add("query_answer", "clean", annotated(t), bare)
    gaps = table("PT101 TT102", step="10", missing=((3, 0),))
    family.add("empty_values", "typical", annotated(gaps), gaps.truth(units=["", ""]))
    tables = "\r\n".join(
        "#datatype,string,long,dateTime:RFC3339,double,string\r\n#group,false,false,false,false,true\r\n"
        "#default,_result,,,,\r\n,result,table,_time,_value,_field\r\n"
        + "".join(f",,{p},{iso(t, k, 3)},{c.values[k]},{c.name}\r\n" for k in t.rows)
        for p, c in enumerate(t.columns)
    )
    family.add("table_for_each", "typical", tables, bare)
    pivot = (
        "#datatype,string,long,dateTime:RFC3339,double,double\r\n#group,false,false,false,false,false\r\n"
        "#default,_result,,,,\r\n,result,table,_time,PT101,TT102\r\n"
        + "".join(f",,0,{iso(t, k, 3)},{t.columns[0].values[k]},{t.columns[1].values[k]}\r\n" for k in t.rows)
    )
    family.add("pivoted", "typical", pivot, bare)
    plain = lines(
        [["", "result", "table", "_time", "_value", "_field", "_measurement"]]
        + [
            ["", "", str(p), iso(t, k, 3), c.values[k], c.name, "pump"]
            for p, c in enumerate(t.columns)
            for k in t.rows
        ]
    )
    family.add("without_annotations", "nasty", plain, bare)
    explorer = lines(
        [["name", "tags", "time", "PT101", "TT102"]]
        + [["pump", "", str(t.milliseconds(k) * 10**6), *(c.values[k] for c in t.columns)] for k in t.rows]
    )
    family.add(
        "influx_1_csv", "nasty", explorer, bare, answers={"time": "time", "time_unit": "ns"}, harmless=("tags",)
    )
    return family.variants


def influx_lines():
    family = Family("influxdb_line_protocol", "text/plain")
    t = table("PT101 TT102", step="10")
    bare = t.truth(units=["", ""])
    fields = "".join(
        f"pump,site=hall3 PT101={t.columns[0].values[k]},TT102={t.columns[1].values[k]} {t.milliseconds(k) * 10**6}\n"
        for k in t.rows
    )
    family.add("fields", "clean", fields, bare)
    each = "".join(
        f"{c.name},site=hall3 value={c.values[k]} {t.milliseconds(k) * 10**6}\n" for k in t.rows for c in t.columns
    )
    family.add("measurement_for_each", "typical", each, bare)
    tagged = "".join(
        f"sensors,sensor={c.name} value={c.values[k]} {t.milliseconds(k) * 10**6}\n"
        for k in t.rows
        for c in t.columns
    )
    family.add("tag_names_the_signal", "typical", tagged, bare)
    whole = table("SC104 LT105", step="10", digits=0)
    family.add(
        "integers",
        "typical",
        "".join(
            f"pump SC104={whole.columns[0].values[k]}i,LT105="
            f"{whole.columns[1].values[k]}i {whole.milliseconds(k) * 10**6}\n"
            for k in whole.rows
        ),
        whole.truth(units=["", ""]),
    )
    family.add("seconds", "nasty", fields.replace("000000000\n", "\n"), bare, answers={"time_unit": "s"})
    family.add("comments_and_gzip", "nasty", packed(("# exported\n" + fields).encode()), bare)
    escaped = fields.replace("pump,site=hall3", "feed\\ pump,site=hall\\ 3")
    family.add("escaped_blanks", "nasty", escaped, bare)
    return family.variants


def influx_json():
    family = Family("influxdb_v1_json", "application/json")
    t = table("PT101 TT102", step="10", missing=((4, 1),))
    bare = t.truth(units=["", ""])

    def answer(time, columns=("time", "PT101", "TT102")):
        return json.dumps(
            {
                "results": [
                    {
                        "statement_id": 0,
                        "series": [
                            {
                                "name": "pump",
                                "columns": list(columns),
                                "values": [[time(k), *(c.number(k) for c in t.columns)] for k in t.rows],
                            }
                        ],
                    }
                ]
            }
        )

    family.add("rfc3339", "clean", answer(lambda k: iso(t, k, 0).replace(".Z", "Z")), bare)
    family.add("epoch_ms", "typical", answer(t.milliseconds), bare, answers={"time_unit": "ms"})
    tagged = [
        {
            "name": "pump",
            "tags": {"sensor": c.name},
            "columns": ["time", "value"],
            "values": [[iso(t, k, 3), c.number(k)] for k in t.rows],
        }
        for c in t.columns
    ]
    family.add("group_by_tag", "typical", json.dumps({"results": [{"statement_id": 0, "series": tagged}]}), bare)
    statements = [
        {
            "statement_id": p,
            "series": [
                {"name": "pump", "columns": ["time", c.name], "values": [[iso(t, k, 3), c.number(k)] for k in t.rows]}
            ],
        }
        for p, c in enumerate(t.columns)
    ]
    family.add("two_statements", "nasty", json.dumps({"results": statements}), bare)
    return family.variants


def json_lines():
    family = Family("json_lines", "application/x-ndjson")
    t = table("PT101 TT102", step="2", missing=((3, 1),))
    bare = t.truth(units=["", ""])
    rows = lambda time: "".join(
        json.dumps({"ts": time(k), **{c.name: c.number(k) for c in t.columns}}) + "\n" for k in t.rows
    )
    family.add("iso", "clean", rows(lambda k: iso(t, k, 3)), bare)
    family.add("epoch_ms", "typical", rows(t.milliseconds), bare)
    family.add("epoch_s", "typical", rows(lambda k: t.milliseconds(k) / 1000), bare)
    long = "".join(
        json.dumps({"timestamp": iso(t, k, 3), "tag": c.name, "value": c.number(k), "unit": c.unit}) + "\n"
        for k in t.rows
        for c in t.columns
    )
    family.add("row_for_each_sample", "typical", long, t.truth())
    nested = "".join(
        json.dumps(
            {"time": iso(t, k, 3), "data": {c.name: {"value": c.number(k), "unit": c.unit} for c in t.columns}}
        )
        + "\n"
        for k in t.rows
    )
    family.add("nested", "nasty", nested, t.truth())
    telegraf = "".join(
        json.dumps(
            {
                "fields": {c.name: c.number(k) for c in t.columns if c.number(k) is not None},
                "name": "opcua",
                "tags": {"host": "edge"},
                "timestamp": t.milliseconds(k) // 1000,
            }
        )
        + "\n"
        for k in t.rows
    )
    family.add("telegraf", "nasty", telegraf, bare)
    texts = "".join(
        json.dumps({"ts": iso(t, k, 3), **{c.name: c.values[k] for c in t.columns}}) + "\n" for k in t.rows
    )
    family.add("numbers_as_text", "nasty", texts, bare)
    family.add("as_json_type", "typical", rows(lambda k: iso(t, k, 3)), bare, content_type="application/json")
    return family.variants


def grafana():
    family = Family("grafana_csv")
    t = table("PT101 TT102", step="60")
    clock = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S", BERLIN)
    zone = {"tz": "Europe/Berlin"}
    family.add(
        "inspect_joined",
        "clean",
        wide(t, clock, names_of(t), time_title="Time", quote=True),
        t.truth(units=["", ""]),
        answers=zone,
        must_ask=("tz",),
    )
    formatted = lines(
        [["Time", *names_of(t)]]
        + [[clock(k), f"{t.columns[0].values[k]} bar", f"{t.columns[1].values[k]} °C"] for k in t.rows],
        quote=True,
    )
    family.add(
        "formatted_units",
        "nasty",
        "\ufeff" + formatted,
        t.truth(),
        answers={**zone, "units": "PT101:bar,TT102:°C"},
        must_ask=("tz",),
    )
    family.add(
        "excel_header",
        "typical",
        "sep=,\r\n" + wide(t, clock, names_of(t), time_title="Time", quote=True),
        t.truth(units=["", ""]),
        answers=zone,
        must_ask=("tz",),
    )
    rows = [["Series", "Time", "Value"]] + [[c.name, iso(t, k, 3), c.values[k]] for c in t.columns for k in t.rows]
    family.add("series_as_rows", "typical", lines(rows, ";"), t.truth(units=["", ""]))
    family.add(
        "epoch_ms",
        "typical",
        wide(t, lambda k: str(t.milliseconds(k)), names_of(t), time_title="Time"),
        t.truth(units=["", ""]),
        answers={"time_unit": "ms"},
    )
    gaps = table("PT101 TT102", step="60", missing=((4, 0),))
    family.add(
        "undefined_cells",
        "nasty",
        wide(gaps, lambda k: iso(gaps, k, 3), names_of(gaps), time_title="Time", missing="undefined"),
        gaps.truth(units=["", ""]),
        answers={"missing": "undefined"},
    )
    return family.variants


def node_red():
    family = Family("node_red_csv")
    t = table("PT101 TT102", step="2")
    plain = wide(t, lambda k: str(t.milliseconds(k)), names_of(t), time_title="timestamp")
    family.add("titles", "clean", plain, t.truth(units=["", ""]), answers={"time_unit": "ms"})
    family.add(
        "no_titles",
        "nasty",
        plain.split("\n", 1)[1],
        t.truth(units=["", ""], names=["column_2", "column_3"]),
        answers={"header_row": "none", "time_unit": "ms"},
    )
    javascript = lambda k: stamp(t.clock(k), "%a %b %d %Y %H:%M:%S GMT+0100 (Central European Standard Time)", BERLIN)
    family.add(
        "javascript_dates", "nasty", wide(t, javascript, names_of(t), time_title="time"), t.truth(units=["", ""])
    )
    long = [["topic", "payload", "timestamp"]] + [
        [f"plant/{c.name}", c.values[k], str(t.milliseconds(k))] for k in t.rows for c in t.columns
    ]
    family.add(
        "topic_payload",
        "typical",
        lines(long),
        t.truth(units=["", ""]),
        answers={"tag": "topic", "value": "payload", "time": "timestamp", "time_unit": "ms"},
    )
    messages = "".join(
        json.dumps({"topic": f"plant/{c.name}", "payload": c.number(k), "timestamp": t.milliseconds(k)}) + "\n"
        for k in t.rows
        for c in t.columns
    )
    family.add("mqtt_lines", "nasty", messages, t.truth(units=["", ""]), content_type="application/x-ndjson")
    return family.variants


def variants():
    return prometheus() + influx_csv() + influx_lines() + influx_json() + json_lines() + grafana() + node_red()
