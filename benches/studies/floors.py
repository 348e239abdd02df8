"""How often the search finds the floor of the cost, with the settings that a job has by itself,
and whether the verdict says so where it does not. Over HTTP.

    python3 benches/studies/floors.py [published viral twins predator tanks thermal gaps] [--seeds 20]

- published: problems of the PEtab benchmark collection (`--problems`: their folder) in the ranges
  that belong to them. Solved where the negative logarithm of the likelihood comes within 1.92 of
  the best that is known.
- viral: one of our own that is as small: a virus that decays under therapy, two rates.
- twins: one compartment, where absorption and elimination can change places. The wrong one may
  be found, but not trusted without naming the other.
- predator: Lotka and Volterra's two species over several periods. At the floor where chi² is no
  larger than at the truth.
- tanks: two tanks in a row that overflow, slowly excited, of which the lower one is measured; no
  noise declared. At the floor where the squared error is no larger than at the truth, or else the
  verdict must say that it may not be.
- thermal: two temperatures of very different noise, none declared: how often the 95 % intervals
  hold the true values.
- gaps: the servo's recording with 5 % of its rows missing, or a clock that jitters by 1 % of a
  sample (the stamps alone, or the samples with them): how far the estimates lie from those of the
  whole recording, in its standard errors.

Plants are simulated here, independently (numba, SciPy). Starts a server of its own (`--program`),
or asks one that runs (`--server`). Packages come from PyPI into a folder of its own.
"""

import csv
import json
import math
import os
import sys

import served

PROBLEMS = os.path.join(served.HERE, "..", "..", "..", "shared", "reference", "benchmarks", "petab")
SAME = 3.84
# Reasons by which a verdict says that the floor may not have been found, or that the fit is poor.
DOUBTS = {"starts_disagree", "plateau", "twin_minima", "misfit", "slight_misfit",
          "residuals_not_white", "not_finished"}


def range_of(lower, upper):
    middle = math.sqrt(lower * upper)
    return {"default": middle, "lower": lower, "upper": upper, "scale": "log", "unknown": True}


def reasons(result):
    return [reason["code"] for reason in result["verdict"]["reasons"]]


def values(result):
    return {own["name"]: own["estimate"] for own in result["parameters"]}


def common(what, shown, result):
    """What is kept of every job."""
    line = {**what, "job": shown["id"], "seconds": served.seconds(shown),
            "status": shown["status"]}
    if result is None:
        return {**line, "error": shown["error"]}
    return {**line, "trust": result["verdict"]["trust"], "reasons": reasons(result),
            "floor": result.get("floor"), "stop": result["stop_reason"],
            "search": result["search"], "estimates": values(result)}


# Published problems


