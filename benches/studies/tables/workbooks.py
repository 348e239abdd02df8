"""Excel workbooks, written by openpyxl."""

import io
from datetime import datetime, time, timedelta

import openpyxl
from openpyxl.styles import numbers

from payloads import BERLIN, Family, bracketed, names_of, table

KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet"


def saved(*sheets, first_state="visible", date_form=None, epoch_1904=False):
    """A workbook of (name, rows)."""
    book = openpyxl.Workbook()
    book.remove(book.active)
    if epoch_1904:
        book.epoch = openpyxl.utils.datetime.CALENDAR_MAC_1904
    for name, rows in sheets:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
        if date_form:
            for cell in next(sheet.iter_cols(1, 1)):
                if isinstance(cell.value, (datetime, int, float)):
                    cell.number_format = date_form
    book.worksheets[0].sheet_state = first_state
    body = io.BytesIO()
    book.save(body)
    return body.getvalue()


def variants():
    family = Family("excel_workbook", KIND)
    t = table("PT101 TT102 FT103", step="1", missing=((4, 1),))
    local = lambda k, t=t: t.clock(k).astimezone(BERLIN).replace(tzinfo=None)
    values = lambda k, t=t: [c.number(k) for c in t.columns]
    zone = {"tz": "Europe/Berlin"}
    truth = t.truth()
    truth.tolerance = 1e-3
    dated = [["Time", *bracketed(t)]] + [[local(k), *values(k)] for k in t.rows]
    relative = [["t [s]", *bracketed(t)]] + [[float(t.instants[k]), *values(k)] for k in t.rows]
    add = lambda name, level, body, meant, **more: family.add(name, level, body, meant, **more)
    add(
        "dates",
        "clean",
        saved(("Data", dated), date_form="yyyy-mm-dd hh:mm:ss"),
        truth,
        answers=zone,
        must_ask=("tz",),
    )
    add("seconds", "clean", saved(("Data", relative)), t.truth(False))
    add(
        "german_form",
        "typical",
        saved(("Daten", dated), date_form="dd.mm.yyyy hh:mm:ss"),
        truth,
        answers=zone,
        must_ask=("tz",),
    )
    add("octet_stream", "typical", saved(("Data", relative)), t.truth(False), content_type="application/octet-stream")
    add(
        "epoch_1904",
        "nasty",
        saved(("Data", dated), date_form="yyyy-mm-dd hh:mm:ss", epoch_1904=True),
        truth,
        answers=zone,
        must_ask=("tz",),
    )
    general = [["Time", *bracketed(t)]] + [[46083.34375 + 1 / 24 + k / 86400, *values(k)] for k in t.rows]
    add(
        "serial_days_as_numbers",
        "nasty",
        saved(("Data", general)),
        truth,
        answers={**zone, "time_unit": "excel"},
        must_ask=("tz",),
    )
    texts = [["Time", *bracketed(t)]] + [[local(k).strftime("%d.%m.%Y %H:%M:%S"), *values(k)] for k in t.rows]
    add("dates_as_text", "typical", saved(("Data", texts)), t.truth(), answers=zone, must_ask=("tz",))
    commas = [["Zeit [s]", *bracketed(t)]] + [
        [str(k), *(None if v is None else str(v).replace(".", ",") for v in values(k))] for k in t.rows
    ]
    add("numbers_as_text_with_commas", "nasty", saved(("Data", commas)), t.truth(False), answers={"decimal": ","})
    points = [["Zeit [s]", *bracketed(t)]] + [
        [str(k), *(None if v is None else str(v) for v in values(k))] for k in t.rows
    ]
    add("numbers_as_text", "typical", saved(("Data", points)), t.truth(False))
    units = [["Time", *names_of(t)], ["s", *(c.unit for c in t.columns)]] + relative[1:]
    add("row_of_units", "typical", saved(("Data", units)), t.truth(False), answers={"unit_row": "2"})
    top = [["Boiler house", None, None, None], ["Report of 2 March 2026"], [], *relative]
    add("title_lines", "typical", saved(("Data", top)), t.truth(False), answers={"header_row": "4"})
    shifted = [[], [], *([None, None, *row] for row in relative)]
    add("table_in_the_middle", "nasty", saved(("Data", shifted)), t.truth(False), answers={"header_row": "3"})
    add(
        "second_sheet",
        "typical",
        saved(("Cover", [["Operator", "lab"], ["Rig", 7]]), ("Data", relative)),
        t.truth(False),
        answers={"sheet": "Data"},
        must_ask=("sheet",),
    )
    add(
        "hidden_first_sheet",
        "nasty",
        saved(("Settings", [["a", "b"], [1, 2]]), ("Data", relative), first_state="hidden"),
        t.truth(False),
    )
    add("empty_first_sheet", "typical", saved(("Sheet1", []), ("Data", relative)), t.truth(False))
    apart = [["Date", "Time", *bracketed(t)]] + [[local(k).date(), local(k).time(), *values(k)] for k in t.rows]
    add("date_and_time_apart", "typical", saved(("Data", apart)), truth, answers=zone, must_ask=("tz",))
    clock = [["Time", *bracketed(t)]] + [[time(0, 0, k), *values(k)] for k in t.rows]
    relative_truth = t.truth(False)
    relative_truth.tolerance = 1e-3
    add("times_of_day", "nasty", saved(("Data", clock)), relative_truth)
    elapsed = [["Elapsed", *bracketed(t)]] + [[timedelta(seconds=k), *values(k)] for k in t.rows]
    add("durations", "typical", saved(("Data", elapsed), date_form="[h]:mm:ss"), relative_truth)
    errors = [["t [s]", *bracketed(t)]] + [[k, *("#N/A" if v is None else v for v in values(k))] for k in t.rows]
    add("error_cells", "typical", saved(("Data", errors)), t.truth(False))
    words = [["t [s]", *bracketed(t)]] + [[k, *("Bad Input" if v is None else v for v in values(k))] for k in t.rows]
    add("state_words", "nasty", saved(("Data", words)), t.truth(False), answers={"missing": "Bad Input"})
    full = table("PT101 TT102 FT103", step="1")
    long = [["time", "tag", "value", "unit"]] + [
        [local(k), c.name, c.number(k), c.unit] for k in full.rows for c in full.columns
    ]
    meant = full.truth()
    meant.tolerance = 1e-3
    add(
        "row_for_each_sample",
        "typical",
        saved(("Data", long), date_form="yyyy-mm-dd hh:mm:ss"),
        meant,
        answers=zone,
        must_ask=("tz",),
    )
    averages = [*relative, [], ["Average", 3.2, 61.5, 12.4]]
    add("average_below", "nasty", saved(("Data", averages)), t.truth(False))
    newest = [relative[0], *relative[:0:-1]]
    add("newest_first", "typical", saved(("Data", newest)), t.truth(False))
    fast = table("PT101 TT102 FT103", step="0.01")
    quick = [["Time", *bracketed(fast)]] + [
        [fast.clock(k).astimezone(BERLIN).replace(tzinfo=None), *values(k, fast)] for k in fast.rows
    ]
    truth = fast.truth()
    truth.tolerance = 1e-3
    add(
        "milliseconds",
        "typical",
        saved(("Data", quick), date_form="yyyy-mm-dd hh:mm:ss.000"),
        truth,
        answers=zone,
        must_ask=("tz",),
    )
    mixed = [["Time", *bracketed(t)]] + [
        [local(k) if k % 2 else local(k).strftime("%d.%m.%Y %H:%M:%S"), *values(k)] for k in t.rows
    ]
    truth = t.truth()
    truth.tolerance = 1e-3
    add(
        "dates_and_texts_mixed",
        "nasty",
        saved(("Data", mixed), date_form="dd.mm.yyyy hh:mm:ss"),
        truth,
        answers=zone,
        must_ask=("tz",),
    )
    share = table("XV107 PT101", step="1")
    book = openpyxl.Workbook()
    book.active.append(["t [s]", "XV107", "PT101 [bar]"])
    for k in share.rows:
        book.active.append([k, share.columns[0].number(k) / 100, share.columns[1].number(k)])
        book.active.cell(k + 2, 2).number_format = numbers.FORMAT_PERCENTAGE_00
    body = io.BytesIO()
    book.save(body)
    add("cells_shown_in_percent", "nasty", body.getvalue(), share.truth(False), answers={"units": "XV107:1"})
    return family.variants
