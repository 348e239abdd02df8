"""A year of a plant in one stream: how long it takes to send, how much it takes of disk and memory, and how long
a plot of all of it or of an hour takes.

    python3 benches/studies/year.py [--months 12] [--signals 10] [--database postgres://…]

The samples come at one hertz, a batch a month in Parquet: temperatures and pressures as sensors of 12 bits have
them, set points that move by shifts, and a spike of one sample in the middle. Cold plots are those of a server
that was just started; the files of its database may still be in the memory of the machine.
"""

import io
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.request
from datetime import datetime, timedelta, timezone

import served

BEGIN = datetime(2025, 1, 1, tzinfo=timezone.utc)
DAY = 86400
DAYS = 30.4
SPIKE = 1e4


def month(number, signals):
    """The instants of a month, and its samples by name."""
    import numpy

    samples = int(DAYS * DAY)
    random = numpy.random.default_rng([1, number])
    second = numpy.arange(samples) + number * samples
    columns = {}
    for signal in range(signals):
        if signal % 5 == 4:
            shifts = random.integers(20, 80, samples // 28800 + 1)
            values = numpy.repeat(shifts, 28800)[:samples].astype(float)
        else:
            walk = numpy.cumsum(random.standard_normal(samples)) * 0.02
            code = 2048 + 600 * numpy.sin(second / (3600.0 * (signal + 1))) + walk
            code = numpy.clip(numpy.round(code + 0.7 * random.standard_normal(samples)), 0, 4095)
            values = 273.15 + code * 150.0 / 4096
        columns[f"signal_{signal}"] = values
    if number == 5:
        columns["signal_0"][samples // 2] = SPIKE
    return second, columns


def parquet(second, columns):
    import pyarrow
    import pyarrow.parquet

    begin = int(BEGIN.timestamp())
    instants = pyarrow.array((begin + second) * 1_000_000_000, pyarrow.int64())
    instants = instants.cast(pyarrow.timestamp("ns", "UTC"))
    table = pyarrow.table({"time": instants, **columns})
    file = io.BytesIO()
    pyarrow.parquet.write_table(table, file, compression="snappy")
    return file.getvalue()


class Program:
    """A server with a database that stays when it ends."""

    def __init__(self, options, database):
        self.process = subprocess.Popen(
            [options.program, "serve", "--listen", "127.0.0.1:0", "--database", database,
             "--log", "error", "--max-body-mib", "1024"],
            stdout=subprocess.PIPE, text=True,
        )
        self.address = self.process.stdout.readline().split()[-1].rstrip("/")

    def ask(self, path, data=None, kind=None):
        request = urllib.request.Request(
            f"{self.address}/v1/{path}", data=data, headers={"content-type": kind} if kind else {}
        )
        with urllib.request.urlopen(request, timeout=600) as answer:
            return answer.read()

    def peak_mib(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            peak = next(line for line in status if line.startswith("VmHWM"))
        return int(peak.split()[1]) / 1024

    def end(self):
        self.process.terminate()
        self.process.wait()


def plotted(options, database, query):
    """How long a plot takes with a server that was just started, and whether it has the spike."""
    program = Program(options, database)
    try:
        program.ask("streams/plant")
        began = time.monotonic()
        answer = program.ask(f"streams/plant?{query}")
        took = time.monotonic() - began
        again = time.monotonic()
        program.ask(f"streams/plant?{query}")
        warm = time.monotonic() - again
        values = json.loads(answer)["window"]["samples"]["signals"]["signal_0"]["values"]
        return took, warm, SPIKE in values, len(values), program.peak_mib()
    finally:
        program.end()


def stamp(second):
    return (BEGIN + timedelta(seconds=second)).strftime("%Y-%m-%dT%H:%M:%SZ")


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--months", type=int, default=12)
    parser.add_argument("--signals", type=int, default=10)
    parser.add_argument("--database", help="of the server, in place of a file of its own")
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment(["numpy", "pyarrow"], "greybox-year")
    with tempfile.TemporaryDirectory() as folder:
        database = options.database or "sqlite://" + os.path.join(folder, "jobs.db")
        program = Program(options, database)
        sending, stored, sent = 0.0, None, 0
        for number in range(options.months):
            body = parquet(*month(number, options.signals))
            sent += len(body)
            began = time.monotonic()
            kind = "application/vnd.apache.parquet"
            answer = program.ask("streams/plant?keep_mib=8192", body, kind)
            sending += time.monotonic() - began
            stored = json.loads(answer)["stream"]
            print(f"month {number}: {sending:.1f} s", file=sys.stderr, flush=True)
        began = time.monotonic()
        line = f"plant signal_0=280 {int(BEGIN.timestamp() + DAYS * DAY * options.months)}000000000\n"
        program.ask("streams/plant", line.encode(), "text/plain")
        single = time.monotonic() - began
        peak = program.peak_mib()
        program.end()
        middle = int((min(5, options.months - 1) + 0.5) * DAYS * DAY)
        rows = [("what", "time, first / again [s]", "points", "spike shown", "peak [MiB]")]
        figures = {"sending_s": sending, "peak_mib": peak, "stream": stored, "sent": sent}
        for name, length in (("year", 366 * DAY), ("month", 30 * DAY), ("day", DAY), ("hour", 3600)):
            query = f"from={stamp(middle - length)}&to={stamp(middle + length)}&max_points=4000"
            if name == "hour":
                query = f"from={stamp(middle - 1800)}&to={stamp(middle + 1800)}&max_points=4000"
            took, warm, spike, points, resident = plotted(options, database, query)
            figures[name] = {"s": took, "again_s": warm, "spike": spike}
            rows.append((name, f"{took:.3f} / {warm:.3f}", points, spike, f"{resident:.0f}"))
        print(f"sent {sent / 2**20:.0f} MiB in {sending:.1f} s, one sample in {1000 * single:.1f} ms; "
              f"stored {stored['samples']} instants in {stored['bytes'] / 2**20:.0f} MiB; "
              f"peak {peak:.0f} MiB")
        print(served.table(rows))
        served.keep(options, figures)


if __name__ == "__main__":
    main()
