"""Tables as notebooks write them: pandas, polars, MATLAB and Simulink."""

import json

from payloads import BERLIN, Family, bracketed, lines, names_of, packed, stamp, table, wide

ISO = "%Y-%m-%d %H:%M:%S"


def pandas_csv():
    family = Family("pandas_to_csv")
    t = table("PT101 TT102 FT103")
    offset = lambda k: stamp(t.clock(k), ISO) + "+00:00"
    family.add("utc_index", "clean", wide(t, offset, bracketed(t), time_title="time"), t.truth())
    family.add("utc_index_no_name", "typical", wide(t, offset, bracketed(t), time_title=""), t.truth())
    family.add(
        "naive_index",
        "typical",
        wide(t, lambda k: stamp(t.clock(k), ISO), bracketed(t), time_title=""),
        t.truth(),
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    berlin = lambda k: stamp(t.clock(k), ISO, BERLIN) + "+01:00"
    family.add("berlin_index", "typical", wide(t, berlin, bracketed(t), time_title="ts"), t.truth())
    numbered = [["", "time", *bracketed(t)]] + [[k, offset(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add(
        "range_index",
        "typical",
        lines(numbered),
        t.truth(),
        harmless=("", "Unnamed: 0", "column_1"),
        answers={"time": "time"},
    )
    unnamed = [["Unnamed: 0", *numbered[0][1:]], *numbered[1:]]
    family.add(
        "range_index_twice",
        "nasty",
        lines([["", *unnamed[0]]] + [[r[0], *r] for r in unnamed[1:]]),
        t.truth(),
        harmless=("", "Unnamed: 0", "column_1", "column_2"),
        answers={"time": "time"},
    )
    fast = table(step="0.001")
    micro = lambda k: stamp(fast.clock(k), ISO + ".%f") + "+00:00"
    whole = lambda k: micro(k).replace(".000000", "")
    family.add("microseconds", "typical", wide(fast, micro, bracketed(fast)), fast.truth())
    family.add("fraction_only_where_needed", "nasty", wide(fast, whole, bracketed(fast)), fast.truth())
    gaps = table(missing=((2, 0), (3, 0), (9, 2)))
    for word in ("", "NaN", "nan", "NULL", "<NA>", "None", "inf"):
        family.add(
            f"missing_{word or 'empty'}",
            "typical",
            wide(gaps, offset, bracketed(gaps), missing=word),
            gaps.truth(),
            answers={"missing": word},
        )
    family.add("european", "typical", wide(t, offset, bracketed(t), ";", ","), t.truth())
    family.add("gzip", "typical", packed(wide(t, offset, bracketed(t)).encode()), t.truth())
    seconds = lambda k: t.seconds(k, 1)
    family.add("float_seconds", "clean", wide(t, seconds, bracketed(t), time_title="t_s"), t.truth(False))
    delta = lambda k: f"0 days 00:00:{k:02d}"
    family.add("timedelta_index", "nasty", wide(t, delta, bracketed(t), time_title="elapsed"), t.truth(False))
    deltas = lambda k: f"0 days 00:00:00.{k:03d}000" if k else "0 days 00:00:00"
    family.add("timedelta_fractions", "nasty", wide(fast, deltas, bracketed(fast), time_title=""), fast.truth(False))
    nanoseconds = lambda k: str(t.milliseconds(k) * 10**6)
    family.add(
        "epoch_ns",
        "typical",
        wide(t, nanoseconds, bracketed(t), time_title="time_ns"),
        t.truth(),
        answers={"time_unit": "ns"},
    )
    family.add(
        "epoch_ms_unnamed",
        "nasty",
        wide(t, lambda k: str(t.milliseconds(k)), bracketed(t), time_title="time"),
        t.truth(),
        answers={"time_unit": "ms"},
    )
    family.add(
        "epoch_float_s",
        "nasty",
        wide(t, lambda k: f"{t.milliseconds(k) / 1000:.1f}", bracketed(t), time_title="timestamp"),
        t.truth(),
        answers={"time_unit": "s"},
    )
    science = lambda k: f"{t.milliseconds(k) / 1000:.9e}"
    family.add(
        "epoch_exponent",
        "nasty",
        wide(t, science, bracketed(t), time_title="time"),
        t.truth(),
        answers={"time_unit": "s"},
    )
    levels = [["", *("PT101 TT102 FT103".split())], ["unit", *(c.unit for c in t.columns)], ["time", "", "", ""]]
    body = [[offset(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add(
        "two_levels_of_columns",
        "nasty",
        lines(levels + body),
        t.truth(),
        answers={"header_row": "1", "unit_row": "2"},
    )
    melted = [["time", "variable", "value"]] + [[offset(k), c.name, c.values[k]] for c in t.columns for k in t.rows]
    family.add(
        "melted", "typical", lines(melted), t.truth(units=["", "", ""]), answers={"tag": "variable", "value": "value"}
    )
    plain = wide(t, offset, names_of(t))
    family.add("no_units", "typical", plain, t.truth(units=["", "", ""]))
    flagged = [["time", *bracketed(t), "is_running", "mode"]] + [
        [offset(k), *(c.values[k] for c in t.columns), str(k > 4), "AUTO" if k > 2 else "MAN"] for k in t.rows
    ]
    family.add(
        "flags_and_words",
        "nasty",
        lines(flagged),
        t.truth(),
        harmless=("is_running", "mode"),
        answers={"ignore": "is_running,mode"},
    )
    repeated = [["time", *bracketed(t)]] + body[:10] + [["time", *bracketed(t)]] + body[10:]
    family.add("joined_files", "nasty", lines(repeated), t.truth())
    shuffled = [["time", *bracketed(t)]] + body[10:] + body[:10]
    family.add("blocks_out_of_order", "nasty", lines(shuffled), t.truth())
    doubled = [["time", *bracketed(t)]] + body[:10] + [body[9]] + body[10:]
    family.add("row_twice", "nasty", lines(doubled), t.truth())
    return family.variants


def pandas_json():
    family = Family("pandas_to_json", "application/json")
    t = table("PT101 TT102 FT103", missing=((4, 1),))
    bare = t.truth(units=["", "", ""])
    records = [{"timestamp": t.milliseconds(k), **{c.name: c.number(k) for c in t.columns}} for k in t.rows]
    family.add("records_ms", "clean", json.dumps(records), bare)
    iso = [
        {**r, "timestamp": stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", digits=3) + "Z"} for k, r in enumerate(records)
    ]
    family.add("records_iso", "typical", json.dumps(iso), bare)
    split = {
        "columns": names_of(t),
        "index": [r["timestamp"] for r in records],
        "data": [[c.number(k) for c in t.columns] for k in t.rows],
    }
    family.add("split_index", "typical", json.dumps(split), bare)
    keyed = {c.name: {str(t.milliseconds(k)): c.number(k) for k in t.rows} for c in t.columns}
    family.add("columns", "typical", json.dumps(keyed), bare)
    rows = {str(t.milliseconds(k)): {c.name: c.number(k) for c in t.columns} for k in t.rows}
    family.add("index", "nasty", json.dumps(rows), bare)
    fields = [{"name": "index", "type": "datetime", "tz": "UTC"}] + [
        {"name": c.name, "type": "number"} for c in t.columns
    ]
    data = [{"index": r["timestamp"], **{k: v for k, v in r.items() if k != "timestamp"}} for r in iso]
    family.add(
        "table",
        "typical",
        json.dumps({"schema": {"fields": fields, "primaryKey": ["index"], "pandas_version": "1.4.0"}, "data": data}),
        bare,
    )
    lists = {"time": [r["timestamp"] for r in iso], **{c.name: [c.number(k) for k in t.rows] for c in t.columns}}
    family.add("dict_of_lists", "typical", json.dumps(lists), bare)
    family.add("records_as_text", "nasty", json.dumps(records), bare, content_type="text/plain")
    family.add(
        "nan_tokens",
        "nasty",
        json.dumps([{k: (float("nan") if v is None else v) for k, v in r.items()} for r in records]),
        bare,
    )
    return family.variants


def polars_and_spark():
    family = Family("polars_write_csv")
    t = table(step="0.25", missing=((3, 1),))
    form = lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f")
    family.add("utc", "clean", wide(t, lambda k: form(k) + "+0000", bracketed(t)), t.truth())
    family.add("naive", "typical", wide(t, form, bracketed(t)), t.truth(), answers={"tz": "UTC"}, must_ask=("tz",))
    family.add("nanoseconds", "typical", wide(t, lambda k: form(k) + "000Z", bracketed(t)), t.truth())
    family.add(
        "spark",
        "typical",
        wide(
            t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", BERLIN, 3) + "+01:00", bracketed(t), missing="@"
        ).replace(",@,", ',"",'),
        t.truth(),
    )
    text = wide(t, lambda k: form(k) + "Z", bracketed(t), missing="null")
    family.add("null_words", "nasty", text, t.truth(), answers={"missing": "null"})
    return family.variants


def matlab():
    family = Family("matlab_writetable")
    t = table("PT101 TT102 FT103", step="0.1", missing=((4, 0),))
    titles = [f"{c.name}_{u}" for c, u in zip(t.columns, ("bar", "degC", "m3_h"))]
    family.add(
        "seconds",
        "clean",
        wide(t, lambda k: f"{k * 0.1:.15g}", bracketed(t), missing="NaN", time_title="Time_s"),
        t.truth(False),
    )
    sec = lambda k: f"{k * 0.1:.15g} sec"
    family.add(
        "timetable_durations",
        "typical",
        wide(t, sec, names_of(t), missing="NaN", time_title="Time"),
        t.truth(False, units=["", "", ""]),
    )
    day = lambda k: stamp(t.clock(k), "%d-%b-%Y %H:%M:%S.%f", digits=3)
    family.add(
        "datetime_default",
        "typical",
        wide(t, day, names_of(t), missing="NaN", time_title="Time"),
        t.truth(units=["", "", ""]),
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    slow = table(step="1")
    whole = lambda k: stamp(slow.clock(k), "%d-%b-%Y %H:%M:%S")
    family.add(
        "datetime_seconds",
        "typical",
        wide(slow, whole, names_of(slow), time_title="Time"),
        slow.truth(units=["", "", ""]),
        answers={"tz": "UTC"},
        must_ask=("tz",),
    )
    serial = lambda k: f"{t.begin.toordinal() + 366 + 8.25 / 24 + 0.1 * k / 86400:.12f}"
    truth = t.truth(units=["", "", ""])
    truth.tolerance = 2e-5
    family.add(
        "datenum",
        "nasty",
        wide(t, serial, names_of(t), missing="NaN", time_title="datenum"),
        truth,
        answers={"time_unit": "datenum", "tz": "UTC"},
        must_ask=("tz",),
    )
    family.add(
        "suffixes",
        "typical",
        wide(t, lambda k: f"{k * 0.1:.15g}", titles[:2] + ["FT103"], missing="NaN", time_title="t"),
        t.truth(False, names=titles[:2] + ["FT103"], units=["bar", "°C", ""]),
    )
    clock = lambda k: f"00:00:{k * 0.1:04.1f}"
    family.add(
        "duration_clock", "nasty", wide(t, clock, bracketed(t), missing="NaN", time_title="Time"), t.truth(False)
    )
    plain = lines([[f"{k * 0.1:.4e}", *(f"{float(c.values[k]):.4e}" for c in slow.columns)] for k in slow.rows])
    truth = table("PT101 TT102 FT103", step="0.1")
    for column in truth.columns:
        column.values = [f"{float(v):.4e}" for v in column.values]
    family.add(
        "writematrix",
        "nasty",
        plain,
        truth.truth(False, units=["", "", ""], names=["column_2", "column_3", "column_4"]),
        answers={"header_row": "none", "time_unit": "s"},
    )
    family.add(
        "tabs",
        "typical",
        wide(t, lambda k: f"{k * 0.1:.15g}", bracketed(t), "\t", missing="NaN", time_title="Time_s"),
        t.truth(False),
    )
    return family.variants


def simulink():
    family = Family("simulink_data_inspector")
    t = table("PT101 TT102", step="0.01")
    units = ["Unit: bar", "Unit: degC"]
    rows = [[f"{k * 0.01:.2f}", *(c.values[k] for c in t.columns)] for k in t.rows]
    family.add("units", "clean", lines([["time", *names_of(t)], ["", *units], *rows]), t.truth(False))
    family.add(
        "types_units_paths",
        "typical",
        lines(
            [
                ["time", *names_of(t)],
                ["", "Type: double", "Type: double"],
                ["", *units],
                ["", "BlockPath: plant/pump", "BlockPath: plant/tank"],
                ["", "PortIndex: 1", "PortIndex: 1"],
                *rows,
            ]
        ),
        t.truth(False),
    )
    family.add(
        "interpolations",
        "typical",
        lines([["time", *names_of(t)], ["", "Interp: linear", "Interp: zoh"], ["", *units], *rows]),
        t.truth(False),
    )
    column_values = [["time", "PT101", "time", "TT102"], ["", units[0], "", units[1]]]
    slow = [row for row in rows[::2]]
    pairs = [[*rows[k][:2], *(slow[k][::2] if k < len(slow) else ["", ""])] for k in t.rows]
    truth = t.truth(False)
    values = truth.signals["TT102"]["values"]
    truth.signals["TT102"]["values"] = {instant: v for k, (instant, v) in enumerate(values.items()) if k % 2 == 0}
    family.add("own_times", "nasty", lines(column_values + pairs), truth, answers={"grid": "none"})
    family.add(
        "names_with_dots", "nasty", lines([["time", "Bus.PT101", "Bus.TT102"], ["", *units], *rows]), t.truth(False)
    )
    return family.variants


def variants():
    return pandas_csv() + pandas_json() + polars_and_spark() + matlab() + simulink()
