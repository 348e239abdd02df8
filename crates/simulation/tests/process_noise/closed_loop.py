"""Writes closed_loop.json: a rig whose controller, within the model, sees the true states once a sample.

The record is linear in the noises, so that what is measured is one normal vector: its density and the
conditional expectation of the states are dense. No filter and no smoother is used.

    pip install numpy scipy && python3 closed_loop.py
"""

import json
import math
import random
from pathlib import Path

import numpy
from scipy.linalg import expm

PARAMETERS = {"mass": 2.0, "damping": 1.5, "stiffness": 8.0, "kp": 9.0, "kd": 1.2, "ki": 0.7}
STRENGTH = 0.6
NOISE = [0.02, 0.3]
START, START_VARIANCE = [0.1, -0.2], [0.03, 0.05]
SUM_BEFORE = 0.4
INTERVAL, SAMPLES = 0.1, 14
REFERENCE = [0.5] * 5 + [-0.3] * 4 + [0.2] * 5
MISSING = {0: {2, 7, 8}, 1: {0, 4, 8, 13}}
# The delay of each case, and the strength of white noise on the command.
CASES = [(0.0, 0.0), (0.03, 0.0), (0.1, 0.0), (0.25, 0.0), (0.1, 0.9), (0.25, 0.9)]


def stretch(length):
    """Phi of position and velocity, the effect of a held force, and the covariance of what noise adds."""
    m, c, k = (PARAMETERS[name] for name in ("mass", "damping", "stiffness"))
    a = numpy.array([[0.0, 1.0], [-k / m, -c / m]])
    q = numpy.diag([0.0, STRENGTH**2])
    van_loan = expm(numpy.block([[-a, q], [numpy.zeros((2, 2)), a.T]]) * length)
    phi = van_loan[2:, 2:].T
    driven = expm(numpy.block([[a, numpy.array([[0.0], [1.0 / m]])], [numpy.zeros((1, 3))]]) * length)
    return phi, driven[:2, 2], phi @ van_loan[:2, 2:]


def of_case(delay, command_strength, measured):
    """Affine quantities are rows: the factors of all noises, and the mean last."""
    age = math.ceil(delay / INTERVAL - 1e-9)
    change = delay - (age - 1) * INTERVAL if age else INTERVAL
    lengths = [change, INTERVAL - change]
    size = 2 + 5 * SAMPLES
    covariance = numpy.zeros((size, size))
    covariance[:2, :2] = numpy.diag(START_VARIANCE)
    state = numpy.zeros((2, size + 1))
    state[0, 0] = state[1, 1] = 1.0
    state[:, -1] = START
    total = numpy.zeros(size + 1)
    total[-1] = SUM_BEFORE
    states, outputs, commands = [], [], []
    kp, kd, ki = (PARAMETERS[name] for name in ("kp", "kd", "ki"))

    def acting(sample):
        return commands[max(sample, 0)]

    for k in range(SAMPLES):
        error = -state[0].copy()
        error[-1] += REFERENCE[k]
        total = total + ki * error
        command = kp * error - kd * state[1] + total
        command[2 + 4 * SAMPLES + k] += 1.0
        covariance[2 + 4 * SAMPLES + k, 2 + 4 * SAMPLES + k] = command_strength**2 / INTERVAL
        commands.append(command)
        states.append(state)
        outputs.append([state[0], acting(k - age)])
        for part, length in enumerate(lengths):
            if length < 1e-12:
                continue
            phi, by_force, added = stretch(length)
            force = acting(k - age + part)
            state = phi @ state + numpy.outer(by_force, force)
            first = 2 + 4 * k + 2 * part
            covariance[first : first + 2, first : first + 2] = added
            state[0, first] += 1.0
            state[1, first + 1] += 1.0
    places = [(k, o) for k in range(SAMPLES) for o in range(2) if k not in MISSING[o]]
    rows = numpy.array([outputs[k][o] for k, o in places])
    errors = numpy.array([measured[o][k] for k, o in places]) - rows[:, -1]
    rows = rows[:, :-1]
    sensors = numpy.diag([NOISE[o] ** 2 for _, o in places])
    density = rows @ covariance @ rows.T + sensors
    _, determinant = numpy.linalg.slogdet(2 * math.pi * density)
    likelihood = -0.5 * (determinant + errors @ numpy.linalg.solve(density, errors))
    gain = covariance @ rows.T @ numpy.linalg.inv(density)
    left = covariance - gain @ rows @ covariance
    smoothed = []
    for state in states:
        value = state[:, :-1] @ gain @ errors + state[:, -1]
        variance = numpy.diag(state[:, :-1] @ left @ state[:, :-1].T)
        smoothed.append([[value[i], math.sqrt(variance[i])] for i in range(2)])
    return {"delay": delay, "command_strength": command_strength, "log_likelihood": likelihood, "smoothed": smoothed}


def main():
    draw = random.Random(5)
    measured = [
        [round(draw.gauss(0.1, spread), 4) for _ in range(SAMPLES)] for spread in (0.2, 3.0)
    ]
    cases = [of_case(*case, measured) for case in CASES]
    for output, missing in MISSING.items():
        for k in missing:
            measured[output][k] = None
    record = {
        "parameters": PARAMETERS, "strength": STRENGTH, "noise_std": NOISE, "start": START,
        "start_variance": START_VARIANCE, "sum_before": SUM_BEFORE, "interval": INTERVAL,
        "reference": REFERENCE, "measured": measured, "cases": cases,
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(record, indent=1) + "\n")


main()
