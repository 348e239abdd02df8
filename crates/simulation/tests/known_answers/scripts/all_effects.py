"""Trajectories of the servo with every switchable effect on, by an integrator of another make.

Writes `reference/all_effects_closed_loop.csv` and `reference/stalled_valve_command.csv`. Each held
stretch is integrated on its own by SciPy's Radau method (implicit, order 5) at a relative
tolerance of 1e-10. The equations are written out again here, from the catalogue's text.

    pip install numpy scipy && python3 all_effects.py
"""

import json
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

ATMOSPHERE = 101325.0
NOMINAL = dict(
    mass=58.0, damping=370.0, stiffness=21412.0, bulk_modulus=1.6009e9, flow_gain=8.91e-8,
    supply_pressure=7e6, return_pressure=1e5, transition_pressure=2e4, piston_area=1.2566e-3,
    annulus_area=8.765e-4, stroke=0.14, dead_volume_1=3e-5, dead_volume_2=3e-5,
    spring_neutral_position=0.07, position_gain=100.0,
    spool_natural_frequency=200 * np.pi, spool_damping_ratio=0.7, spool_time_constant=0.0,
    dead_band=0.0, valve_offset=0.0, coulomb_friction=0.0, friction_velocity=2e-3,
    stribeck_friction=0.0, stribeck_velocity=1e-2, internal_leakage=0.0, external_leakage=0.0,
    air_fraction=0.0, end_stop_stiffness=0.0, end_stop_damping=1.0, input_delay=0.0,
    load_force=0.0, supply_droop=0.0,
)


def derivative(p, command, y):
    p1, p2, x, v, s, w = y
    d0 = p["transition_pressure"]
    psi = lambda d: d / (d * d + d0 * d0) ** 0.25
    if p["spool_natural_frequency"] > 0:
        wn, z = p["spool_natural_frequency"], p["spool_damping_ratio"]
        spool, ds, dw = s, w, wn * wn * (command - s) - 2 * z * wn * w
    elif p["spool_time_constant"] > 0:
        spool, ds, dw = s, (command - s) / p["spool_time_constant"], 0.0
    else:
        spool, ds, dw = command, 0.0, 0.0
    u = np.sign(spool) * min(max(abs(spool) - p["dead_band"], 0.0), 1.0)
    ps, pt = p["supply_pressure"], p["return_pressure"]
    chamber = p1 if u >= 0 else p2
    ps = ps - p["supply_droop"] * max(p["flow_gain"] * abs(u) * psi(ps - chamber), 0.0)
    if u >= 0:
        q1, q2 = p["flow_gain"] * u * psi(ps - p1), p["flow_gain"] * u * psi(p2 - pt)
    else:
        q1, q2 = p["flow_gain"] * u * psi(p1 - pt), p["flow_gain"] * u * psi(ps - p2)
    volume1 = p["dead_volume_1"] + p["piston_area"] * x
    volume2 = p["dead_volume_2"] + p["annulus_area"] * (p["stroke"] - x)
    across = p["internal_leakage"] * (p1 - p2)
    out1, out2 = p["external_leakage"] * (p1 - pt), p["external_leakage"] * (p2 - pt)

    def bulk(pressure):
        pressure = max(pressure, 2e4)
        return 1 / (1 / p["bulk_modulus"] + p["air_fraction"] * ATMOSPHERE / pressure**2)

    friction = p["coulomb_friction"] + p["stribeck_friction"] * np.exp(
        -((v / p["stribeck_velocity"]) ** 2)
    )
    k, c = p["end_stop_stiffness"], p["end_stop_damping"]
    stop = lambda depth, speed: k * max(depth, 0.0) * max(1 + c * speed, 0.0)
    force = (
        p["piston_area"] * p1 - p["annulus_area"] * p2 - p["damping"] * v
        - p["stiffness"] * (x - p["spring_neutral_position"])
        - friction * np.tanh(v / p["friction_velocity"]) - p["load_force"]
        + stop(-x, -v) - stop(x - p["stroke"], v)
    )
    return [
        bulk(p1) / volume1 * (q1 - p["piston_area"] * v - across - out1),
        bulk(p2) / volume2 * (p["annulus_area"] * v - q2 + across - out2),
        v, force / p["mass"], ds, dw,
    ]


def simulate(p, reference, valve_command, sample_time):
    closed = reference is not None
    inputs = reference if closed else valve_command
    y = np.array([0.0, 0.575 * p["supply_pressure"], p["spring_neutral_position"], 0.0, 0.0, 0.0])
    y[0] = y[1] * p["annulus_area"] / p["piston_area"]
    delay, rows, held = p["input_delay"], [], []
    for k, value in enumerate(inputs):
        command = np.clip(p["position_gain"] * (value - y[2]), -1, 1) if closed else value
        rows.append([k * sample_time, value if closed else 0.0, command, y[2], y[3], y[0], y[1]])
        held.append(command + p["valve_offset"])
        whole = int(np.floor(delay / sample_time))
        part = delay - whole * sample_time
        for age, length in ((whole + 1, part), (whole, sample_time - part)):
            if length > 0:
                acting = held[max(len(held) - 1 - age, 0)]
                solution = solve_ivp(
                    lambda t, y: derivative(p, acting, y), (0, length), y, method="Radau",
                    rtol=1e-10, atol=[1e-3, 1e-3, 1e-13, 1e-11, 1e-10, 1e-8],
                )
                y = solution.y[:, -1]
    return np.array(rows)


def write(name, changes, reference=None, valve_command=None):
    parameters = NOMINAL | changes
    rows = simulate(parameters, reference, valve_command, 0.01)
    header = ("time [s],reference [m],valve_command [1],position [m],velocity [m/s],"
              "chamber_pressure_1 [Pa],chamber_pressure_2 [Pa]")
    folder = Path(__file__).parent.parent / "reference"
    np.savetxt(folder / f"{name}.csv", rows, delimiter=",", header=header, comments="", fmt="%.17g")
    entry = {"parameters": parameters, "input": "reference" if reference is not None else "valve_command"}
    (folder / f"{name}.json").write_text(json.dumps(entry, indent=1) + "\n")


if __name__ == "__main__":
    rng = np.random.default_rng(5)
    steps = np.repeat(rng.uniform(0.04, 0.10, 15), 20)
    write("all_effects_closed_loop", dict(
        spool_natural_frequency=0.0, spool_time_constant=2e-3, dead_band=0.015, valve_offset=-0.01,
        coulomb_friction=60.0, friction_velocity=5e-3, stribeck_friction=40.0,
        stribeck_velocity=2e-2, internal_leakage=1e-12, external_leakage=5e-13,
        air_fraction=0.01, input_delay=0.0137, load_force=-250.0, supply_droop=1.5e9,
    ), reference=steps)
    # Driven into both end stops and held there: the pressures stall against supply and return.
    push = np.concatenate([np.full(120, 0.9), np.full(180, -0.7), np.full(60, 0.05)])
    write("stalled_valve_command", dict(end_stop_stiffness=2e7, end_stop_damping=2.0),
          valve_command=push)
