"""Units whose letters plants mean otherwise, and the places of a title that may have its unit."""

from payloads import SCALES, Family, bracketed, table, wide


def doubtful_units():
    """Units whose letters say something else than plants mean by them, or two things."""
    family = Family("doubtful_units")
    for unit, si, factor, offset, answer, is_doubtful in (
        ("min-1", "rad/s", 0.10471975511965977, 0, "rpm", False),
        ("min^-1", "rad/s", 0.10471975511965977, 0, "rpm", False),
        ("1/s", "1/s", 1, 0, "Hz", True),
        ("s-1", "1/s", 1, 0, "Hz", True),
        ("1/h", "1/s", 1 / 3600, 0, "", True),
        ("deg.C", "K", 1, 273.15, "°C", False),
        ("kn", "m/s", 1852 / 3600, 0, "kt", True),
        ("kg/cm2", "Pa", 98066.5, 0, "kgf/cm2", False),
        ("kg/cm²", "Pa", 98066.5, 0, "kgf/cm2", False),
        ("W/mK", "kg·m·s^-3·K^-1", 1, 0, "W/(m*K)", False),
        ("W/m·K", "kg·m·s^-3·K^-1", 1, 0, "W/(m*K)", False),
        ("lb ft", "N·m", 1.3558179483314003, 0, "lbf*ft", False),
        ("ft lb", "N·m", 1.3558179483314003, 0, "lbf*ft", False),
        ("m3/h N", "m3/s", 1 / 3600, 0, "Nm3/h", False),
        ("m³/h i.N.", "m3/s", 1 / 3600, 0, "Nm3/h", False),
        ("mm Hg", "Pa", 133.322387415, 0, "mmHg", False),
        ("M", "m", 1, 0, "m", True),
        ("mpa", "Pa", 1e6, 0, "MPa", False),
        ("mw", "W", 1e6, 0, "MW", True),
        ("K", "K", 1, 0, "K", False),
        ("C", "K", 1, 273.15, "°C", False),
        ("bar", "Pa", 1e5, 0, "bar", False),
    ):
        t = table("PT101", titles=("signal",), step="1")
        SCALES[unit] = SCALES.get(unit, (si, factor, offset))
        t.columns[0].unit = unit
        must = ("units",) if is_doubtful else ()
        family.add(
            unit,
            "nasty" if is_doubtful else "typical",
            wide(t, lambda k: str(k), [f"signal [{unit}]"], time_title="t [s]"),
            t.truth(False),
            answers={"units": f"signal:{answer}"},
            must_ask=must,
        )
    return family.variants


def title_styles():
    """Where a title may have its unit."""
    family = Family("title_styles")
    t = table("PT101 TT102", step="1")
    for form in (
        "{name} [{unit}]",
        "{name}[{unit}]",
        "{name} ({unit})",
        "{name}({unit})",
        "{name} / {unit}",
        "{name}/{unit}",
        "{name} in {unit}",
        "{name}, {unit}",
        "{name} {unit}",
        "{name} {{{unit}}}",
        "{name} <{unit}>",
        "{name} - {unit}",
        "{name}_{unit}",
        "{name}.{unit}",
        "{name}|{unit}",
        "{name}:{unit}",
        "{name} (in {unit})",
        "{name} [in {unit}]",
        "{name} [{unit}] avg",
        "{name} ({unit}) mean",
        "[{unit}] {name}",
        "{name} EU={unit}",
        "{name} [ {unit} ]",
        "{description} {name} [{unit}]",
        "{name}#{unit}",
        "{name} \\n[{unit}]",
    ):
        titles = [title.replace("\\n", "\n") for title in bracketed(t, form)]
        answers = {"units": ",".join(f"{c.name}:{c.unit}" for c in t.columns)}
        family.add(
            form.format(name="name", unit="unit", description="text").replace("\\n", "break"),
            "typical",
            wide(t, lambda k: str(k), titles, ";", time_title="t [s]"),
            t.truth(False),
            answers=answers,
        )
    return family.variants


def variants():
    return doubtful_units() + title_styles()
