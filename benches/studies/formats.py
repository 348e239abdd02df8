"""How long recordings of every format take from the first byte sent to the answer, beside a CSV with a
column for each signal that holds as many samples, and what memory the server takes for it.

    python3 benches/studies/formats.py [--mib 64] [--only parquet,excel] [--json file]

Four signals at 100 Hz with a timestamp each. Starts a server of its own for each body (`--program`), so
that its peak of memory is that body's. Packages come from PyPI into a folder of its own.
"""

import io
import json
import os
import time
import urllib.error
import urllib.request
import zipfile
from datetime import datetime, timedelta, timezone

import served

BEGIN = datetime(2026, 3, 2, 8, 15, tzinfo=timezone.utc)
SIGNALS = ("valve", "pressure", "position", "flow")
# The rows of a worksheet at the most, but for its header.
MOST_ROWS = 1_048_575


def stamps(rows):
    step = timedelta(milliseconds=10)
    return [(BEGIN + k * step).strftime("%Y-%m-%dT%H:%M:%S.%f")[:-4] + "Z" for k in range(rows)]


def values(rows):
    import numpy

    random = numpy.random.default_rng(1)
    return numpy.round(random.normal(size=(rows, len(SIGNALS))).cumsum(0), 5)


def by_signal(rows, record):
    """Records of each signal."""
    times, table = stamps(rows), values(rows).T.tolist()
    return {name: [record(name, t, v) for t, v in zip(times, own)] for name, own in zip(SIGNALS, table)}


def csv_lines(head, lines):
    return ("\n".join([head, *lines]) + "\n").encode()


def wide_csv(rows):
    lines = (",".join([t, *map(repr, row)]) for t, row in zip(stamps(rows), values(rows).tolist()))
    return csv_lines(",".join(["time", *SIGNALS]), lines)


def long_csv(rows):
    lists = by_signal(rows, lambda name, t, v: f"{t},{name},{v!r},Good")
    return csv_lines("timestamp,tag,value,quality", (line for own in lists.values() for line in own))


def simulink_csv(rows):
    lines = (",".join([f"{k / 100:.2f}", *map(repr, row)]) for k, row in enumerate(values(rows).tolist()))
    head = ",".join(["time", *SIGNALS]) + "\n" + ",Unit: 1" * len(SIGNALS)
    return csv_lines(head, lines)


def influx_csv(rows):
    lists = by_signal(rows, lambda name, t, v: f",,0,{t},{v!r},{name},rig")
    head = "#datatype,string,long,dateTime:RFC3339,double,string,string\n" \
           ",result,table,_time,_value,_field,_measurement"
    return csv_lines(head, (line for own in lists.values() for line in own))


def influx_line_protocol(rows):
    begin = int(BEGIN.timestamp()) * 10**9
    fields = lambda row: ",".join(f"{name}={v!r}" for name, v in zip(SIGNALS, row))
    lines = [f"rig {fields(row)} {begin + k * 10**7}" for k, row in enumerate(values(rows).tolist())]
    return csv_lines(lines[0], lines[1:])


def own_json(rows):
    table = values(rows).T.tolist()
    signals = {name: {"unit": "", "values": own} for name, own in zip(SIGNALS, table)}
    return json.dumps({"start": BEGIN.isoformat(), "sample_time_s": 0.01, "signals": signals}).encode()


def pi_web_api(rows):
    lists = by_signal(rows, lambda _, t, v: {"Timestamp": t, "Value": v, "Good": True, "Questionable": False,
                                             "Substituted": False, "UnitsAbbreviation": ""})
    return json.dumps({"Items": [{"Name": name, "Items": own} for name, own in lists.items()]}).encode()


def omf(rows):
    lists = by_signal(rows, lambda _, t, v: {"timestamp": t, "value": v})
    return json.dumps([{"containerid": name, "values": own} for name, own in lists.items()]).encode()


def aveva_odata(rows):
    lists = by_signal(rows, lambda name, t, v: {"FQN": name, "DateTime": t, "OpcQuality": 192, "Value": v})
    return json.dumps({"value": [own for each in lists.values() for own in each]}).encode()


def canary(rows):
    lists = by_signal(rows, lambda _, t, v: {"t": t, "v": v, "q": 192})
    return json.dumps({"statusCode": "Good", "data": lists}).encode()


def opc_ua_json(rows):
    return json.dumps(by_signal(rows, lambda _, t, v: {"Value": v, "SourceTimestamp": t})).encode()


def frame(rows):
    milliseconds = [int(BEGIN.timestamp()) * 1000 + 10 * k for k in range(rows)]
    return zip(milliseconds, values(rows).tolist())


def cognite(rows):
    begin, table = int(BEGIN.timestamp()) * 1000, values(rows).T.tolist()
    points = lambda own: [{"timestamp": begin + 10 * k, "value": v} for k, v in enumerate(own)]
    items = [{"externalId": name, "datapoints": points(own)} for name, own in zip(SIGNALS, table)]
    return json.dumps({"items": items}).encode()


def pandas_records(rows):
    records = ({"timestamp": t, **dict(zip(SIGNALS, row))} for t, row in frame(rows))
    return json.dumps(list(records)).encode()


def pandas_split(rows):
    data = [[t, *row] for t, row in frame(rows)]
    return json.dumps({"columns": ["timestamp", *SIGNALS], "data": data}).encode()


