"""Columns of quality, one title and one spelling at a time, each with bad samples in it."""

import json

from historians import iso, marked
from payloads import Family, lines, table


def quality_columns():
    """A bad sample in a table with a row for each sample, under each title that a column of quality has."""
    family = Family("quality_in_rows")
    bad = marked(table("PT101 TT102", rows=12), {(4, 0), (7, 1)})
    truth = bad.truth(units=["", ""])

    def add(title, good, wrong, answers=None, level="typical", truth=truth, harmless=()):
        rows = [
            [iso(bad, k, 3), c.name, c.values[k], good if c.qualities[k] else wrong]
            for k in bad.rows
            for c in bad.columns
        ]
        family.add(
            f"{title} {good} {wrong}".replace(" ", "_"),
            level,
            lines([["Timestamp", "Tag", "Value", title], *rows]),
            truth,
            answers=answers or {},
            harmless=harmless,
        )

    for title in (
        "Quality",
        "DataQuality",
        "Data Quality",
        "QualityText",
        "Status",
        "TagQuality",
        "Qualität",
        "Value Status",
        "Q",
        "OPC Quality",
        "Quality Description",
        "Flag",
    ):
        add(title, "Good", "Bad", {"quality": title})
    for title, wrong in (
        ("StatusCode", "BadSensorFailure"),
        ("StatusCode", "Bad_NoCommunication"),
        ("StatusCode", "BadWaitingForInitialData"),
        ("Quality", "Bad, Not Connected"),
        ("Quality", "BAD"),
        ("Quality", "Bad [Comm Failure]"),
        ("Quality", "Bad_Stale"),
        ("Quality", "Not Good"),
        ("Quality", "Invalid"),
        ("Quality", "Comm Fail"),
        ("Quality", "Configuration Error"),
        ("Quality", "Error"),
    ):
        add(title, "Good", wrong, {"quality": title, "quality_scheme": "words"}, "nasty")
    for title, good, wrong in (
        ("IsGood", "true", "false"),
        ("Good", "True", "False"),
        ("IsValid", "1", "0"),
        ("Bad", "0", "1"),
        ("Questionable", "False", "True"),
        ("Valid", "Yes", "No"),
    ):
        add(title, good, wrong, {"quality": title, "quality_scheme": "words"}, "nasty")
    for title, good, wrong, scheme in (
        ("OPCQuality", "192", "0", "opc_da"),
        ("Quality", "192", "24", "opc_da"),
        ("Quality", "0xC0", "0x00", "opc_da"),
        ("QualityCode", "192", "8", "opc_da"),
        ("StatusCode", "0", "2147483648", "opc_ua"),
        ("StatusCode", "0x00000000", "0x80310000", "opc_ua"),
        ("Quality Code", "192", "500", "ignition_legacy"),
        ("QualityDetail", "192", "24", "aveva_quality_detail"),
    ):
        add(title, good, wrong, {"quality": title, "quality_scheme": scheme}, "nasty")
    return family.variants


def qualities_beside():
    """A bad sample in a table with a column for each signal, under each title of a quality beside it."""
    family = Family("quality_beside_signals")
    bad = marked(table("PT101 TT102", rows=12), {(4, 0), (7, 1)})

    def add(name, titles, good, wrong, answers=None):
        head = ["Timestamp"] + [
            cell for c, title in zip(bad.columns, titles) for cell in (f"{c.name} [{c.unit}]", title)
        ]
        rows = [
            [iso(bad, k, 3)]
            + [cell for c in bad.columns for cell in (c.values[k], good if c.qualities[k] else wrong)]
            for k in bad.rows
        ]
        family.add(
            name,
            "nasty",
            lines([head, *rows]),
            bad.truth(),
            answers=answers or {},
            harmless=(r".*([Qq]ual|[Ss]tat|_Q|\.Q|QF|[Gg]ood|Flag).*",),
        )

    for form in (
        "{}.Quality",
        "{}_Quality",
        "{} Quality",
        "{}.Q",
        "{}_Q",
        "{} Status",
        "{}_status",
        "{}.Status",
        "Q {}",
        "Quality({})",
        "{} (Quality)",
        "{}_QF",
        "{}/Quality",
        "{}.StatusCode",
        "{} Flag",
        "{}_isGood",
    ):
        titles = [form.format(c.name) for c in bad.columns]
        good, wrong = ("1", "0") if "isGood" in form else ("Good", "Bad")
        add(form.format("tag").replace(" ", "_"), titles, good, wrong)
    for form, scheme in (("{}.Quality", "opc_da"), ("{}_Q", "opc_da"), ("{} Status", "opc_da")):
        add(
            form.format("tag").replace(" ", "_") + "_192",
            [form.format(c.name) for c in bad.columns],
            "192",
            "0",
            {"quality_scheme": scheme},
        )
    add("Quality_twice", ["Quality", "Quality"], "Good", "Bad")
    add("empty_titles", ["", ""], "Good", "Bad")
    return family.variants


