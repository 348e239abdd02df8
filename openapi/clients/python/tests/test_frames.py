"""What becomes of a DataFrame on its way to the server, and of an answer on its way back."""

import asyncio
import gzip
import io
import json

import httpx
import pandas as pd
import pytest

from greybox_client import AsyncClient, Client, Job, Problem, Result
from greybox_client._frames import disturbance, estimates, history, instant, packed, timed, to_csv


def test_times_with_a_zone_become_instants_and_units_stand_in_brackets():
    index = pd.date_range("2026-03-02 09:15", periods=2, freq="s", tz="Europe/Berlin")
    frame = pd.DataFrame({"position": [0.1, None]}, index=index)
    assert to_csv(timed(frame, {"position": "mm"})) == (
        "time,position [mm]\n2026-03-02T08:15:00+00:00,0.1\n2026-03-02T08:15:01+00:00,\n"
    )


def test_numbers_and_durations_are_seconds():
    values = pd.DataFrame({"a": [1, 2]}, index=[0.0, 0.5])
    durations = values.set_axis(pd.to_timedelta([0, 500], unit="ms"))
    assert to_csv(timed(values)) == to_csv(timed(durations)) == "time [s],a\n0.0,1\n0.5,2\n"


def test_times_without_a_zone_are_asked_about():
    frame = pd.DataFrame({"a": [1]}, index=pd.DatetimeIndex(["2026-03-02"]))
    with pytest.raises(ValueError, match="no zone"):
        timed(frame)
    assert to_csv(timed(frame, zone="Europe/Berlin")) == "time,a\n2026-03-01T23:00:00+00:00,1\n"


def test_an_instant_has_its_zone():
    local = pd.Timestamp("2026-03-02 09:15", tz="Europe/Berlin")
    assert instant(local) == instant("2026-03-02T08:15:00Z") == "2026-03-02T08:15:00+00:00"
    assert instant(local + pd.Timedelta(7, "ns")) == "2026-03-02T08:15:00.000000007+00:00"
    with pytest.raises(ValueError, match="no zone"):
        instant("2026-03-02T08:15:00")


def test_units_of_columns_that_are_not_there_are_refused():
    with pytest.raises(ValueError, match="velocity"):
        timed(pd.DataFrame({"a": [1]}), {"velocity": "m/s"})


def test_a_table_is_packed_without_a_loss():
    pyarrow = pytest.importorskip("pyarrow.parquet")
    index = pd.date_range("2026-03-02 09:15", periods=3, freq="250ms", tz="Europe/Berlin")
    content, headers = packed(timed(pd.DataFrame({"a": [1.5, None, 3e-9]}, index=index), {"a": "mm"}))
    assert headers == {"Content-Type": "application/vnd.apache.parquet"}
    table = pyarrow.read_table(io.BytesIO(content)).to_pandas()
    assert list(table.columns) == ["time", "a [mm]"]
    assert list(table["time"]) == list(index.tz_convert("UTC"))
    assert table["a [mm]"].isna().tolist() == [False, True, False] and table["a [mm]"][2] == 3e-9


