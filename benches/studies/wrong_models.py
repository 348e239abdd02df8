"""How often a verdict trusts a parameter that is wrong, where a document leaves an effect out and its
author gives no tolerances.

    python3 benches/studies/wrong_models.py [--program greybox] [--sizes 1,2] [--json file]

Each document below has effects that are off by default: a leak, an exponent, quadratic drag, dry
friction, hysteresis, a lag of the sensor. `greybox simulate` makes a recording with one effect on, noise
is added, and `greybox estimate` looks for the document's unknowns with the effect left off. Each job is
asked three times: with the noise declared as it is, with no noise declared, and with five times the
noise declared. With `--disturbed` a load that nobody recorded wanders beside the input while the plant
runs: an Ornstein-Uhlenbeck process with a standard deviation of 5 % of the input's span and a memory of a
quarter of a dwell. Then each estimate is held against the truth: it is false where it is more than four of
its total standard errors and more than 2 % off. It needs nothing beyond Python and the program.
"""

import argparse
import collections
import csv
import json
import math
import os
import random
import subprocess
import tempfile

HERE = os.path.dirname(os.path.abspath(__file__))
PROGRAM = os.path.join(HERE, "..", "..", "target", "release", "greybox")
FALSE_ERRORS, FALSE_SHARE = 4.0, 0.02
LOAD_SHARE, LOAD_MEMORY = 0.05, 0.25
SEARCH = {"generations": 25, "population": 32, "further_searches": 2}


def unknown(symbol, unit, value):
    """A parameter that jobs look for between a fifth and five times its true value."""
    return {"symbol": symbol, "unit": unit, "default": value, "lower": value / 5, "upper": value * 5,
            "scale": "log", "unknown": True}


def effect(symbol, unit, value=0.0):
    """A parameter that jobs take as known exactly."""
    return {"symbol": symbol, "unit": unit, "default": value, "lower": value - 1, "upper": value + 1}


def state(symbol, unit, derivative, initial=0.0, scale=1.0):
    return {"symbol": symbol, "unit": unit, "derivative": derivative, "initial": initial,
            "scale": scale}


TANK = {
    "name": "tank",
    "inputs": {"pump": {"symbol": "u", "unit": "V"}},
    "parameters": {
        "gain": unknown("k", "m/(s*V)", 0.002), "outlet": unknown("a", "1/s", 0.012),
        "leak": effect("l", "1/s"), "loss": effect("g", "1"),
        "exponent": effect("n", "1", 0.5),
    },
    "constants": {"meter": {"value": 1.0, "unit": "m"}, "tiny": {"value": 1e-6, "unit": "m"}},
    "states": {"level": state(
        "h", "m", "k*(1 - g)*u - a*meter*(max(h, tiny)/meter)^n - l*h", 0.2)},
    "outputs": {"level": {"unit": "m", "expression": "h"}},
}
SPRING = {
    "name": "spring",
    "inputs": {"force": {"symbol": "f", "unit": "N"}},
    "parameters": {
        "mass": unknown("m", "kg", 2.0), "damping": unknown("d", "N*s/m", 4.0),
        "stiffness": unknown("c", "N/m", 200.0),
        "drag": effect("q", "N*s^2/m^2"), "friction": effect("Fc", "N"),
        "friction_velocity": effect("vs", "m/s", 0.01),
    },
    "states": {
        "position": state("x", "m", "v", scale=0.05),
        "velocity": state(
            "v", "m/s", "(f - d*v - c*x - q*v*abs(v) - Fc*tanh(v/vs))/m", scale=0.3),
    },
    "outputs": {"position": {"unit": "m", "expression": "x"}},
}
DRIVE = {
    "name": "drive",
    "inputs": {"torque": {"symbol": "u", "unit": "N*m"}},
    "parameters": {
        "inertia": unknown("J", "kg*m^2", 0.02), "friction": unknown("b", "N*m*s", 0.01),
        "dry": effect("Tc", "N*m"), "fan": effect("q", "N*m*s^2"), "lag": effect("tau", "s"),
    },
    "constants": {"turn": {"value": 0.05, "unit": "1/s"}, "soon": {"value": 0.001, "unit": "s"}},
    "states": {
        "speed": state("w", "1/s", "(u - b*w - Tc*tanh(w/turn) - q*w*abs(w))/J", scale=10.0),
        "seen": state("y", "1/s", "(w - y)/(soon + tau)", scale=10.0),
    },
    "outputs": {"speed": {"unit": "1/s", "expression": "y"}},
}
BATTERY = {
    "name": "battery",
    "inputs": {"current": {"symbol": "i", "unit": "A"}},
    "parameters": {
        "resistance": unknown("R", "V/A", 0.02), "polarisation": unknown("Rp", "V/A", 0.015),
        "time_constant": unknown("T", "s", 40.0), "slope": unknown("s", "V/(A*s)", 4e-5),
        "hysteresis": effect("H", "V"),
    },
    "constants": {
        "half": {"value": 400.0, "unit": "A*s"}, "small": {"value": 0.01, "unit": "A"},
        "rest": {"value": 3.6, "unit": "V"},
    },
    "states": {
        "charge": state("z", "A*s", "-i", scale=1000.0),
        "overpotential": state("v", "V", "(Rp*i - v)/T", scale=0.1),
        "memory": state("y", "1", "abs(i)/half*(-tanh(i/small) - y)"),
    },
    "outputs": {"voltage": {"unit": "V", "expression": "rest + s*z - R*i - v + H*y"}},
}
HEATER = {
    "name": "heater",
    "inputs": {"power": {"symbol": "u", "unit": "W"}},
    "parameters": {
        "capacity": unknown("C", "J/K", 50.0), "loss": unknown("G", "W/K", 0.5),
        "radiation": effect("q", "W/K^2"), "lag": effect("tau", "s"),
        "growth": effect("r", "1/s"),
    },
    "constants": {"soon": {"value": 0.5, "unit": "s"}},
    "states": {
        "temperature": state("x", "K", "(u - G*x*(1 + r*t) - q*x*abs(x))/C", scale=20.0),
        "seen": state("y", "K", "(x - y)/(soon + tau)", scale=20.0),
        "clock": state("t", "s", "1", scale=1000.0),
    },
    "outputs": {"temperature": {"unit": "K", "expression": "y"}},
}
HEATER["states"]["clock"]["derivative"] = "one"
HEATER["constants"]["one"] = {"value": 1.0, "unit": "1"}


