#!/usr/bin/env python3
"""The same work by other programs, beside `cargo bench --bench speed`, in one run.

    python3 benches/studies/compare.py

makes a throw-away environment with numba and SciPy, simulates thirty candidates of the servo over
recording A with twenty Runge-Kutta steps a sample and with so many that the positions err by a
tenth of a micrometre (numba, both cores), estimates M, B, Ks and Km by differential evolution and
least squares (SciPy around the same kernel), and prints the times beside this project's. The
candidates are the same; the equations are those of `crates/simulation/src/model/single_rod_servo`, without the
effects that recording A does not have.
"""

import json
import pathlib
import subprocess
import sys
import tempfile
import time
import venv

PROJECT = pathlib.Path(__file__).resolve().parent.parent.parent
STEPS = 20
SAMPLE_TIME = 0.01
NOISE = 9.9e-6
ESTIMATION_SAMPLES = 9000
# M [kg], B [N s/m], Ks [N/m], Km [Pa].
TRUTH = (58.0, 370.0, 21412.0, 1.6009e9)
RUNS = 15
CANDIDATES = 30
# How far the candidates lie from the truth, as a share.
SPREAD = 0.05
# The error at which populations are compared [um rms].
TENTH = 0.1
# The natural frequency of the spool [rad/s]; its damping ratio is 0.7.
SPOOL = 628.318530717958647


def outside():
    """Runs this file again inside an environment that has what it needs."""
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        venv.create(folder / "venv", with_pip=True)
        python = folder / "venv" / "bin" / "python"
        subprocess.run(
            [python, "-m", "pip", "install", "--quiet", "numba", "numpy", "scipy"], check=True
        )
        greybox = ["cargo", "run", "--release", "--quiet", "--locked", "--"]
        recording = folder / "a.csv"
        subprocess.run([*greybox, "record", "a", "--output", recording], cwd=PROJECT, check=True)
        ours = subprocess.run(
            ["cargo", "bench", "--quiet", "--locked", "--bench", "speed", "--", "--json"],
            cwd=PROJECT,
            check=True,
            capture_output=True,
        ).stdout
        ours_file = folder / "ours.json"
        ours_file.write_bytes(ours)
        subprocess.run([python, __file__, recording, ours_file], check=True)


