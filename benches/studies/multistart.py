"""Published problems solved by SciPy and by COPASI: how often, how long, how many candidates, beside this
program's jobs with the settings that they have by themselves.

- SciPy: L-BFGS-B from a start at random, each candidate simulated by LSODA around a right-hand side
  that numba compiled.
- COPASI's parameter estimation with its own settings: Levenberg–Marquardt from a start at random, and
  scatter search. Its outputs are weighed by their mean squares.

    python3 benches/studies/multistart.py [--seeds 20] [--only Boehm] [--program greybox]

Ranges, data and likelihood are those of the collection; the noise of each output that is not given is
what is left. Solved where the negative logarithm of the likelihood comes within 1.92 of the best that is
known. Fetches its packages from PyPI into a folder of its own.
"""

import csv
import math
import os
import statistics
import tempfile
import time

import floors
import published
import served

NAMES = ["Bertozzi_PNAS2020", "Boehm_JProteomeRes2014", "Rahman_MBS2016"]
TOLERANCE = 1e-7
COPASI = {"COPASI, a start": "Levenberg - Marquardt", "COPASI, scatter search": "Scatter Search"}


class Likelihood:
    """The negative logarithm of the likelihood of a problem, by the logarithms of its unknowns."""

    def __init__(self, folder):
        import numba
        import numpy

        self.problem = published.Problem(folder)
        self.reference = self.problem.reference
        space = {}
        exec(self.problem.python(), space)
        self.initial = space["initial"]
        self.outputs = numba.njit(space["outputs"])
        compiled = numba.njit(space["rhs"])
        size = len(self.problem.parameters)
        compiled(0.0, numpy.ones(len(self.problem.states)), numpy.ones(size))
        self.rhs = numba.njit("f8[:](f8, f8[:], f8[:])")(published._as_array(compiled))
        noise = set(self.reference["estimated_noise_parameters"])
        bounds = self.reference["bounds"].items()
        self.bounds = {name: bound[:2] for name, bound in bounds if name not in noise}
        self.experiments = [self.read(folder, own) for own in self.reference["experiments"]]
        self.evaluations = 0

    def read(self, folder, experiment):
        import numpy

        with open(os.path.join(folder, experiment["file"])) as file:
            head, *rows = list(csv.reader(file))
        rows = [row for row in rows if float(row[0]) == 0 or any(row[2:])]
        names = list(self.problem.outputs)
        measured = numpy.full((len(rows), len(names)), numpy.nan)
        for place, name in enumerate(head[2:], 2):
            for k, row in enumerate(rows):
                if row[place]:
                    measured[k, names.index(name)] = float(row[place])
        return experiment["condition"], numpy.array([float(row[0]) for row in rows]), measured

    def __call__(self, logarithms):
        import numpy
        from scipy.integrate import odeint

        self.evaluations += 1
        values = dict(zip(self.bounds, 10.0 ** numpy.asarray(logarithms)))
        square = numpy.zeros(len(self.problem.outputs))
        count = numpy.zeros(len(self.problem.outputs))
        for condition, instants, measured in self.experiments:
            known = {**self.problem.parameters, **{n: v for n, v in values.items()
                                                   if n in self.problem.parameters}}
            for name, said in condition.items():
                known[name] = values[said] if said in values else float(said)
            parameters = numpy.array(list(known.values()), dtype=float)
            start = numpy.array(self.initial(parameters), dtype=float)
            states, told = odeint(
                self.rhs, start, instants, args=(parameters,), tfirst=True, rtol=TOLERANCE,
                atol=TOLERANCE * 1e-3, mxstep=20000, full_output=True,
            )
            if told["message"] != "Integration successful.":
                return 1e10
            pairs = zip(instants, states)
            simulated = numpy.array([self.outputs(t, y, parameters) for t, y in pairs])
            off = (simulated - measured) ** 2
            square += numpy.nansum(off, axis=0)
            count += numpy.sum(~numpy.isnan(measured), axis=0)
        total = self.reference.get("jacobian_of_log_transform") or 0.0
        for name, own, n in zip(self.problem.outputs, square, count):
            noise = self.reference["noise"][name][0]
            if noise and noise.replace(".", "").isdigit():
                total += 0.5 * own / float(noise) ** 2
                total += 0.5 * n * math.log(2 * math.pi * float(noise) ** 2)
            else:
                total += 0.5 * n * (math.log(2 * math.pi * max(own, 1e-300) / n) + 1)
        return total if math.isfinite(total) else 1e10