def pandas_table(rows):
    fields = [{"name": "timestamp", "type": "datetime"}, *({"name": name, "type": "number"} for name in SIGNALS)]
    data = [{"timestamp": t, **dict(zip(SIGNALS, row))} for t, row in zip(stamps(rows), values(rows).tolist())]
    return json.dumps({"schema": {"fields": fields}, "data": data}).encode()


def parquet(rows):
    import pyarrow
    import pyarrow.parquet

    times = [BEGIN + k * timedelta(milliseconds=10) for k in range(rows)]
    table = {"time": pyarrow.array(times, pyarrow.timestamp("ms", "UTC")), **dict(zip(SIGNALS, values(rows).T))}
    body = io.BytesIO()
    pyarrow.parquet.write_table(pyarrow.table(table), body)
    return body.getvalue()


def excel(rows):
    """A workbook with numbers alone: the sheet as a spreadsheet writes it."""
    relations = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    relation = lambda kind, target: (
        f'<Relationships xmlns="{package}/relationships"><Relationship Id="r1" '
        f'Target="{target}" Type="{relations}/{kind}"/></Relationships>'
    )
    cell = lambda text: f'<c t="inlineStr"><is><t>{text}</t></is></c>'
    head = "".join(map(cell, ["time", *SIGNALS]))
    lines = (
        f"<row><c><v>{k / 100!r}</v></c>" + "".join(f"<c><v>{v!r}</v></c>" for v in row) + "</row>"
        for k, row in enumerate(values(rows).tolist())
    )
    body = io.BytesIO()
    with zipfile.ZipFile(body, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("[Content_Types].xml", (
            f'<Types xmlns="{package}/content-types"><Default Extension="rels" '
            'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
            '<Default Extension="xml" ContentType="application/xml"/></Types>'))
        file.writestr("_rels/.rels", relation("officeDocument", "xl/workbook.xml"))
        file.writestr("xl/workbook.xml", (
            f'<workbook xmlns="{main}" xmlns:r="{relations}"><sheets>'
            '<sheet name="Data" sheetId="1" r:id="r1"/></sheets></workbook>'))
        file.writestr("xl/_rels/workbook.xml.rels", relation("worksheet", "worksheets/sheet1.xml"))
        file.writestr("xl/worksheets/sheet1.xml", (
            f'<worksheet xmlns="{main}"><sheetData><row>{head}</row>' + "".join(lines)
            + "</sheetData></worksheet>"))
    return body.getvalue()


FORMATS = {
    "long_csv": (long_csv, "text/csv"), "simulink_csv": (simulink_csv, "text/csv"),
    "influx_csv": (influx_csv, "text/csv"), "influx_line_protocol": (influx_line_protocol, "text/plain"),
    "json": (own_json, "application/json"), "pi_web_api": (pi_web_api, "application/json"),
    "omf": (omf, "application/json"), "aveva_odata": (aveva_odata, "application/json"),
    "canary": (canary, "application/json"), "opc_ua_json": (opc_ua_json, "application/json"),
    "cognite": (cognite, "application/json"), "pandas_records": (pandas_records, "application/json"),
    "pandas_split": (pandas_split, "application/json"), "pandas_table": (pandas_table, "application/json"),
    "parquet": (parquet, "application/octet-stream"), "excel": (excel, "application/octet-stream"),
}


def posted(options, body, content_type, name):
    """Seconds to the answer, samples stored, and the peak of the server's memory [MiB]."""
    with served.Server(options) as server:
        request = urllib.request.Request(
            f"{server.address}/v1/datasets" + (f"?format={name}" if name else ""), data=body,
            headers={"content-type": content_type})
        began = time.monotonic()
        try:
            with urllib.request.urlopen(request, timeout=600) as answer:
                stored = json.load(answer)
        except urllib.error.HTTPError as refusal:
            raise SystemExit(f"{name}: {refusal.read().decode()[:500]}")
        took = time.monotonic() - began
        with open(f"/proc/{server.process.pid}/status") as status:
            peak = next(int(line.split()[1]) for line in status if line.startswith("VmHWM"))
    return took, stored["samples"], peak / 1024


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--mib", type=float, default=64, help="size of a body [MiB]")
    parser.add_argument("--only", help="names of formats, separated by commas")
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment(["numpy", "pyarrow"], "greybox-formats")
    # As many samples as a short format has may take more room in another.
    os.environ["GREYBOX_MAX_BODY_MIB"] = "1024"
    names = options.only.split(",") if options.only else list(FORMATS)
    rows = [("format", "MiB", "samples", "s", "wide CSV, s", "ratio", "memory, MiB")]
    figures = []
    for name in names:
        write, content_type = FORMATS[name]
        trial = 200_000
        fitting = int(options.mib * 2**20 / len(write(trial)) * trial)
        count = min(fitting, MOST_ROWS if name == "excel" else 4_000_000)
        body = write(count)
        took, samples, peak = posted(options, body, content_type, name)
        beside, same, _ = posted(options, wide_csv(count), "text/csv", None)
        assert samples == same == count, (samples, same, count)
        figures.append({"format": name, "mib": len(body) / 2**20, "rows": count, "s": took,
                        "wide_csv_s": beside, "memory_mib": peak})
        rows.append((name, f"{len(body) / 2**20:.0f}", f"{count * len(SIGNALS):,}", f"{took:.2f}",
                     f"{beside:.2f}", f"{took / beside:.1f}", f"{peak:.0f}"))
        print(served.table([rows[0], rows[-1]]), flush=True)
    print(served.table(rows))
    served.keep(options, figures)


if __name__ == "__main__":
    main()
