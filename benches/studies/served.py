"""A server of this program for measurements over HTTP, and what goes to and fro.

Not a command: the other scripts of this folder use it. It needs nothing beyond Python itself, but for
`in_own_environment`, which starts a script again where its packages are installed.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
import venv

HERE = os.path.dirname(os.path.abspath(__file__))
PACKAGES = ["numpy", "scipy", "numba"]


def in_own_environment(packages=PACKAGES, name="greybox-measurements"):
    """Starts the script again in a folder of its own where the packages are installed."""
    folder = os.path.join(tempfile.gettempdir(), name)
    python = os.path.join(folder, "bin", "python")
    if not os.path.exists(python):
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *packages], check=True)
    sys.exit(subprocess.run([python, *sys.argv], env={**os.environ, "IN_OWN": "1"}).returncode)


def arguments(description):
    """The options that all measurements have."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--server", help="address of a running server, instead of an own one")
    parser.add_argument(
        "--program", default=os.path.join(HERE, "..", "..", "target", "release", "greybox"),
        help="the program of the server that is started",
    )
    parser.add_argument("--keep", help="folder in which each job is kept with its result, as JSON")
    parser.add_argument("--in-flight", type=int, default=2, help="jobs at once")
    parser.add_argument("--json", help="file for all figures")
    parser.add_argument("--minutes", type=float, help="begin no job later than this")
    return parser


class Server:
    """A server that is asked over HTTP; an own one ends with the `with` block."""

    def __init__(self, options):
        self.address, self.process = options.server, None
        self.options, self.began = options, time.monotonic()

    def __enter__(self):
        if not self.address:
            self.folder = tempfile.TemporaryDirectory()
            database = "sqlite://" + os.path.join(self.folder.name, "jobs.db")
            self.process = subprocess.Popen(
                [self.options.program, "serve", "--listen", "127.0.0.1:0",
                 "--database", database, "--log", "error"],
                stdout=subprocess.PIPE, text=True,
            )
            self.address = self.process.stdout.readline().split()[-1]
        self.address = self.address.rstrip("/")
        return self

    def __exit__(self, *_):
        if self.process:
            self.process.terminate()
            self.process.wait()
            self.folder.cleanup()

    @property
    def is_late(self):
        minutes = self.options.minutes
        return minutes is not None and time.monotonic() - self.began > 60 * minutes

    def ask(self, path, body=None, method=None, headers=None):
        """The answer as JSON; a refusal is an answer too."""
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(
            self.address + "/v1/" + path, data=data, method=method,
            headers={"content-type": "application/json", **(headers or {})},
        )
        try:
            with urllib.request.urlopen(request, timeout=120) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as refusal:
            with refusal:
                return {"refused": refusal.code, **json.load(refusal)}

    def store(self, name, signals, sample_time=None, instants=None):
        """The id of a recording: `signals` are values by (name, unit)."""
        body = {"name": name, "signals": {}}
        for (signal, unit), values in signals.items():
            values = [None if value != value else float(value) for value in values]
            body["signals"][signal] = {"unit": unit, "values": values}
        if instants is None:
            body["sample_time_s"] = sample_time
        else:
            body["time"] = {"unit": "s", "values": [float(instant) for instant in instants]}
        answer = self.ask("datasets", body)
        if "id" not in answer:
            raise RuntimeError(f"the recording was refused: {answer}")
        return answer["id"]

    def submit(self, job):
        answer = self.ask("jobs", job)
        if "id" not in answer:
            raise RuntimeError(f"the job was refused: {json.dumps(answer)}")
        return answer["id"]

    def wait(self, job):
        while True:
            shown = self.ask(f"jobs/{job}?wait=30")
            if shown["status"] in ("succeeded", "failed", "cancelled"):
                return shown

    def run_all(self, made):
        """Runs what `made` yields, (what it is, job), some at once; yields what it is, the job as
        shown and its result, in the order in which they were made."""
        flying = []
        made = iter(made)
        while True:
            while len(flying) < self.options.in_flight and not self.is_late:
                try:
                    what, job = next(made)
                except StopIteration:
                    break
                flying.append((what, self.submit(job)))
            if not flying:
                return
            what, job = flying.pop(0)
            shown = self.wait(job)
            result = self.ask(f"jobs/{job}/result") if shown["status"] == "succeeded" else None
            if self.options.keep:
                os.makedirs(self.options.keep, exist_ok=True)
                with open(os.path.join(self.options.keep, f"{job}.json"), "w") as file:
                    json.dump({"what": what, "job": shown, "result": result}, file, indent=1)
            yield what, shown, result


def seconds(shown):
    """How long a job took."""
    from datetime import datetime

    read = lambda text: datetime.fromisoformat(text.replace("Z", "+00:00"))
    return (read(shown["finished_at"]) - read(shown["started_at"])).total_seconds()


def keep(options, figures):
    """Writes all figures to the file that was asked for, if one was."""
    if options.json:
        with open(options.json, "w") as file:
            json.dump(figures, file, indent=1)


def table(rows):
    """Rows of text as a Markdown table, the first one its head."""
    rows = [[str(cell) for cell in row] for row in rows]
    lines = ["| " + " | ".join(row) + " |" for row in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join(lines)