class Published:
    """A problem of the collection."""

    def __init__(self, folder):
        self.folder = folder
        with open(os.path.join(folder, "reference.json")) as file:
            self.reference = json.load(file)
        with open(os.path.join(folder, "model.json")) as file:
            document = json.load(file)
        # The clock stood in for an input once; where equations need the time it is a state.
        document.pop("inputs", None)
        document.pop("options", None)
        if "clock" in json.dumps({key: document[key] for key in document if key != "title"}):
            document["states"]["clock"] = {"derivative": "1", "initial": 0, "unit": ""}
        for name, own in document["parameters"].items():
            if own.get("unknown"):
                # The published optimum stands there: nobody would know it.
                lower, upper = self.reference["bounds"].get(name, (own["lower"], own["upper"]))[:2]
                own.update(range_of(lower, upper))
        self.document = document

    def job(self, server, seed):
        experiments = [self.experiment(server, own) for own in self.reference["experiments"]]
        outputs = {}
        for name in self.document["outputs"]:
            noise = self.reference["noise"][name][0]
            if noise and noise.replace(".", "").isdigit():
                outputs[name] = {"noise_std": float(noise)}
        return {"model": self.document, "experiments": experiments, "outputs": outputs,
                "validation": {"fraction": 0}, "seed": seed}

    def experiment(self, server, experiment):
        with open(os.path.join(self.folder, experiment["file"])) as file:
            head, *rows = list(csv.reader(file))
        rows = [row for row in rows if float(row[0]) == 0 or any(row[2:])]
        signals = {}
        for place, name in enumerate(head[2:], 2):
            column = [float(row[place]) if row[place] else math.nan for row in rows]
            if any(value == value for value in column):
                signals[name, ""] = column
        own = {}
        for name, value in experiment["condition"].items():
            if value in self.reference["bounds"]:
                lower, upper, _ = self.reference["bounds"][value]
                own[name] = {"estimate": {"lower": lower, "upper": upper, "scale": "log"}}
            else:
                own[name] = {"value": float(value)}
        dataset = server.store(experiment["file"], signals,
                               instants=[float(row[0]) for row in rows])
        return {"dataset": dataset, "parameters": own} if own else {"dataset": dataset}

    def objective(self, result):
        """The negative logarithm of the likelihood at the estimate."""
        total = self.reference.get("jacobian_of_log_transform") or 0.0
        for name, fit in result["fit"]["estimation"].items():
            n, square = fit["samples"], fit["rmse"] ** 2 * fit["samples"]
            noise = self.reference["noise"][name][0]
            if noise and noise.replace(".", "").isdigit():
                total += 0.5 * square / float(noise) ** 2
                total += 0.5 * n * math.log(2 * math.pi * float(noise) ** 2)
            else:
                total += 0.5 * n * (math.log(2 * math.pi * square / n) + 1)
        return total


def published(server, options):
    problems = {}
    if os.path.isdir(options.problems):
        for name in sorted(os.listdir(options.problems)):
            if os.path.exists(os.path.join(options.problems, name, "model.json")):
                if not options.only or any(word in name for word in options.only.split(",")):
                    problems[name] = Published(os.path.join(options.problems, name))

    def made():
        for seed in options.all_seeds:
            for name, problem in problems.items():
                yield {"problem": name, "seed": seed}, problem.job(server, seed)

    lines = []
    for what, shown, result in server.run_all(made()):
        problem = problems[what["problem"]]
        if result is None and "identif" in json.dumps(shown["error"]):
            # It was told before anything ran that the data do not fix all; now all the same.
            job = {**problem.job(server, what["seed"]),
                   "uncertainty": {"flat_directions": "report"}}
            what = {**what, "refused": shown["error"].get("detail")}
            (what, shown, result), = server.run_all([(what, job)])
        line = common(what, shown, result)
        if result is not None:
            line["above"] = problem.objective(result) - problem.reference["J_star"]
            line["solved"] = line["above"] < 1.92
            line["flat"] = result.get("flat_directions")
        lines.append(line)
        tell(line, "problem", "seed", "above", "trust", "reasons", "seconds", "refused")
    return lines


def viral(server, options):
    """A virus under therapy, two rates unknown (A. S. Perelson and others,
    Science 271, 1996): log10 of the load is measured."""
    import numpy
    from scipy.integrate import solve_ivp

    document = {
        "name": "viral_decay",
        "parameters": {"c": range_of(0.01, 100), "delta": range_of(0.001, 10)},
        "states": {
            # What was infectious when the therapy began infects on; what is budded after it is
            # not infectious, and measured too.
            "infected": {"derivative": "delta*(virus/10 - infected)", "initial": 1e4},
            "virus": {"derivative": "-c*virus", "initial": 1e5},
            "inert": {"derivative": "c*(10*infected - inert)", "initial": 0},
        },
        "outputs": {"load": {"expression": "log(max(virus + inert, 1e-12))/log(10)"}},
    }
    instants = numpy.array([0.0, 0.1, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 5, 6, 7])

    def load(c, delta):
        rate = lambda _, s: [
            delta * (s[1] / 10 - s[0]), -c * s[1], c * (10 * s[0] - s[2])
        ]
        run = solve_ivp(rate, (0, 7), [1e4, 1e5, 0], "LSODA", instants, rtol=1e-9, atol=1e-9)
        return numpy.log10(run.y[1] + run.y[2])

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            c, delta = 3.0 * math.exp(random.normal(0, 0.3)), 0.5 * math.exp(random.normal(0, 0.3))
            noise = 0.05 * random.standard_normal(len(instants))
            dataset = server.store(f"virus {seed}", {("load", ""): load(c, delta) + noise},
                                   instants=instants)
            what = {"seed": seed, "truth": {"c": c, "delta": delta},
                    "at_truth": float(numpy.sum((noise / 0.05) ** 2))}
            yield what, {"model": document, "experiments": [{"dataset": dataset}],
                         "outputs": {"load": {"noise_std": 0.05}},
                         "validation": {"fraction": 0}, "seed": seed}

    return against_truth(server, made(), {"load": 0.05})


