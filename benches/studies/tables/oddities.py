"""Oddities that any export may have, one at a time: spellings of numbers, sections, encodings."""

from historians import iso
from payloads import Column, Family, Table, bracketed, lines, table, wide
from fractions import Fraction


def lakhs(text):
    """A whole number with commas as in India: before the last three digits and before each two above them."""
    above, groups = text[:-3], [text[-3:]]
    while above:
        above, groups = above[:-2], [above[-2:], *groups]
    return ",".join(groups)


def spelled_numbers():
    """Numbers as people and instruments write them."""
    family = Family("number_spellings")

    def add(name, spelled, separator=",", answers=None, level="nasty", values=None, must=(), columns="PT101 SC104"):
        t = table(columns, step="1", digits=3)
        if values:
            for c in t.columns:
                c.values = [values(v) for v in c.values]
        rows = [[str(k), *(spelled(c.values[k]) for c in t.columns)] for k in t.rows]
        family.add(
            name,
            level,
            lines([["t [s]", *bracketed(t)], *rows], separator),
            t.truth(False),
            answers=answers or {},
            must_ask=must,
        )

    whole = lambda v: f"{float(v):.0f}"
    big = lambda v: f"{float(v) * 1000:.0f}"
    grouped = lambda mark: lambda v: f"{int(v):,}".replace(",", mark)
    add("plus_signs", lambda v: "+" + v)
    add("blanks_around", lambda v: f"  {v} ")
    add("leading_zeros", lambda v: v.rjust(10, "0"))
    add("bare_fraction", lambda v: v.lstrip("0"), values=lambda v: f"0.{v.replace('.', '')}")
    add("trailing_point", lambda v: v + ".", values=whole)
    add("unicode_minus", lambda v: v.replace("-", "\u2212"), values=lambda v: "-" + v)
    add("accounting_parentheses", lambda v: f"({v[1:]})", values=lambda v: "-" + v)
    add("trailing_minus", lambda v: f"{v[1:]}-", values=lambda v: "-" + v)
    add("formula_text", lambda v: f'="{v}"')
    add("apostrophe", lambda v: f"'{v}")
    add("exponent_blank", lambda v: f"{float(v):.3e}".replace("e", " E"), values=lambda v: f"{float(v):.3e}")
    add("exponent_comma", lambda v: f"{float(v):.3e}".replace(".", ","), ";", values=lambda v: f"{float(v):.3e}")
    add(
        "times_ten",
        lambda v: f"{float(v):.3e}".replace("e+0", "×10^").replace("e-0", "×10^-"),
        values=lambda v: f"{float(v):.3e}",
        columns="PT101",
    )
    add(
        "english_thousands_alone",
        grouped(","),
        values=big,
        must=("decimal",),
        answers={"decimal": "."},
        columns="SC104",
    )
    add(
        "german_thousands_alone",
        grouped("."),
        ";",
        values=big,
        must=("decimal",),
        answers={"decimal": ","},
        columns="SC104",
    )
    for name, mark, separator in (("english", ",", ","), ("german", ".", ";"), ("german_tabs", ".", "\t")):
        add(
            f"{name}_single_thousands",
            grouped(mark),
            separator,
            values=whole,
            must=("decimal",),
            answers={"decimal": "." if mark == "," else ","},
            columns="SC104",
        )
    add("blank_thousands", grouped(" "), ";", values=big)
    add("narrow_blank_thousands", grouped("\u202f"), ";", values=big)
    add("hard_blank_thousands", grouped("\u00a0"), ";", values=big)
    add("swiss_thousands", grouped("'"), ";", values=big)
    add("swiss_typographic_thousands", grouped("’"), ";", values=big)
    add(
        "indian_thousands",
        lakhs,
        values=lambda v: big(big(v)),
        must=("decimal",),
        answers={"decimal": "."},
        columns="SC104",
    )
    add("underscores", grouped("_"), values=big)
    add("full_width_digits", lambda v: "".join(chr(ord(d) + 0xFEE0) for d in v))
    add("arabic_digits", lambda v: "".join(chr(ord(d) - 48 + 0x660) if d.isdigit() else d for d in v))
    add("unit_in_each_cell", lambda v: v + " bar", answers={"units": "PT101:bar"}, columns="PT101")
    mixed = Table(
        [Column("PT101", "bar", [f"{3 + k / 100:.2f}" for k in range(20)])], [Fraction(k) for k in range(20)]
    )
    rows = [["t [s]", "PT101"]] + [
        [
            str(k),
            f"{mixed.columns[0].values[k]} bar" if k % 2 else f"{float(mixed.columns[0].values[k]) * 1000:.0f} mbar",
        ]
        for k in mixed.rows
    ]
    family.add("two_units_in_one_column", "nasty", lines(rows), mixed.truth(False))
    for word in (
        "NA",
        "N.A.",
        "n/a",
        "null",
        "NIL",
        "#NV",
        "#N/B",
        "1.#QNAN",
        "-1.#IND",
        "1.#INF",
        "nan(ind)",
        "-nan",
        "*",
        "**",
        "****",
        "?",
        "??",
        ".",
        "--",
        "---",
        "OFF",
        "Err",
        "ERR",
        "ERROR",
        "Overflow",
        "OL",
        "OVLD",
        "Open",
        "-9999",
        "-999.25",
        "9.9E+37",
        "9.91E37",
        "1e30",
        "-32768",
        "65535",
        "999999",
        "Sensor fault",
        "Kein Wert",
        "fehlt",
        "keine Daten",
        "No Good Data",
        "NoData",
        "Comm Fail",
        "Not Connected",
        "Timeout",
    ):
        gaps = table("PT101 TT102", rows=16, missing=((4, 0), (5, 0), (9, 1)))
        is_number = word.lstrip("-").replace(".", "", 1).replace("E+", "").replace("e", "").replace("E", "").isdigit()
        family.add(
            f"missing_{word}".replace(" ", "_"),
            "nasty" if is_number else "typical",
            wide(gaps, lambda k: str(k), bracketed(gaps), missing=word, time_title="t [s]"),
            gaps.truth(False),
            answers={"missing": word},
            must_ask=("missing",) if is_number else (),
        )
    return family.variants


