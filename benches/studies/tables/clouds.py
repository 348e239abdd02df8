"""What services for devices and time series answer."""

import json

from historians import iso, marked
from payloads import BERLIN, Family, lines, names_of, stamp, table, wide


def cognite():
    family = Family("cognite", "application/json")
    t = table("PT101 TT102", step="10")
    points = lambda c: [{"timestamp": t.milliseconds(k), "value": c.number(k)} for k in t.rows]
    items = [
        {
            "id": 17 + p,
            "externalId": c.name,
            "isString": False,
            "isStep": False,
            "unit": c.unit,
            "datapoints": points(c),
        }
        for p, c in enumerate(t.columns)
    ]
    family.add("data_points", "clean", json.dumps({"items": items}), t.truth())
    bare = [{k: v for k, v in item.items() if k != "unit"} for item in items]
    family.add("no_units", "typical", json.dumps({"items": bare}), t.truth(units=["", ""]))
    bad = marked(table("PT101 TT102", step="10"), {(3, 0), (7, 1)})
    coded = [
        {
            "externalId": c.name,
            "unit": c.unit,
            "datapoints": [
                {
                    "timestamp": bad.milliseconds(k),
                    "value": c.number(k) if c.qualities[k] else None,
                    "status": {
                        "code": 0 if c.qualities[k] else 2147483648,
                        "symbol": "Good" if c.qualities[k] else "Bad",
                    },
                }
                for k in bad.rows
            ],
        }
        for c in bad.columns
    ]
    family.add("status_codes", "nasty", json.dumps({"items": coded}), bad.truth())
    averages = [
        {**item, "datapoints": [{"timestamp": p["timestamp"], "average": p["value"]} for p in item["datapoints"]]}
        for item in items
    ]
    family.add("averages", "nasty", json.dumps({"items": averages}), t.truth())
    external = [{**item, "unitExternalId": unit} for item, unit in zip(bare, ("pressure:bar", "temperature:deg_c"))]
    family.add(
        "unit_ids", "nasty", json.dumps({"items": external}), t.truth(), answers={"units": "PT101:bar,TT102:°C"}
    )
    frame = wide(
        t,
        lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S"),
        [f"{c.name}|average" for c in t.columns],
        time_title="timestamp",
    )
    family.add(
        "frame_csv",
        "typical",
        frame,
        t.truth(units=["", ""]),
        answers={"tz": "UTC"},
        content_type="text/csv",
        must_ask=("tz",),
    )
    return family.variants


