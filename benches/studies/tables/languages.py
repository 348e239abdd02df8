"""Tables as programming languages and their libraries write them."""

from payloads import BERLIN, Family, bracketed, lines, names_of, number, packed, stamp, table, wide


def r_language():
    family = Family("r_write_csv")
    t = table("PT101 TT102", step="1", missing=((4, 1),))
    clock = lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S")
    bare, zone = t.truth(units=["", ""]), {"tz": "UTC", "missing": "NA"}
    rows = [[clock(k), *(number(c.values[k], ".", "NA") for c in t.columns)] for k in t.rows]
    family.add("no_row_names", "clean", lines([["time", *names_of(t)]] + rows), bare, answers=zone, must_ask=("tz",))
    text = '"","time","PT101","TT102"\n' + "".join(
        f'"{k + 1}",{row[0]},{row[1]},{row[2]}\n' for k, row in enumerate(rows)
    )
    family.add(
        "row_names",
        "typical",
        text,
        bare,
        answers={**zone, "time": "time"},
        must_ask=("tz",),
        harmless=("", "column_1"),
    )
    semicolons = '"time";"PT101";"TT102"\n' + "".join(
        ";".join(cell.replace(".", ",") for cell in row) + "\n" for row in rows
    )
    family.add("csv2", "typical", semicolons, bare, answers=zone, must_ask=("tz",))
    blanks = '"time" "PT101" "TT102"\n' + "".join(
        f'"{k + 1}" "{row[0]}" {row[1]} {row[2]}\n' for k, row in enumerate(rows)
    )
    family.add("write_table", "nasty", blanks, bare, answers={**zone, "time": "time"}, must_ask=("tz",))
    readr = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%SZ"), names_of(t), missing="NA")
    family.add("readr", "clean", readr, bare, answers={"missing": "NA"})
    dotted = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%SZ"), ["PT101..bar.", "TT102...C."], missing="NA")
    family.add(
        "mangled_names",
        "nasty",
        dotted,
        t.truth(units=["", ""], names=["PT101..bar.", "TT102...C."]),
        answers={"missing": "NA"},
    )
    return family.variants


def numpy_text():
    family = Family("numpy_and_octave_text", "text/plain")
    t = table("PT101 TT102", step="0.1")
    exact = table("PT101 TT102", step="0.1")
    rows = [[f"{k * 0.1:.18e}", *(f"{float(c.values[k]):.18e}" for c in t.columns)] for k in t.rows]
    truth = exact.truth(False)
    family.add("savetxt_commas", "clean", lines([["# time [s]", *bracketed(t)]] + rows), truth)
    family.add(
        "savetxt_blanks",
        "nasty",
        "# time_s PT101 TT102\n" + lines(rows, " "),
        exact.truth(False, units=["", ""]),
        answers={"time_unit": "s"},
    )
    family.add(
        "savetxt_bare",
        "nasty",
        lines(rows, " "),
        exact.truth(False, units=["", ""], names=["column_2", "column_3"]),
        answers={"header_row": "none", "time_unit": "s"},
    )
    octave = (
        "# Created by Octave 8.4.0, Mon Mar 02 08:15:00 2026 UTC <lab@rig>\n# name: data\n# type: matrix\n# rows: 20\n"
        "# columns: 3\n"
        + "".join(" " + " ".join(f"{float(cell):.10g}" for cell in row) + "\n" for row in rows)
        + "\n\n"
    )
    family.add(
        "octave_save",
        "nasty",
        octave,
        exact.truth(False, units=["", ""], names=["column_2", "column_3"]),
        answers={"header_row": "none", "time_unit": "s"},
    )
    aligned = f"{'time_s':>12}{'PT101':>12}{'TT102':>12}\n" + "".join(
        f"{k * 0.1:12.3f}{float(t.columns[0].values[k]):12.3f}{float(t.columns[1].values[k]):12.3f}\n" for k in t.rows
    )
    family.add("aligned_columns", "typical", aligned, exact.truth(False, units=["", ""]), answers={"time_unit": "s"})
    comments = "# rig 7\n# operator: lab\n# columns below\n" + lines([["time [s]", *bracketed(t)]] + rows)
    family.add("comments_on_top", "typical", comments, truth)
    fortran = lines([["time [s]", *bracketed(t)]] + [[cell.replace("e", "D") for cell in row] for row in rows])
    family.add("fortran_exponents", "nasty", fortran, truth)
    modelica = lines([['"time"', '"pump.PT101"', '"pump.TT102"']]).replace('"""', '"') + lines(
        [[cell for cell in row] for row in rows]
    )
    family.add("openmodelica", "typical", modelica, exact.truth(False, units=["", ""]), answers={"time_unit": "s"})
    return family.variants


