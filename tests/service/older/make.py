#!/usr/bin/env python3
"""Makes the database of an older version that `tests/service/older.rs` opens.

    make.py PROGRAM FOLDER

has PROGRAM, a build of that version, estimate and watch; copies its database while a job is at work; and
packs the copy with what the program answered into FOLDER/older.zip: `greybox.db` and `answers.json`, with
the results, what the job at work came to in the end, and the samples of the monitor's next window.
"""

import json
import math
import pathlib
import random
import subprocess
import sys
import time
import urllib.error
import urllib.request
import zipfile

SAMPLE_TIME, MASS, FRICTION = 0.01, 100.0, 200.0
WINDOW, NOISE = 400, 0.02


def drive(samples, noise):
    """A drive of 100 kg with 200 N·s/m of friction, integrated exactly between its samples."""
    draws = random.Random(1)
    decay = math.exp(-FRICTION / MASS * SAMPLE_TIME)
    position = velocity = 0.0
    rows = ["time [s],force [N],position [m]"]
    for k in range(samples):
        force = 50.0 if (k // 50) % 2 == 0 else -50.0
        rows.append(f"{k * SAMPLE_TIME:.2f},{force},{position + draws.gauss(0, noise)}")
        terminal = force / FRICTION
        position += terminal * SAMPLE_TIME + (velocity - terminal) * (1 - decay) * MASS / FRICTION
        velocity = terminal + (velocity - terminal) * decay
    return "\n".join(rows) + "\n"


def lag(window):
    """A lag of 1 s with a gain of 2, a window of 40 s at a time."""
    draws, x, rows = random.Random(window), 0.0, ["time,u [V],y [V]"]
    for k in range(WINDOW):
        u = 1.0 if (k // 40) % 2 == 0 else 0.0
        second = window * WINDOW / 10 + k / 10
        stamp = f"2026-01-05T{int(second // 3600):02}:{int(second // 60 % 60):02}:{second % 60:06.3f}Z"
        rows.append(f"{stamp},{u},{x + draws.gauss(0, NOISE)}")
        x = 2 * u + (x - 2 * u) * math.exp(-0.1)
    return "\n".join(rows) + "\n"


def job(dataset, generations, seed):
    return {
        "model": "positioning_drive",
        "experiments": [{"dataset": dataset, "initial_state": {"position": 0, "velocity": 0}}],
        "parameters": {
            "mass": {"estimate": {"lower": 10, "upper": 1000}},
            "viscous_friction": {"estimate": {"lower": 1, "upper": 2000}},
            "coulomb_friction": {"value": 0},
            "offset": {"value": 0},
        },
        "outputs": {"position": {"noise_std": 1e-5}},
        "method": {"population": 10, "generations": generations, "stagnation_generations": 0},
        "seed": seed,
    }


def monitor():
    unknown = {"lower": 0.1, "upper": 10, "default": 1, "unknown": True}
    return {
        "name": "a lag",
        "stream": "lag",
        "window": {"length_s": WINDOW / 10},
        "job": {
            "model": {
                "name": "lag",
                "inputs": {"u": {"unit": "V"}},
                "parameters": {
                    "time": {"symbol": "T", "unit": "s", "scale": "log", **unknown},
                    "gain": {"symbol": "K", "unit": "", **unknown},
                },
                "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
                "outputs": {"y": {"unit": "V", "expression": "x"}},
            },
            "experiments": [{"initial_state": {"x": {"estimate": {"lower": -5, "upper": 5}}}}],
            "outputs": {"y": {"noise_std": NOISE}},
            "method": {"population": 12, "generations": 12},
        },
    }


class Client:
    def __init__(self, url):
        self.url = url

    def ask(self, method, path, body=None, kind="application/json"):
        if body is not None and not isinstance(body, str):
            body = json.dumps(body)
        request = urllib.request.Request(self.url + path, body and body.encode(), {"Content-Type": kind}, method=method)
        try:
            with urllib.request.urlopen(request) as answer:
                return json.loads(answer.read())
        except urllib.error.HTTPError as refused:
            sys.exit(f"{method} {path}: {refused.read().decode()}")

    def until(self, path, holds):
        while not holds(answer := self.ask("GET", path)):
            time.sleep(0.01)
        return answer

    def ended(self, name):
        return self.until(f"/v1/jobs/{name}", lambda row: row["status"] in ("succeeded", "failed", "cancelled"))


def main():
    program, folder = sys.argv[1], pathlib.Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    home = f"sqlite://{folder}/at_work.db"
    server = subprocess.Popen(
        [program, "serve", "--listen", "127.0.0.1:0", "--log", "warn", "--database", home, "--threads", "1"],
        stdout=subprocess.PIPE, text=True,
    )
    client = Client(server.stdout.readline().split()[-1])
    dataset = client.ask("POST", "/v1/datasets", drive(400, 1e-5), "text/csv")["id"]
    finished = [client.ask("POST", "/v1/jobs", job(dataset, 5, seed))["id"] for seed in (1, 2)]
    for name in finished:
        client.ended(name)
    client.ask("POST", "/v1/streams/lag", lag(0), "text/csv")
    watch = client.ask("POST", "/v1/monitors", monitor())["id"]
    for window in range(1, 3):
        client.ask("POST", "/v1/streams/lag", lag(window), "text/csv")
    client.until(f"/v1/monitors/{watch}", lambda row: len(row["windows"]) >= 2)
    at_work = client.ask("POST", "/v1/jobs", job(dataset, 4000, 3))["id"]
    client.until(f"/v1/jobs/{at_work}", lambda row: row["progress"] and row["progress"].get("generation", 0) > 100)
    copy = folder / "greybox.db"
    copy.unlink(missing_ok=True)
    subprocess.run([program, "backup", str(copy), "--database", home], check=True)
    row = client.ended(at_work)
    answers = {
        "finished": {name: client.ask("GET", f"/v1/jobs/{name}/result") for name in finished},
        "monitor": client.ask("GET", f"/v1/monitors/{watch}"),
        "next_window": lag(3),
        "at_work": {at_work: client.ask("GET", f"/v1/jobs/{at_work}/result")},
    }
    with zipfile.ZipFile(folder / "older.zip", "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
        packed.write(copy, "greybox.db")
        packed.writestr("answers.json", json.dumps(answers, indent=1))
    print(row["status"], row["progress"])
    server.terminate()


main()
