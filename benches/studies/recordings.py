"""Grades of real recordings, with and without process noise: whole recordings and windows of them.

    python3 benches/studies/recordings.py --data FOLDER [--only emps,hoop] [--noise auto] [--json FILE]

Each recording is identified whole and in windows, each window alone, with the documents of
`crates/greybox/tests/documents/models`, by `greybox estimate`. The table gives, for each parameter,
the estimate of the whole recording with its total error, its trust, the spread of the windows'
estimates (largest distance of two windows, in % of their mean, and in standard errors of the
difference), the trust in the windows, and a published value where one exists. Below each table
stand the reasons of the verdict. A parameter *reproduces* where any two windows differ by less
than 10 %, or by less than half where the windows' total errors say so (three of them).

The recordings belong to others and are not part of the repository; FOLDER holds them under the
names below.
"""

import argparse
import itertools
import json
import math
import pathlib
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCUMENTS = ROOT / "crates/greybox/tests/documents/models"
WHITE_FORCE = [
    {"acts_on": {"state": "velocity"}, "kind": "white", "strength": {"estimate": {}}}
]
PUBLISHED_AXIS = {
    "mass": 95.1089, "viscous_friction": 203.5034, "coulomb_friction": 20.3935, "offset": -3.1648,
}


def halves(start, middle, end):
    return [(start, middle), (middle, end)]


PLANTS = {
    "emps": {
        "file": "emps.csv", "document": "positioning_drive",
        "signals": {"force": "force", "y": "position"},
        "windows": [(6.2 * k, 6.2 * (k + 1)) for k in range(4)],
        "published": PUBLISHED_AXIS,
        "noise": ["none", "auto", WHITE_FORCE],
    },
    "emps_closed_loop": {
        "file": "emps.csv", "document": "closed_loop_drive",
        "signals": {"reference": "reference", "position": "position", "acting_voltage": "voltage"},
        # A window begins in motion.
        "initial_state": {"velocity": {"estimate": {"lower": -0.5, "upper": 0.5}}},
        "windows": [(6.2 * k, 6.2 * (k + 1)) for k in range(4)],
        "published": PUBLISHED_AXIS,
    },
    "crane": {
        "file": "lut_patu_crane.csv", "document": "crane",
        "signals": {
            "valve_voltage": "valve_signal", "rod_pressure": "rod_side_pressure",
            "cylinder_length": "cylinder_length", "piston_pressure": "piston_side_pressure",
        },
        "more": {"method": {"population": 40, "generations": 120, "restarts": 12}},
        "windows": halves(0, 8, 16),
    },
    "tclab_1s": {
        "file": "tclab_1s.csv", "document": "temperature_lab", "signals": {},
        "windows": halves(0, 300, 600),
    },
    "tclab_3s": {
        "file": "tclab_3s.csv", "document": "temperature_lab", "signals": {},
        "windows": halves(0, 300, 600),
    },
    "hoop_random": {
        "file": "ball_and_hoop_random.csv", "document": "hoop",
        "signals": {"motor_command": "motor_command", "measured_speed": "speed"},
        "windows": [(203 * k, 203 * (k + 1)) for k in range(4)],
    },
    "hoop_fixed": {
        "file": "ball_and_hoop_fixed.csv", "document": "hoop",
        "signals": {"motor_command": "motor_command", "measured_speed": "speed"},
        "windows": halves(0, 107, 215),
    },
    "arm": {
        "file": "quarter_drone_irregular.csv", "document": "arm", "signals": {},
        "whole": (5, 125),
        "windows": [(5 + 30 * k, 35 + 30 * k) for k in range(4)],
    },
}