def julia_and_others():
    family = Family("julia_go_dotnet_csv")
    t = table("PT101 TT102", step="0.5", missing=((4, 1),))
    julia = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", digits=3).removesuffix(".000"), bracketed(t))
    family.add("julia", "typical", julia, t.truth(), answers={"tz": "UTC"}, must_ask=("tz",))
    family.add(
        "julia_missing_word",
        "nasty",
        wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", digits=3) + "Z", bracketed(t), missing="missing"),
        t.truth(),
        answers={"missing": "missing"},
    )
    go = wide(
        t,
        lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", digits=1).removesuffix(".0") + " +0000 UTC",
        bracketed(t),
    )
    family.add("go_time_string", "nasty", go, t.truth())
    nano = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", digits=6) + "000Z", bracketed(t))
    family.add("rfc3339_nano", "clean", nano, t.truth())
    dotnet = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", BERLIN, 6) + "0+01:00", bracketed(t))
    family.add("dotnet_round_trip", "clean", dotnet, t.truth())
    ticks = wide(t, lambda k: str(t.milliseconds(k) * 10000 + 621355968000000000), bracketed(t), time_title="Ticks")
    family.add("dotnet_ticks", "nasty", ticks, t.truth(), answers={"time_unit": "ticks"})
    java = wide(
        t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S.%f", BERLIN, 3) + "+01:00[Europe/Berlin]", bracketed(t)
    )
    family.add("java_zoned", "nasty", java, t.truth())
    rfc = wide(t, lambda k: stamp(t.clock(k), "%a, %d %b %Y %H:%M:%S.%f GMT", digits=3), bracketed(t), quote=True)
    family.add("mail_dates", "nasty", rfc, t.truth())
    week = wide(t, lambda k: stamp(t.clock(k), "%Y%m%dT%H%M%S.%f", digits=3) + "Z", bracketed(t))
    family.add("basic_iso", "typical", week, t.truth())
    ordinal = wide(t, lambda k: stamp(t.clock(k), "%Y-%jT%H:%M:%S.%f", digits=3) + "Z", bracketed(t))
    family.add("ordinal_iso", "nasty", ordinal, t.truth())
    comma = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dT%H:%M:%S,%f", digits=3) + "Z", bracketed(t), ";")
    family.add("iso_comma_fraction", "typical", comma, t.truth())
    named = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%d %H:%M:%S.%f", BERLIN, 3) + " CET", bracketed(t))
    family.add("zone_abbreviation", "nasty", named, t.truth(), answers={"tz": "Europe/Berlin"})
    lower = wide(t, lambda k: stamp(t.clock(k), "%Y-%m-%dt%H:%M:%S.%f", digits=3) + "z", bracketed(t))
    family.add("lower_case_iso", "nasty", lower, t.truth())
    return family.variants


