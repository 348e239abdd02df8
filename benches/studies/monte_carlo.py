"""Whether a Monte Carlo analysis (JCGM 101) comes to what the propagation of uncertainty (JCGM 100) says: the
servo with three constants that are known within a tolerance, over HTTP.

    python3 benches/studies/monte_carlo.py [--draws 2000] [--json file]

How far each parameter moves with a constant is found by jobs of their own that take the constant a
tolerance higher and lower; squared and added to the square of the noise's standard error that is the
propagation. The total standard error of a job stands beside it: it is smaller where the residuals say more
of a constant than its tolerance. The recording comes from the independent simulator of `false_high.py`;
all other constants are taken as exact. Starts a server of its own
(`--program`), or asks one that runs (`--server`). Packages come from PyPI into a folder of its own.
"""

import json
import math
import os

import false_high
import served

RIG = {"mass": 58.0, "damping": 450.0, "stiffness": 24e3, "bulk_modulus": 1.2e9}
TOLERANCES = {"supply_pressure": "0.03 %", "flow_gain": "0.03 %", "piston_area": "0.02 %"}
NOISE, SAMPLES = 1e-5, 1000


def job(server, draws):
    import numpy

    random = numpy.random.default_rng(5)
    reference = false_high.textbook(random, SAMPLES)
    seen = false_high.simulator()({**false_high.NOMINAL, **RIG}, reference)
    position = seen[:, 0] + NOISE * random.standard_normal(SAMPLES)
    signals = {("reference", "m"): reference, ("position", "m"): position}
    dataset = server.store("Monte Carlo", signals, false_high.SAMPLE_TIME)
    model = server.ask("models/single_rod_servo")
    known = [own for own in model["parameters"] if own["name"] not in RIG]
    exact = {own["name"]: {"value": own["default"], "tolerance": 0} for own in known}
    for name, tolerance in TOLERANCES.items():
        exact[name]["tolerance"] = tolerance
    return {
        "model": "single_rod_servo", "experiments": [{"dataset": dataset}],
        "parameters": {**exact, **{name: {"estimate": {}} for name in RIG}},
        "outputs": {"position": {"noise_std": NOISE}}, "validation": {"fraction": 0},
        "method": {"generations": 20, "refine_candidates": 2}, "seed": 1,
        "uncertainty": {"monte_carlo_samples": draws},
    }


def moves(server, asked):
    """For each constant how far each parameter moves by a standard deviation of its tolerance."""
    moved = {}
    for name, tolerance in TOLERANCES.items():
        share = float(tolerance.rstrip(" %")) / 100
        found = []
        for side in (1, -1):
            job = json.loads(json.dumps(asked))
            del job["uncertainty"]
            for constant in TOLERANCES:
                job["parameters"][constant]["tolerance"] = 0
            job["parameters"][name]["value"] *= 1 + side * share
            identifier = server.submit(job)
            server.wait(identifier)
            result = server.ask(f"jobs/{identifier}/result")
            found.append({own["name"]: own["estimate"] for own in result["parameters"]})
        moved[name] = {own: (found[0][own] - found[1][own]) / 2 for own in RIG}
    return moved


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--draws", type=int, default=2000)
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment()
    with served.Server(options) as server:
        asked = job(server, options.draws)
        moved = moves(server, asked)
        identifier = server.submit(asked)
        shown = server.wait(identifier)
        result = server.ask(f"jobs/{identifier}/result")
    rows = [("parameter", "noise alone", "total", "propagated", "Monte Carlo", "ratio")]
    figures = {}
    for own in result["parameters"]:
        name, drawn = own["name"], own["monte_carlo"]["standard_error"]
        squares = [own["standard_error"] ** 2, *(move[name] ** 2 for move in moved.values())]
        propagated = math.sqrt(sum(squares))
        figures[name] = {"propagated": propagated, "monte_carlo": drawn}
        numbers = (own["standard_error"], own["total_standard_error"], propagated, drawn)
        rows.append((name, *(f"{number:.4g}" for number in numbers), f"{drawn / propagated:.3f}"))
    print(served.table(rows))
    print(f"{options.draws} draws in {served.seconds(shown):.0f} s")
    served.keep(options, figures)


if __name__ == "__main__":
    main()