def against_truth(server, jobs, noises):
    """Solved where chi² is no larger than at the truth; told where the verdict doubts it."""
    lines = []
    for what, shown, result in server.run_all(jobs):
        line = common(what, shown, result)
        if result is not None:
            fits = result["fit"]["estimation"]
            line["chi_square"] = sum(
                fits[name]["samples"] * (fits[name]["rmse"] / noise) ** 2
                for name, noise in noises.items()
            )
            line["solved"] = line["chi_square"] <= what["at_truth"] + SAME
            line["told"] = line["trust"] == "low" or bool(DOUBTS & set(line["reasons"]))
        lines.append(line)
        tell(line, "seed", "chi_square", "at_truth", "solved", "trust", "reasons", "floor",
             "seconds")
    return lines


def twins(server, options):
    import numpy

    document = {
        "name": "one_compartment",
        "parameters": {"ka": range_of(0.05, 5), "ke": range_of(0.05, 5),
                       "V": range_of(0.1, 50)},
        "states": {"gut": {"derivative": "-ka*gut", "initial": 100},
                   "blood": {"derivative": "ka*gut/V - ke*blood", "initial": 0}},
        "outputs": {"level": {"expression": "blood"}},
    }

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            ka, ke = 1.2 * math.exp(random.normal(0, 0.3)), 0.25 * math.exp(random.normal(0, 0.2))
            volume, t = 4.0 * math.exp(random.normal(0, 0.3)), 0.25 * numpy.arange(80)
            level = 100 * ka / (volume * (ka - ke)) * (numpy.exp(-ke * t) - numpy.exp(-ka * t))
            level = level + 0.1 * random.standard_normal(80)
            dataset = server.store(f"kinetics {seed}", {("level", ""): level}, 0.25)
            what = {"seed": seed, "truth": {"ka": ka, "ke": ke, "V": volume}}
            yield what, {"model": document, "experiments": [{"dataset": dataset}],
                         "outputs": {"level": {"noise_std": 0.1}}, "seed": seed}

    lines = []
    for what, shown, result in server.run_all(made()):
        line = common(what, shown, result)
        if result is not None:
            line["is_wrong"] = line["estimates"]["ka"] < line["estimates"]["ke"]
            line["names_twin"] = "twin_minima" in line["reasons"]
            line["is_false"] = line["trust"] == "high" and not line["names_twin"]
        lines.append(line)
        tell(line, "seed", "is_wrong", "names_twin", "trust", "reasons", "estimates", "seconds")
    return lines