def clocks():
    """Times without a date."""
    family = Family("elapsed_clocks")
    t = table("PT101 TT102", step="0.5")
    truth = t.truth(False)

    def clock(form):
        return wide(t, form, bracketed(t), time_title="Time")

    family.add("minutes_seconds", "nasty", clock(lambda k: f"00:{k * 0.5:04.1f}"), truth, must_ask=())
    family.add("hours_minutes_seconds", "typical", clock(lambda k: f"00:00:{k * 0.5:06.3f}"), truth)
    long = table("PT101 TT102", step="3600", rows=40)
    family.add(
        "more_than_a_day",
        "nasty",
        wide(long, lambda k: f"{k}:00:00", bracketed(long), time_title="Elapsed"),
        long.truth(False),
    )
    night = table("PT101 TT102", step="60", rows=30)
    day = lambda k: f"{(23 * 60 + 45 + k) // 60 % 24:02d}:{(45 + k) % 60:02d}:00"
    family.add("over_midnight", "nasty", wide(night, day, bracketed(night), time_title="Time"), night.truth(False))
    family.add(
        "minutes",
        "typical",
        wide(night, lambda k: str(k), bracketed(night), time_title="t [min]"),
        night.truth(False),
    )
    hours = table("PT101 TT102", step="360")
    family.add(
        "decimal_hours",
        "typical",
        wide(hours, lambda k: f"{k / 10:.1f}", bracketed(hours), time_title="t (h)"),
        hours.truth(False),
    )
    family.add("unit_in_name", "typical", wide(t, lambda k: str(500 * k), bracketed(t), time_title="time_ms"), truth)
    family.add(
        "unit_spelled_out",
        "nasty",
        wide(t, lambda k: str(500 * k), bracketed(t), time_title="Time (milliseconds)"),
        truth,
        answers={"time_unit": "ms"},
    )
    family.add(
        "seconds_spelled_out",
        "typical",
        wide(t, t.seconds, bracketed(t), time_title="Elapsed time (seconds)"),
        truth,
        answers={"time_unit": "s"},
    )
    family.add(
        "bare_counter",
        "nasty",
        wide(t, str, bracketed(t), time_title="Index"),
        truth,
        answers={"time_unit": "500ms"},
        must_ask=("time_unit",),
    )
    digits = table("PT101 TT102", step="20")
    compact = lambda k: stamp(digits.clock(k), "%Y%m%d%H%M%S")
    for title in ("time", "Timestamp"):
        family.add(
            f"fourteen_digits_{title}",
            "nasty",
            wide(digits, compact, bracketed(digits), time_title=title),
            digits.truth(),
            answers={"tz": "UTC"},
        )
    daily = table("PT101 TT102", step="86400", begin=digits.begin.replace(hour=0, minute=0))
    for title in ("time", "Date", "Zeit"):
        family.add(
            f"whole_serial_days_{title}",
            "nasty",
            wide(daily, lambda k: str(46083 + k), bracketed(daily), time_title=title),
            daily.truth(),
            answers={"time_unit": "excel", "tz": "UTC"},
            must_ask=("time_unit",),
        )
    for title, scale in (("time", 1000), ("Time", 1000000), ("t", 1000), ("Zeit", 1000)):
        family.add(
            f"no_unit_{title}_{scale}",
            "nasty",
            wide(t, lambda k: str(k * scale // 2), bracketed(t), time_title=title),
            truth,
            answers={"time_unit": {1000: "ms", 1000000: "us"}[scale]},
            must_ask=("time_unit",),
        )
    for name, form in (
        ("iso_durations", lambda k: f"PT{k * 0.5:.1f}S"),
        ("seconds_in_cells", lambda k: f"{k * 0.5} s"),
        ("milliseconds_in_cells", lambda k: f"{k * 500} ms"),
        ("days_first", lambda k: f"0.00:00:{k * 0.5:06.3f}"),
    ):
        family.add(name, "nasty", clock(form), truth)
    family.add(
        "negative_times",
        "typical",
        wide(t, lambda k: f"{(k - 8) * 0.5:.1f}", bracketed(t), time_title="t [s]"),
        truth,
    )
    family.add("gzip", "typical", packed(wide(t, t.seconds, bracketed(t), time_title="t [s]").encode()), truth)
    return family.variants


def unit_spellings():
    """Titles that spell units otherwise."""
    family = Family("unit_spellings")
    for names, units in (
        ("PT101 TT102 FT103", ("bar(a)", "Deg C", "m^3/h")),
        ("PT101 TT102 SC104", ("barg", "℃", "min-1")),
        ("PT101 SC104 WT110", ("kPa", "1/min", "N*m")),
        ("PT101 SC104 LT105", ("psig", "r/min", "inch")),
        ("PT101 TT102 FT103", ("bar a", "deg C", "m3/hr")),
        ("PT101 TT102 FT103", ("BAR", "DEGC", "M3/H")),
        ("TT102 FT103 XV107", ("degrees Celsius", "LPM", "percent")),
        ("TT102 FT103 WT110", ("degF", "USGPM", "N-m")),
        ("ET108 IT109 LT105", ("Volts", "Amp", "um")),
        ("SC104 WT110 JT106", ("min^-1", "N.m", "KW")),
        ("SC104 TT102 XV107", ("min⁻¹", "°c", "% r.F.")),
        ("FT103 TT102 PT101", ("ltr/min", "Kelvin", "KPA")),
    ):
        t = table(names, step="0.5", units=units)
        answers = {"units": ",".join(f"{c.name}:{ASKED.get(c.unit, c.unit)}" for c in t.columns)}
        family.add(
            " ".join(units),
            "typical",
            wide(t, t.seconds, bracketed(t), time_title="t [s]"),
            t.truth(False),
            answers=answers,
        )
    return family.variants


# What a person answers who is asked about a spelling.
ASKED = {
    "ltr/min": "l/min",
    "r/min": "rpm",
    "N-m": "Nm",
    "USGPM": "gpm",
    "% r.F.": "%RH",
    "min⁻¹": "1/min",
    "Kelvin": "K",
    "m3/hr": "m3/h",
    "Amp": "A",
    "degrees Celsius": "°C",
    "min-1": "1/min",
    "min^-1": "1/min",
    "KPA": "kPa",
}


def variants():
    return r_language() + numpy_text() + julia_and_others() + clocks() + unit_spellings()
