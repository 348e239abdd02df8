"""Answers and exports of plant historians."""

import json

from payloads import BERLIN, NEW_YORK, Family, bracketed, lines, names_of, number, stamp, table, wide

ISO_Z = "%Y-%m-%dT%H:%M:%S"


def iso(t, k, digits=7):
    return stamp(t.clock(k), ISO_Z) + "." + stamp(t.clock(k), "%f", digits=digits) + "Z"


def long(t, time, *more, missing=""):
    """A row for each sample: time, tag, value and what `more` says of column and row."""
    return [
        [time(k), c.name, number(c.values[k], ".", missing), *(text(c, k) for text in more)]
        for k in t.rows
        for c in t.columns
    ]


def marked(t, bad):
    """The table with samples that the source calls bad."""
    for position, column in enumerate(t.columns):
        column.qualities = [(row, position) not in bad for row in t.rows]
    return t


def pi_data_link():
    family = Family("pi_datalink")
    t = table("PT101 TT102 FT103", step="10", titles=("HALL3:PT101.PV", "HALL3:TT102.PV", "HALL3:FT103.PV"))
    day = lambda k: stamp(t.clock(k), "%d-%b-%y %H:%M:%S", NEW_YORK)
    zone = {"tz": "America/New_York"}
    family.add(
        "sampled_data",
        "clean",
        wide(t, day, bracketed(t), time_title="Timestamp", end="\r\n"),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    descriptors = [["", *(c.description for c in t.columns)], ["", *(c.unit for c in t.columns)]]
    family.add(
        "descriptor_and_unit_rows",
        "typical",
        wide(t, day, names_of(t), time_title="Timestamp", below=descriptors),
        t.truth(),
        answers={**zone, "header_row": "1", "unit_row": "3"},
        must_ask=("tz",),
    )
    above = [["", *(c.description for c in t.columns)]]
    family.add(
        "descriptors_above",
        "typical",
        wide(t, day, names_of(t), time_title="Timestamp", top=above, below=descriptors[1:]),
        t.truth(),
        answers={**zone, "header_row": "2", "unit_row": "3"},
        must_ask=("tz",),
    )
    fast = table("PT101 TT102 FT103", step="0.5")
    family.add(
        "subseconds",
        "typical",
        wide(
            fast,
            lambda k: stamp(fast.clock(k), "%d-%b-%Y %H:%M:%S.%f", NEW_YORK, 5),
            bracketed(fast),
            time_title="Time",
        ),
        fast.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    gaps = table("PT101 TT102 FT103", step="10", missing=((2, 0), (5, 1), (6, 1)))
    clock = lambda k: stamp(gaps.clock(k), "%d-%b-%y %H:%M:%S", NEW_YORK)
    for word in (
        "No Data",
        "Bad Input",
        "I/O Timeout",
        "Pt Created",
        "Bad",
        "Calc Failed",
        "Shutdown",
        "[-11059] No Good Data For Calculation",
    ):
        family.add(
            "state_" + word.split("]")[-1].strip().replace(" ", "_"),
            "nasty",
            wide(gaps, clock, bracketed(gaps), missing=word, time_title="Timestamp"),
            gaps.truth(),
            answers={**zone, "missing": word},
            must_ask=("tz",),
        )
    pairs = [[cell for c in t.columns for cell in (f"{c.name} time", f"{c.name} [{c.unit}]")]]
    body = [[cell for c in t.columns for cell in (day(k), c.values[k])] for k in t.rows]
    family.add("compressed_data_in_pairs", "nasty", lines(pairs + body), t.truth(), answers=zone, must_ask=("tz",))
    german = wide(
        t,
        lambda k: stamp(t.clock(k), "%d-%b-%y %H:%M:%S", BERLIN).replace("Mar", "Mrz"),
        bracketed(t),
        ";",
        ",",
        time_title="Zeit",
    )
    family.add("german_months", "nasty", german, t.truth(), answers={"tz": "Europe/Berlin"}, must_ask=("tz",))
    return family.variants


def pi_web_api():
    family = Family("pi_web_api", "application/json")
    t = table("PT101 TT102", step="5")

    def stream(c, rows, missing=()):
        items = []
        for k in rows:
            value = c.number(k)
            good = not (c.qualities and not c.qualities[k])
            state = {"Name": "No Data", "Value": 248, "IsSystem": True}
            items.append(
                {
                    "Timestamp": iso(t, k),
                    "Value": value if good else state,
                    "UnitsAbbreviation": c.unit,
                    "Good": good,
                    "Questionable": False,
                    "Substituted": False,
                    "Annotated": False,
                }
            )
        return {
            "WebId": "F1DP" + c.name,
            "Name": c.name,
            "Path": f"\\\\PI\\{c.name}",
            "Links": {},
            "Items": items,
            "UnitsAbbreviation": c.unit,
        }

    family.add(
        "stream_set", "clean", json.dumps({"Links": {}, "Items": [stream(c, t.rows) for c in t.columns]}), t.truth()
    )
    bad = marked(table("PT101 TT102", step="5"), {(3, 0), (4, 0), (11, 1)})
    family.add(
        "system_states",
        "typical",
        json.dumps({"Links": {}, "Items": [stream(c, bad.rows) for c in bad.columns]}),
        bad.truth(),
    )
    lone = table("PT101", step="5")
    answer = stream(lone.columns[0], lone.rows)
    family.add(
        "one_stream",
        "typical",
        json.dumps({"Links": {}, "Items": answer["Items"], "UnitsAbbreviation": "bar"}),
        lone.truth(names=["value"]),
        answers={"rename": "value:PT101"},
    )
    family.add(
        "newest_first",
        "nasty",
        json.dumps({"Items": [{**stream(c, t.rows), "Items": stream(c, t.rows)["Items"][::-1]} for c in t.columns]}),
        t.truth(),
    )
    summary = {
        "Items": [
            {
                "Name": c.name,
                "UnitsAbbreviation": c.unit,
                "Items": [{"Type": "Average", "Value": i} for i in stream(c, t.rows)["Items"]],
            }
            for c in t.columns
        ]
    }
    family.add("summaries", "nasty", json.dumps(summary), t.truth())
    selected = {
        "Items": [
            {"Name": c.name, "Items": [{k: i[k] for k in ("Timestamp", "Value")} for i in stream(c, t.rows)["Items"]]}
            for c in t.columns
        ]
    }
    family.add("selected_fields", "typical", json.dumps(selected), t.truth(units=["", ""]))
    batch = {"values": {"Status": 200, "Headers": {}, "Content": {"Items": [stream(c, t.rows) for c in t.columns]}}}
    family.add("batch_answer", "nasty", json.dumps(batch), t.truth())
    family.add(
        "utf8_mark",
        "nasty",
        b"\xef\xbb\xbf" + json.dumps({"Items": [stream(c, t.rows) for c in t.columns]}).encode(),
        t.truth(),
    )
    return family.variants


def omf():
    family = Family("omf", "application/json")
    t = table("PT101 TT102", step="5")
    bare = t.truth(units=["", ""])
    each = [
        {"containerid": c.name, "values": [{"Timestamp": iso(t, k, 3), "Value": c.number(k)} for k in t.rows]}
        for c in t.columns
    ]
    family.add("container_for_each", "clean", json.dumps(each), bare)
    whole = [
        {
            "containerid": "pump",
            "values": [{"Time": iso(t, k, 3), **{c.name: c.number(k) for c in t.columns}} for k in t.rows],
        }
    ]
    family.add("several_properties", "typical", json.dumps(whole), bare)
    rows = [
        {"containerid": c.name, "values": [{"Timestamp": iso(t, k, 3), "Value": c.number(k)}]}
        for k in t.rows
        for c in t.columns
    ]
    family.add("message_for_each_sample", "typical", json.dumps(rows), bare)
    typed = [{"typeid": "pump.v1", **entry} for entry in each]
    family.add("type_ids", "typical", json.dumps(typed), bare)
    flagged = [
        {
            "containerid": c.name,
            "values": [
                {"Timestamp": iso(t, k, 3), "Value": c.number(k), "IsQuestionable": False, "IsSubstituted": False}
                for k in t.rows
            ],
        }
        for c in t.columns
    ]
    family.add("flags", "nasty", json.dumps(flagged), bare, harmless=(".*Is(Questionable|Substituted)",))
    return family.variants


def proficy():
    family = Family("proficy_historian")
    t = table("PT101 TT102", step="10", titles=("SRV.PT101.F_CV", "SRV.TT102.F_CV"))
    am = lambda k: stamp(t.clock(k), "%m/%d/%Y %I:%M:%S.%f %p", NEW_YORK, 3)
    answers = {"tz": "America/New_York", "time_unit": "mdy"}
    bare = t.truth(units=["", ""])
    head = ["Tagname", "TimeStamp", "Value", "DataQuality"]
    rows = [[c.name, am(k), c.values[k], "Good"] for c in t.columns for k in t.rows]
    family.add("excel_add_in", "clean", lines([head, *rows]), bare, answers=answers, must_ask=("tz",))
    family.add(
        "data_section",
        "typical",
        lines([["[Data]"], head, *rows]),
        bare,
        answers={**answers, "header_row": "2"},
        must_ask=("tz",),
    )
    tags = [
        ["[Tags]"],
        ["Tagname", "Description", "EngineeringUnits", "DataType"],
        *([c.name, c.description, c.unit, "SingleFloat"] for c in t.columns),
        [""],
    ]
    family.add(
        "tags_and_data",
        "nasty",
        lines(tags + [["[Data]"], head, *rows]),
        t.truth(),
        answers={**answers, "header_row": "7", "units": "SRV.PT101.F_CV:bar,SRV.TT102.F_CV:°C"},
        must_ask=("tz",),
    )
    percent = [[c.name, am(k), c.values[k], "100"] for c in t.columns for k in t.rows]
    family.add(
        "percent_good",
        "typical",
        lines([["tagname", "timestamp", "value", "quality"], *percent]),
        bare,
        answers={**answers, "quality": "none"},
        must_ask=("tz",),
    )
    bad = marked(table("PT101 TT102", step="10", titles=("SRV.PT101.F_CV", "SRV.TT102.F_CV")), {(3, 0), (7, 1)})
    rows = [
        [c.name, am(k), c.values[k] if c.qualities[k] else "0", "Good" if c.qualities[k] else "Bad"]
        for c in bad.columns
        for k in bad.rows
    ]
    family.add(
        "bad_as_zero", "nasty", lines([head, *rows]), bad.truth(units=["", ""]), answers=answers, must_ask=("tz",)
    )
    ole = [["tagname", "timestamp", "intervalmilliseconds", "value", "quality", "opcquality", "opcqualityvalid"]]
    rows = [
        [c.name, stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=3), "10000", c.values[k], "100", "192", "1"]
        for c in t.columns
        for k in t.rows
    ]
    family.add(
        "ole_db_rows",
        "nasty",
        lines(ole + rows),
        bare,
        answers={"tz": "UTC", "value": "value", "quality": "opcquality", "tag": "tagname"},
        must_ask=("tz",),
    )
    rest = {
        "Data": [
            {
                "TagName": c.name,
                "ErrorCode": 0,
                "DataType": "Float",
                "Samples": [{"TimeStamp": iso(t, k, 3), "Value": c.values[k], "Quality": "3"} for k in t.rows],
            }
            for c in t.columns
        ],
        "ErrorCode": 0,
        "ErrorMessage": None,
    }
    family.add(
        "rest",
        "nasty",
        json.dumps(rest),
        bare,
        answers={"quality_scheme": "proficy"},
        content_type="application/json",
    )
    return family.variants


def aveva_sql():
    family = Family("aveva_historian_sql")
    t = table("PT101 TT102", step="5", titles=("Reactor.PT101", "Reactor.TT102"))
    zone, bare = {"tz": "UTC"}, t.truth(units=["", ""])
    clock = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f") + "0"
    cyclic = [
        [
            "DateTime",
            "TagName",
            "Value",
            "vValue",
            "Quality",
            "QualityDetail",
            "OPCQuality",
            "wwTagKey",
            "wwRetrievalMode",
            "wwResolution",
            "wwTimeZone",
        ]
    ]
    rows = [
        [clock(k), c.name, c.values[k], c.values[k], "0", "192", "192", "17", "Cyclic", "5000", "UTC"]
        for k in t.rows
        for c in t.columns
    ]
    family.add("history", "typical", lines(cyclic + rows), bare, answers={**zone, "value": "Value"})
    short = long(t, clock, lambda c, k: "0", lambda c, k: "192", lambda c, k: "192")
    head = [["DateTime", "TagName", "Value", "Quality", "QualityDetail", "OPCQuality"]]
    family.add("clean", "clean", lines(head + short), bare, answers=zone, must_ask=("tz",))
    gaps = table("PT101 TT102", step="5", missing=((3, 0), (4, 1)))
    rows = [
        [
            clock(k),
            c.name,
            c.values[k] or "NULL",
            "0" if c.values[k] else "1",
            "192" if c.values[k] else "24",
            "192" if c.values[k] else "0",
        ]
        for k in gaps.rows
        for c in gaps.columns
    ]
    family.add(
        "null_and_bad", "typical", lines(head + rows), gaps.truth(units=["", ""]), answers=zone, must_ask=("tz",)
    )
    grid = [["DateTime", "Reactor.PT101", "Reactor.TT102"]]
    family.add(
        "wide_history",
        "typical",
        lines(grid + [[clock(k), *(c.values[k] for c in t.columns)] for k in t.rows]),
        bare,
        answers=zone,
        must_ask=("tz",),
    )
    fixed = (
        "DateTime                    TagName        Value    Quality\n"
        + "-" * 27
        + " "
        + "-" * 14
        + " "
        + "-" * 8
        + " -------\n"
        + "".join(f"{clock(k):27} {c.name:14} {c.values[k]:>8} {'0':>7}\n" for k in t.rows for c in t.columns)
    )
    family.add(
        "sqlcmd_fixed_width",
        "nasty",
        fixed + f"\n({len(t.instants) * 2} rows affected)\n",
        bare,
        answers={**zone, "quality_scheme": "aveva_quality"},
        content_type="text/plain",
    )
    trend = [["Tag Name", "Units", "DateTime", "Value"]] + [
        [c.name, c.unit, stamp(t.clock(k), "%m/%d/%Y %I:%M:%S %p", NEW_YORK), c.values[k]]
        for c in t.columns
        for k in t.rows
    ]
    family.add(
        "trend_export",
        "typical",
        lines(trend),
        t.truth(),
        answers={"tz": "America/New_York", "time_unit": "mdy"},
        must_ask=("tz",),
    )
    return family.variants


def aveva_odata():
    family = Family("aveva_odata", "application/json")
    t = table("PT101 TT102", step="5", titles=("Plant.PT101", "Plant.TT102"))
    rows = [
        {"FQN": c.name, "DateTime": iso(t, k, 3), "OpcQuality": 192, "Value": c.number(k), "Text": None}
        for c in t.columns
        for k in t.rows
    ]
    bare = t.truth(units=["", ""])
    family.add(
        "process_values",
        "clean",
        json.dumps({"@odata.context": "https://host/$metadata#ProcessValues", "value": rows}),
        bare,
    )
    united = [
        {**row, "EngUnit": c.unit, "Unit": c.unit} for row, c in zip(rows, [c for c in t.columns for _ in t.rows])
    ]
    family.add(
        "next_link", "typical", json.dumps({"odata.metadata": "x", "value": rows, "odata.nextLink": "y"}), bare
    )
    family.add("units", "nasty", json.dumps({"value": united}), t.truth())
    bad = marked(table("PT101 TT102", step="5", titles=("Plant.PT101", "Plant.TT102")), {(3, 0), (7, 1)})
    rows = [
        {
            "FQN": c.name,
            "DateTime": iso(bad, k, 3),
            "OpcQuality": 192 if c.qualities[k] else 0,
            "Value": c.number(k) if c.qualities[k] else None,
        }
        for c in bad.columns
        for k in bad.rows
    ]
    family.add("bad_samples", "typical", json.dumps({"value": rows}), bad.truth(units=["", ""]))
    return family.variants


def canary():
    family = Family("canary", "application/json")
    t = table("PT101 TT102", step="5", titles=("Site.PT101", "Site.TT102"))
    bare = t.truth(units=["", ""])
    data = {c.name: [{"t": iso(t, k), "v": c.number(k), "q": 192} for k in t.rows] for c in t.columns}
    family.add("clean", "clean", json.dumps({"statusCode": "Good", "errors": [], "data": data}), bare)
    offset = {
        name: [{**p, "t": stamp(t.clock(k), ISO_Z, BERLIN) + ".0000000+01:00"} for k, p in enumerate(points)]
        for name, points in data.items()
    }
    family.add("offsets", "typical", json.dumps({"statusCode": "Good", "data": offset, "continuation": None}), bare)
    gaps = marked(table("PT101 TT102", step="5", titles=("Site.PT101", "Site.TT102")), {(4, 0), (5, 0)})
    nodata = {
        c.name: [
            {"t": iso(t, k), "v": c.number(k) if c.qualities[k] else None, "q": 192 if c.qualities[k] else 32768}
            for k in gaps.rows
        ]
        for c in gaps.columns
    }
    family.add("no_data", "nasty", json.dumps({"statusCode": "Good", "data": nodata}), gaps.truth(units=["", ""]))
    csv = wide(
        t, lambda k: stamp(t.clock(k), "%-m/%-d/%Y %-I:%M:%S.%f %p", NEW_YORK, 3), names_of(t), time_title="Timestamp"
    )
    family.add(
        "axiom_csv",
        "typical",
        csv,
        bare,
        answers={"tz": "America/New_York", "time_unit": "mdy"},
        must_ask=("tz",),
        content_type="text/csv",
    )
    arrays = {name: [[p["t"], p["v"], p["q"]] for p in points] for name, points in data.items()}
    family.add("arrays", "nasty", json.dumps({"statusCode": "Good", "data": arrays}), bare)
    return family.variants


def variants():
    return pi_data_link() + pi_web_api() + omf() + proficy() + aveva_sql() + aveva_odata() + canary()