def sections():
    """Tables that are joined, interrupted or followed by something else."""
    family = Family("table_sections")
    t = table("PT101 TT102", step="1")
    rows = [[str(k), *(c.values[k] for c in t.columns)] for k in t.rows]
    head = ["t [s]", *bracketed(t)]
    truth = t.truth(False)
    family.add("blank_lines", "typical", lines([head, *rows[:7], [""], *rows[7:], [""], [""]]), truth)
    family.add("average_below", "nasty", lines([head, *rows, ["Average", "3.2", "61.5"]]), truth)
    family.add(
        "statistics_below", "nasty", lines([head, *rows, [""], ["Min", "2.4", "57"], ["Max", "4.0", "66"]]), truth
    )
    family.add("count_below", "nasty", lines([head, *rows, ["20 rows", "", ""]]), truth)
    family.add("end_mark", "nasty", lines([head, *rows, ["EOF"]]), truth)
    family.add("footer_text", "nasty", lines([head, *rows, [""], ["Exported by operator on 2026-03-02"]]), truth)
    swapped = ["t [s]", *bracketed(t)[::-1]]
    crossed = [[r[0], r[2], r[1]] for r in rows[10:]]
    family.add("titles_swapped_in_between", "nasty", lines([head, *rows[:10], swapped, *crossed]), truth)
    rescaled = ["t [s]", "PT101 [mbar]", "TT102 [°C]"]
    thousand = [[r[0], f"{float(r[1]) * 1000:.0f}", r[2]] for r in rows[10:]]
    family.add("unit_changes_in_between", "nasty", lines([head, *rows[:10], rescaled, *thousand]), truth)
    second = ["t [s]", "SC104 [rpm]", "LT105 [mm]"]
    more = table("SC104 LT105", step="1")
    both = t.truth(False)
    both.signals.update(more.truth(False).signals)
    below = [[str(k), *(c.values[k] for c in more.columns)] for k in more.rows]
    family.add(
        "second_table_below", "nasty", lines([head, *rows, [""], second, *below]), both, answers={"grid": "none"}
    )
    family.add(
        "line_break_in_title",
        "typical",
        lines([["t [s]", "PT101\n[bar]", "TT102\n[°C]"]], quote=True) + lines(rows),
        truth,
    )
    family.add("titles_twice", "nasty", lines([head, head, *rows]), truth)
    family.add("trailing_separators", "typical", lines([[*r, ""] for r in [head, *rows]]), truth)
    family.add(
        "short_rows",
        "nasty",
        lines([head, *[r if k != 6 else r[:2] for k, r in enumerate(rows)]]),
        table("PT101 TT102", step="1", missing=((6, 1),)).truth(False),
    )
    family.add(
        "cut_last_row",
        "nasty",
        lines([head, *rows[:-1]]) + "19,3.2",
        table("PT101 TT102", step="1", missing=((19, 1), (19, 0))).truth(False),
    )
    family.add("nul_bytes_at_end", "nasty", lines([head, *rows]).encode() + b"\0" * 40, truth)
    dual = ["t [s]", "PT101 [bar]", "PT101 [bar]"]
    family.add(
        "same_title_twice",
        "nasty",
        lines([dual, *rows]),
        t.truth(False, names=["PT101", "PT101_2"], units=["bar", "bar"]),
        answers={"header_row": "none"},
    )
    words = [[r[0], "AUTO" if k > 4 else "MAN", *r[1:], "on" if k % 2 else "off"] for k, r in enumerate(rows)]
    family.add(
        "columns_of_words",
        "typical",
        lines([["t [s]", "mode", *bracketed(t), "pump"], *words]),
        truth,
        harmless=("mode", "pump"),
    )
    changed = [["time", "tag", "value", "unit"]] + [
        [
            iso(t, k, 3),
            "PT101",
            t.columns[0].values[k] if k < 10 else f"{float(t.columns[0].values[k]) * 1000:.0f}",
            "bar" if k < 10 else "mbar",
        ]
        for k in t.rows
    ]
    lone = table("PT101", step="1")
    family.add("unit_changes_in_rows", "nasty", lines(changed), lone.truth())
    twice = [["time", "tag", "value"]] + [
        [iso(lone, k, 3), "PT101", lone.columns[0].values[k]] for k in lone.rows for _ in "ab"
    ]
    family.add("each_row_twice", "typical", lines(twice), lone.truth(units=[""]))
    return family.variants


