"""The time of one candidate of published problems: this program beside COPASI, SciPy's LSODA
around a right-hand side that numba compiled, and diffsol (BDF, its equations compiled by LLVM).

    python3 benches/studies/published.py [folder of the problems]

All run one after the other on one thread of the same machine. Each figure is the shortest of
several runs; each program's own tolerance is chosen so that its error at the samples, against
LSODA at 1e-12, is the nearest that it has below the one asked for. Fetches the others from PyPI
into a folder of its own.
"""

import csv
import json
import os
import re
import subprocess
import sys
import time

import served

HERE = os.path.dirname(os.path.abspath(__file__))
FOLDER = os.path.join(HERE, "..", "..", "..", "shared", "reference", "benchmarks")
PROBLEMS = [
    "crauste",
    "petab/Bertozzi_PNAS2020",
    "petab/Boehm_JProteomeRes2014",
    "petab/Elowitz_Nature2000",
    "petab/Rahman_MBS2016",
]
PACKAGES = ["numpy", "scipy", "numba", "copasi-basico", "pydiffsol"]
RUNS = 30
ASKED = 3e-5


def names_in(text):
    return set(re.findall(r"[A-Za-z_]\w*", text))


class Problem:
    """A document's equations as text, in an order of computation."""

    def __init__(self, folder):
        with open(os.path.join(folder, "model.json")) as file:
            self.document = json.load(file)
        with open(os.path.join(folder, "reference.json")) as file:
            self.reference = json.load(file)
        self.parameters = {n: p["default"] for n, p in self.document["parameters"].items()}
        self.states = list(self.document["states"])
        text = lambda said: said if isinstance(said, str) else said["expression"]
        self.quantities = self.ordered(
            {n: text(q) for n, q in self.document.get("quantities", {}).items()}
        )
        self.constants = {
            n: c["value"] if isinstance(c, dict) else c
            for n, c in self.document.get("constants", {}).items()
        }
        self.rates = {n: s["derivative"] for n, s in self.document["states"].items()}
        self.initial = {n: str(s.get("initial", 0)) for n, s in self.document["states"].items()}
        self.outputs = {n: text(o) for n, o in self.document["outputs"].items()}
        first = self.reference["experiments"][0]["file"]
        with open(os.path.join(folder, first)) as file:
            rows = list(csv.reader(file))[1:]
        is_used = lambda row: float(row[0]) == 0 or any(row[2:])
        self.instants = [float(row[0]) for row in rows if is_used(row)]

    @staticmethod
    def ordered(quantities):
        left, order = dict(quantities), []
        while left:
            ready = [n for n, e in left.items() if not names_in(e) & (set(left) - {n})]
            order += [(name, left.pop(name)) for name in ready]
        return order

    def python(self):
        """`rhs(t, y, p)`, `outputs(t, y, p)` and `initial(p)` as text."""
        power = lambda text: text.replace("^", "**")
        given = [f"    {n} = p[{k}]" for k, n in enumerate(self.parameters)]
        given += [f"    {n} = {v}" for n, v in self.constants.items()]
        moving = [f"    {n} = y[{k}]" for k, n in enumerate(self.states)] + ["    clock = t"]
        derived = [(n, f"    {n} = {power(e)}") for n, e in self.quantities]
        of_time = set(self.states) | {"clock"}
        for name, line in derived:
            if names_in(line) & of_time:
                of_time.add(name)
        body = given + moving + [line for _, line in derived]
        still = given + [line for name, line in derived if name not in of_time]
        tuple_of = lambda texts: "    return (" + ", ".join(map(power, texts)) + ",)"
        return "\n".join(
            ["from math import *", "def rhs(t, y, p):", *body, tuple_of(self.rates.values())]
            + ["def outputs(t, y, p):", *body, tuple_of(self.outputs.values())]
            + ["def initial(p):", *still, tuple_of(self.initial.values())]
        )


def shortest(run):
    run()
    best = float("inf")
    for _ in range(RUNS):
        started = time.perf_counter()
        run()
        best = min(best, time.perf_counter() - started)
    return 1e3 * best


def lsoda(problem):
    """Trajectories and times of SciPy's LSODA by tolerance."""
    import numba
    import numpy
    from scipy.integrate import odeint

    space = {}
    exec(problem.python(), space)
    parameters = numpy.array(list(problem.parameters.values()), dtype=float)
    compiled = numba.njit(space["rhs"])
    start = numpy.array(space["initial"](parameters), dtype=float)
    compiled(0.0, start, parameters)
    jitted = numba.njit("f8[:](f8, f8[:], f8[:])")(_as_array(compiled))
    instants = numpy.array(problem.instants)

    def run(tolerance):
        return odeint(
            jitted, start, instants, args=(parameters,), tfirst=True,
            rtol=tolerance, atol=tolerance * 1e-3, mxstep=100000,
        )

    return run, start


def _as_array(compiled):
    import numpy

    def rhs(t, y, p):
        return numpy.array(compiled(t, y, p))

    return rhs


