"""How often the service is confidently wrong: jobs on rigs that are not quite what the job takes
them to be, over HTTP.

    python3 benches/studies/false_high.py [--jobs 240] [--keep folder] [--json file]

An independent simulator (the equations that `GET /v1/models/single_rod_servo` shows, by fixed
steps of RK4 in numba) draws rigs at random: a third are exactly what the model says, the others
have one fault or two of a kind that nobody sees in a plot (`--others`: other kinds). Each
recording goes to the server with a job as a user would write it: the model's own tolerances and
search ranges, a declared noise level, a shorter search than usual. Then the result is held against
the truth:

- false high: a parameter whose trust is `high` although it is more than four of its own total
  standard errors and more than 2 % off;
- coverage: how often the 95 % intervals hold the true value, the total ones where the fault is no
  larger than the tolerance of what it is a fault of, the statistical ones on right models;
- how many jobs on right models are `high`, and what the score tests say of right and wrong ones.

Starts a server of its own (`--program`), or asks one that runs (`--server`). Packages come from
PyPI into a folder of its own. `--seeds 17,23` repeats single jobs.
"""

import collections
import math
import os
import sys

import served

SAMPLE_TIME, STEP = 0.01, 1e-4
STROKE, AREA_1, AREA_2 = 0.14, 1.2566e-3, 8.765e-4
NOMINAL = {
    "flow_gain": 8.91e-8, "supply_pressure": 7e6, "return_pressure": 1e5,
    "dead_volume_1": 3e-5, "dead_volume_2": 3e-5, "spool_natural_frequency": 200 * math.pi,
    "coulomb_friction": 0.0, "quadratic_damping": 0.0, "dead_band": 0.0, "sensor_lag": 0.0,
    "bulk_modulus_drift": 0.0, "internal_leakage": 0.0, "load_force": 0.0, "valve_offset": 0.0,
    "supply_droop": 0.0, "air_fraction": 0.0, "sensor_gain": 1.0, "sensor_offset": 0.0,
    "clock": 1.0,
}
UNKNOWNS = {
    "mass": (30, 100), "damping": (120, 1500), "stiffness": (8e3, 45e3),
    "bulk_modulus": (0.7e9, 2.0e9),
}
LEAKAGE = (3e-13, 3e-12)
PRESSURE_NOISE = 7e3


def faults(random, others):
    """Kinds of faults: what the rig has instead, how large that is in words, and how many
    tolerances of the model it is (nothing where the model knows no such thing)."""
    within = lambda a, b: float(random.uniform(a, b))

    def supply():
        share = within(-0.005, 0.005)
        return {"supply_pressure": 7e6 / (1 + share)}, f"{100 * share:+.2f} %", share / 0.01

    def flow():
        share = within(-0.003, 0.003)
        return {"flow_gain": 8.91e-8 / (1 + share)}, f"{100 * share:+.2f} %", share / 0.05

    def coulomb():
        force = within(0, 40)
        return {"coulomb_friction": force}, f"{force:.1f} N", force / 50

    def quadratic():
        factor = within(0, 1500)
        return {"quadratic_damping": factor}, f"{factor:.0f} N s²/m²", None

    def band():
        width = within(0, 0.001)
        return {"dead_band": width}, f"{100 * width:.3f} %", width / 0.005

    def outlet():
        off = within(-2e4, 2e4)
        return {"return_pressure": 1e5 - off}, f"{off / 1e6:+.4f} MPa", off / 2e4

    def volumes():
        times = math.exp(within(math.log(0.7), math.log(1.5)))
        volume = 3e-5 / times
        size = (3e-5 - volume) / 9e-6
        return {"dead_volume_1": volume, "dead_volume_2": volume}, f"× {times:.2f}", size

    def lag():
        time = within(0, 1e-4)
        return {"sensor_lag": time}, f"{1e3 * time:.3f} ms", time / 2e-4

    def valve():
        share = within(-0.03, 0.03)
        frequency = 200 * math.pi * (1 + share)
        return {"spool_natural_frequency": frequency}, f"{100 * share:+.1f} %", share / 0.1

    def drift():
        share = within(0, 0.4)
        return {"bulk_modulus_drift": share}, f"{100 * share:.0f} %", None

    def load():
        force = within(-20, 20)
        return {"load_force": force}, f"{force:+.1f} N", force / 20

    def offset():
        share = within(-0.005, 0.005)
        return {"valve_offset": share}, f"{100 * share:+.2f} %", share / 0.01

    def droop():
        fall = within(0, 1e8)
        return {"supply_droop": fall}, f"{fall:.2g} Pa s/m³", fall / 1e8

    def air():
        share = within(0, 0.005)
        return {"air_fraction": share}, f"{100 * share:.2f} %", share / 0.005

    def gain():
        share = within(-0.005, 0.005)
        return {"sensor_gain": 1 + share}, f"{100 * share:+.2f} %", None

    def zero():
        off = within(-5e-4, 5e-4)
        return {"sensor_offset": off}, f"{1e3 * off:+.2f} mm", None

    def clock():
        share = within(-1e-3, 1e-3)
        return {"clock": 1 + share}, f"{100 * share:+.3f} %", None

    if others:
        return {
            "load force": load, "valve offset": offset, "supply droop": droop, "air": air,
            "sensor gain": gain, "sensor offset": zero, "clock": clock,
        }
    return {
        "supply pressure": supply, "flow gain": flow, "Coulomb friction": coulomb,
        "quadratic damping": quadratic, "dead band": band, "return pressure": outlet,
        "dead volumes": volumes, "sensor lag": lag, "valve bandwidth": valve,
        "bulk modulus drifts": drift,
    }