def test_without_pyarrow_a_table_is_csv_packed_by_gzip(monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    content, headers = packed(timed(pd.DataFrame({"a": [1, 2]}, index=[0.0, 0.5])))
    assert headers["Content-Encoding"] == "gzip"
    assert gzip.decompress(content) == b"time [s],a\n0.0,1\n0.5,2\n"


def test_a_file_is_sent_as_it_is_and_by_its_name(tmp_path):
    sent = []

    def answer(request):
        sent.append((request.content, request.headers["content-type"], dict(request.url.params)))
        return httpx.Response(201, json={"id": "ds_1", "samples": 2, "signals": [], "name": "run.json"})

    file = tmp_path / "run.json"
    file.write_text("{}")
    recording = Client(transport=httpx.MockTransport(answer)).upload(file, tz="Europe/Berlin")
    assert sent == [(b"{}", "application/json", {"name": "run.json", "tz": "Europe/Berlin"})]
    assert repr(recording) == "<Dataset ds_1: run.json, 2 samples of 0 signals>"


def test_a_model_and_what_to_estimate_are_watched():
    sent = []

    def answer(request):
        sent.append(json.loads(request.content))
        return httpx.Response(201, json={"id": "mon_1"})

    api = Client(transport=httpx.MockTransport(answer))
    api.watch("rig-4", "single_rod_servo", window_s=60, estimate={"mass": (20, 120)}, fix={"damping": 5})
    parameters = {"mass": {"estimate": {"lower": 20, "upper": 120}}, "damping": {"value": 5}}
    assert sent[0]["job"] == {"model": "single_rod_servo", "experiments": [{}], "parameters": parameters}


def test_a_job_is_awaited():
    answers = {"/v1/jobs/job_1": {"id": "job_1", "status": "succeeded"}}
    result = {"parameters": [], "verdict": {"trust": "high", "reasons": []}}
    events = b'id: 1\nevent: state\ndata: {}\n\nid: 2\nevent: end\ndata: {"status":"succeeded"}\n\n'

    def answer(request):
        if request.url.path.endswith("/events"):
            return httpx.Response(200, content=events)
        return httpx.Response(200, json=answers.get(request.url.path, result))

    async def work():
        async with AsyncClient(transport=httpx.MockTransport(answer)) as api:
            job = await api.job("job_1")
            names = [event.name async for event in job.events()]
            return names, await job.result()

    names, came = asyncio.run(work())
    assert names == ["state", "end"]
    assert repr(came) == "<Result of job_1: 0 parameters, trust high>" and "trust high" in came._repr_html_()


def test_a_refusal_lists_all_faults():
    faults = [{"pointer": "/model", "code": "x", "detail": "there is none"}]
    document = {"title": "The request is wrong", "detail": "there is none", "errors": faults}
    transport = httpx.MockTransport(lambda _: httpx.Response(422, json=document))
    with pytest.raises(Problem, match="/model: there is none") as refused:
        Client(transport=transport).get("/v1/jobs")
    assert refused.value.status == 422


def test_events_are_taken_up_where_the_stream_broke_off(monkeypatch):
    monkeypatch.setattr("greybox_client._client._RETRY_S", 0)
    asked = []

    class Broken(httpx.SyncByteStream):
        def __iter__(self):
            yield b'retry: 2000\n\nid: 1\nevent: state\ndata: {"status":"running"}\n\n: alive\n\n'
            raise httpx.ReadError("gone")

    def answer(request):
        asked.append(request.headers["last-event-id"])
        if len(asked) == 1:
            return httpx.Response(200, stream=Broken())
        return httpx.Response(200, content=b'id: 2\nevent: end\ndata: {"status":"succeeded"}\n\n')

    events = list(Client(transport=httpx.MockTransport(answer)).follow("/v1/jobs/x/events"))
    assert [(event.id, event.name) for event in events] == [(1, "state"), (2, "end")]
    assert asked == ["0", "1"]


def test_estimates_and_histories_are_tables():
    known = {"name": "mass", "unit": "kg", "estimate": 58.0, "standard_error": 0.3,
             "confidence_interval": {"lower": 57.4, "upper": None}, "total_interval": None}
    table = estimates([known])
    assert table.loc["mass", "lower"] == 57.4 and pd.isna(table.loc["mass", "upper"])
    window = {"number": 1, "from": "2026-03-02T08:15:00Z", "to": "2026-03-02T08:16:00Z",
              "status": "estimated", "trust": "high", "parameters": [known]}
    quiet = {**window, "number": 0, "status": "quiet", "parameters": []}
    frame = history([window, quiet])
    assert list(frame[("window", "number")]) == [0, 1]
    assert frame[("mass", "estimate")].notna().tolist() == [False, True]


def test_a_disturbance_is_a_table_with_a_gap_at_its_last_sample():
    series = {"value": [0.2, 0.3], "deviation": [0.1, 0.1], "t": [4.5, None]}
    experiment = {"time_s": [0.0, 0.5], "disturbances": [{"acts_on": {"state": "velocity"}, **series}]}
    frame = disturbance({"experiments": [experiment]})[0]
    assert frame[("rate_of_velocity", "value")].loc[0.5] == 0.3
    assert frame[("rate_of_velocity", "t")].isna().tolist() == [False, True]


def test_a_next_step_is_submitted_as_the_changed_job():
    spec = {"model": "m", "parameters": {"mass": {"estimate": {"lower": 1, "upper": 2}}}}
    patch = {"parameters": {"mass": {"estimate": None, "value": 57.0}}}
    step = {"label": "Fix mass", "why": "Put the value of the data sheet there.", "patch": patch}
    reasons = [{"code": "correlated", "detail": "d", "next": [step]}, {"code": "misfit", "detail": "d"}]
    sent = []

    def answer(request):
        if request.method == "POST":
            sent.append(json.loads(request.content))
        return httpx.Response(200, json={"id": "job_2", "status": "queued", "spec": spec})

    client = Client(transport=httpx.MockTransport(answer))
    result = Result(Job(client, {"id": "job_1"}), {"verdict": {"trust": "low", "reasons": reasons}})
    assert result.next_steps[["code", "label"]].values.tolist() == [["correlated", "Fix mass"]]
    assert result.again(result.next_steps.patch[0]).id == "job_2"
    assert sent == [{"model": "m", "parameters": {"mass": {"value": 57.0}}}]
