"""The package and a generated client against a server: `GREYBOX_URL` says where it is, `GENERATED` where
the generated client is."""

import math
import os
import pkgutil
import sys
from importlib import import_module

import pandas as pd
import pytest

from greybox_client import Client, Dataset, Problem

URL = os.environ.get("GREYBOX_URL")
GENERATED = os.environ.get("GENERATED")

needs_server = pytest.mark.skipif(URL is None, reason="GREYBOX_URL names no server")
needs_both = pytest.mark.skipif(URL is None or GENERATED is None, reason="GENERATED names no client")

LAG = {
    "name": "lag",
    "inputs": {"u": {"unit": "V"}},
    "parameters": {
        "time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1, "upper": 10,
                 "scale": "log", "unknown": True},
        "gain": {"symbol": "K", "unit": "", "default": 1, "lower": 0.1, "upper": 10, "unknown": True},
    },
    "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
    "outputs": {"y": {"unit": "V", "expression": "x"}},
}
METHOD = {"population": 12, "generations": 12}


def recorded(samples: int, index: pd.Index) -> pd.DataFrame:
    """A lag of 1.5 s and the gain 2, from rest, with a little of a fast sine for noise."""
    decay, output = math.exp(-0.1 / 1.5), 0.0
    inputs, outputs = [], []
    for k in range(samples):
        value = 1.0 if (k // 35) % 2 == 0 else -1.0
        inputs.append(value)
        outputs.append(output + 0.01 * math.sin(1e3 * k))
        output = 2.0 * value + (output - 2.0 * value) * decay
    return pd.DataFrame({"u": inputs, "y": outputs}, index=index)


@pytest.fixture
def api():
    with Client(URL) as client:
        yield client


@needs_server
def test_a_frame_becomes_an_estimate_and_a_plot(api):
    frame = recorded(200, pd.Index([0.1 * k for k in range(200)]))
    recording = api.upload(frame, name="a lag", units={"u": "V", "y": "V"})
    job = api.submit(LAG, recording, estimate={"gain": (0.5, 5)}, method=METHOD, seed=1)
    names = [event.name for event in job.events()]
    assert names[0] == "state" and names[-1] == "end" and "generation" in names
    result = job.result(timeout_s=120)
    changed = job.change(note="the first look", labels={"site": "hall 2"}).document
    assert (changed["note"], changed["labels"]) == ("the first look", {"site": "hall 2"})
    assert job.change(note=None).document["note"] is None
    assert abs(result.parameters.loc["gain", "estimate"] - 2) < 0.05
    assert abs(result.parameters.loc["time", "estimate"] - 1.5) < 0.05
    assert result.verdict["trust"] in ("low", "moderate", "high")
    assert list(result.trajectory().columns)[0] == ("y", "measured")
    assert len(recording.frame()) == 200
    import matplotlib

    matplotlib.use("Agg")
    assert len(result.plot()) == 2


@needs_server
def test_what_is_marked_is_left_out(api):
    frame = recorded(200, pd.Index([0.1 * k for k in range(200)]))
    frame.loc[6.0:8.0, "y"] += 3.0
    recording = api.upload(frame, name="a loose sensor", units={"u": "V", "y": "V"})
    assert recording.version()["marks"] == []
    marked = recording.mark(5.95, 8.05, "sensor loose", ["y"])
    assert (marked["number"], recording.version()["marks"]) == (1, marked["marks"])
    result = api.submit(LAG, recording, estimate={"gain": (0.5, 5)}, method=METHOD, seed=1).result(timeout_s=120)
    assert abs(result.parameters.loc["gain", "estimate"] - 2) < 0.05
    assert recording.mark_all([])["number"] == 2
    assert recording.version(1)["marks"] == marked["marks"]


@needs_server
def test_a_recording_is_prepared_from_another(api):
    frame = recorded(200, pd.Index([0.1 * k for k in range(200)]))
    recording = api.upload(frame, name="to be prepared", units={"u": "V", "y": "V"})
    steps = [{"step": "cut", "from_s": 5}, {"step": "calculate", "signal": "both", "equation": "u + y"}]
    prepared = recording.prepare(*steps, name="prepared")
    assert (prepared.document["name"], prepared.document["samples"]) == ("prepared", 150)
    samples = prepared.frame()
    assert (samples.iloc[:, 2] - samples.iloc[:, 0] - samples.iloc[:, 1]).abs().max() < 1e-9
    assert len(recording.frame()) == 200


@needs_server
def test_a_refusal_says_where(api):
    with pytest.raises(Problem) as refused:
        api.submit("single_rod_servoo", "ds_00000000000000000000000000000000")
    places = [fault["pointer"] for fault in refused.value.errors]
    assert "/model" in places, places


@needs_server
def test_a_stream_is_watched(api):
    index = pd.date_range("2026-03-02 08:15", periods=500, freq="100ms", tz="UTC")
    frame = recorded(500, index)
    name = f"lag-{os.getpid()}"
    assert api.append(name, frame[:300])["added"] == 300
    assert api.append(name, frame[250:])["repeated"] == 50
    job = {"model": LAG, "method": METHOD, "outputs": {"y": {"noise_std": 0.01}},
           "experiments": [{"initial_state": {"x": {"estimate": {"lower": -5, "upper": 5}}}}]}
    monitor = api.watch(name, job, window_s=20)
    for event in monitor.events():
        if event.name == "window" and event.data["number"] == 1 and event.data["status"] != "running":
            break
    history = monitor.history()
    assert list(history[("window", "status")]) == ["estimated", "estimated"], history
    assert (history[("gain", "estimate")] - 2).abs().max() < 0.05
    import matplotlib

    matplotlib.use("Agg")
    assert len(monitor.plot()) == 2
    monitor.delete()


@needs_server
def test_what_of_a_stream_is_marked_is_left_out_of_its_recordings(api):
    index = pd.date_range("2026-03-02 08:15", periods=300, freq="100ms", tz="UTC")
    api.append(f"loose-{os.getpid()}", recorded(300, index))
    stream = api.stream(f"loose-{os.getpid()}")
    assert repr(stream) == f"<Stream {stream.id}: 300 samples of 2 signals>"
    assert (stream.marks()["number"], stream.marks()["marks"]) == (0, [])
    stream.mark(index[60], index[80], "sensor loose", ["y"])
    marked = stream.mark("2026-03-02T08:15:20+00:00", "2026-03-02T08:15:21+00:00", "valve shut")
    assert (marked["number"], [mark["reason"] for mark in marked["marks"]]) == (2, ["sensor loose", "valve shut"])
    assert stream.marks()["marks"] == marked["marks"]
    part = {"from": index[0].isoformat(), "to": index[-1].isoformat()}
    cut = Dataset(api, api.post(f"{stream.path}/recordings", json=part))
    assert list(cut.signals["missing"]) == [11, 32]
    with pytest.raises(Problem) as refused:
        stream.mark_all([], based_on=1)
    assert refused.value.status == 409
    assert stream.mark_all([])["marks"] == []
    stream.delete()


@needs_both
def test_a_generated_client_imports_whole_and_asks_the_server():
    sys.path.insert(0, os.path.dirname(GENERATED))
    package = import_module(os.path.basename(GENERATED))
    for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        import_module(module.name)
    client = package.Client(base_url=URL)
    models = import_module(f"{package.__name__}.api.models.list_models").sync(client=client)
    assert "single_rod_servo" in [model.name for model in models.items]
    create = import_module(f"{package.__name__}.api.datasets.create_dataset")
    File = import_module(f"{package.__name__}.types").File
    import io

    text = b"time [s],a [m]\n0,1\n1,2\n2,5\n"
    stored = create.sync(client=client, body=File(payload=io.BytesIO(text)), name="generated")
    assert stored.samples == 3, stored
    page = import_module(f"{package.__name__}.api.datasets.list_datasets").sync(client=client)
    assert stored.id in [dataset.id for dataset in page.items]