def identify(program, data, plant, window, noise):
    """The result of one job, and how long it took."""
    document = json.loads((DOCUMENTS / f"{plant['document']}.json").read_text())
    experiment = {"signals": plant["signals"]} if plant["signals"] else {}
    if "initial_state" in plant:
        experiment["initial_state"] = plant["initial_state"]
    if window:
        experiment["window"] = {"from_s": window[0], "to_s": window[1]}
    job = {
        "model": document, "experiments": [experiment], "process_noise": noise,
        "method": {"population": 40, "generations": 120}, "validation": {"fraction": 0}, "seed": 5,
        **plant.get("more", {}),
    }
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "job.json").write_text(json.dumps(job))
        begin = time.monotonic()
        command = [program, "estimate", data / plant["file"], folder / "job.json"]
        ran = subprocess.run(
            [*map(str, command), "--json"], capture_output=True, text=True, check=False
        )
        if ran.returncode:
            raise SystemExit(ran.stderr)
        return json.loads(ran.stdout), time.monotonic() - begin


def total(parameter):
    """The total standard error, and nothing where none is known."""
    error = parameter.get("total_standard_error") or parameter.get("standard_error")
    return math.nan if error is None else error


def spread(windows, name):
    """Largest distance of two windows: in % of their mean, and in errors of the difference."""
    shares, errors = [0.0], [0.0]
    parts = [next(p for p in w["parameters"] if p["name"] == name) for w in windows]
    for first, second in itertools.combinations(parts, 2):
        distance = abs(first["estimate"] - second["estimate"])
        mean = abs(first["estimate"] + second["estimate"]) / 2
        shares.append(100 * distance / mean if mean else math.inf)
        error = math.hypot(total(first), total(second))
        errors.append(distance / error if error else math.inf)
    return max(shares), max(errors)


def table(name, plant, noise, whole, windows, seconds):
    described = noise if isinstance(noise, str) else "listed"
    chosen = (whole.get("process_noise") or {}).get("chosen")
    print(f"\n### {name}, process noise {described} ({chosen}), {seconds:.0f} s\n")
    print("| parameter | whole | ± total | trust | windows % | windows/error | windows' trust | published |")
    print("|---|---|---|---|---|---|---|---|")
    counts = {"reproduces": 0, "usable": 0, "false": 0, "all": 0}
    for parameter in whole["parameters"]:
        if "estimate" not in parameter or "trust" not in parameter:
            continue
        share, errors = spread(windows, parameter["name"])
        trusts = [
            next(p for p in w["parameters"] if p["name"] == parameter["name"])["trust"]
            for w in windows
        ]
        reproduces = share < 10 or (share < 50 and errors < 3)
        usable = parameter["trust"] != "low"
        counts["all"] += 1
        counts["reproduces"] += reproduces
        counts["usable"] += reproduces and usable
        counts["false"] += usable and not reproduces
        published = plant.get("published", {}).get(parameter["name"], "")
        print(
            f"| {parameter['name']} | {parameter['estimate']:.5g} | {total(parameter):.2g}"
            f" | {parameter['trust']} | {share:.1f} | {errors:.1f}"
            f" | {' '.join(t[0] for t in trusts)} | {published} |"
        )
    print()
    for reason in whole["verdict"]["reasons"]:
        print(f"- `{reason['code']}` {reason.get('parameters', '')} {reason['detail']}")
    print(f"\n{counts}")
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--program", default=ROOT / "target/release/greybox")
    parser.add_argument("--only", default="")
    parser.add_argument("--noise", default="", help="process noise of all jobs: none or auto")
    parser.add_argument("--json", type=pathlib.Path)
    given = parser.parse_args()
    kept = []
    for name, plant in PLANTS.items():
        if given.only and name not in given.only.split(","):
            continue
        for noise in [given.noise] if given.noise else plant.get("noise", ["none", "auto"]):
            whole, seconds = identify(
                given.program, given.data, plant, plant.get("whole"), noise
            )
            windows = [
                identify(given.program, given.data, plant, window, noise)[0]
                for window in plant["windows"]
            ]
            counts = table(name, plant, noise, whole, windows, seconds)
            kept.append({"plant": name, "noise": noise, "whole": whole, "windows": windows,
                         "seconds": seconds, "counts": counts})
            if given.json:
                given.json.write_text(json.dumps(kept))


if __name__ == "__main__":
    main()