def copasi_model(problem):
    """The problem in COPASI: every state and every quantity one of its global quantities."""
    import basico

    model = basico.new_model(name="problem", time_unit="1")
    known = {**problem.parameters, **problem.constants}
    derived = {**dict(problem.quantities), **problem.outputs}

    def spelled(text, when=""):
        text = re.sub(r"\bclock\b", "{Time}", text)
        everything = [*known, *derived, *problem.states]
        place = lambda m: f"{{Values[{m.group(0)}]{when}}}" if m.group(0) in everything else m.group(0)
        return re.sub(r"(?<![\w{\[])[A-Za-z_]\w*(?![\w(\]])", place, text)

    for name, value in known.items():
        basico.add_parameter(name, initial_value=value, model=model)
    for name in problem.states:
        basico.add_parameter(name, initial_value=0, model=model)
    for name, text in derived.items():
        basico.add_parameter(name, type="assignment", expression=spelled(text), model=model)
    for name, text in problem.rates.items():
        start = spelled(problem.initial[name], ".InitialValue")
        basico.set_parameters(name, exact=True, status="ode", expression=spelled(text),
                              initial_expression=start, model=model)
    return model


def copasi(problem):
    """Trajectories of COPASI's LSODA by tolerance."""
    import basico

    model = copasi_model(problem)
    columns = [f"Values[{name}]" for name in problem.states]

    def run(tolerance):
        basico.set_task_settings(
            basico.T.TIME_COURSE,
            {"method": {"name": "Deterministic (LSODA)", "Relative Tolerance": tolerance,
                        "Absolute Tolerance": tolerance * 1e-3, "Max Internal Steps": 1000000}},
            model=model,
        )
        return basico.run_time_course_with_output(
            columns, values=problem.instants, start_time=0, model=model
        ).to_numpy()

    # What is timed is COPASI's own task, without what Python makes of its answer.
    run.timed = lambda: model.getTask("Time-Course").process(True)
    return run


def diffsol(problem):
    """Trajectories of diffsol's BDF by tolerance."""
    import numpy
    import pydiffsol

    # Its names have letters alone.
    everything = [*problem.parameters, *problem.constants, *problem.states]
    everything += [name for name, _ in problem.quantities]
    letters = lambda k: "v" + "".join(chr(97 + int(digit)) for digit in str(k))
    short = {name: letters(k) for k, name in enumerate(everything)} | {"clock": "t"}

    def spelled(text):
        text = re.sub(r"[A-Za-z_]\w*", lambda m: short.get(m.group(0), m.group(0)), text)
        return re.sub(r"(\w+)\^(\w+(\.\d+)?)", r"pow(\1, \2)", text)

    of_time = set(problem.states) | {"clock"}
    still, moving = [], []
    for name, text in problem.quantities:
        line = f"{short[name]} {{ {spelled(text)} }}"
        if names_in(text) & of_time:
            of_time.add(name)
            moving.append(line)
        else:
            still.append(line)
    values = ", ".join(f"{short[n]} = {v!r}" for n, v in problem.parameters.items())
    lines = [f"in_i {{ {values} }}"]
    lines += [f"{short[n]} {{ {v!r} }}" for n, v in problem.constants.items()]
    starts = ", ".join(f"{short[n]} = {spelled(problem.initial[n])}" for n in problem.states)
    rates = ", ".join(spelled(problem.rates[n]) for n in problem.states)
    lines += [*still, f"u_i {{ {starts} }}", *moving, f"F_i {{ {rates} }}"]
    ode = pydiffsol.Ode("\n".join(lines), ode_solver=pydiffsol.bdf)
    parameters = numpy.array(list(problem.parameters.values()), dtype=float)
    instants = numpy.array(problem.instants)

    def run(tolerance):
        ode.rtol, ode.atol = tolerance, tolerance * 1e-3
        return numpy.asarray(ode.solve_dense(parameters, instants).ys).T

    return run


def at_accuracy(run, truth):
    """The time at the loosest tolerance whose error is below the one asked for."""
    import numpy

    size = numpy.abs(truth).max(axis=0) + 1e-300
    best = float("inf")
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10):
        error = float((numpy.abs(run(tolerance) - truth) / size).max())
        if error <= ASKED:
            timed = getattr(run, "timed", lambda: run(tolerance))
            return {"ms": shortest(timed), "error": error, "tolerance": tolerance}
        best = min(best, error)
    return f"its error stays at {best:.1e}"


def main():
    folder = sys.argv[1] if len(sys.argv) > 1 else FOLDER
    own = subprocess.run(
        ["cargo", "bench", "--quiet", "--bench", "published"],
        capture_output=True, text=True, check=True, cwd=os.path.join(HERE, "..", ".."),
    )
    own = json.loads(own.stdout)
    for name in PROBLEMS:
        problem = Problem(os.path.join(folder, name))
        line = {"greybox": own[name]}
        reference, start = lsoda(problem)
        truth = reference(1e-12)
        line["lsoda"] = at_accuracy(reference, truth)
        for other, made in (("copasi", copasi), ("diffsol", diffsol)):
            try:
                line[other] = at_accuracy(made(problem), truth)
            except Exception as error:  # another program's refusal is a finding
                line[other] = f"{type(error).__name__}: {error}"[:200]
        print(name, json.dumps(line), flush=True)


if __name__ == "__main__":
    main() if os.environ.get("IN_OWN") else served.in_own_environment(PACKAGES, "greybox-published")
