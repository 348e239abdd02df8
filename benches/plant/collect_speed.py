"""The speed of `greybox collect --once`, which brings the history of ten signals at 1 Hz: from a table with a column
each, from a table with a row for each sample, and from an InfluxDB."""

import math
import random
import time

from collect import Plant
from collect_sources import Influx, influx_source, postgres_source
from postgres import programs

SIGNALS, DAY_S, YEAR_DAYS = 10, 86_400, 365.25
DAYS = 20
# The history of the InfluxDB is shorter by this factor.
INFLUX_SHARE = 5
# A request that writes into the InfluxDB has so many points.
POINTS = 5000
NAMES = [f"s{place}" for place in range(SIGNALS)]


def value(place, row="n"):
    """The expression of a signal at a row, for SQL: a slow movement with noise of three digits."""
    return f"round((100 * sin({row} / {600 + 37 * place}.0) + random())::numeric, 3)::float8"


def peak_mib(process):
    """Waits for the end of a process; the most memory that the process had [MiB]."""
    peak = 0.0
    while process.poll() is None:
        try:
            with open(f"/proc/{process.pid}/status") as status:
                line = next((line for line in status if line.startswith("VmHWM")), None)
        except OSError:
            line = None
        if line:
            peak = int(line.split()[1]) / 1024
        time.sleep(0.05)
    return peak


def wide(plant, begin, days):
    columns = ", ".join(f"{name} double precision" for name in NAMES)
    values = ", ".join(value(place) for place in range(SIGNALS))
    plant.database.sql(f"create unlogged table wide (at timestamptz, {columns})")
    plant.database.sql(f"insert into wide select to_timestamp({begin} + n), {values} "
                       f"from generate_series(0, {days * DAY_S - 1}) n")
    plant.database.sql("create index on wide (at)")
    plant.database.sql("analyze wide")
    signals = "".join(f"{name} = {{}}\n" for name in NAMES)
    series = f'[[source.series]]\nstream = "wide"\ntable = "wide"\ntime = "at"\n[source.series.signals]\n{signals}'
    return postgres_source("wide", plant.database, begin * 10**6 - 1, series), days * DAY_S


def long(plant, begin, days):
    plant.database.sql("create unlogged table long (tag text, ts bigint, val double precision)")
    for place, name in enumerate(NAMES):
        plant.database.sql(f"insert into long select '{name}', ({begin} + n) * 1000::bigint, {value(place)} "
                           f"from generate_series(0, {days * DAY_S - 1}) n")
    plant.database.sql("create index on long (tag, ts)")
    plant.database.sql("analyze long")
    series = "".join(f'[[source.series]]\nstream = "long"\ntable = "long"\ntime = "ts"\ntime_unit = "ms"\n'
                     f'where = {{ tag = "{name}" }}\nsignals = {{ {name} = {{ column = "val" }} }}\n' for name in NAMES)
    return postgres_source("long", plant.database, begin * 10**6 - 1, series), days * DAY_S * SIGNALS


def influx(plant, begin, days, historian):
    rows, draw = days * DAY_S, random.Random(days)
    for first in range(0, rows, POINTS):
        lines = []
        for row in range(first, min(rows, first + POINTS)):
            fields = ",".join(f"{name}={100 * math.sin(row / (600 + 37 * place)) + draw.random():.3f}"
                              for place, name in enumerate(NAMES))
            lines.append(f"plant,line=a {fields} {(begin + row) * 10**6}")
        historian.write("\n".join(lines))
    signals = "".join(f"{name} = {{}}\n" for name in NAMES)
    series = f'[[source.series]]\nstream = "influx"\nmeasurement = "plant"\n[source.series.signals]\n{signals}'
    return influx_source("influx", historian, begin * 10**6 - 1, series), rows


def bring(plant, name, prepared, days):
    """Brings a history once, and prints how fast that was; whether all is there."""
    source, rows = prepared
    samples = days * DAY_S
    plant.collector.describe(source)
    began = time.monotonic()
    plant.collector.start("--once")
    peak = peak_mib(plant.collector.process)
    took = time.monotonic() - began
    status, shown, _ = plant.client().ask("GET", f"/v1/streams/{name}")
    there = shown["samples"] if status == 200 else 0
    is_good = plant.collector.process.returncode == 0 and there == samples
    print(f"collect_speed: {name}: {days} days of {SIGNALS} signals at 1 Hz in {took:.1f} s: {rows / took:.0f} rows/s, "
          f"{samples * SIGNALS / took:.0f} values/s, {peak:.0f} MiB of memory at the most; a year would take "
          f"{took * YEAR_DAYS / days / 60:.0f} min; {there} of {samples} instants are in the stream, "
          f"{shown['bytes'] / 2**20 if there else 0:.0f} MiB", flush=True)
    return is_good


def collect_speed(options):
    """The speed of a history that is brought once."""
    if programs() is None:
        print("collect_speed: NOT MEASURED: PostgreSQL is not installed", flush=True)
        return True
    days = options.count or DAYS
    plant, is_good = Plant(options, "speed"), True
    begin = int(time.time()) - (days + 1) * DAY_S
    for prepare in (wide, long):
        prepared = prepare(plant, begin, days)
        is_good = bring(plant, prepare.__name__, prepared, days) and is_good
        plant.database.sql(f"drop table {prepare.__name__}")
    if Influx.program():
        historian, less = Influx(), max(1, days // INFLUX_SHARE)
        is_good = bring(plant, "influx", influx(plant, begin, less, historian), less) and is_good
        historian.remove()
    else:
        print("collect_speed: influxd is not installed; the InfluxDB is left out", flush=True)
    plant.close(is_good)
    return is_good
