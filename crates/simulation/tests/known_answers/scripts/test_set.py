"""Writes ../test_set.json: initial value problems as model documents, with where they end.

The problems are those of the Test Set for Initial Value Problem Solvers (F. Mazzia, C. Magherini,
release 2.4, 2008: HIRES, POLLU, OREGO, ROBER, VDPOL), E. Hairer, G. Wanner (Brusselator: Solving
Ordinary Differential Equations I, 1993, section I.16), the two-body problem with eccentricity 0.9
(T. E. Hull and others, SIAM Journal on Numerical Analysis 9, 1972, class D5) and a pendulum.
The ends are computed here by SciPy's Radau and DOP853 at a relative tolerance of 1e-12.
"""
import json
import math
import pathlib

import numpy
from scipy.integrate import solve_ivp

PROBLEMS = {
    "hires": dict(
        end=321.8122,
        states={
            "y1": ("-1.71*y1 + 0.43*y2 + 8.32*y3 + 0.0007", 1),
            "y2": ("1.71*y1 - 8.75*y2", 0),
            "y3": ("-10.03*y3 + 0.43*y4 + 0.035*y5", 0),
            "y4": ("8.32*y2 + 1.71*y3 - 1.12*y4", 0),
            "y5": ("-1.745*y5 + 0.43*y6 + 0.43*y7", 0),
            "y6": ("-280*y6*y8 + 0.69*y4 + 1.71*y5 - 0.43*y6 + 0.69*y7", 0),
            "y7": ("280*y6*y8 - 1.81*y7", 0),
            "y8": ("-280*y6*y8 + 1.81*y7", 0.0057),
        },
    ),
    "orego": dict(
        end=360,
        states={
            "y1": ("77.27*(y2 + y1*(1 - 8.375e-6*y1 - y2))", 1),
            "y2": ("(y3 - (1 + y1)*y2)/77.27", 2),
            "y3": ("0.161*(y1 - y3)", 3),
        },
    ),
    "rober": dict(
        end=1e11,
        states={
            "y1": ("-0.04*y1 + 1e4*y2*y3", 1),
            "y2": ("0.04*y1 - 1e4*y2*y3 - 3e7*y2*y2", 0),
            "y3": ("3e7*y2*y2", 0),
        },
    ),
    "vdpol": dict(
        end=2,
        states={"y1": ("y2", 2), "y2": ("((1 - y1*y1)*y2 - y1)/1e-6", 0)},
    ),
    "pollu": dict(end=60, states={}),
    "brusselator": dict(
        end=20,
        states={"y1": ("1 + y1*y1*y2 - 4*y1", 1.5), "y2": ("3*y1 - y1*y1*y2", 3)},
    ),
    "kepler": dict(
        end=20,
        states={
            "y1": ("y3", 0.1),
            "y2": ("y4", 0),
            "y3": ("-y1/(y1*y1 + y2*y2)^1.5", 0),
            "y4": ("-y2/(y1*y1 + y2*y2)^1.5", math.sqrt(1.9 / 0.1)),
        },
    ),
    "pendulum": dict(end=20, states={"y1": ("y2", 3), "y2": ("-sin(y1)", 0)}),
}


def pollu():
    """Air pollution: 25 reactions of 20 species."""
    k = [0.35, 26.6, 1.23e4, 8.6e-4, 8.2e-4, 1.5e4, 1.3e-4, 2.4e4, 1.65e4, 9e3, 2.2e-2, 1.2e4,
         1.88, 1.63e4, 4.8e6, 3.5e-4, 1.75e-2, 1e8, 4.44e11, 1.24e3, 2.1, 5.78, 4.74e-2, 1.78e3, 3.12]
    on = [[1], [2, 4], [5, 2], [7], [7], [7, 6], [9], [9, 6], [11, 2], [11, 1], [13], [10, 2], [14],
          [1, 6], [3], [4], [4], [16], [16], [17, 6], [19], [19], [1, 4], [19, 1], [20]]
    r = {i + 1: "*".join([repr(k[i])] + [f"y{s}" for s in on[i]]) for i in range(25)}
    signs = {
        1: [-1, -10, -14, -23, -24, 2, 3, 9, 11, 12, 22, 25], 2: [-2, -3, -9, -12, 1, 21],
        3: [-15, 1, 17, 19, 22], 4: [-2, -16, -17, -23, 15], 5: [-3, 4, 4, 6, 7, 13, 20],
        6: [-6, -8, -14, -20, 3, 18, 18], 7: [-4, -5, -6, 13], 8: [4, 5, 6, 7], 9: [-7, -8],
        10: [-12, 7, 9], 11: [-9, -10, 8, 11], 12: [9], 13: [-11, 10], 14: [-13, 12], 15: [14],
        16: [-18, -19, 16], 17: [-20], 18: [20], 19: [-21, -22, -24, 23, 25], 20: [-25, 24],
    }
    start = {2: 0.2, 4: 0.04, 7: 0.1, 8: 0.3, 9: 0.01, 17: 0.007}
    text = lambda s: " ".join(("- " if n < 0 else "+ ") + r[abs(n)] for n in s)
    return {f"y{i}": ("0 " + text(signs[i]), start.get(i, 0)) for i in range(1, 21)}


def document(name, states):
    return {
        "name": name,
        "parameters": {"one": {"unit": "unitless", "default": 1.0}},
        "states": {
            state: {"unit": "unitless", "derivative": derivative, "initial": initial}
            for state, (derivative, initial) in states.items()
        },
        "outputs": {f"of_{state}": {"unit": "unitless", "expression": state} for state in states},
    }


def end(states, until, method):
    names = list(states)
    code = compile("[" + ",".join(d.replace("^", "**") for d, _ in states.values()) + "]", "f", "eval")
    known = {"sin": math.sin}
    slope = lambda _t, y: eval(code, known, dict(zip(names, y)))
    start = [initial for _, initial in states.values()]
    solution = solve_ivp(slope, (0, until), start, method=method, rtol=1e-12, atol=1e-20)
    assert solution.success, solution.message
    return solution.y[:, -1].tolist()


def main():
    PROBLEMS["pollu"]["states"] = pollu()
    problems = {}
    for name, problem in PROBLEMS.items():
        smooth = name in ("brusselator", "kepler", "pendulum")
        ends = end(problem["states"], problem["end"], "DOP853" if smooth else "Radau")
        problems[name] = {
            "end": problem["end"],
            "ends": ends,
            "document": document(name, problem["states"]),
        }
        print(name, ends)
    path = pathlib.Path(__file__).parent.parent / "test_set.json"
    path.write_text(json.dumps(problems, indent=1) + "\n")


if __name__ == "__main__":
    numpy.seterr(all="ignore")
    main()