def encodings():
    """The same table in the encodings of operating systems and programs."""
    family = Family("text_encodings")
    t = table("PT101 TT102", step="1", titles=("Zulauf", "Überlauf"), units=("bar", "°C"))
    text = wide(t, lambda k: str(k), bracketed(t), ";", ",", time_title="Zeit [s]", end="\r\n")
    for name, label in (
        ("cp1252", "windows-1252"),
        ("iso8859-15", "iso-8859-15"),
        ("cp850", "ibm850"),
        ("mac_roman", "macintosh"),
        ("cp437", "ibm437"),
        ("iso8859-1", "iso-8859-1"),
    ):
        family.add(
            name,
            "typical" if "cp4" not in name else "nasty",
            text,
            t.truth(False),
            encoding=name,
            answers={"encoding": label},
            must_ask=("encoding",),
        )
    family.add("utf8_mark", "clean", "\ufeff" + text, t.truth(False))
    family.add("utf16_little", "typical", b"\xff\xfe" + text.encode("utf-16-le"), t.truth(False))
    family.add("utf16_big", "typical", b"\xfe\xff" + text.encode("utf-16-be"), t.truth(False))
    family.add(
        "utf16_little_no_mark", "nasty", text.encode("utf-16-le"), t.truth(False), answers={"encoding": "utf-16le"}
    )
    family.add("utf32", "nasty", text.encode("utf-32"), t.truth(False), answers={"encoding": "utf-32"})
    broken = text.encode("utf-8").decode("cp1252").replace("Ã\u009c", "Ãœ")
    family.add(
        "utf8_read_as_cp1252",
        "nasty",
        broken,
        t.truth(False, names=[c.name.encode().decode("cp1252") for c in t.columns]),
        answers={"units": "Ãœberlauf:°C"},
    )
    decomposed = table("PT101 TT102", step="1", titles=("Zulauf", "U\u0308berlauf"), units=("bar", "°C"))
    family.add(
        "decomposed_letters",
        "nasty",
        wide(decomposed, lambda k: str(k), bracketed(decomposed), time_title="t [s]"),
        decomposed.truth(False),
    )
    degree = table("TT102", step="1")
    for name, sign in (("masculine_ordinal", "º"), ("ring_above", "˚"), ("kelvin_style_one_letter", "℃")):
        family.add(
            f"degree_as_{name}",
            "nasty",
            wide(degree, lambda k: str(k), [f"TT102 [{sign}{'' if sign == '℃' else 'C'}]"], time_title="t [s]"),
            degree.truth(False),
            answers={"units": "TT102:°C"},
        )
    micro = table("LT105", step="1", units=("µm",))
    family.add(
        "greek_mu",
        "typical",
        wide(micro, lambda k: str(k), ["LT105 [\u03bcm]"], time_title="t [s]"),
        micro.truth(False),
    )
    family.add(
        "hard_blank_in_unit",
        "nasty",
        wide(degree, lambda k: str(k), ["TT102\u00a0[°C]"], time_title="t\u00a0[s]"),
        degree.truth(False),
    )
    return family.variants


def variants():
    return spelled_numbers() + sections() + encodings()
