"""Whether estimates scatter as a design predicts: an experiment for the servo is designed as a job,
played on an independent simulator (that of `false_high.py`) with another noise each time, and estimated
from, over HTTP.

    python3 benches/studies/designs.py [--seeds 200] [--first 1] [--json file]

Starts a server of its own (`--program`), or asks one that runs (`--server`). Packages come from
PyPI into a folder of its own.
"""

import json
import math
import os

import false_high
import served

RIG = {"mass": 58.0, "damping": 450.0, "stiffness": 24e3, "bulk_modulus": 1.2e9}
NOISE = 1e-5
SECONDS = 10.0


def designed(server):
    """The design, made as a job."""
    # Priors so wide that they tell nothing beside the experiment.
    free = {
        name: {"estimate": {}, "prior": {"mean": value, "std": 3.0 * value}}
        for name, value in RIG.items()
    }
    document = {
        "model": "single_rod_servo", "parameters": free,
        "outputs": {"position": {"noise_std": NOISE}},
        "inputs": {"reference": {"lower": 0.045, "upper": 0.095}},
        "families": ["prbs", "steps"], "points": 1,
        "sample_time_s": false_high.SAMPLE_TIME, "duration_s": SECONDS,
    }
    job = server.ask("designs", document, headers={"prefer": "respond-async"})
    shown = server.wait(job["id"])
    print(f"designed in {served.seconds(shown):.1f} s, "
          f"{shown['progress']['evaluations']} experiments looked at")
    return server.ask(f"jobs/{job['id']}/result")


def made(server, reference, options):
    """A recording and a job for each seed."""
    import numpy

    seen = false_high.simulator()({**false_high.NOMINAL, **RIG}, reference)
    for seed in range(options.first, options.first + options.seeds):
        noise = numpy.random.default_rng(seed).standard_normal(len(reference))
        signals = {("reference", "m"): reference, ("position", "m"): seen[:, 0] + NOISE * noise}
        dataset = server.store(f"designed {seed}", signals, false_high.SAMPLE_TIME)
        yield seed, {
            "model": "single_rod_servo", "experiments": [{"dataset": dataset}],
            "parameters": {name: {"estimate": {}} for name in RIG},
            "outputs": {"position": {"noise_std": NOISE}}, "validation": {"fraction": 0},
            "method": {"generations": 20, "refine_candidates": 2}, "seed": seed,
        }


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment()
    import numpy

    with served.Server(options) as server:
        design = designed(server)
        best = design["proposals"][0]
        print(f"played: {json.dumps(best['excitation'])}")
        reference = numpy.array(design["inputs"]["signals"]["reference"]["values"])
        found = {name: [] for name in RIG}
        for _, _, result in server.run_all(made(server, reference, options)):
            for own in result["parameters"]:
                found[own["name"]].append(own["estimate"])
    predicted = {own["name"]: own["standard_error"] for own in best["after"]}
    rows = [("parameter", "predicted", "realised", "ratio", "jobs")]
    figures = {}
    for name, truth in RIG.items():
        errors = numpy.array(found[name]) - truth
        realised = math.sqrt(float(numpy.mean(errors * errors)))
        figures[name] = {"predicted": predicted[name], "realised": realised, "jobs": len(errors)}
        rows.append((name, f"{predicted[name]:.4g}", f"{realised:.4g}",
                     f"{realised / predicted[name]:.3f}", len(errors)))
    print(served.table(rows))
    served.keep(options, figures)


if __name__ == "__main__":
    main()
