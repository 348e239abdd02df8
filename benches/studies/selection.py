"""Which windows of a year fix a plant's parameters: how long a selection takes, and whether the estimates from the
chosen windows are as close as was foretold, beside windows that are drawn and those in which the input moves most.

    python3 benches/studies/selection.py [--days 365] [--plants 30]

The plant is two lags in series with a gain, and a second input of its own gain; it is computed here, by scipy, and
not by greybox. It rests: an operator moves its input a little a few times a day, a feed changes now and then, on two
days somebody tests it. An unmeasured disturbance with a memory acts on the output, which is read with noise. The
first part runs one selection over the year at one hertz with ten signals, ends it, kills it and runs it on one
thread; the second makes plants of 20 days, estimates each from the windows that a selection chose, and from as many
others.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
import urllib.request
from datetime import datetime, timedelta, timezone

import served

BEGIN = datetime(2025, 1, 1, tzinfo=timezone.utc)
DAY = 86400
HOUR = 3600
TRUTH = {"K": 2.0, "T1": 300.0, "T2": 60.0, "Kf": 0.5}
NOISE, DISTURBANCE, MEMORY = 0.01, 0.03, 40.0
# The plants of the second part are read so many seconds apart; inputs move at such instants.
STEP = 10


def history(days, seed):
    """The inputs and the output of a plant from the first day on, a sample a second."""
    import numpy
    from scipy.signal import lfilter

    random = numpy.random.default_rng([2, seed])
    samples = days * DAY
    valve = numpy.full(samples, 1.0)
    at = 0
    while at < samples:
        until = at + STEP * int(random.exponential(4 * HOUR) / STEP) + 600
        valve[at:until] = 1.0 + random.choice([0, 0.005, 0.01, 0.02, -0.01])
        at = until
    for day in (1, max(2, days // 2)):
        test = numpy.repeat(1 + 0.2 * random.choice([-1, 1], 24), 300)
        first = day * DAY + 10 * HOUR
        valve[first:first + len(test)] = test
    feed = numpy.repeat(1 + 0.05 * random.standard_normal(samples // (12 * HOUR) + 1), 12 * HOUR)[:samples]

    def lag(values, time_constant, start):
        share = numpy.exp(-1.0 / time_constant)
        driven = numpy.concatenate([[start], (1 - share) * values[:-1]])
        return lfilter([1.0], [1.0, -share], driven)

    first = lag(valve, TRUTH["T1"], valve[0]) * TRUTH["K"] + lag(feed, TRUTH["T1"], feed[0]) * TRUTH["Kf"]
    share = numpy.exp(-1.0 / TRUTH["T2"])
    # The second lag follows the first, which is no step from sample to sample: both of its ends count.
    ratio = TRUTH["T2"] * (1 - share)
    driven = (ratio - share) * first[:-1] + (1 - ratio) * first[1:]
    level = lfilter([1.0], [1.0, -share], numpy.concatenate([[first[0]], driven]))
    share = numpy.exp(-1.0 / MEMORY)
    moved = DISTURBANCE * numpy.sqrt(1 - share**2) * random.standard_normal(samples)
    level = level + lfilter([1.0], [1.0, -share], moved) + NOISE * random.standard_normal(samples)
    return {"valve": valve, "feed": feed, "level": level}


def model():
    # The two lags could change places: their ranges do not meet.
    unknown = lambda unit, value, by=5: {"unit": unit, "default": value, "lower": value / by, "upper": by * value,
                                         "scale": "log", "unknown": True}
    return {
        "name": "two_lags",
        "inputs": {"valve": {"unit": "1"}, "feed": {"unit": "1"}},
        "parameters": {"K": unknown("1", 1.5), "Kf": unknown("1", 0.7), "T1": unknown("s", 400.0, 3),
                       "T2": unknown("s", 40.0, 3)},
        "states": {"x": {"unit": "1", "initial": 2, "derivative": "(K*valve + Kf*feed - x)/T1"},
                   "y": {"unit": "1", "initial": 2, "derivative": "(x - y)/T2"}},
        "outputs": {"level": {"unit": "1", "expression": "y"}},
    }


START = {state: {"estimate": {"lower": 1, "upper": 4}} for state in "xy"}


class Program:
    """A server on a file that stays when the server ends."""

    def __init__(self, options, database, threads=None):
        command = [options.program, "serve", "--listen", "127.0.0.1:0", "--database", f"sqlite://{database}",
                   "--log", "error", "--max-body-mib", "1024"]
        environment = dict(os.environ, **({"RAYON_NUM_THREADS": str(threads)} if threads else {}))
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment)
        self.address = self.process.stdout.readline().split()[-1].rstrip("/")

    def ask(self, method, path, body=None, kind="application/json", wait=None):
        data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
        headers = {"content-type": kind, **({"prefer": f"wait={wait}"} if wait else {})}
        request = urllib.request.Request(f"{self.address}/v1/{path}", data, headers, method=method)
        with urllib.request.urlopen(request, timeout=600) as answer:
            return json.loads(answer.read())

    def ended(self, job):
        while True:
            shown = self.ask("GET", f"jobs/{job}?wait=30")
            if shown["status"] in ("succeeded", "failed", "cancelled"):
                return shown

    def result(self, job):
        shown = self.ended(job)
        if shown["status"] != "succeeded":
            raise RuntimeError(shown)
        return self.ask("GET", f"jobs/{job}/result")

    def send(self, stream, columns, begin=0, step=1):
        import io
        import numpy
        import pyarrow
        import pyarrow.parquet

        second = step * numpy.arange(len(columns["level"])) + begin
        instants = pyarrow.array((int(BEGIN.timestamp()) + second) * 1_000_000_000, pyarrow.int64())
        instants = instants.cast(pyarrow.timestamp("ns", "UTC"))
        file = io.BytesIO()
        pyarrow.parquet.write_table(pyarrow.table({"time": instants, **columns}), file)
        self.ask("POST", f"streams/{stream}?keep_mib=8192", file.getvalue(), "application/vnd.apache.parquet")

    def first_job(self, stream):
        """The estimate from the first test."""
        part = {"from": stamp(DAY + 10 * HOUR - 600), "to": stamp(DAY + 12 * HOUR)}
        dataset = self.ask("POST", f"streams/{stream}/recordings", part)["id"]
        return self.estimation([dataset])

    def estimation(self, datasets):
        experiments = [{"dataset": dataset, "initial_state": START} for dataset in datasets]
        job = {"model": model(), "experiments": experiments, "validation": {"fraction": 0}, "seed": 1,
               "tolerances": {"*": 0}}
        return self.ask("POST", "jobs", job)["id"]

    def resident_mib(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            peak = next(line for line in status if line.startswith("VmHWM"))
        return int(peak.split()[1]) / 1024

    def end(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        self.process.wait()


def stamp(second):
    return (BEGIN + timedelta(seconds=second)).strftime("%Y-%m-%dT%H:%M:%SZ")


def year(options, folder):
    """One selection over a long history: whole, ended, killed, and on one thread."""
    import numpy

    database = os.path.join(folder, "year.db")
    program = Program(options, database)
    for first in range(0, options.days, 30):
        days = min(30, options.days - first)
        columns = history(max(days, 3), first)
        columns = {name: values[:days * DAY] for name, values in columns.items()}
        random = numpy.random.default_rng([3, first])
        for other in range(7):
            walk = numpy.cumsum(random.standard_normal(days * DAY)) * 0.02
            columns[f"other_{other}"] = numpy.round(walk + random.standard_normal(days * DAY), 2)
        program.send("plant", columns, first * DAY)
    job = program.first_job("plant")
    program.result(job)
    program.end()
    asked = {"job": job, "stream": "plant", "window_s": HOUR, "target": {"T2": "2 %", "K": "1 %"}}
    program = Program(options, database)
    began = time.monotonic()
    selection = program.result(program.ask("POST", "selections", asked)["id"])
    took, resident = time.monotonic() - began, program.resident_mib()
    ended = program.ask("POST", "selections", asked)["id"]
    time.sleep(took / 3)
    began = time.monotonic()
    program.ask("POST", f"jobs/{ended}/cancel")
    program.ended(ended)
    cancelled = time.monotonic() - began
    best = program.ask("GET", f"jobs/{ended}/result")
    killed = program.ask("POST", "selections", asked)["id"]
    time.sleep(took / 2)
    program.end(signal.SIGKILL)
    program = Program(options, database)
    same_after_kill = program.result(killed)["chosen"] == selection["chosen"]
    program.end()
    program = Program(options, database, threads=1)
    alone = program.result(program.ask("POST", "selections", asked)["id"])
    same_on_one = (alone["chosen"], alone["windows"]) == (selection["chosen"], selection["windows"])
    program.end()
    looked = selection["windows"]["count"]
    quiet = sum(count["windows"] for count in selection["left_out"])
    rows = [("what", "figure"), ("windows, of which say nothing", f"{looked}, {quiet}"),
            ("selection", f"{took:.1f} s"), ("peak", f"{resident:.0f} MiB"),
            ("ended after", f"{cancelled:.2f} s with the best of {best['windows']['count']} windows"),
            ("chosen", f"{len(selection['chosen'])}, {selection['samples']} samples"),
            ("the same after kill -9", same_after_kill), ("the same on one thread", same_on_one)]
    print(served.table(rows))
    return {"s": took, "cancel_s": cancelled, "windows": looked, "peak_mib": resident,
            "same": [same_after_kill, same_on_one]}


def plants(options, folder):
    """Estimates from chosen windows, and from as many others."""
    import numpy

    program = Program(options, os.path.join(folder, "plants.db"))
    errors = {"chosen": [], "random": [], "moving most": []}
    foretold, covered = [], []
    for plant in range(options.plants):
        columns = history(20, 1000 + plant)
        stream = f"plant_{plant}"
        program.send(stream, {name: values[::STEP] for name, values in columns.items()}, step=STEP)
        job = program.first_job(stream)
        program.result(job)
        asked = {"job": job, "stream": stream, "window_s": HOUR, "budget_samples": 8 * HOUR // STEP,
                 "wanted": ["T1"], "exclude": [{"from": stamp(DAY), "to": stamp(2 * DAY)}]}
        selection = program.result(program.ask("POST", "selections", asked)["id"])
        windows = [own["window"] for own in selection["chosen"]]
        span = [numpy.ptp(columns["valve"][hour * HOUR:(hour + 1) * HOUR]) for hour in range(20 * 24)]
        hours = [hour for hour in range(20 * 24) if hour // 24 != 1]
        random = numpy.random.default_rng([4, plant])
        choices = {
            "chosen": windows,
            "random": sorted(random.choice(hours, len(windows), replace=False).tolist()),
            "moving most": sorted(sorted(hours, key=lambda hour: -span[hour])[:len(windows)]),
        }
        for name, choice in choices.items():
            datasets = [program.ask("POST", f"streams/{stream}/recordings",
                                    {"from": stamp(hour * HOUR), "to": stamp((hour + 1) * HOUR)})["id"]
                        for hour in choice]
            found = program.result(program.estimation(datasets))["parameters"]
            found = next(own for own in found if own["name"] == "T1")
            errors[name].append(float(numpy.log(found["estimate"] / TRUTH["T1"])))
            if name == "chosen":
                known = next(own for own in selection["with_chosen"] if own["name"] == "T1")
                foretold.append(known["total_standard_error"] / TRUTH["T1"])
                interval = found["total_interval"]
                covered.append(interval is not None and interval["lower"] <= TRUTH["T1"] <= interval["upper"])
        print(f"plant {plant}: {[round(own[-1], 4) for own in errors.values()]}, foretold {foretold[-1]:.4f}",
              file=sys.stderr, flush=True)
    program.end()
    rms = {name: float(numpy.sqrt(numpy.mean(numpy.square(own)))) for name, own in errors.items()}
    middle = {name: float(numpy.median(numpy.abs(own))) for name, own in errors.items()}
    ratio = numpy.array(errors["chosen"]) / numpy.array(foretold)
    rows = [("windows", "rms error of T1", "median error", "samples for the same error")]
    for name in errors:
        rows.append((name, f"{100 * rms[name]:.2f} %", f"{100 * middle[name]:.2f} %",
                     f"{(middle[name] / middle['chosen'])**2:.1f} x"))
    print(served.table(rows))
    print(f"realised over foretold {numpy.sqrt(numpy.mean(ratio**2)):.2f}, mean {numpy.mean(ratio):.2f} of a standard "
          f"error, {sum(covered)} of {len(covered)} intervals cover")
    return {"rms": rms, "median": middle, "realised": float(numpy.sqrt(numpy.mean(ratio**2))),
            "bias": float(numpy.mean(ratio)), "covered": sum(covered)}


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--days", type=int, default=365)
    parser.add_argument("--plants", type=int, default=30)
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment(["numpy", "scipy", "pyarrow"], "greybox-selection")
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        if options.days:
            figures["year"] = year(options, folder)
        if options.plants:
            figures["plants"] = plants(options, folder)
    served.keep(options, figures)


if __name__ == "__main__":
    main()