def simulator():
    """The rig in its position loop, compiled."""
    import numba
    import numpy

    @numba.njit
    def psi(drop):
        return drop / math.sqrt(math.sqrt(drop * drop + 4e8))

    @numba.njit
    def rates(state, command, rig, bulk):
        (mass, damping, stiffness, gain, supply, outlet, volume_1, volume_2, valve, coulomb,
         quadratic, band, leakage, load, _, droop, air) = rig
        p1, p2, x, v, spool, spool_rate = state
        opening = max(-1.0, min(1.0, spool))
        if band > 0.0:
            opening = math.copysign(min(max(abs(spool) - band, 0.0), 1.0), spool)
        chamber = p1 if opening >= 0.0 else p2
        supply -= droop * max(gain * abs(opening) * psi(supply - chamber), 0.0)
        if opening >= 0.0:
            q1 = gain * opening * psi(supply - p1)
            q2 = gain * opening * psi(p2 - outlet)
        else:
            q1 = gain * opening * psi(p1 - outlet)
            q2 = gain * opening * psi(supply - p2)
        across = leakage * (p1 - p2)
        force = AREA_1 * p1 - AREA_2 * p2 - damping * v - stiffness * (x - 0.07)
        force -= load + coulomb * math.tanh(v / 2e-3) + quadratic * v * abs(v)
        soft = air * 101325.0 * bulk
        bulk_1 = bulk / (1.0 + soft / max(p1, 2e4) ** 2)
        bulk_2 = bulk / (1.0 + soft / max(p2, 2e4) ** 2)
        return (
            bulk_1 / (volume_1 + AREA_1 * x) * (q1 - AREA_1 * v - across),
            bulk_2 / (volume_2 + AREA_2 * (STROKE - x)) * (AREA_2 * v - q2 + across),
            v,
            force / mass,
            spool_rate,
            valve * valve * (command - spool) - 1.4 * valve * spool_rate,
        )

    @numba.njit
    def moved(state, rate, by):
        return (
            state[0] + by * rate[0], state[1] + by * rate[1], state[2] + by * rate[2],
            state[3] + by * rate[3], state[4] + by * rate[4], state[5] + by * rate[5],
        )

    @numba.njit
    def run(rig, bulk, drift, sensor, reference, late, steps, sample_time):
        h, (lag, gain, zero) = sample_time / steps, sensor
        p2 = 0.575 * rig[4]
        state = (p2 * AREA_2 / AREA_1, p2, 0.07, 0.0, 0.0, 0.0)
        seen = numpy.empty((len(reference), 3))
        for k in range(len(reference)):
            now = bulk * (1.0 + drift * (k / len(reference) - 0.5))
            # A sensor of first order, by the first terms of its answer to what is slow for it.
            slope = rates(state, state[4], rig, now)[3]
            position = gain * (state[2] - lag * state[3] + lag * lag * slope) + zero
            then = position + late[k] * state[3] + 0.5 * late[k] * late[k] * slope
            seen[k] = (then, state[0], state[1])
            command = max(-1.0, min(1.0, 100.0 * (reference[k] - position))) + rig[14]
            for _ in range(steps):
                a = rates(state, command, rig, now)
                b = rates(moved(state, a, 0.5 * h), command, rig, now)
                c = rates(moved(state, b, 0.5 * h), command, rig, now)
                d = rates(moved(state, c, h), command, rig, now)
                state = moved(
                    moved(moved(moved(state, a, h / 6), b, h / 3), c, h / 3), d, h / 6
                )
        return seen

    def simulate(rig, reference, late=None):
        """Position and pressures; `late` by how much each position is taken after its instant."""
        late = numpy.zeros(len(reference)) if late is None else late
        names = ["mass", "damping", "stiffness", "flow_gain", "supply_pressure",
                 "return_pressure", "dead_volume_1", "dead_volume_2", "spool_natural_frequency",
                 "coulomb_friction", "quadratic_damping", "dead_band", "internal_leakage",
                 "load_force", "valve_offset", "supply_droop", "air_fraction"]
        values = tuple(float(rig[name]) for name in names)
        sensor = (rig["sensor_lag"], rig["sensor_gain"], rig["sensor_offset"])
        return run(values, rig["bulk_modulus"], rig["bulk_modulus_drift"], sensor, reference,
                   late, round(SAMPLE_TIME / STEP), SAMPLE_TIME * rig["clock"])

    return simulate