def multistart(likelihood, seeds):
    """Whether each start came to the floor, its seconds and its candidates."""
    import numpy
    from scipy.optimize import minimize

    bounds = [[math.log10(end) for end in ends] for ends in likelihood.bounds.values()]
    lower, upper = numpy.array(bounds).T
    lines = []
    for seed in range(1, seeds + 1):
        start = numpy.random.default_rng(seed).uniform(lower, upper)
        before, began = likelihood.evaluations, time.monotonic()
        found = minimize(likelihood, start, method="L-BFGS-B", bounds=bounds,
                         options={"maxiter": 1000, "maxfun": 20000})
        lines.append((found.fun - likelihood.reference["J_star"] < 1.92,
                      time.monotonic() - began, likelihood.evaluations - before))
    return lines


def copasi(likelihood, method, seeds):
    """The same of COPASI's parameter estimation."""
    import basico
    import numpy

    model = published.copasi_model(likelihood.problem)
    start_of = lambda name: f"Values[{name}].InitialValue"
    with tempfile.TemporaryDirectory() as files:
        own_unknowns = {}
        for k, (condition, instants, measured) in enumerate(likelihood.experiments):
            columns = {"Time": instants}
            for name, said in condition.items():
                if said in likelihood.bounds:
                    own_unknowns.setdefault(said, (name, []))[1].append(f"e{k}")
                else:
                    columns[start_of(name)] = float(said)
            for name, column in zip(likelihood.problem.outputs, measured.T):
                if not numpy.isnan(column).all():
                    columns[f"Values[{name}]"] = column
            basico.add_experiment(f"e{k}", basico.pandas.DataFrame(columns), model=model, data_dir=files)
        items = []
        for unknown, (lower, upper) in likelihood.bounds.items():
            name, affected = own_unknowns.get(unknown, (unknown, []))
            items.append({"name": start_of(name), "lower": lower, "upper": upper,
                          "start": math.sqrt(lower * upper), "affected": affected})
        basico.set_fit_parameters(items, model=model)
        lines = []
        for seed in range(1, seeds + 1):
            settings = {"method": {"Random Number Generator": 1, "Seed": seed}}
            began = time.monotonic()
            found = basico.run_parameter_estimation(
                model=model, method=method, randomize_start_values=True, update_model=False,
                settings=settings, write_report=False)
            seconds = time.monotonic() - began
            cost = likelihood(numpy.log10(found["sol"].to_numpy(float)))
            evaluations = basico.get_fit_statistic(model=model)["f_evals"]
            lines.append((cost - likelihood.reference["J_star"] < 1.92, seconds, evaluations))
    return lines


def jobs(server, folder, seeds):
    """The same of this program's jobs."""
    problem = floors.Published(folder)
    made = [(seed, {**problem.job(server, seed), "uncertainty": {"flat_directions": "report"}})
            for seed in range(1, seeds + 1)]
    lines = []
    for _, shown, result in server.run_all(made):
        is_solved = problem.objective(result) - problem.reference["J_star"] < 1.92
        lines.append((is_solved, served.seconds(shown), result["search"]["evaluations"]))
    return lines


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--problems", default=floors.PROBLEMS, help="folder of the problems")
    parser.add_argument("--only", help="those whose name holds one of these words")
    parser.add_argument("--seeds", type=int, default=20)
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment(published.PACKAGES, "greybox-published")
    chosen = [name for name in NAMES
              if not options.only or any(word in name for word in options.only.split(","))]
    rows = [("problem", "program", "solved", "median s", "median candidates", "s a success")]
    options.in_flight = 1
    with served.Server(options) as server:
        for name in chosen:
            folder = os.path.join(options.problems, name)
            likelihood = Likelihood(folder)
            runs = {"greybox, a job": jobs(server, folder, options.seeds),
                    "SciPy, a start": multistart(likelihood, options.seeds)}
            for program, method in COPASI.items():
                runs[program] = copasi(likelihood, method, options.seeds)
            for program, lines in runs.items():
                solved, seconds, candidates = zip(*lines)
                each = sum(seconds) / sum(solved) if any(solved) else math.inf
                rows.append((name, program, f"{sum(solved)} of {len(lines)}",
                             f"{statistics.median(seconds):.2f}",
                             round(statistics.median(candidates)), f"{each:.2f}"))
    print(served.table(rows))
    served.keep(options, rows)


if __name__ == "__main__":
    main()
