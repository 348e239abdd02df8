"""How often a monitor raises an alarm of a plant that does not change, and how soon it tells one that does: a lag of
first order under a square wave, a window after the other, over HTTP.

    python3 benches/studies/alarms.py [--windows 600] [--seeds 1]

Four streams, each watched by a monitor with the default false-alarm rate of one in a thousand windows: white noise
that is declared, white noise that is not, a disturbance with a memory of 40 s and three times the noise, and a gain
that falls by a fifth halfway.
"""

import collections
import os
import time
from datetime import datetime, timedelta, timezone

import served

BEGIN = datetime(2026, 3, 2, 8, 0, tzinfo=timezone.utc)
SAMPLE_TIME, SAMPLES = 0.1, 200
NOISE, DISTURBANCE, MEMORY_S = 0.01, 0.03, 40.0
TIME_CONSTANT, GAIN = 1.5, 2.0


def monitor(stream, declared):
    unknown = {"default": 1, "lower": 0.1, "upper": 10, "unknown": True}
    job = {
        "model": {
            "name": "lag", "inputs": {"u": {"unit": "V"}},
            "parameters": {"time": {"symbol": "T", "unit": "s", "scale": "log", **unknown},
                           "gain": {"symbol": "K", "unit": "", **unknown}},
            "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
            "outputs": {"y": {"unit": "V", "expression": "x"}},
        },
        "experiments": [{"initial_state": {"x": {"estimate": {"lower": -5, "upper": 5}}}}],
        "method": {"population": 12, "generations": 12}, "validation": {"fraction": 0},
    }
    if declared:
        job["outputs"] = {"y": {"noise_std": NOISE}}
    window = {"length_s": SAMPLES * SAMPLE_TIME, "from": BEGIN.isoformat()}
    return {"stream": stream, "window": window, "job": job}


def batches(windows, seed, kind):
    """The batches of a stream, a window each."""
    import numpy

    random = numpy.random.default_rng(seed)
    state = disturbance = 0.0
    decay, memory = numpy.exp(-SAMPLE_TIME / TIME_CONSTANT), numpy.exp(-SAMPLE_TIME / MEMORY_S)
    for window in range(windows + 1):
        gain = 0.8 * GAIN if kind == "fall" and window > windows // 2 else GAIN
        inputs, outputs = [], []
        for sample in range(SAMPLES):
            moved = 1.0 if (sample // 35) % 2 == 0 else -1.0
            if kind == "coloured":
                disturbance *= memory
                disturbance += DISTURBANCE * numpy.sqrt(1 - memory**2) * random.standard_normal()
            inputs.append(moved)
            outputs.append(state + disturbance + NOISE * random.standard_normal())
            state = gain * moved + (state - gain * moved) * decay
        start = BEGIN + timedelta(seconds=window * SAMPLES * SAMPLE_TIME)
        signals = {"u": {"unit": "V", "values": inputs}, "y": {"unit": "V", "values": outputs}}
        yield {"start": start.isoformat(), "sample_time_s": SAMPLE_TIME, "signals": signals}


def everything(server, path):
    items, token = [], None
    while True:
        page = server.ask(f"{path}?limit=100" + (f"&page_token={token}" if token else ""))
        items += page["items"]
        token = page.get("next_page_token")
        if not token:
            return items


def watched(server, stream, windows, seed, kind):
    """The windows and the alarms of a monitor that has worked all windows."""
    made = None
    for batch in batches(windows, seed, kind):
        answer = server.ask(f"streams/{stream}", batch)
        assert "refused" not in answer, answer
        if made is None:
            made = server.ask("monitors", monitor(stream, kind == "white"))
            assert "id" in made, made
    path = f"monitors/{made['id']}"
    while server.ask(path)["next_window"] < windows:
        time.sleep(1)
    return everything(server, f"{path}/windows"), everything(server, f"{path}/alarms")


def main():
    parser = served.arguments(__doc__)
    parser.add_argument("--windows", type=int, default=600)
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    if "IN_OWN" not in os.environ:
        served.in_own_environment()
    rows = [("stream", "windows", "estimated", "high / moderate / low", "`change`", "`trust_fell`",
             "first alarm")]
    figures = []
    with served.Server(options) as server:
        for kind in ("white", "undeclared", "coloured", "fall"):
            for seed in range(1, options.seeds + 1):
                windows, alarms = watched(server, f"{kind}-{seed}", options.windows, seed, kind)
                trusts = collections.Counter(window["trust"] for window in windows)
                kinds = collections.Counter(alarm["kind"] for alarm in alarms)
                changes = [alarm for alarm in alarms if alarm["kind"] == "change"]
                first = min((alarm["window"] for alarm in changes), default="-")
                estimated = sum(window["status"] == "estimated" for window in windows)
                shares = " / ".join(str(trusts[name]) for name in ("high", "moderate", "low"))
                rows.append((kind, len(windows), estimated, shares, kinds["change"],
                             kinds["trust_fell"], first))
                figures.append({"kind": kind, "seed": seed, "trusts": trusts, "alarms": alarms})
                print(served.table(rows), flush=True)
    served.keep(options, figures)


if __name__ == "__main__":
    main()