def inside(recording, ours):
    import numba
    import numpy
    from scipy import optimize

    rows = numpy.genfromtxt(recording, delimiter=",", skip_header=1)
    reference, measured = rows[:, 1].copy(), rows[:, 3].copy()

    @numba.njit
    def root(drop):
        return drop / numpy.sqrt(numpy.sqrt(drop * drop + 2e4**2))

    @numba.njit
    def slope(state, command, candidate):
        p1, p2, x, v, spool, spool_velocity = state
        mass, damping, stiffness, bulk = candidate
        supply, drain, gain = 7e6, 1e5, 8.91e-8
        area_1, area_2, stroke = 1.2566e-3, 8.765e-4, 0.14
        opening = min(max(spool, -1.0), 1.0)
        if opening >= 0.0:
            flow_1, flow_2 = root(supply - p1), root(p2 - drain)
        else:
            flow_1, flow_2 = root(p1 - drain), root(supply - p2)
        flow_1 *= gain * opening
        flow_2 *= gain * opening
        return (
            bulk / (3e-5 + area_1 * x) * (flow_1 - area_1 * v),
            bulk / (3e-5 + area_2 * (stroke - x)) * (area_2 * v - flow_2),
            v,
            (area_1 * p1 - area_2 * p2 - damping * v - stiffness * (x - 0.07)) / mass,
            spool_velocity,
            SPOOL**2 * (command - spool) - 2.0 * 0.7 * SPOOL * spool_velocity,
        )

    @numba.njit
    def along(state, length, rate):
        return (
            state[0] + length * rate[0],
            state[1] + length * rate[1],
            state[2] + length * rate[2],
            state[3] + length * rate[3],
            state[4] + length * rate[4],
            state[5] + length * rate[5],
        )

    @numba.njit(parallel=True)
    def positions(candidates, reference, steps):
        out = numpy.empty((candidates.shape[0], reference.size))
        for k in numba.prange(candidates.shape[0]):
            candidate = (candidates[k, 0], candidates[k, 1], candidates[k, 2], candidates[k, 3])
            p2 = 0.575 * 7e6
            state = (p2 * 8.765e-4 / 1.2566e-3, p2, 0.07, 0.0, 0.0, 0.0)
            h = SAMPLE_TIME / steps
            for n in range(reference.size):
                out[k, n] = state[2]
                command = min(max(100.0 * (reference[n] - state[2]), -1.0), 1.0)
                for _ in range(steps):
                    k1 = slope(state, command, candidate)
                    k2 = slope(along(state, 0.5 * h, k1), command, candidate)
                    k3 = slope(along(state, 0.5 * h, k2), command, candidate)
                    k4 = slope(along(state, h, k3), command, candidate)
                    state = (
                        state[0] + h / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
                        state[1] + h / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
                        state[2] + h / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
                        state[3] + h / 6.0 * (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3]),
                        state[4] + h / 6.0 * (k1[4] + 2.0 * (k2[4] + k3[4]) + k4[4]),
                        state[5] + h / 6.0 * (k1[5] + 2.0 * (k2[5] + k3[5]) + k4[5]),
                    )
        return out

    def shortest(runs, work):
        times = []
        for _ in range(runs):
            started = time.perf_counter()
            answer = work()
            times.append(time.perf_counter() - started)
        return min(times), answer

    truth = numpy.array(TRUTH)
    # Steps of the golden ratio, as in `benches/speed/population.rs`.
    spread = numpy.arange(4 * CANDIDATES) * 0.618033988749894848 % 1.0 * 2.0 - 1.0
    candidates = truth * (1.0 + SPREAD * spread.reshape(CANDIDATES, 4))
    positions(candidates[:2], reference[:10], STEPS)
    fine = positions(candidates, reference, 400)

    def error(steps):
        difference = positions(candidates, reference, steps) - fine
        return 1e6 * float(numpy.sqrt(numpy.mean(difference**2)))

    accurate_steps = next(steps for steps in range(STEPS, 400) if error(steps) <= TENTH)
    populations = {
        steps: shortest(RUNS, lambda: positions(candidates, reference, steps))[0]
        for steps in (STEPS, accurate_steps)
    }
    population = populations[accurate_steps]

    box = ours["estimate"][0]["bounds"]
    lower, upper = (numpy.log([bounds[side] for bounds in box]) for side in (0, 1))
    data = measured[:ESTIMATION_SAMPLES]

    def residuals(logs):
        simulated = positions(numpy.exp(logs)[None, :], reference[:ESTIMATION_SAMPLES], STEPS)[0]
        difference = (simulated - data) / NOISE
        return numpy.where(numpy.isfinite(difference), difference, 1e6)

    def costs(columns):
        many = numpy.exp(numpy.atleast_2d(columns.T))
        simulated = positions(many, reference[:ESTIMATION_SAMPLES], STEPS)
        squares = numpy.mean(((simulated - data) / NOISE) ** 2, axis=1)
        return numpy.where(numpy.isfinite(squares), squares, 1e12)

    started = time.perf_counter()
    found = optimize.differential_evolution(
        costs,
        list(zip(lower, upper)),
        maxiter=100,
        seed=1,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    refined = optimize.least_squares(residuals, found.x, bounds=(lower, upper), x_scale="jac")
    estimate = time.perf_counter() - started
    errors = 100.0 * (numpy.exp(refined.x) / truth - 1.0)

    print("population, 30 candidates, 12 000 samples, both cores")
    for steps, seconds in populations.items():
        print(f"  numba, {steps} steps: {1e3 * seconds:7.1f} ms, {error(steps):.3f} um rms")
    for row in ours["population"]["accuracies"]:
        milliseconds = row["milliseconds_on_2_threads"]
        print(
            f"  greybox, {row['accuracy']}: {milliseconds:7.1f} ms, "
            f"{row['position_error_rms_micrometres']:.3f} um rms, "
            f"{1e3 * population / milliseconds:.1f} times numba at {TENTH} um"
        )
    mine = ours["estimate"][0]
    print("estimate of M, B, Ks, Km with standard errors")
    print(
        f"  SciPy: {estimate:.1f} s, {found.nfev + refined.nfev} evaluations, "
        f"cost {2.0 * refined.cost / ESTIMATION_SAMPLES:.3f}, "
        f"errors {numpy.array2string(errors, precision=2)} %"
    )
    print(
        f"  greybox: {mine['seconds']:.2f} s, {mine['candidates_simulated']} candidates, "
        f"errors {[round(value, 2) for value in mine['error_percent'].values()]} %, "
        f"{estimate / mine['seconds']:.1f} times SciPy"
    )


if __name__ == "__main__":
    if len(sys.argv) == 1:
        outside()
    else:
        inside(sys.argv[1], json.loads(pathlib.Path(sys.argv[2]).read_text()))
