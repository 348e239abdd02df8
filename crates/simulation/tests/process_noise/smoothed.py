"""Writes smoothed.json: an oscillator that two disturbances move, as all samples put it.

The states and the noises of the whole record are one normal vector; what the samples say of it is the
dense conditional expectation, with 60 digits. No filter and no smoother is used.

    pip install mpmath && python3 smoothed.py
"""

import json
import random
from pathlib import Path

from mpmath import diag, expm, matrix, mp, mpf, sqrt, zeros

mp.dps = 60
PARAMETERS = {"damping": 0.8, "stiffness": 6.0, "gain": 2.0, "load": 0.0}
STRENGTH, STD, TIME_CONSTANT = 0.5, 0.3, 0.7
NOISE = [0.02, 0.1]
START, START_VARIANCE = [0.3, -0.1], [0.04, 0.09]
INSTANTS = [0.0, 0.1, 0.2, 0.35, 0.4, 0.5, 0.75, 0.8, 0.9, 1.0, 1.3, 1.4, 1.5]
INPUT = [1.0, 1.0, -1.0, -1.0, -1.0, 0.5, 0.5, 1.0, 1.0, -1.0, -1.0, 0.0, 0.0]
MISSING = {0: {3, 6, 12}, 1: {0, 3, 4, 8, 9}}


def submatrix(whole, rows, columns):
    return matrix([[whole[i, j] for j in columns] for i in rows])


def interval(length):
    """Phi, the effect of a held input, and the joint covariance of the states' and the mean white noise.

    The states are position, velocity, load and the integral of the white noise.
    """
    c, k, b = (mpf(PARAMETERS[name]) for name in ("damping", "stiffness", "gain"))
    a = matrix([[0, 1, 0, 0], [-k, -c, 1, 0], [0, 0, -1 / mpf(TIME_CONSTANT), 0], [0, 0, 0, 0]])
    g = matrix([[0, 0], [STRENGTH, 0], [0, mpf(STD) * sqrt(2 / mpf(TIME_CONSTANT))], [STRENGTH, 0]])
    h = mpf(length)
    block = zeros(8)
    q = g * g.T
    for i in range(4):
        for j in range(4):
            block[i, j] = -a[i, j]
            block[i, 4 + j] = q[i, j]
            block[4 + i, 4 + j] = a[j, i]
    exponential = expm(block * h, method="taylor")
    phi = submatrix(exponential, range(4, 8), range(4, 8)).T
    added = phi * submatrix(exponential, range(4), range(4, 8))
    driven = zeros(5)
    for i in range(4):
        for j in range(4):
            driven[i, j] = a[i, j]
    driven[1, 4] = b
    by_input = submatrix(expm(driven * h, method="taylor"), range(3), [4])
    # The integral over the length is the mean.
    scale = diag([1, 1, 1, 1 / h])
    return submatrix(phi, range(3), range(3)), by_input, scale * added * scale


def main():
    n = len(INSTANTS)
    size = 3 + 4 * (n - 1)
    covariance = zeros(size)
    for i, variance in enumerate([*START_VARIANCE, mpf(STD) ** 2]):
        covariance[i, i] = mpf(variance)
    state, mean = zeros(3, size), matrix([*START, 0])
    for i in range(3):
        state[i, i] = 1
    states, means, noises = [state], [mean], []
    for k in range(n - 1):
        phi, by_input, added = interval(mpf(INSTANTS[k + 1]) - mpf(INSTANTS[k]))
        first = 3 + 4 * k
        for i in range(4):
            for j in range(4):
                covariance[first + i, first + j] = added[i, j]
        state, mean = phi * state, phi * mean + by_input * mpf(INPUT[k])
        for i in range(3):
            state[i, first + i] += 1
        states.append(state)
        means.append(mean)
        noises.append(added)
    draw = random.Random(3)
    measured = [[round(draw.gauss(0.2, 0.3), 4) for _ in range(n)] for _ in range(2)]
    places = [(k, o) for k in range(n) for o in range(2) if k not in MISSING[o]]
    rows, errors = zeros(len(places), size), zeros(len(places), 1)
    for place, (k, output) in enumerate(places):
        for column in range(size):
            rows[place, column] = states[k][output, column]
        errors[place] = mpf(measured[output][k]) - means[k][output]
    density = rows * covariance * rows.T
    for place, (_, output) in enumerate(places):
        density[place, place] += mpf(NOISE[output]) ** 2
    gain = covariance * rows.T * density ** -1
    expected, left = gain * errors, covariance - gain * rows * covariance
    answer = {"states": [], "white": [], "memory": []}
    for k in range(n):
        value = means[k] + states[k] * expected
        variance = states[k] * left * states[k].T
        answer["states"].append([[float(value[i]), float(sqrt(variance[i, i]))] for i in range(3)])
    for k, added in enumerate(noises):
        first = 3 + 4 * k
        of_states = range(first, first + 3)
        # What the samples tell of the noise: its expectation is Qd times the pull.
        inverse = submatrix(added, range(3), range(3)) ** -1
        pull = inverse * submatrix(expected, of_states, [0])
        known = submatrix(covariance - left, of_states, of_states)
        information = inverse * known * inverse
        # The last sample, a velocity, tells nothing of what the load received just before.
        told = information[2, 2] > mpf(10) ** -30
        answer["memory"].append(float(pull[2] / sqrt(information[2, 2])) if told else None)
        value, prior, after = expected[first + 3], added[3, 3], left[first + 3, first + 3]
        residual = value / sqrt(prior - after)
        # Strength times noise, in the unit of the velocity's rate.
        answer["white"].append([float(value), float(sqrt(after)), float(residual)])
    for output, missing in MISSING.items():
        for k in missing:
            measured[output][k] = None
    record = {
        "parameters": PARAMETERS, "strength": STRENGTH, "std": STD, "time_constant": TIME_CONSTANT,
        "noise_std": NOISE, "start": START, "start_variance": START_VARIANCE,
        "instants": INSTANTS, "force": INPUT, "measured": measured, "smoothed": answer,
    }
    Path(__file__).with_suffix(".json").write_text(json.dumps(record, indent=1) + "\n")


main()