def predator(server, options):
    import numpy
    from scipy.integrate import solve_ivp

    document = {
        "name": "lotka_volterra",
        "parameters": {"a": range_of(0.1, 10), "b": range_of(0.01, 1), "c": range_of(0.1, 10),
                       "d": range_of(0.01, 1)},
        "states": {"prey": {"derivative": "a*prey - b*prey*hunter", "initial": 10},
                   "hunter": {"derivative": "d*prey*hunter - c*hunter", "initial": 5}},
        "outputs": {"preys": {"expression": "prey"}, "hunters": {"expression": "hunter"}},
    }
    instants = 0.25 * numpy.arange(81)

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            a, b, c, d = numpy.array([1, 0.1, 1.5, 0.075]) * numpy.exp(random.normal(0, 0.2, 4))
            rate = lambda _, s: [a * s[0] - b * s[0] * s[1], d * s[0] * s[1] - c * s[1]]
            run = solve_ivp(rate, (0, 20), [10, 5], "LSODA", instants, rtol=1e-9, atol=1e-9)
            noise = random.standard_normal((2, 81))
            preys, hunters = run.y + noise
            dataset = server.store(f"species {seed}",
                                   {("preys", ""): preys, ("hunters", ""): hunters}, 0.25)
            what = {"seed": seed, "truth": {"a": a, "b": b, "c": c, "d": d},
                    "at_truth": float(numpy.sum(noise**2))}
            yield what, {"model": document, "experiments": [{"dataset": dataset}],
                         "outputs": {name: {"noise_std": 1} for name in ("preys", "hunters")},
                         "validation": {"fraction": 0}, "seed": seed}

    return against_truth(server, made(), {"preys": 1.0, "hunters": 1.0})


TANKS = {"k1": 0.055, "k2": 0.050, "k3": 0.045, "k4": 0.060, "k5": 0.40, "start": 3.0}


def tank_levels():
    import numba
    import numpy

    @numba.njit
    def levels(pump, lower, k1, k2, k3, k4, k5, start):
        upper, seen, h = start, numpy.empty(len(pump)), 0.02
        for k in range(len(pump)):
            seen[k] = lower
            for _ in range(200):
                spill = max(upper - 10.0, 0.0)
                out = math.sqrt(max(upper, 0.0))
                lost = max(lower - 10.0, 0.0)
                rise = k4 * pump[k] - k1 * out - spill
                lower += h * (k2 * out - k3 * math.sqrt(max(lower, 0.0)) + k5 * spill - lost)
                upper += h * rise
        return seen

    return levels


def tanks(server, options):
    """As the benchmark of M. Schoukens and J. P. Noël (IFAC 2017) is: levels in volts, 1024
    samples of 4 s, slow sums of sines, overflow, an unknown start."""
    import numpy

    levels = tank_levels()
    document = {
        "name": "two_tanks",
        "inputs": {"pump": {}},
        "parameters": {name: range_of(0.003, 1.0) for name in ("k1", "k2", "k3", "k4")},
        "quantities": {"out": "sqrt(max(upper, 0))", "spill": "max(upper - 10, 0)"},
        "states": {
            "upper": {"derivative": "k4*pump - k1*out - spill", "initial": "start"},
            "lower": {"derivative": "k2*out - k3*sqrt(max(lower, 0)) + k5*spill"
                                    " - max(lower - 10, 0)",
                      "initial": "first sample of output level"},
        },
        "outputs": {"level": {"expression": "lower"}},
    }
    document["parameters"]["k5"] = {"default": 0.5, "lower": 0, "upper": 1, "unknown": True}
    document["parameters"]["start"] = {"default": 5, "lower": 0, "upper": 10, "unknown": True}
    noise_std = 0.02

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            truth = {name: value * math.exp(random.normal(0, 0.1)) for name, value in TANKS.items()}
            truth["start"] = min(truth["start"], 9.0)
            t, pump = 4.0 * numpy.arange(1024), numpy.full(1024, 3.0)
            for n in range(1, 30):
                phase = random.uniform(0, 2 * math.pi)
                pump += 0.35 * numpy.cos(2 * math.pi * n * t / 4096 + phase)
            pump = numpy.clip(pump, 0, None)
            # The model starts the lower level at its first sample, noise and all: none there.
            noise = noise_std * random.standard_normal(1024)
            noise[0] = 0
            first = float(random.uniform(3, 6))
            level = levels(pump, first, **truth) + noise
            dataset = server.store(f"tanks {seed}", {("pump", ""): pump, ("level", ""): level}, 4.0)
            what = {"seed": seed, "truth": truth, "highest": float(level.max()),
                    "at_truth": float(numpy.sum((noise[:768] / noise_std) ** 2))}
            yield what, {"model": document, "experiments": [{"dataset": dataset}], "seed": seed}

    return against_truth(server, made(), {"level": noise_std})


