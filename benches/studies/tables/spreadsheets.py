"""Tables as spreadsheet programs save them as text, in several locales."""

from payloads import BERLIN, NEW_YORK, Family, bracketed, lines, names_of, packed, stamp, table, wide

BOM = b"\xef\xbb\xbf"


def american():
    """Excel with the settings of the United States."""
    family = Family("excel_csv_us")
    t = table("PT101 TT102 FT103", units=("psi", "°F", "gpm"))
    am = lambda row, zone=NEW_YORK: stamp(t.clock(row), "%-m/%-d/%Y %-I:%M:%S %p", zone)
    zone = {"tz": "America/New_York", "time_unit": "mdy"}
    family.add(
        "brackets",
        "clean",
        BOM + wide(t, am, bracketed(t), time_title="Time", end="\r\n").encode(),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    family.add(
        "parentheses",
        "typical",
        wide(t, am, bracketed(t, "{name} ({unit})"), time_title="Date Time", end="\r\n"),
        t.truth(),
        answers={**zone, "encoding": "windows-1252"},
        encoding="cp1252",
        must_ask=("tz",),
    )
    minutes = table("PT101 TT102", step="60", units=("psi", "°F"))
    short = lambda row: stamp(minutes.clock(row), "%-m/%-d/%y %-H:%M", NEW_YORK)
    family.add(
        "two_digit_years",
        "nasty",
        wide(minutes, short, bracketed(minutes), end="\r\n", time_title="Time"),
        minutes.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    split = lambda row: [stamp(t.clock(row), "%-m/%-d/%Y", NEW_YORK), stamp(t.clock(row), "%-I:%M:%S %p", NEW_YORK)]
    family.add(
        "date_and_time_apart",
        "typical",
        wide(t, split, bracketed(t), time_title=("Date", "Time"), end="\r\n"),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    large = table("SC104 LT105", units=("rpm", "mm"))
    stamps = lambda row: stamp(large.clock(row), "%-m/%-d/%Y %-I:%M:%S %p", NEW_YORK)
    family.add(
        "thousands",
        "nasty",
        wide(large, stamps, bracketed(large), grouping=",", end="\r\n"),
        large.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    gaps = table("PT101 TT102 FT103", units=("psi", "°F", "gpm"), missing=((3, 0), (7, 1), (8, 1)))
    stamps = lambda row: stamp(gaps.clock(row), "%-m/%-d/%Y %-I:%M:%S %p", NEW_YORK)
    for word in ("#N/A", "#DIV/0!", "#VALUE!", "N/A", "-", "---", "#REF!"):
        family.add(
            f"missing_{word}",
            "nasty",
            wide(gaps, stamps, bracketed(gaps), missing=word, end="\r\n"),
            gaps.truth(),
            answers={**zone, "missing": word},
            must_ask=("tz",),
        )
    serial = lambda row: f"{46083.34375 + row / 24:.10f}"
    hours = table("PT101 TT102", step="3600", units=("psi", "°F"))
    truth = hours.truth()
    truth.tolerance = 1e-4
    family.add(
        "serial_days",
        "nasty",
        wide(hours, serial, bracketed(hours), time_title="Date"),
        truth,
        answers={"time_unit": "excel", "tz": "UTC"},
        must_ask=("time_unit",),
    )
    top = [["Boiler house trend"], ["Exported by", "Operations"], []]
    family.add(
        "title_lines",
        "nasty",
        wide(t, am, bracketed(t), time_title="Time", top=top, end="\r\n"),
        t.truth(),
        answers={**zone, "header_row": "4"},
        must_ask=("tz",),
    )
    padded = [row + [""] * (6 - len(row)) for row in top]
    body = [
        row + ["", ""]
        for row in [["Time", *bracketed(t)]] + [[am(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    ]
    family.add(
        "empty_columns_and_rows",
        "nasty",
        lines(padded + body + [[""] * 6] * 3, end="\r\n"),
        t.truth(),
        answers={**zone, "header_row": "4"},
        must_ask=("tz",),
    )
    return family.variants


def german():
    """Excel with the settings of Germany: semicolons and decimal commas."""
    family = Family("excel_csv_de")
    t = table()
    day = lambda row, zone=BERLIN: stamp(t.clock(row), "%d.%m.%Y %H:%M:%S", zone)
    zone = {"tz": "Europe/Berlin"}
    plain = wide(t, day, bracketed(t), ";", ",", time_title="Zeit", end="\r\n")
    family.add(
        "ansi",
        "clean",
        plain,
        t.truth(),
        answers={**zone, "encoding": "windows-1252"},
        encoding="cp1252",
        must_ask=("tz",),
    )
    family.add("utf8_mark", "typical", BOM + plain.encode(), t.truth(), answers=zone, must_ask=("tz",))
    family.add(
        "unicode_text",
        "typical",
        wide(t, day, bracketed(t), "\t", ",", time_title="Zeit", end="\r\n"),
        t.truth(),
        answers=zone,
        encoding="utf-16",
        must_ask=("tz",),
    )
    family.add(
        "sep_line",
        "typical",
        "sep=;\r\n" + plain,
        t.truth(),
        answers={**zone, "encoding": "windows-1252"},
        encoding="cp1252",
        must_ask=("tz",),
    )
    family.add("gzip", "typical", packed(plain.encode()), t.truth(), answers=zone, must_ask=("tz",))
    units = [["", *(c.unit for c in t.columns)]]
    family.add(
        "row_of_units",
        "typical",
        wide(t, day, names_of(t), ";", ",", time_title="Zeit", below=units),
        t.truth(),
        answers={**zone, "unit_row": "2"},
        must_ask=("tz",),
    )
    bracketed_units = [["", *(f"[{c.unit}]" for c in t.columns)]]
    family.add(
        "row_of_bracketed_units",
        "typical",
        wide(t, day, names_of(t), ";", ",", time_title="Datum/Uhrzeit", below=bracketed_units),
        t.truth(),
        answers={**zone, "unit_row": "2"},
        must_ask=("tz",),
    )
    above = [["", *(c.unit for c in t.columns)]]
    family.add(
        "units_above",
        "nasty",
        wide(t, day, names_of(t), ";", ",", time_title="Zeit", top=above),
        t.truth(),
        answers={**zone, "unit_row": "1", "header_row": "2"},
        must_ask=("tz",),
    )
    split = lambda row: [stamp(t.clock(row), "%d.%m.%Y", BERLIN), stamp(t.clock(row), "%H:%M:%S", BERLIN)]
    family.add(
        "datum_uhrzeit",
        "typical",
        wide(t, split, bracketed(t), ";", ",", time_title=("Datum", "Uhrzeit")),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    large = table("SC104 LT105 PT101", units=("U/min", "mm", "mbar"))
    dots = wide(
        large,
        lambda row: stamp(large.clock(row), "%d.%m.%Y %H:%M:%S", BERLIN),
        bracketed(large),
        ";",
        ",",
        grouping=".",
        time_title="Zeit",
    )
    family.add("dots_for_thousands", "nasty", dots, large.truth(), answers={**zone, "decimal": ","}, must_ask=("tz",))
    whole = table("SC104 LT105", digits=0)
    family.add(
        "whole_numbers",
        "typical",
        wide(
            whole,
            lambda k: stamp(whole.clock(k), "%d.%m.%y %H:%M:%S", BERLIN),
            bracketed(whole),
            ";",
            time_title="Zeit",
        ),
        whole.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    fast = table(step="0.01")
    family.add(
        "comma_in_seconds",
        "nasty",
        wide(
            fast,
            lambda k: stamp(fast.clock(k), "%d.%m.%Y %H:%M:%S,%f", BERLIN, digits=3),
            bracketed(fast),
            ";",
            ",",
            time_title="Zeit",
        ),
        fast.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    relative = table(step="0.05")
    family.add(
        "seconds",
        "clean",
        wide(
            relative,
            lambda k: relative.seconds(k).replace(".", ","),
            bracketed(relative),
            ";",
            ",",
            time_title="Zeit [s]",
        ),
        relative.truth(False),
    )
    family.add(
        "decimal_comma_between_commas",
        "nasty",
        lines(
            [["Zeit [s]", *bracketed(relative)]]
            + [
                [relative.seconds(k).replace(".", ","), *(c.values[k].replace(".", ",") for c in relative.columns)]
                for k in relative.rows
            ],
            ",",
            quote=True,
        ),
        relative.truth(False),
        answers={"decimal": ","},
    )
    family.add(
        "newest_first",
        "typical",
        wide(t, day, bracketed(t), ";", ",", order=-1, time_title="Zeit"),
        t.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    three = table("PT101", rows=12, digits=3)
    family.add(
        "three_digits_one_column",
        "nasty",
        wide(
            three,
            lambda k: stamp(three.clock(k), "%d.%m.%Y %H:%M:%S", BERLIN),
            ["Druck [bar]"],
            ";",
            ",",
            time_title="Zeit",
        ),
        three.truth(names=["Druck"]),
        answers={**zone, "decimal": ","},
        must_ask=("tz",),
    )
    return family.variants


def others():
    """LibreOffice Calc and Google Sheets."""
    office, sheets = Family("libreoffice_csv"), Family("google_sheets_csv")
    t = table(step="0.5")
    quoted = lines(
        [["Time", *bracketed(t)]]
        + [
            [stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", digits=3) + "Z", *(c.values[k] for c in t.columns)]
            for k in t.rows
        ],
        quote=True,
    )
    office.add("all_quoted", "clean", quoted, t.truth())
    comma = wide(t, lambda k: t.seconds(k).replace(".", ","), bracketed(t), "\t", ",", time_title="t [s]")
    office.add("tabs_and_commas", "typical", comma, t.truth(False))
    office.add("utf16_big_endian", "typical", b"\xfe\xff" + comma.encode("utf-16-be"), t.truth(False))
    office.add("utf16_no_mark", "nasty", comma.encode("utf-16-le"), t.truth(False), answers={"encoding": "utf-16le"})
    rows = [["Time [s]", *bracketed(t)]] + [[t.seconds(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    office.add("pipes", "typical", lines(rows, "|"), t.truth(False))
    office.add("old_mac_ends", "nasty", lines(rows, end="\r"), t.truth(False))
    office.add("mixed_ends", "nasty", lines(rows[:8], end="\r\n") + lines(rows[8:]), t.truth(False))
    office.add("no_last_end", "typical", lines(rows, last_end=False), t.truth(False))
    gaps = table(step="0.5", missing=((2, 0), (5, 1), (6, 1)))
    office.add(
        "errors_as_words",
        "nasty",
        wide(gaps, gaps.seconds, bracketed(gaps), missing="Err:502", time_title="t [s]"),
        gaps.truth(False),
        answers={"missing": "Err:502"},
    )
    minutes = table(step="60")
    clock = lambda k: stamp(minutes.clock(k), "%-m/%-d/%Y %-H:%M:%S", NEW_YORK)
    zone = {"tz": "America/New_York", "time_unit": "mdy"}
    sheets.add(
        "united_states",
        "typical",
        wide(minutes, clock, bracketed(minutes), time_title="Timestamp", end="\r\n"),
        minutes.truth(),
        answers=zone,
        must_ask=("tz",),
    )
    gaps = table(step="60", missing=((4, 2),))
    sheets.add(
        "not_available",
        "nasty",
        wide(
            gaps,
            lambda k: stamp(gaps.clock(k), "%Y-%m-%dT%H:%M:%SZ"),
            bracketed(gaps),
            missing="#N/A",
            time_title="Timestamp",
        ),
        gaps.truth(),
        answers={"missing": "#N/A"},
    )
    share = table("XV107 TT102", step="60")
    body = lines(
        [["Timestamp", "XV107", "TT102 [°C]"]]
        + [[clock(k), share.columns[0].values[k] + "%", share.columns[1].values[k]] for k in share.rows],
        end="\r\n",
    )
    sheets.add(
        "percent_in_cells", "nasty", body, share.truth(), answers={**zone, "units": "XV107:%"}, must_ask=("tz",)
    )
    two = table("PT101 TT102", step="60")
    cells = lines(
        [["Timestamp", "PT101", "TT102"]]
        + [[clock(k), two.columns[0].values[k] + " bar", two.columns[1].values[k] + " °C"] for k in two.rows],
        end="\r\n",
    )
    sheets.add(
        "units_in_cells",
        "nasty",
        cells,
        two.truth(),
        answers={**zone, "units": "PT101:bar,TT102:°C"},
        must_ask=("tz",),
    )
    exponent = lines(
        [["Time [s]", "PT101 [bar]"]]
        + [[minutes.seconds(k, 0), f"{float(minutes.columns[0].values[k]):.3E}"] for k in minutes.rows]
    )
    truth = table("PT101", step="60")
    truth.columns[0].values = [f"{float(v):.3e}" for v in minutes.columns[0].values]
    sheets.add("exponents", "typical", exponent, truth.truth(False))
    return office.variants + sheets.variants


def variants():
    return american() + german() + others()
