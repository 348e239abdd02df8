"""A plant with known signals, and the spellings in which programs write its tables.

The truth of a variant comes from the numbers of this file alone: values as decimal text, instants as fractions
of a second, units by the factors below. No part of it is read from the program that is asked.
"""

import gzip
import math
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta, timezone
from fractions import Fraction
from zoneinfo import ZoneInfo

BEGIN = datetime(2026, 3, 2, 8, 15, tzinfo=timezone.utc)
BERLIN, NEW_YORK, TOKYO = ZoneInfo("Europe/Berlin"), ZoneInfo("America/New_York"), ZoneInfo("Asia/Tokyo")
ATMOSPHERE = 101325.0
PSI = 0.45359237 * 9.80665 / 0.0254**2

# The SI unit, the factor and the offset of each spelling of a unit.
SCALES = {}
for spellings, si, factor, offset in (
    ("bar|bara|bar(a)|bar a|BAR", "Pa", 1e5, 0),
    ("barg|bar(g)|bar g", "Pa", 1e5, ATMOSPHERE),
    ("mbar", "Pa", 1e2, 0),
    ("kPa|KPA", "Pa", 1e3, 0),
    ("MPa", "Pa", 1e6, 0),
    ("hPa", "Pa", 1e2, 0),
    ("psi|PSI", "Pa", PSI, 0),
    ("psig|PSIG|psi(g)", "Pa", PSI, ATMOSPHERE),
    ("Pa", "Pa", 1, 0),
    ("°C|degC|Deg C|deg C|C|Celsius|Grad C|℃|DEGC|°c|degrees Celsius", "K", 1, 273.15),
    ("K|Kelvin", "K", 1, 0),
    ("°F|degF|DEGF|deg F|F", "K", 5 / 9, 459.67 * 5 / 9),
    ("m³/h|m3/h|m^3/h|M3/H|m³/hr|m3/hr", "m3/s", 1 / 3600, 0),
    ("l/min|L/min|LPM|lpm|ltr/min", "m3/s", 1e-3 / 60, 0),
    ("gpm|GPM|gal/min|USGPM", "m3/s", 231 * 0.0254**3 / 60, 0),
    ("m³/s|m3/s", "m3/s", 1, 0),
    ("rpm|RPM|U/min|1/min|min-1|min^-1|r/min|min⁻¹", "rad/s", math.pi / 30, 0),
    ("mm|MM", "m", 1e-3, 0),
    ("m|Meter", "m", 1, 0),
    ("µm|um", "m", 1e-6, 0),
    ("inch|in", "m", 0.0254, 0),
    ("cm", "m", 1e-2, 0),
    ("kW|KW", "W", 1e3, 0),
    ("W", "W", 1, 0),
    ("V|Volt|volts|Volts", "V", 1, 0),
    ("mV", "V", 1e-3, 0),
    ("A|Ampere|Amp", "A", 1, 0),
    ("mA", "A", 1e-3, 0),
    ("Nm|N·m|N*m|N-m|N.m", "N·m", 1, 0),
    ("kN", "N", 1e3, 0),
    ("N", "N", 1, 0),
    ("%|pct|percent|Percent", "1", 1e-2, 0),
    ("%RH|% r.F.", "1", 1e-2, 0),
    ("kg/h", "kg/s", 1 / 3600, 0),
    ("t/h", "kg/s", 1 / 3.6, 0),
    ("Hz", "Hz", 1, 0),
    ("m/s²|m/s^2", "m/s2", 1, 0),
    ("deg|°", "rad", math.pi / 180, 0),
    ("rad/s", "rad/s", 1, 0),
    ("1|-", "1", 1, 0),
    ("", "", 1, 0),
):
    for spelling in spellings.split("|"):
        SCALES[spelling] = (si, factor, offset)


@dataclass
class Column:
    """A signal: its name, its unit as the program spells it, and its values as decimal text; None is missing."""

    name: str
    unit: str
    values: list
    description: str = ""
    names: tuple = ()
    qualities: list = None

    def si(self, text):
        _, factor, offset = SCALES[self.unit]
        return None if text is None else float(text) * factor + offset

    def number(self, row):
        return None if self.values[row] is None else float(self.values[row])


@dataclass
class Table:
    """Columns at common instants: seconds from `begin`, as fractions."""

    columns: list
    instants: list
    begin: datetime = BEGIN

    @property
    def rows(self):
        return range(len(self.instants))

    def clock(self, row):
        """The time of day of a row, in UTC, to the microsecond."""
        return self.begin + timedelta(microseconds=round(self.instants[row] * 10**6))

    def seconds(self, row, digits=3):
        return f"{float(self.instants[row]):.{digits}f}"

    def milliseconds(self, row):
        return round(self.begin.timestamp() * 1000) + round(self.instants[row] * 1000)

    def truth(self, is_absolute=True, names=None, units=None):
        """Signals by name: unit in SI and values by instant; without units where the file has none."""
        epoch = Fraction(round(self.begin.timestamp() * 10**6), 10**6) if is_absolute else Fraction(0)
        signals = {}
        for position, column in enumerate(self.columns):
            scaled = column if units is None else replace(column, unit=units[position])
            bad = column.qualities or [True] * len(self.instants)
            values = {
                epoch + t: scaled.si(text) if good else None
                for t, text, good in zip(self.instants, column.values, bad)
            }
            name = column.name if names is None else names[position]
            signals[name] = {"unit": SCALES[scaled.unit][0], "values": values, "names": column.names}
        return Truth(signals, is_absolute)