def thermal(server, options):
    import numpy
    from scipy.signal import cont2discrete

    truth = {"C1": 120.0, "C2": 400.0, "G12": 3.0, "G2": 1.2}
    document = {
        "name": "two_bodies",
        "inputs": {"heat": {}},
        "parameters": {name: range_of(value / 5, value * 4) for name, value in truth.items()},
        "states": {"warm": {"derivative": "(heat - G12*(warm - cool))/C1", "initial": 0},
                   "cool": {"derivative": "(G12*(warm - cool) - G2*cool)/C2", "initial": 0}},
        "outputs": {"first": {"expression": "warm"}, "second": {"expression": "cool"}},
    }
    c1, c2, g12, g2 = truth.values()
    a = numpy.array([[-g12 / c1, g12 / c1], [g12 / c2, -(g12 + g2) / c2]])
    one, other, *_ = cont2discrete(
        (a, numpy.array([[1 / c1], [0]]), numpy.eye(2), numpy.zeros((2, 1))), 10.0
    )

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            heat = numpy.repeat(random.choice([0.0, 100.0], size=20), 20)
            state, seen = numpy.zeros(2), []
            for power in heat:
                seen.append(state)
                state = one @ state + other[:, 0] * power
            seen = numpy.array(seen) + random.standard_normal((400, 2)) * [2.0, 0.1]
            signals = {("heat", ""): heat, ("first", ""): seen[:, 0], ("second", ""): seen[:, 1]}
            dataset = server.store(f"bodies {seed}", signals, 10.0)
            yield {"seed": seed, "truth": truth}, {
                "model": document, "experiments": [{"dataset": dataset}], "seed": seed,
            }

    lines = []
    for what, shown, result in server.run_all(made()):
        line = common(what, shown, result)
        if result is not None:
            line["inside"] = {}
            line["z"] = {}
            for own in result["parameters"]:
                interval, true = own["confidence_interval"], truth[own["name"]]
                line["inside"][own["name"]] = interval["lower"] <= true <= interval["upper"]
                line["z"][own["name"]] = (own["estimate"] - true) / own["standard_error"]
        lines.append(line)
        tell(line, "seed", "z", "trust", "reasons", "seconds")
    return lines


def gaps(server, options):
    import numpy

    import false_high

    simulate = false_high.simulator()
    samples, noise_std = 2000, 1e-5
    rig = {**false_high.NOMINAL, "mass": 58.0, "damping": 370.0, "stiffness": 21412.0,
           "bulk_modulus": 1.6009e9}

    def made():
        for seed in options.all_seeds:
            random = numpy.random.default_rng(seed)
            reference = false_high.textbook(random, samples)
            noise = noise_std * random.standard_normal(samples)
            jitter = 0.01 * false_high.SAMPLE_TIME * random.standard_normal(samples)
            jitter[0] = 0
            lost = random.random(samples) < 0.05
            lost[0] = lost[-1] = False
            # Of a set point that is lost where it changes nobody knows when it did.
            changes = numpy.concatenate([[False], numpy.diff(reference) != 0])
            position = simulate(rig, reference)[:, 0] + noise
            late = simulate(rig, reference, jitter)[:, 0] + noise
            blank = numpy.where(lost, math.nan, position)
            time, every = false_high.SAMPLE_TIME * numpy.arange(samples), ~numpy.zeros_like(lost)
            forms = {
                "whole": (position, every, None),
                "rows missing": (position, ~lost, time),
                "rows missing, none where the set point changes":
                    (position, ~(lost & ~changes), time),
                "values missing": (blank, every, None),
                "stamps jitter": (position, every, time + jitter),
                "samples jitter": (late, every, time + jitter),
            }
            for form, (seen, kept, stamps) in forms.items():
                signals = {("reference", "m"): reference[kept], ("position", "m"): seen[kept]}
                if stamps is None:
                    dataset = server.store(f"{form} {seed}", signals, false_high.SAMPLE_TIME)
                else:
                    dataset = server.store(f"{form} {seed}", signals, instants=stamps[kept])
                yield {"seed": seed, "form": form}, {
                    "model": "single_rod_servo", "experiments": [{"dataset": dataset}],
                    "outputs": {"position": {"noise_std": noise_std}},
                    "method": {"generations": 20, "refine_candidates": 2},
                    "validation": {"fraction": 0}, "seed": seed,
                }

    lines, whole = [], {}
    for what, shown, result in server.run_all(made()):
        line = common(what, shown, result)
        if result is not None:
            found = {own["name"]: (own["estimate"], own["standard_error"])
                     for own in result["parameters"]}
            if what["form"] == "whole":
                whole[what["seed"]] = found
            clean = whole.get(what["seed"])
            if clean:
                line["off"] = {name: (found[name][0] - clean[name][0]) / clean[name][1]
                               for name in found}
                line["solved"] = max(map(abs, line["off"].values())) <= 1
            own = result["residuals"]["position"]
            line["chi_square"] = own.get("chi_square_per_sample")
        lines.append(line)
        tell(line, "seed", "form", "off", "chi_square", "trust", "reasons", "error", "seconds")
    return lines