class Plant:
    """A document, its excitation and its noise."""

    def __init__(self, document, levels, dwell, sample_time, samples, noise):
        self.document, self.levels, self.dwell = document, levels, dwell
        self.sample_time, self.samples, self.noise = sample_time, samples, noise


PLANTS = {
    "tank": Plant(TANK, (0.5, 4.5), 40, 2.0, 1200, 5e-4),
    "spring": Plant(SPRING, (-20.0, 20.0), 15, 0.01, 2000, 2e-4),
    "drive": Plant(DRIVE, (-0.3, 0.3), 40, 0.02, 2000, 0.05),
    "battery": Plant(BATTERY, (-5.0, 5.0), 30, 1.0, 3000, 5e-4),
    "heater": Plant(HEATER, (0.0, 20.0), 60, 2.0, 1500, 0.05),
}
# What is left out, at its first size; the truths that an effect moves are those of the document.
WRONG = {
    "nothing": [(plant, {}) for plant in PLANTS],
    "a loss of the pump's gain": [("tank", {"loss": 0.03})],
    "a leak": [("tank", {"leak": 4e-4})],
    "an exponent": [("tank", {"exponent": 0.505})],
    "quadratic drag": [("spring", {"drag": 0.4}), ("drive", {"fan": 1e-5})],
    "dry friction": [("spring", {"friction": 0.2}), ("drive", {"dry": 0.004})],
    "hysteresis": [("battery", {"hysteresis": 0.004})],
    "a lag of the sensor": [("drive", {"lag": 0.03}), ("heater", {"lag": 2.0})],
    "radiation": [("heater", {"radiation": 5e-4})],
    "a drift of the loss": [("heater", {"growth": 3e-5})],
}
NOISE = {"declared": 1.0, "undeclared": None, "overstated": 5.0}


def grown(plant, name, value, size):
    """An effect at so many times its first size, from what it is by default."""
    default = PLANTS[plant].document["parameters"][name]["default"]
    return default + size * (value - default)


def run(program, *arguments):
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def load(plant, seed):
    """What acts beside the input at each sample."""
    draw = random.Random(f"load {seed}")
    deviation = LOAD_SHARE * (plant.levels[1] - plant.levels[0])
    kept = math.exp(-1 / (LOAD_MEMORY * plant.dwell))
    value = draw.gauss(0.0, deviation)
    for _ in range(plant.samples):
        yield value
        value = kept * value + deviation * math.sqrt(1 - kept * kept) * draw.gauss(0.0, 1.0)