def textbook(random, samples):
    """Set points: large slow moves and small quick ones, both pseudo-random binary."""
    import numpy

    reference = numpy.full(samples, 0.07)
    for amplitude, held in ((0.025, 50), (0.010, 5)):
        signs = random.choice([-1.0, 1.0], size=samples // held + 1)
        reference += amplitude * numpy.repeat(signs, held)[:samples]
    return reference


def drawn(seed, options):
    """A rig, its recording and the job, without its dataset."""
    import numpy

    random = numpy.random.default_rng(seed)
    span = lambda ends: float(numpy.exp(random.uniform(*numpy.log(ends))))
    rig = {**NOMINAL, **{name: span(ends) for name, ends in UNKNOWNS.items()}}
    free = dict.fromkeys(UNKNOWNS, None)
    known = {}
    form = random.choice(["four", "three", "leakage"], p=[0.6, 0.2, 0.2])
    if form == "three":
        del free["stiffness"]
        known["stiffness"] = {"value": rig["stiffness"]}
    elif form == "leakage":
        rig["internal_leakage"] = span(LEAKAGE)
        free["internal_leakage"] = None
        if random.random() < 0.5:
            del free["stiffness"]
            known["stiffness"] = {"value": rig["stiffness"]}
    samples = int(random.integers(2000, 4001))
    samples = options.samples or samples
    noise = span((5e-6, 2e-5))
    with_pressures = random.random() < 0.10
    kinds = faults(random, options.others)
    # A third of all jobs without, a tenth with two.
    number = int(random.choice([0, 1, 2], p=[0.33, 0.57, 0.10]))
    told, largest = [], 0.0
    chosen = [str(kind) for kind in random.choice(list(kinds), size=number, replace=False)]
    for kind in chosen:
        has, size, tolerances = kinds[kind]()
        rig.update(has)
        told.append(f"{kind} {size}")
        largest = math.inf if tolerances is None else max(largest, abs(tolerances))
    reference = textbook(random, samples)
    noises = random.standard_normal((samples, 3)) * [noise, PRESSURE_NOISE, PRESSURE_NOISE]
    outputs = {"position": {"noise_std": noise}}
    if with_pressures:
        outputs |= {f"chamber_pressure_{n}": {"noise_std": PRESSURE_NOISE} for n in (1, 2)}
    job = {
        "name": f"false high {seed}",
        "model": "single_rod_servo",
        "parameters": {**{name: {"estimate": {}} for name in free}, **known},
        "outputs": outputs,
        "method": {"generations": 20, "refine_candidates": 2},
        "seed": seed,
    }
    what = {
        "seed": seed, "faults": told, "tolerances": largest, "samples": samples,
        "noise_std": noise, "outputs": len(outputs), "unknowns": list(free),
        "truth": {name: rig[name] for name in free}, "drift": rig["bulk_modulus_drift"],
        "kinds": chosen,
    }
    return what, rig, reference, noises, job


def made(server, seeds, options):
    simulate = simulator()
    for seed in seeds:
        what, rig, reference, noises, job = drawn(seed, options)
        seen = simulate(rig, reference) + noises
        signals = {("reference", "m"): reference, ("position", "m"): seen[:, 0]}
        if what["outputs"] > 1:
            signals |= {(f"chamber_pressure_{n}", "Pa"): seen[:, n] for n in (1, 2)}
        dataset = server.store(f"rig {seed}", signals, SAMPLE_TIME)
        yield what, {**job, "experiments": [{"dataset": dataset}]}


def holds(interval, truth):
    if not interval:
        return False
    lower, upper = interval["lower"], interval["upper"]
    return (lower is None or lower <= truth) and (upper is None or truth <= upper)


def judged(what, shown, result):
    """One line for each parameter of a job, and what the job says."""
    parameters = []
    for own in result["parameters"]:
        truth, estimate = what["truth"][own["name"]], own["estimate"]
        if own["name"] == "bulk_modulus" and what["drift"]:
            # Of what changes nobody knows the one true value: any that it had is true.
            low, high = (truth * (1 + 0.5 * sign * what["drift"]) for sign in (-1, 1))
            truth = min(max(estimate, low), high)
        off, total = estimate - truth, own.get("total_standard_error")
        parameters.append({
            "name": own["name"], "estimate": estimate, "truth": truth,
            "off_percent": 100 * off / truth,
            "total_errors": off / total if total else None,
            "noise_errors": off / own["standard_error"] if own["standard_error"] else None,
            "total_percent": 100 * total / truth if total else None,
            "trust": own["trust"],
            "in_total": holds(own.get("total_interval"), truth),
            "in_noise": holds(own["confidence_interval"], truth),
        })
    scores = {line["assumption"]: line["score"] for line in result["budget"]
              if line["score"] is not None}
    strongest = max(scores, key=lambda name: abs(scores[name]), default=None)
    by_output = {name: own.get("chi_square_per_sample")
                 for name, own in result.get("residuals", {}).items()}
    return {
        **what, "job": shown["id"], "seconds": served.seconds(shown),
        "trust": result["verdict"]["trust"],
        "reasons": [reason["code"] for reason in result["verdict"]["reasons"]],
        "strongest": [strongest, scores.get(strongest)], "chi_square": by_output,
        "parameters": parameters,
    }


def is_false_high(parameter):
    errors = parameter["total_errors"]
    return (parameter["trust"] == "high" and errors is not None and abs(errors) > 4
            and abs(parameter["off_percent"]) > 2)


def share(hits, all_of):
    return f"{hits} of {all_of}" + (f" ({100 * hits / all_of:.1f} %)" if all_of else "")


def counted(jobs):
    """Figures over jobs, of their parameters."""
    of = [parameter for job in jobs for parameter in job["parameters"]]
    known = [own for own in of if own["noise_errors"] is not None]
    return {
        "jobs": len(jobs),
        "high": sum(job["trust"] == "high" for job in jobs),
        "parameters": len(of),
        "parameters_high": sum(own["trust"] == "high" for own in of),
        "false_high": sum(map(is_false_high, of)),
        "high_outside": sum(own["trust"] == "high" and not own["in_total"] for own in of),
        "in_total": sum(own["in_total"] for own in of),
        "jobs_in_total": sum(all(own["in_total"] for own in job["parameters"]) for job in jobs),
        "in_noise": sum(own["in_noise"] for own in of),
        "rms_noise_errors": math.sqrt(
            sum(own["noise_errors"] ** 2 for own in known) / max(len(known), 1)
        ),
        "score_beyond_4": sum(abs(job["strongest"][1] or 0) > 4 for job in jobs),
        "contradicted": sum("assumption_contradicted" in job["reasons"] for job in jobs),
    }


def summary(jobs):
    right = [job for job in jobs if not job["faults"]]
    inside = [job for job in jobs if job["faults"] and job["tolerances"] <= 1]
    beyond = [job for job in jobs if job["tolerances"] > 1]
    groups = {"right": right, "fault within its tolerance": inside,
              "fault beyond it, or of a kind that the model has not": beyond, "all": jobs}
    kinds = collections.defaultdict(list)
    for job in jobs:
        if len(job["kinds"]) == 1:
            kinds[job["kinds"][0]].append(job)
        elif job["kinds"]:
            kinds["two faults"].append(job)
    return {name: counted(own) for name, own in [*groups.items(), *sorted(kinds.items())]}


def in_words(figures):
    head = ["rigs", "jobs", "`high`", "parameters `high`", "false high", "`high`, interval misses",
            "in total interval", "all of a job", "in interval of noise", "rms z",
            "a score beyond 4"]
    rows = [head]
    for name, own in figures.items():
        rows.append([
            name, own["jobs"], own["high"], own["parameters_high"], own["false_high"],
            own["high_outside"], share(own["in_total"], own["parameters"]),
            share(own["jobs_in_total"], own["jobs"]),
            share(own["in_noise"], own["parameters"]), f"{own['rms_noise_errors']:.2f}",
            own["score_beyond_4"],
        ])
    return served.table(rows)


def show_false_high(job, parameter):
    print(f"FALSE HIGH seed {job['seed']}: {'; '.join(job['faults']) or 'right'}: "
          f"{parameter['name']} {parameter['off_percent']:+.2f} %, "
          f"{parameter['total_errors']:+.1f} total standard errors "
          f"({parameter['noise_errors']:+.1f} of noise), job {job['trust']}, {job['reasons']}, "
          f"strongest score {job['strongest']}, chi²/n {job['chi_square']}, {job['job']}",
          flush=True)


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--jobs", type=int, default=240)
    parser.add_argument("--others", action="store_true",
                        help="other kinds: load, offsets, droop, air, gain and clock of a sensor")
    parser.add_argument("--samples", type=int, help="of every recording")
    parser.add_argument("--first", type=int, default=1, help="the first seed")
    parser.add_argument("--seeds", help="these seeds alone, with commas between")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.jobs)
    if options.seeds:
        seeds = [int(seed) for seed in options.seeds.split(",")]
    jobs, failed = [], []
    with served.Server(options) as server:
        for what, shown, result in server.run_all(made(server, seeds, options)):
            if result is None:
                failed.append({**what, "job": shown["id"], "error": shown["error"]})
                print(f"seed {what['seed']}: {shown['status']}: {shown['error']}", flush=True)
                continue
            job = judged(what, shown, result)
            jobs.append(job)
            worst = max(job["parameters"], key=lambda own: abs(own["total_errors"] or math.inf))
            print(f"seed {job['seed']}: {'; '.join(job['faults']) or 'right'}: {job['trust']} "
                  f"{job['reasons']}, worst {worst['name']} {worst['off_percent']:+.2f} %, "
                  f"z {worst['total_errors']}, {worst['trust']}, score {job['strongest']}, "
                  f"{job['seconds']:.1f} s", flush=True)
            for parameter in filter(is_false_high, job["parameters"]):
                show_false_high(job, parameter)
            served.keep(options, {"figures": summary(jobs), "failed": failed, "jobs": jobs})
    print(in_words(summary(jobs)))
    print(f"{len(failed)} failed; the slowest of {len(jobs)} jobs took "
          f"{max((job['seconds'] for job in jobs), default=0):.1f} s")
    found = [(job, own) for job in jobs for own in job["parameters"] if is_false_high(own)]
    for job, parameter in found:
        show_false_high(job, parameter)
    sys.exit(bool(found))


if __name__ == "__main__":
    main() if os.environ.get("IN_OWN") else served.in_own_environment()
