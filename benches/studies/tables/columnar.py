"""Apache Parquet, written by pyarrow."""

import io

import pyarrow
import pyarrow.feather
import pyarrow.parquet

from payloads import Family, names_of, table

KIND = "application/vnd.apache.parquet"


def saved(columns, metadata=None, **options):
    made = pyarrow.table(columns)
    if metadata:
        fields = [made.schema.field(name).with_metadata(metadata.get(name)) for name in made.schema.names]
        made = made.cast(pyarrow.schema(fields))
    body = io.BytesIO()
    pyarrow.parquet.write_table(made, body, **options)
    return body.getvalue()


def variants():
    family = Family("parquet", KIND)
    t = table("PT101 TT102", step="0.5", missing=((4, 1),))
    bare, zone = t.truth(units=["", ""]), {"tz": "UTC"}
    values = {c.name: [c.number(k) for k in t.rows] for c in t.columns}
    clock = [t.clock(k) for k in t.rows]
    naive = [moment.replace(tzinfo=None) for moment in clock]
    stamps = lambda unit, zone="UTC": pyarrow.array(clock, pyarrow.timestamp(unit, zone))
    for unit in ("ms", "us", "ns"):
        family.add(f"utc_{unit}", "clean", saved({"time": stamps(unit), **values}), bare)
    family.add("berlin", "typical", saved({"time": stamps("us", "Europe/Berlin"), **values}), bare)
    family.add(
        "naive",
        "typical",
        saved({"time": pyarrow.array(naive, pyarrow.timestamp("us")), **values}),
        bare,
        answers=zone,
        must_ask=("tz",),
    )
    for compression in ("gzip", "zstd", "lz4", "brotli", "none"):
        family.add(
            f"packed_{compression}",
            "typical" if compression != "brotli" else "nasty",
            saved({"time": stamps("ms"), **values}, compression=compression),
            bare,
        )
    family.add(
        "int96",
        "nasty",
        saved(
            {"time": pyarrow.array(naive, pyarrow.timestamp("ns")), **values}, use_deprecated_int96_timestamps=True
        ),
        bare,
        answers=zone,
    )
    family.add(
        "single_precision",
        "typical",
        saved({"time": stamps("ms"), "PT101": pyarrow.array(values["PT101"], pyarrow.float32())}),
        table("PT101", step="0.5").truth(units=[""]),
    )
    family.add(
        "index_last", "nasty", saved({**values, "timestamp": stamps("ns")}), bare, answers={"time": "timestamp"}
    )
    family.add(
        "epoch_ms",
        "typical",
        saved({"timestamp": [t.milliseconds(k) for k in t.rows], **values}),
        bare,
        answers={"time_unit": "ms"},
    )
    family.add("text_times", "nasty", saved({"time": [m.isoformat() for m in clock], **values}), bare)
    family.add(
        "dictionary_tags",
        "typical",
        saved(
            {
                "time": pyarrow.array([m for m in clock for _ in "ab"], pyarrow.timestamp("us", "UTC")),
                "tag": pyarrow.array(names_of(t) * len(clock)).dictionary_encode(),
                "value": [c.number(k) for k in t.rows for c in t.columns],
            }
        ),
        bare,
    )
    family.add("row_groups", "typical", saved({"time": stamps("ms"), **values}, row_group_size=3), bare)
    family.add("second_data_pages", "typical", saved({"time": stamps("ms"), **values}, data_page_version="2.0"), bare)
    family.add(
        "field_units",
        "nasty",
        saved({"time": stamps("ms"), **values}, {"PT101": {"unit": "bar"}, "TT102": {"unit": "°C"}}),
        t.truth(),
        answers={"units": "PT101:bar,TT102:°C"},
    )
    family.add(
        "titles_with_units",
        "typical",
        saved({"time": stamps("ms"), **{f"{c.name} [{c.unit}]": values[c.name] for c in t.columns}}),
        t.truth(),
    )
    family.add(
        "durations",
        "nasty",
        saved(
            {"elapsed": pyarrow.array([round(float(x) * 1e6) for x in t.instants], pyarrow.duration("us")), **values}
        ),
        t.truth(False, units=["", ""]),
        answers={"time_unit": "us"},
    )
    decimals = {
        name: pyarrow.array(
            [None if v is None else __import__("decimal").Decimal(str(v)) for v in column_values],
            pyarrow.decimal128(12, 3),
        )
        for name, column_values in values.items()
    }
    family.add("decimals", "nasty", saved({"time": stamps("ms"), **decimals}), bare)
    family.add(
        "octet_stream",
        "typical",
        saved({"time": stamps("ms"), **values}),
        bare,
        content_type="application/octet-stream",
    )
    family.add(
        "delta_encoding",
        "nasty",
        saved(
            {"time": stamps("us"), **values},
            use_dictionary=False,
            column_encoding={
                "time": "DELTA_BINARY_PACKED",
                "PT101": "BYTE_STREAM_SPLIT",
                "TT102": "BYTE_STREAM_SPLIT",
            },
        ),
        bare,
    )
    return family.variants
