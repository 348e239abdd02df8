"""Bodies that were made to cost a server much: memory, depth, time to read."""

import gzip
import io
import json
import zipfile

from server import job
from wire import request

SHEET = "xl/worksheets/sheet1.xml"
RELATIONSHIPS = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
MIB = 1 << 20


def workbook(text_mib, parts):
    """A workbook with a cell of so many MiB and so many empty parts."""
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/_rels/workbook.xml.rels", (
            f"<Relationships><Relationship Id='r1' Type='{RELATIONSHIPS}/worksheet' "
            "Target='worksheets/sheet1.xml'/></Relationships>"))
        archive.writestr("xl/workbook.xml", (
            "<workbook><sheets><sheet name='a' sheetId='1' r:id='r1'/></sheets></workbook>"))
        cell = "<c t='inlineStr'><is><t>" + "a" * (text_mib * MIB) + "</t></is></c>"
        archive.writestr(SHEET, f"<worksheet><sheetData><row>{cell}</row></sheetData></worksheet>")
        for part in range(parts):
            archive.writestr(f"part-{part}", b"")
    return content.getvalue()


def wrong_jobs(dataset):
    """Jobs with wrong types, impossible numbers, and very many fields."""
    # The unknown field has each of them refused: a job that is accepted would have a place to compute.
    spec = {**job(dataset), "unknown": True}
    numbers = ["1e999", "-1e999", "9" * 100_000, "1e-400", "0." + "0" * 50_000 + "1"]
    for number in numbers:
        yield json.dumps({**spec, "seed": "NUMBER"}).replace('"NUMBER"', number)
        yield json.dumps({**spec, "parameters": {"mass": {"value": "NUMBER"}}}).replace('"NUMBER"', number)
    for value in (None, True, [], {}, "text", [[[]]], {"value": {"value": {}}}, "\u0000", "\ud83d\ude00" * 1000):
        for field in ("model", "experiments", "parameters", "outputs", "method", "seed"):
            yield json.dumps({**spec, field: value})
    yield json.dumps({**spec, "parameters": {f"unknown_{k}": {"value": k} for k in range(20_000)}})
    yield json.dumps({**spec, "experiments": [{"dataset": dataset}] * 20_000})
    yield json.dumps({**spec, "constraints": ["(" * 50_000 + "mass" + ")" * 50_000 + " < 1"]})


def documents(dataset):
    """Texts in JSON that nest deeply or are cut, and wrong jobs."""
    yield "[" * MIB
    yield '{"a":' * 150_000
    yield "[" * 100_000 + "]" * 100_000
    yield '{"model": "\\ud800'
    yield '{"' + "k" * (MIB - 100) + '": 1}'
    yield from wrong_jobs(dataset)


def recordings():
    """Recordings with their media type and headers."""
    zeros = gzip.compress(b"time,a\n0," + b"0" * (200 * MIB))
    rows = gzip.compress(b"time,a\n" + b"".join(b"%d,0\n" % k for k in range(4_000_000)))
    yield "text/csv", ["content-encoding: gzip"], zeros
    yield "text/csv", ["content-encoding: gzip"], rows
    yield "text/csv", ["content-encoding: gzip"], rows[:len(rows) // 2]
    yield "text/csv", [], b"time,a" + b"," * (24 * MIB) + b"\n"
    yield "text/csv", [], b'time,a\n0,"' + b"a" * (24 * MIB) + b'"\n1,2\n'
    yield "application/json", [], b"[" * (24 * MIB)
    yield "application/json", [], b'[{"t":0' + b',"":1' * (4 * MIB) + b"}]"
    yield "application/octet-stream", [], workbook(100, 0)
    yield "application/octet-stream", [], workbook(0, 20_000)
    yield "application/octet-stream", [], b"PAR1" + b"\xff" * MIB + b"\xff\xff\xff\x7fPAR1"


def requests(token, dataset):
    """All of them as whole requests."""
    bombs = [gzip.compress(b"[" * (100 * MIB)), gzip.compress(b" " * (100 * MIB) + b"{}")]
    texts = []
    for text in documents(dataset):
        body = text.encode(errors="surrogatepass")
        for path in ("/v1/jobs", "/v1/simulations"):
            texts.append(request("POST", path, token, body, "application/json"))
    for body in bombs:
        texts.append(request("POST", "/v1/jobs", token, body, "application/json", ["content-encoding: gzip"]))
    for media_type, headers, body in recordings():
        texts.append(request("POST", "/v1/datasets", token, body, media_type, headers))
    return texts