PARTS = {"published": published, "viral": viral, "twins": twins, "predator": predator,
         "tanks": tanks, "thermal": thermal, "gaps": gaps}


def tell(line, *keys):
    def short(value):
        if isinstance(value, float):
            return f"{value:.4g}"
        if isinstance(value, dict):
            return "{" + ", ".join(f"{name} {short(own)}" for name, own in value.items()) + "}"
        return str(value)

    print("  " + ", ".join(f"{key} {short(line[key])}" for key in keys
                           if line.get(key) is not None), flush=True)


def groups(part, lines):
    key = {"published": "problem", "gaps": "form"}.get(part)
    names = dict.fromkeys(line[key] for line in lines) if key else [part]
    for name in names:
        yield name, [line for line in lines if not key or line[key] == name]


def in_words(parts):
    rows = [["what", "jobs", "at the floor", "not there, and told so", "not there, not told",
             "`high` and wrong", "median seconds"]]
    for part, lines in parts.items():
        for name, own in groups(part, lines):
            done = [line for line in own if line["status"] == "succeeded"]
            seconds = sorted(line["seconds"] for line in own)
            solved = [line for line in done if line.get("solved")]
            told = [line for line in done if not line.get("solved") and line.get("told")]
            silent = [line for line in done if not line.get("solved") and not line.get("told")]
            row = [name, len(own), len(solved), len(told), len(silent), "-",
                   f"{seconds[len(seconds) // 2]:.1f}" if seconds else "-"]
            if part == "published":
                row[3:5] = [sum(line["trust"] != "high" for line in done if not line["solved"]),
                            sum(line["trust"] == "high" for line in done if not line["solved"])]
            if part == "twins":
                row[2:6] = [sum(not line["is_wrong"] for line in done),
                            sum(line["is_wrong"] and not line["is_false"] for line in done),
                            sum(not line["names_twin"] for line in done),
                            sum(line["is_false"] and line["is_wrong"] for line in done)]
            if part == "thermal":
                inside = [hit for line in done for hit in line["inside"].values()]
                row[2:5] = [f"{sum(inside)} of {len(inside)} intervals hold", "-", "-"]
            if part == "gaps":
                off = [abs(own) for line in done for own in line.get("off", {}).values()]
                row[3:5] = [f"largest {max(off, default=math.nan):.2f} standard errors", "-"]
            rows.append(row)
    return served.table(rows)


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("parts", nargs="*", help=", ".join(PARTS))
    parser.add_argument("--problems", default=PROBLEMS, help="folder of the published problems")
    parser.add_argument("--only", help="those of them whose name holds one of these words")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    options = parser.parse_args()
    options.all_seeds = range(options.first, options.first + options.seeds)
    parts = {}
    for name in options.parts or PARTS:
        print(name, flush=True)
        with served.Server(options) as server:
            parts[name] = PARTS[name](server, options)
        served.keep(options, parts)
    print(in_words(parts))


if __name__ == "__main__":
    main() if os.environ.get("IN_OWN") else served.in_own_environment()