def recorded(program, folder, plant, effects, seed, disturbed):
    """The file of a recording with the effects and noise."""
    draw = random.Random(seed)
    acting = load(plant, seed) if disturbed else [0.0] * plant.samples
    (input_name, described), = plant.document["inputs"].items()
    (output_name, _), = plant.document["outputs"].items()
    values, level = [], 0.0
    for sample in range(plant.samples):
        if sample % plant.dwell == 0:
            level = draw.uniform(*plant.levels)
        values.append(level)
    model = os.path.join(folder, "model.json")
    with open(model, "w") as file:
        json.dump(plant.document, file)
    excitation = os.path.join(folder, "input.csv")
    with open(excitation, "w") as file:
        file.write(f"time,{input_name} [{described['unit']}]\n")
        file.writelines(f"{k * plant.sample_time!r},{u + beside!r}\n"
                        for k, (u, beside) in enumerate(zip(values, acting)))
    truth = os.path.join(folder, "truth.json")
    with open(truth, "w") as file:
        json.dump(effects, file)
    rows = list(csv.reader(run(program, "simulate", excitation, truth, "--model", model).splitlines()))
    header = [name.split("[")[0].split("(")[0].strip() for name in rows[0]]
    place = len(header) - 1 - header[::-1].index(output_name)
    unit = plant.document["outputs"][output_name]["unit"]
    recording = os.path.join(folder, "recording.csv")
    with open(recording, "w") as file:
        file.write(f"time,{input_name} [{described['unit']}],{output_name} [{unit}]\n")
        for (k, u), row in zip(enumerate(values), rows[1:]):
            measured = float(row[place]) + draw.gauss(0.0, plant.noise)
            file.write(f"{k * plant.sample_time!r},{u!r},{measured!r}\n")
    return recording, output_name


def estimated(options, folder, plant, recording, output, times):
    """The result of the job, with the noise declared as so many times what it is."""
    job = {"process_noise": options.process_noise, "model": plant.document, "experiments": [{}], "method": SEARCH, "seed": 1,
           "validation": {"fraction": 0}}
    if times is not None:
        job["outputs"] = {output: {"noise_std": times * plant.noise}}
    path = os.path.join(folder, "job.json")
    with open(path, "w") as file:
        json.dump(job, file)
    return json.loads(run(options.program, "estimate", recording, path, "--json"))


def main():
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", default=PROGRAM)
    parser.add_argument("--sizes", default="1,3", help="sizes of the effects")
    parser.add_argument("--only", help="one plant")
    parser.add_argument("--process-noise", default="auto", help="none or auto")
    parser.add_argument("--seed", type=int, default=7, help="of the excitation and of the noise")
    parser.add_argument("--disturbed", action="store_true", help="a load that nobody recorded acts")
    parser.add_argument("--json", help="file for all figures")
    options = parser.parse_args()
    sizes = [float(size) for size in options.sizes.split(",")]
    counts, kept = collections.defaultdict(collections.Counter), []
    for wrong, cases in WRONG.items():
        for name, effects in cases:
            if options.only not in (None, name):
                continue
            plant = PLANTS[name]
            for size in sizes[:1] if wrong == "nothing" else sizes:
                with tempfile.TemporaryDirectory() as folder:
                    on = {key: grown(name, key, value, size) for key, value in effects.items()}
                    recording, output = recorded(
                        options.program, folder, plant, on, options.seed, options.disturbed)
                    for noise, times in NOISE.items():
                        result = estimated(options, folder, plant, recording, output, times)
                        kept.append(judged(plant, wrong, name, size, noise, result, counts))
    for (kind, noise), grades in sorted(counts.items()):
        print(f"{kind}, noise {noise}: " + ", ".join(
            f"{grades[grade, False]} {grade}"
            + (f" and {grades[grade, True]} false {grade}" if grades[grade, True] else "")
            for grade in ("high", "moderate", "low")))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(kept, file, indent=1)


def judged(plant, wrong, name, size, noise, result, counts):
    """Holds each estimate against the truth, and prints a line for the job."""
    words = []
    for parameter in result["parameters"]:
        true = plant.document["parameters"].get(parameter["name"], {}).get("default")
        if true is None:
            continue
        error = parameter["estimate"] - true
        total = parameter["total_standard_error"] or math.inf
        is_false = abs(error) > max(FALSE_ERRORS * total, FALSE_SHARE * abs(true))
        kind = "right models" if wrong == "nothing" else "wrong models"
        counts[kind, noise][parameter["trust"], is_false] += 1
        mark = " FALSE" if is_false else ""
        words.append(f"{parameter['name']} {100 * error / true:+.1f} % of "
                     f"{100 * total / true:.2f} {parameter['trust']}{mark}")
    codes = [reason["code"] for reason in result["verdict"]["reasons"]]
    print(f"{name}, {wrong} × {size:g}, {noise}: {'; '.join(words)}; {' '.join(codes)}", flush=True)
    return {"plant": name, "wrong": wrong, "size": size, "noise": noise, "result": result}


if __name__ == "__main__":
    main()