@dataclass
class Truth:
    signals: dict
    is_absolute: bool
    tolerance: float = 0.0


@dataclass
class Variant:
    """A payload, what it means, and what a person answers who is asked about it."""

    source: str
    name: str
    level: str
    body: bytes
    truth: Truth
    answers: dict = field(default_factory=dict)
    content_type: str = "text/csv"
    must_ask: tuple = ()
    harmless: tuple = ()


PLANT = {
    "PT101": ("bar", 3.2, 0.8, 0.31, 3, "Feed pressure"),
    "TT102": ("°C", 61.5, 4.2, 0.17, 2, "Outlet temperature"),
    "FT103": ("m³/h", 12.4, 2.6, 0.23, 3, "Feed flow"),
    "SC104": ("rpm", 1452.0, 38.0, 0.41, 1, "Pump speed"),
    "LT105": ("mm", 842.0, 65.0, 0.11, 1, "Tank level"),
    "JT106": ("kW", 7.31, 1.2, 0.29, 3, "Motor power"),
    "XV107": ("%", 45.0, 30.0, 0.37, 1, "Valve position"),
    "ET108": ("V", 4.8, 3.9, 0.53, 4, "Drive command"),
    "IT109": ("mA", 12.1, 6.3, 0.19, 3, "Loop current"),
    "WT110": ("Nm", 21.7, 9.4, 0.47, 2, "Shaft torque"),
}


def table(
    names="PT101 TT102 FT103", rows=20, step="1", units=None, titles=None, missing=(), begin=BEGIN, digits=None
):
    """A table of the plant; `missing` are pairs of row and column without a sample."""
    columns = []
    for position, name in enumerate(names.split()):
        unit, mean, swing, rate, decimals, description = PLANT[name]
        decimals = decimals if digits is None else digits
        values = [f"{mean + swing * math.sin(rate * k + position) + 0.003 * k:.{decimals}f}" for k in range(rows)]
        for row, place in missing:
            if place == position:
                values[row] = None
        title = titles[position] if titles else name
        columns.append(Column(title, units[position] if units else unit, values, description))
    return Table(columns, [Fraction(step) * k for k in range(rows)], begin)


def stamp(moment, form, zone=timezone.utc, digits=None, mark="."):
    """A moment as strftime writes it, `%f` cut to `digits`; `%E` is a month or day or hour without a leading zero."""
    local = moment.astimezone(zone)
    text = form
    for code, number in (
        ("%-d", local.day),
        ("%-m", local.month),
        ("%-I", (local.hour - 1) % 12 + 1),
        ("%-H", local.hour),
    ):
        text = text.replace(code, str(number))
    fraction = f"{local.microsecond:06d}"
    if digits is not None:
        fraction = (fraction + "0" * 6)[:digits]
    return local.strftime(text.replace("%f", fraction).replace("%.", mark))


def number(text, mark=".", missing="", grouping=""):
    """A value as a locale writes it."""
    if text is None:
        return missing
    if grouping:
        whole, _, rest = text.partition(".")
        text = f"{int(whole):,}".replace(",", grouping) + ("." + rest if rest else "")
        return text if mark == "." else text[::-1].replace(".", mark, 1)[::-1]
    return text.replace(".", mark)


def lines(rows, separator=",", end="\n", quote=False, last_end=True):
    """Rows of text as a table; a cell that holds the separator is quoted."""

    def cell(text):
        text = str(text)
        if quote or separator in text and separator != " " or '"' in text or "\n" in text:
            return '"' + text.replace('"', '""') + '"'
        return text

    text = end.join(separator.join(map(cell, row)) for row in rows)
    return text + (end if last_end else "")


def wide(
    table,
    times,
    titles,
    separator=",",
    mark=".",
    missing="",
    order=1,
    top=(),
    grouping="",
    end="\n",
    quote=False,
    time_title="time",
    tail="",
    below=(),
    bottom=(),
):
    """The usual table: a time (one or several cells) and a column for each signal."""
    head = ([time_title] if isinstance(time_title, str) else list(time_title)) + list(titles)
    body = []
    for row in table.rows:
        time = times(row)
        cells = [time] if isinstance(time, str) else list(time)
        cells += [number(column.values[row], mark, missing, grouping) for column in table.columns]
        body.append(cells + ([tail] if tail is None else []))
    body = [[cell if cell is not None else "" for cell in cells] for cells in body][::order]
    if tail is None:
        head.append("")
    return lines([*top, head, *below, *body, *bottom], separator, end, quote)


def bracketed(table, form="{name} [{unit}]"):
    return [form.format(name=c.name, unit=c.unit, description=c.description) for c in table.columns]


def names_of(table):
    return [column.name for column in table.columns]


def packed(body):
    return gzip.compress(body, mtime=0)


class Family:
    """Variants of one source, in the order in which they were added."""

    def __init__(self, source, content_type="text/csv"):
        self.source, self.content_type, self.variants = source, content_type, []

    def add(self, name, level, body, truth, **options):
        data = body if isinstance(body, bytes) else body.encode(options.pop("encoding", "utf-8"))
        options.pop("encoding", None)
        options.setdefault("content_type", self.content_type)
        self.variants.append(Variant(self.source, name, level, data, truth, **options))