def qualities_in_json():
    """A bad sample in each JSON that has a place for its quality."""
    family = Family("quality_in_json", "application/json")
    bad = marked(table("PT101 TT102", rows=12), {(4, 0), (7, 1)})
    truth = bad.truth(units=["", ""])
    good = lambda c, k: c.qualities[k]
    cells = [(c, k) for k in bad.rows for c in bad.columns]

    def rows(name, key, right, wrong, level="typical", answers=None):
        made = [
            {"timestamp": iso(bad, k, 3), "tag": c.name, "value": c.number(k), key: right if good(c, k) else wrong}
            for c, k in cells
        ]
        family.add(f"records_{name}", level, json.dumps(made), truth, answers=answers or {})
        family.add(
            f"lines_{name}",
            level,
            "\n".join(map(json.dumps, made)),
            truth,
            answers=answers or {},
            content_type="application/x-ndjson",
        )

    rows("quality_words", "quality", "Good", "Bad")
    rows("status_words", "status", "Good", "Bad")
    rows("status_code_words", "statusCode", "Good", "BadNoCommunication")
    rows("good_flag", "good", True, False)
    rows("is_good_flag", "isGood", True, False)
    rows("is_valid_flag", "is_valid", True, False)
    rows("opc_codes", "quality", 192, 0, "nasty", {"quality_scheme": "opc_da"})
    rows("q_codes", "q", 192, 0, "nasty", {"quality_scheme": "opc_da"})
    rows("data_quality", "dataQuality", "GOOD", "BAD")
    streams = lambda make: json.dumps(
        {"Items": [{"Name": c.name, "Items": [make(c, k) for k in bad.rows]} for c in bad.columns]}
    )
    family.add(
        "pi_good_false_with_number",
        "nasty",
        streams(
            lambda c, k: {
                "Timestamp": iso(bad, k),
                "Value": c.number(k),
                "Good": good(c, k),
                "Questionable": False,
                "Substituted": False,
            }
        ),
        truth,
    )
    odata = [
        {"FQN": c.name, "DateTime": iso(bad, k, 3), "OpcQuality": 192 if good(c, k) else 0, "Value": c.number(k)}
        for c, k in cells
    ]
    family.add("odata_bad_with_number", "nasty", json.dumps({"value": odata}), truth)
    data = {
        c.name: [{"t": iso(bad, k), "v": c.number(k), "q": 192 if good(c, k) else 0} for k in bad.rows]
        for c in bad.columns
    }
    family.add("canary_bad_with_number", "nasty", json.dumps({"statusCode": "Good", "data": data}), truth)
    ua = {
        c.name: [
            {"Value": c.number(k), "StatusCode": 0 if good(c, k) else 2150694912, "SourceTimestamp": iso(bad, k, 3)}
            for k in bad.rows
        ]
        for c in bad.columns
    }
    family.add("opc_ua_code_number", "nasty", json.dumps(ua), truth)
    ua = {
        c.name: [
            {
                "Value": c.number(k),
                "StatusCode": {
                    "Code": 0 if good(c, k) else 2150694912,
                    "Symbol": "Good" if good(c, k) else "BadNoCommunication",
                },
                "SourceTimestamp": iso(bad, k, 3),
            }
            for k in bad.rows
        ]
        for c in bad.columns
    }
    family.add("opc_ua_code_and_symbol", "nasty", json.dumps(ua), truth)
    ua = {
        c.name: [
            {"Value": c.number(k), "Status": "Good" if good(c, k) else "Bad", "SourceTimestamp": iso(bad, k, 3)}
            for k in bad.rows
        ]
        for c in bad.columns
    }
    family.add("opc_ua_status_word", "nasty", json.dumps(ua), truth)
    points = [
        {
            "externalId": c.name,
            "datapoints": [
                {
                    "timestamp": bad.milliseconds(k),
                    "value": c.number(k),
                    "status": {"code": 0 if good(c, k) else 2147483648, "symbol": "Good" if good(c, k) else "Bad"},
                }
                for k in bad.rows
            ],
        }
        for c in bad.columns
    ]
    family.add("cognite_bad_with_number", "nasty", json.dumps({"items": points}), truth)
    omf = [
        {
            "containerid": c.name,
            "values": [
                {"Timestamp": iso(bad, k, 3), "Value": c.number(k), "Quality": 192 if good(c, k) else 0}
                for k in bad.rows
            ],
        }
        for c in bad.columns
    ]
    family.add(
        "omf_quality_property",
        "nasty",
        json.dumps(omf),
        truth,
        harmless=(".*Quality",),
        answers={"quality_scheme": "opc_da"},
    )
    influx = "".join(
        f"pump,tag={c.name},quality={'good' if good(c, k) else 'bad'} value={c.values[k]} "
        f"{bad.milliseconds(k) * 10**6}\n"
        for c, k in cells
    )
    family.add(
        "line_protocol_quality_tag", "nasty", influx, truth, content_type="text/plain", harmless=(".*quality=bad.*",)
    )
    influx = "".join(
        f"pump,tag={c.name} value={c.values[k]},quality={192 if good(c, k) else 0}i {bad.milliseconds(k) * 10**6}\n"
        for c, k in cells
    )
    family.add(
        "line_protocol_quality_field",
        "nasty",
        influx,
        truth,
        content_type="text/plain",
        harmless=(".*quality",),
        answers={"quality_scheme": "opc_da"},
    )
    return family.variants


def variants():
    return quality_columns() + qualities_beside() + qualities_in_json()