def sitewise():
    family = Family("aws_sitewise", "application/json")
    t = table("PT101 TT102", step="10")
    entry = lambda c, k: {
        "value": {"doubleValue": c.number(k)},
        "timestamp": {"timeInSeconds": t.milliseconds(k) // 1000, "offsetInNanos": 0},
        "quality": "GOOD",
    }
    lone = table("PT101", step="10")
    family.add(
        "property_history",
        "clean",
        json.dumps({"assetPropertyValueHistory": [entry(lone.columns[0], k) for k in lone.rows]}),
        lone.truth(units=[""], names=["value"]),
        answers={"rename": "value:PT101"},
    )
    batch = {
        "successEntries": [
            {"entryId": c.name, "assetPropertyValueHistory": [entry(c, k) for k in t.rows]} for c in t.columns
        ],
        "errorEntries": [],
        "skippedEntries": [],
    }
    family.add("batch_history", "typical", json.dumps(batch), t.truth(units=["", ""]))
    puts = {
        "entries": [
            {"entryId": str(p), "propertyAlias": f"/plant/{c.name}", "propertyValues": [entry(c, k) for k in t.rows]}
            for p, c in enumerate(t.columns)
        ]
    }
    family.add("batch_put", "nasty", json.dumps(puts), t.truth(units=["", ""]))
    cold = [["series_id", "data_type", "time_in_seconds", "offset_in_nanos", "quality", "double_value", "alias"]]
    rows = [
        ["a1b2-" + str(p), "DOUBLE", str(t.milliseconds(k) // 1000), "0", "GOOD", c.values[k], f"/plant/{c.name}"]
        for k in t.rows
        for p, c in enumerate(t.columns)
    ]
    family.add(
        "cold_tier_csv",
        "nasty",
        lines(cold + rows),
        t.truth(units=["", ""]),
        content_type="text/csv",
        answers={
            "tag": "alias",
            "value": "double_value",
            "time": "time_in_seconds",
            "time_unit": "s",
            "quality": "quality",
        },
    )
    bulk = [["ALIAS", "DATA_TYPE", "TIMESTAMP_SECONDS", "TIMESTAMP_NANO_OFFSET", "QUALITY", "VALUE"]]
    rows = [
        [f"/plant/{c.name}", "DOUBLE", str(t.milliseconds(k) // 1000), "0", "GOOD", c.values[k]]
        for k in t.rows
        for c in t.columns
    ]
    family.add(
        "bulk_import_csv",
        "typical",
        lines(bulk + rows),
        t.truth(units=["", ""]),
        content_type="text/csv",
        answers={"tag": "ALIAS", "value": "VALUE", "time": "TIMESTAMP_SECONDS", "time_unit": "s"},
        harmless=(".*NANO_OFFSET",),
    )
    fast = table("PT101 TT102", step="0.25")
    rows = [
        [
            f"/plant/{c.name}",
            "DOUBLE",
            str(fast.milliseconds(k) // 1000),
            str(fast.milliseconds(k) % 1000 * 10**6),
            "GOOD",
            c.values[k],
        ]
        for k in fast.rows
        for c in fast.columns
    ]
    family.add(
        "bulk_import_nanoseconds",
        "nasty",
        lines(bulk + rows),
        fast.truth(units=["", ""]),
        answers={"tag": "ALIAS", "value": "VALUE", "time": "TIMESTAMP_SECONDS", "time_unit": "s"},
        content_type="text/csv",
        harmless=(".*NANO_OFFSET",),
    )
    return family.variants


def thingsboard():
    family = Family("thingsboard", "application/json")
    t = table("PT101 TT102", step="10")
    bare = t.truth(units=["", ""])
    family.add(
        "time_series",
        "clean",
        json.dumps(
            {c.name: [{"ts": t.milliseconds(k), "value": c.values[k]} for k in reversed(t.rows)] for c in t.columns}
        ),
        bare,
    )
    family.add(
        "strict_types",
        "typical",
        json.dumps({c.name: [{"ts": t.milliseconds(k), "value": c.number(k)} for k in t.rows] for c in t.columns}),
        bare,
    )
    telemetry = [{"ts": t.milliseconds(k), "values": {c.name: c.number(k) for c in t.columns}} for k in t.rows]
    family.add("telemetry_upload", "typical", json.dumps(telemetry), bare)
    csv = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S", BERLIN), names_of(t), ";", time_title="Timestamp")
    family.add(
        "widget_csv", "typical", csv, bare, answers={"tz": "Europe/Berlin"}, content_type="text/csv", must_ask=("tz",)
    )
    gateway = {"Pump": telemetry}
    family.add("gateway_telemetry", "nasty", json.dumps(gateway), bare)
    return family.variants


def home_assistant():
    family = Family("home_assistant", "application/json")
    t = table("TT102 XV107", step="60", titles=("sensor.tt102", "sensor.xv107"))
    entry = lambda c, k, state=None: {
        "entity_id": c.name,
        "state": state or c.values[k],
        "last_changed": iso(t, k, 6).replace("Z", "+00:00"),
        "last_updated": iso(t, k, 6).replace("Z", "+00:00"),
        "attributes": {"unit_of_measurement": c.unit, "friendly_name": c.description},
    }
    family.add("history_period", "clean", json.dumps([[entry(c, k) for k in t.rows] for c in t.columns]), t.truth())
    minimal = [
        [entry(c, 0)]
        + [{"state": c.values[k], "last_changed": iso(t, k, 6).replace("Z", "+00:00")} for k in t.rows[1:]]
        for c in t.columns
    ]
    family.add("minimal_response", "nasty", json.dumps(minimal), t.truth())
    csv = [["entity_id", "state", "last_changed"]] + [
        [c.name, c.values[k], iso(t, k, 3)] for c in t.columns for k in t.rows
    ]
    family.add(
        "history_csv",
        "typical",
        lines(csv),
        t.truth(units=["", ""]),
        content_type="text/csv",
        answers={"tag": "entity_id", "value": "state", "time": "last_changed"},
    )
    gaps = table("TT102 XV107", step="60", titles=("sensor.tt102", "sensor.xv107"), missing=((3, 0), (4, 0), (9, 1)))
    rows = [
        [c.name, c.values[k] or ("unavailable" if k < 5 else "unknown"), iso(gaps, k, 3)]
        for c in gaps.columns
        for k in gaps.rows
    ]
    family.add(
        "unavailable",
        "nasty",
        lines([csv[0], *rows]),
        gaps.truth(units=["", ""]),
        content_type="text/csv",
        answers={"tag": "entity_id", "value": "state", "time": "last_changed", "missing": "unavailable,unknown"},
    )
    statistics = [["statistic_id", "unit", "start", "mean"]] + [
        [c.name, c.unit, iso(t, k, 0).replace(".Z", "Z"), c.values[k]] for c in t.columns for k in t.rows
    ]
    family.add(
        "statistics",
        "typical",
        lines(statistics),
        t.truth(),
        content_type="text/csv",
        answers={"tag": "statistic_id", "value": "mean", "time": "start"},
    )
    return family.variants


def azure_and_aws():
    azure, stream = Family("azure_data_explorer", "application/json"), Family("aws_timestream", "application/json")
    t = table("PT101 TT102", step="10")
    bare = t.truth(units=["", ""])
    columns = [{"ColumnName": "Timestamp", "DataType": "DateTime", "ColumnType": "datetime"}] + [
        {"ColumnName": c.name, "DataType": "Double", "ColumnType": "real"} for c in t.columns
    ]
    rows = [[iso(t, k), *(c.number(k) for c in t.columns)] for k in t.rows]
    azure.add(
        "v1_tables",
        "typical",
        json.dumps({"Tables": [{"TableName": "Table_0", "Columns": columns, "Rows": rows}]}),
        bare,
    )
    azure.add(
        "csv",
        "clean",
        lines([["Timestamp", *names_of(t)]] + [[iso(t, k), *(c.values[k] for c in t.columns)] for k in t.rows]),
        bare,
        content_type="text/csv",
    )
    american = lambda k: stamp(t.clock(k), "%-m/%-d/%Y, %-I:%M:%S.%f %p", digits=3)
    azure.add(
        "web_export",
        "nasty",
        "\ufeff" + wide(t, american, names_of(t), time_title="Timestamp [UTC]"),
        bare,
        content_type="text/csv",
        answers={"time_unit": "mdy", "tz": "UTC"},
    )
    telemetry = "".join(
        json.dumps(
            {"enqueuedTime": iso(t, k, 3), "deviceId": "pump", "telemetry": {c.name: c.number(k) for c in t.columns}}
        )
        + "\n"
        for k in t.rows
    )
    azure.add("central_export", "nasty", telemetry, bare, content_type="application/x-ndjson")
    info = [{"Name": "time", "Type": {"ScalarType": "TIMESTAMP"}}] + [
        {"Name": c.name, "Type": {"ScalarType": "DOUBLE"}} for c in t.columns
    ]
    answer = {
        "QueryId": "Q",
        "Rows": [
            {
                "Data": [
                    {"ScalarValue": stamp(t.clock(k), "%Y-%m-%d %H:%M:%S") + ".000000000"},
                    *({"ScalarValue": c.values[k]} for c in t.columns),
                ]
            }
            for k in t.rows
        ],
        "ColumnInfo": info,
    }
    stream.add("query", "typical", json.dumps(answer), bare, answers={"tz": "UTC"})
    long = [["time", "measure_name", "measure_value::double"]] + [
        [stamp(t.clock(k), "%Y-%m-%d %H:%M:%S") + ".000000000", c.name, c.values[k]]
        for k in t.rows
        for c in t.columns
    ]
    stream.add(
        "console_csv",
        "clean",
        lines(long, quote=True),
        bare,
        answers={"tz": "UTC", "tag": "measure_name", "value": "measure_value::double"},
        content_type="text/csv",
        must_ask=("tz",),
    )
    sparse = [["time", "device", "measure_name", "measure_value::double", "measure_value::bigint"]]
    rows = [
        [stamp(t.clock(k), "%Y-%m-%d %H:%M:%S") + ".000000000", "pump", c.name, c.values[k], "-"]
        for k in t.rows
        for c in t.columns
    ]
    stream.add(
        "console_csv_dashes",
        "nasty",
        lines(sparse + rows, quote=True),
        bare,
        answers={"tz": "UTC", "tag": "measure_name", "value": "measure_value::double", "missing": "-"},
        content_type="text/csv",
        must_ask=("tz",),
    )
    return azure.variants + stream.variants


def other_services():
    family = Family("web_services", "application/json")
    t = table("PT101 TT102", step="10")
    bare = t.truth(units=["", ""])
    plotly = [
        {"x": [iso(t, k, 3) for k in t.rows], "y": [c.number(k) for k in t.rows], "name": c.name, "type": "scatter"}
        for c in t.columns
    ]
    family.add("plotly_traces", "nasty", json.dumps(plotly), bare)
    rows = [
        {"time": iso(t, k, 3), "name": c.name, "value": c.number(k), "unit": c.unit}
        for k in t.rows
        for c in t.columns
    ]
    family.add("row_for_each_sample", "typical", json.dumps(rows), t.truth())
    wrapped = {"data": [{"timestamp": iso(t, k, 3), **{c.name: c.number(k) for c in t.columns}} for k in t.rows]}
    family.add("wrapped_records", "typical", json.dumps(wrapped), bare)
    series = [{"target": c.name, "datapoints": [[c.number(k), t.milliseconds(k)] for k in t.rows]} for c in t.columns]
    family.add("grafana_json_datasource", "typical", json.dumps(series), bare)
    graphite = [
        {"target": c.name, "datapoints": [[c.number(k), t.milliseconds(k) // 1000] for k in t.rows]}
        for c in t.columns
    ]
    family.add("graphite_render", "typical", json.dumps(graphite), bare)
    opentsdb = [
        {
            "metric": c.name,
            "tags": {},
            "aggregateTags": [],
            "dps": {str(t.milliseconds(k) // 1000): c.number(k) for k in t.rows},
        }
        for c in t.columns
    ]
    family.add("opentsdb_query", "typical", json.dumps(opentsdb), bare)
    sparkplug = [
        {
            "timestamp": t.milliseconds(k),
            "metrics": [
                {"name": c.name, "timestamp": t.milliseconds(k), "dataType": "Double", "value": c.number(k)}
                for c in t.columns
            ],
            "seq": k,
        }
        for k in t.rows
    ]
    family.add("sparkplug_decoded", "nasty", json.dumps(sparkplug), bare, harmless=("seq",))
    senml = [
        {
            "bn": "pump/",
            "bt": t.milliseconds(0) / 1000,
            "n": t.columns[0].name,
            "u": "Pa",
            "v": t.columns[0].number(0),
        }
    ]
    senml += [
        {"n": t.columns[0].name, "u": "Pa", "t": float(t.instants[k]), "v": t.columns[0].number(k)}
        for k in t.rows[1:]
    ]
    lone = table("PT101", step="10")
    family.add("senml", "nasty", json.dumps(senml), lone.truth(units=["Pa"]), content_type="application/senml+json")
    return family.variants


def variants():
    return cognite() + sitewise() + thingsboard() + home_assistant() + azure_and_aws() + other_services()
