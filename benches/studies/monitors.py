"""What monitors see: a servo (the independent simulator of `false_high.py`) whose windows come in as
a stream, over HTTP, with one watched parameter that falls, one that steps, or none that changes.

    python3 benches/studies/monitors.py [--unchanged 1000] [--noise 1e-5] [--json file]

Three streams, each watched by a monitor with the default false-alarm rate of one in a thousand windows:

- *air in the oil*: the bulk modulus falls by 30 % over 60 windows;
- *worn seal*: damping steps by 20 % at window 30 of 60;
- *unchanged*: nothing changes, over `--unchanged` windows.

Tells after how many windows an alarm came, how many alarms there were before any change, and how many
of the 95 % intervals hold the true value. A window is 5 s of every 10 s. Starts a server of its own
(`--program`), or asks one that runs (`--server`).
"""

import os
import time
from datetime import datetime, timedelta, timezone

import designs
import false_high
import served

WINDOW_S, EVERY_S = 5.0, 10.0
BEGIN = datetime(2026, 3, 2, 8, 0, tzinfo=timezone.utc)
FALL, STEP_AT, STEP = 0.30, 30, 0.20
SEED = 1


def falling(window, windows):
    return {"bulk_modulus": designs.RIG["bulk_modulus"] * (1 - FALL * window / (windows - 1))}


def stepping(window, _):
    return {"damping": designs.RIG["damping"] * (1 + STEP * (window >= STEP_AT))}


def unchanged(*_):
    return {}


def reference():
    """Steps of a quarter of a second."""
    import numpy

    levels = numpy.random.default_rng(SEED).uniform(0.045, 0.095, int(WINDOW_S / 0.25))
    return numpy.repeat(levels, int(0.25 / false_high.SAMPLE_TIME))


def watched(server, name, change, windows, options):
    """Sends the windows of a stream and waits until its monitor has worked them all: the true rig of
    each, the windows as shown, and the alarms."""
    import numpy

    moved, simulate = reference(), false_high.simulator()
    random = numpy.random.default_rng([SEED, len(name)])
    true = [{**designs.RIG, **change(window, windows)} for window in range(windows)]
    stream = name.replace(" ", "-")
    monitor = None
    began = time.monotonic()
    for window, rig in enumerate([*true, true[-1]]):
        seen = simulate({**false_high.NOMINAL, **rig}, moved)[:, 0]
        start = BEGIN + timedelta(seconds=EVERY_S * window)
        body = {
            "start": start.isoformat(), "sample_time_s": false_high.SAMPLE_TIME,
            "signals": {
                "reference": {"unit": "m", "values": moved.tolist()},
                "position": {"unit": "m", "values": (
                    seen + options.noise * random.standard_normal(len(seen))).tolist()},
            },
        }
        answer = server.ask(f"streams/{stream}", body)
        assert "refused" not in answer, answer
        if monitor is None:
            monitor = server.ask("monitors", {
                "stream": stream, "name": name,
                "window": {"length_s": WINDOW_S, "every_s": EVERY_S, "from": BEGIN.isoformat()},
                "job": {
                    "model": "single_rod_servo", "experiments": [{}],
                    "parameters": {name: {"estimate": {}} for name in designs.RIG},
                    "outputs": {"position": {"noise_std": options.noise}},
                    "validation": {"fraction": 0}, "method": {"refine_candidates": 4},
                },
            })
            assert "id" in monitor, monitor
    shown = []
    while len(shown) < windows or any(own["status"] == "running" for own in shown):
        time.sleep(2)
        shown = everything(server, f"monitors/{monitor['id']}/windows", windows)
    alarms = everything(server, f"monitors/{monitor['id']}/alarms", None)
    return true, shown, alarms, time.monotonic() - began


def everything(server, path, most):
    """All entries of a list, the oldest first, as far as the windows that are asked for."""
    items, token = [], None
    while True:
        page = server.ask(f"{path}?limit=100" + (f"&page_token={token}" if token else ""))
        items += page["items"]
        token = page.get("next_page_token")
        if not token:
            break
    items.sort(key=lambda item: item.get("number", item.get("id")))
    return [item for item in items if most is None or item["number"] < most]


def told(name, true, shown, alarms, took):
    """A line of the table, and all figures."""
    held, intervals, estimated = 0, 0, 0
    for rig, window in zip(true, shown):
        estimated += window["status"] == "estimated"
        for own in window["parameters"]:
            interval = own["confidence_interval"]
            intervals += 1
            held += interval["lower"] <= rig[own["name"]] <= interval["upper"]
    changes = [alarm for alarm in alarms if alarm["kind"] == "change"]
    others = [alarm["kind"] for alarm in alarms if alarm["kind"] != "change"]
    changed = {"air in the oil": "bulk_modulus", "worn seal": "damping"}.get(name)
    begins = {"air in the oil": 0, "worn seal": STEP_AT}.get(name, len(true))
    right = [alarm for alarm in changes
             if alarm["change"]["parameter"] == changed and alarm["window"] >= begins]
    wrong = [alarm for alarm in changes if alarm not in right]
    first = right[0]["window"] if right else None
    share = 1 - true[first][changed] / designs.RIG[changed] if right else None
    figures = {
        "name": name, "windows": len(shown), "estimated": estimated, "held": held,
        "intervals": intervals, "first_alarm": first,
        "since": right[0]["change"]["since_window"] if right else None,
        "change_by_then": share, "false_alarms": len(wrong), "others": others,
        "seconds_a_window": took / len(shown),
        "wrong": [alarm["detail"] for alarm in wrong],
    }
    row = (
        name, f"{estimated} of {len(shown)}",
        "-" if first is None else f"{first}, says since {figures['since']}",
        "-" if share is None else f"{-100 * share:+.1f} %",
        len(wrong), f"{held} of {intervals}, {100 * held / max(intervals, 1):.1f} %",
        f"{figures['seconds_a_window']:.2f} s",
    )
    return row, figures


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--unchanged", type=int, default=1000, help="windows without a change")
    parser.add_argument("--noise", type=float, default=1e-5, help="of the position [m]")
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment()
    rows = [("stream", "estimated", "first right alarm", "changed by then", "false alarms",
             "95 % intervals that hold", "a window")]
    all_figures = []
    with served.Server(options) as server:
        for name, change, windows in (
            ("air in the oil", falling, 60), ("worn seal", stepping, 60),
            ("unchanged", unchanged, options.unchanged),
        ):
            row, figures = told(name, *watched(server, name, change, windows, options))
            rows.append(row)
            all_figures.append(figures)
            print(served.table(rows), *figures["wrong"], figures["others"], sep="\n", flush=True)
    served.keep(options, all_figures)


if __name__ == "__main__":
    main()
