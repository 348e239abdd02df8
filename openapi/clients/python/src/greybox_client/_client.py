"""The client: a thin layer over HTTP that knows what a notebook wants."""

from __future__ import annotations

import io
import json as _json
import time
import uuid
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar, Union

import httpx
import pandas as pd

from . import _frames

#: How long one request may wait for the state of a job to change [s].
_WAIT_S = 30
#: How soon a stream that broke off is taken up again [s].
_RETRY_S = 2.0
_ENDED = ("succeeded", "failed", "cancelled")

#: The type of a file by the end of its name; everything else goes as CSV, and the server looks at it.
_TYPES = {
    ".json": "application/json",
    ".parquet": "application/vnd.apache.parquet",
    ".txt": "text/plain",
    ".xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
}

#: What is sent as a recording: a frame, a text, bytes, or the path of a file.
Data = Union[pd.DataFrame, str, bytes, Path]

Self = TypeVar("Self", bound="_Resource")


class Problem(Exception):
    """What the server refused, and why: `status`, `detail`, and `errors` with a place each."""

    def __init__(self, status: int, document: Mapping[str, Any]) -> None:
        self.status = status
        self.title = document.get("title", "")
        self.detail = document.get("detail", "")
        self.errors = list(document.get("errors", []))
        self.request_id = document.get("request_id")
        lines = [f"{status} {self.title}: {self.detail}"]
        for fault in self.errors:
            place = next((fault[key] for key in ("pointer", "parameter", "header") if fault.get(key)), "")
            lines.append(f"  {place}: {fault.get('detail', '')}")
        super().__init__("\n".join(lines))


@dataclass(frozen=True)
class Event:
    """An event of a job or of a monitor."""

    id: int
    name: str
    data: dict[str, Any]


class Client:
    """A server, by its address. `token` goes along where the server wants one."""

    def __init__(
        self,
        url: str = "http://127.0.0.1:8080",
        token: str | None = None,
        timeout_s: float = 60.0,
        transport: httpx.BaseTransport | None = None,
    ) -> None:
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        self._http = httpx.Client(
            base_url=url, headers=headers, timeout=timeout_s, transport=transport
        )

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def request(self, method: str, path: str, **more: Any) -> httpx.Response:
        """Any request; raises a `Problem` for what the server refuses."""
        response = self._http.request(method, path, **more)
        _refuse(response)
        return response

    def get(self, path: str, **params: Any) -> Any:
        """The JSON at a path."""
        return self.request("GET", path, params=params).json()

    def post(self, path: str, **more: Any) -> Any:
        """The JSON that a POST answers."""
        return self.request("POST", path, **more).json()

    def upload(
        self,
        data: Data,
        name: str | None = None,
        units: Mapping[str, str] | None = None,
        content_type: str | None = None,
        **options: str,
    ) -> Dataset:
        """Stores a recording: a DataFrame whose index is the time, the path of a file, or the text or bytes of
        a historian's answer.

        `units` are those of columns; `options` are those of the upload, such as `tz`, `format` or `missing`.
        `tz` is also the zone of a frame whose times have none.
        """
        if isinstance(data, Path) and name is None:
            name = data.name
        return Dataset(self, self._send("/v1/datasets", data, units, content_type, {"name": name, **options}))

    def append(
        self,
        stream: str,
        data: Data,
        units: Mapping[str, str] | None = None,
        content_type: str | None = None,
        **options: Any,
    ) -> dict[str, Any]:
        """Adds samples to a stream; answers what became of them."""
        return self._send(f"/v1/streams/{stream}", data, units, content_type, options)

    def stream(self, name: str) -> Stream:
        """A stream by its name."""
        return Stream(self, self.get(f"/v1/streams/{name}"))

    def _send(
        self,
        path: str,
        data: Data,
        units: Mapping[str, str] | None,
        content_type: str | None,
        options: Mapping[str, Any],
    ) -> dict[str, Any]:
        params = {key: value for key, value in options.items() if value is not None}
        headers: dict[str, str] = {}
        if isinstance(data, pd.DataFrame):
            frame = _frames.timed(data, units, params.pop("tz", None))
            content, headers = _frames.packed(frame)
        else:
            if units:
                params["units"] = _json.dumps(dict(units))
            if isinstance(data, Path):
                content_type = content_type or _TYPES.get(data.suffix.lower())
            content = data.read_bytes() if isinstance(data, Path) else data.encode() if isinstance(data, str) else data
        headers.setdefault("Content-Type", content_type or "text/csv")
        answer: dict[str, Any] = self.post(path, content=content, params=params, headers=headers)
        return answer

    def submit(
        self,
        model: str | Mapping[str, Any],
        recording: Dataset | str,
        estimate: Mapping[str, Any] | None = None,
        fix: Mapping[str, float] | None = None,
        key: str | None = None,
        **more: Any,
    ) -> Job:
        """Submits a job on a recording.

        `estimate` names unknown parameters with their bounds, `(lower, upper)` or a whole document;
        `fix` those that are known. `more` is any other part of a job, such as `outputs` or `method`.
        The same `key` never makes two jobs.
        """
        parameters = {**more.pop("parameters", {}), **_parameters(estimate, fix)}
        dataset = recording.id if isinstance(recording, Dataset) else recording
        experiment = {"dataset": dataset, **more.pop("experiment", {})}
        document = {"model": model, "experiments": [experiment], "parameters": parameters, **more}
        headers = {"Idempotency-Key": key or str(uuid.uuid4())}
        return Job(self, self.post("/v1/jobs", json=document, headers=headers))

    def job(self, id: str) -> Job:
        """A job by its identifier."""
        return Job(self, self.get(f"/v1/jobs/{id}"))

    def watch(
        self,
        stream: str,
        job: Mapping[str, Any] | str,
        window_s: float,
        every_s: float | None = None,
        estimate: Mapping[str, Any] | None = None,
        fix: Mapping[str, float] | None = None,
        **more: Any,
    ) -> Monitor:
        """Watches a stream: `job` is done on each window of so many seconds.

        The job is a document, or the name of a model with `estimate` and `fix` as for `submit`.
        """
        if isinstance(job, str):
            job = {"model": job, "experiments": [{}]}
        if estimate or fix:
            job = {**job, "parameters": {**job.get("parameters", {}), **_parameters(estimate, fix)}}
        window = {"length_s": window_s, **more.pop("window", {})}
        if every_s is not None:
            window["every_s"] = every_s
        document = {"stream": stream, "window": window, "job": job, **more}
        headers = {"Idempotency-Key": str(uuid.uuid4())}
        return Monitor(self, self.post("/v1/monitors", json=document, headers=headers))

    def monitor(self, id: str) -> Monitor:
        """A monitor by its identifier."""
        return Monitor(self, self.get(f"/v1/monitors/{id}"))

    def follow(self, path: str, after: int = 0) -> Iterator[Event]:
        """Server-sent events from after the one with that id, taken up again where the stream breaks."""
        while True:
            broke = False
            try:
                headers = {"Accept": "text/event-stream", "Last-Event-ID": str(after)}
                with self._http.stream("GET", path, headers=headers, timeout=_WAIT_S * 2) as response:
                    if response.status_code == httpx.codes.NO_CONTENT:
                        return
                    if response.is_error:
                        response.read()
                    _refuse(response)
                    for event in _events(response.iter_lines()):
                        after = event.id
                        yield event
                        if event.name == "end":
                            return
            except httpx.TransportError:
                broke = True
            if broke:
                time.sleep(_RETRY_S)


def _parameters(estimate: Mapping[str, Any] | None, fix: Mapping[str, float] | None) -> dict[str, Any]:
    """Unknown parameters with their bounds, and known ones with their values, as a job says them."""
    parameters: dict[str, Any] = {}
    for name, bounds in (estimate or {}).items():
        if not isinstance(bounds, Mapping):
            lower, upper = bounds
            bounds = {"estimate": {"lower": lower, "upper": upper}}
        parameters[name] = bounds
    for name, value in (fix or {}).items():
        parameters[name] = {"value": value}
    return parameters


def _refuse(response: httpx.Response) -> None:
    if not response.is_error:
        return
    try:
        document = response.json()
    except ValueError:
        document = {"title": response.reason_phrase, "detail": response.text}
    raise Problem(response.status_code, document)


def _patched(value: Any, patch: Any) -> Any:
    """The value with a JSON merge patch (RFC 7396)."""
    if not isinstance(patch, Mapping):
        return patch
    result = dict(value) if isinstance(value, Mapping) else {}
    for name, part in patch.items():
        if part is None:
            result.pop(name, None)
        else:
            result[name] = _patched(result.get(name), part)
    return result


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _events(lines: Iterator[str]) -> Iterator[Event]:
    fields: dict[str, str] = {}
    for line in lines:
        if line:
            name, _, value = line.partition(":")
            fields[name] = value.removeprefix(" ")
        else:
            if "data" in fields and "id" in fields:
                data = _json.loads(fields["data"])
                yield Event(int(fields["id"]), fields.get("event", "message"), data)
            fields = {}


class _Resource:
    """Something of the server: its document by name, `resource["status"]`."""

    _path = ""

    def __init__(self, client: Client, document: dict[str, Any]) -> None:
        self._client = client
        self.document = document

    def __getitem__(self, name: str) -> Any:
        return self.document[name]

    def __repr__(self) -> str:
        facts = ", ".join(str(fact) for fact in self._facts() if fact)
        return f"<{type(self).__name__} {self.id}{': ' + facts if facts else ''}>"

    def _facts(self) -> list[Any]:
        return [self.document.get("name"), self.document.get("status")]

    @property
    def id(self) -> str:
        """The identifier."""
        return str(self.document["id"])

    @property
    def path(self) -> str:
        """Where it is."""
        return f"{self._path}/{self.id}"

    def refresh(self: Self) -> Self:
        """Asks the server how it stands."""
        self.document = self._client.get(self.path)
        return self

    def delete(self) -> None:
        """Removes it."""
        self._client.request("DELETE", self.path)


class Dataset(_Resource):
    """A stored recording."""

    _path = "/v1/datasets"

    def _facts(self) -> list[Any]:
        samples, signals = self.document.get("samples"), self.document.get("signals", [])
        return [self.document.get("name"), f"{samples} samples of {len(signals)} signals"]

    def _repr_html_(self) -> str:
        return f"<p>{_escaped(repr(self))}</p>{self.signals.to_html()}"

    @property
    def signals(self) -> pd.DataFrame:
        """Each signal with its unit and its range, SI."""
        columns = ["name", "unit", "recorded_unit", "missing", "min", "mean", "max"]
        return pd.DataFrame(self.document.get("signals", []), columns=columns).set_index("name")

    @property
    def warnings(self) -> pd.DataFrame:
        """What is odd about it."""
        return pd.DataFrame(self.document["report"]["warnings"])

    def frame(self) -> pd.DataFrame:
        """All samples, in SI."""
        answer = self._client.request("GET", f"{self.path}/samples", headers={"Accept": "text/csv"})
        return pd.read_csv(io.StringIO(answer.text), index_col=0)

    def version(self, number: int | None = None) -> dict[str, Any]:
        """What a version of it marks as bad; the newest version where no number is given."""
        if number is None:
            number = self._client.get(self.path)["version"]
        version: dict[str, Any] = self._client.get(f"{self.path}/versions/{number}")
        return version

    def mark(self, from_s: float, to_s: float, reason: str, signals: list[str] | None = None) -> dict[str, Any]:
        """Marks a stretch as bad, in addition to what is marked: the new version, which jobs then leave out."""
        mark = {"from_s": from_s, "to_s": to_s, "reason": reason} | ({"signals": signals} if signals else {})
        newest = self.version()
        return self.mark_all([*newest["marks"], mark], based_on=newest["number"])

    def mark_all(self, marks: list[dict[str, Any]], based_on: int | None = None) -> dict[str, Any]:
        """Makes a version that marks just these stretches; none at all with an empty list."""
        body = {"marks": marks, "based_on": based_on}
        version: dict[str, Any] = self._client.post(f"{self.path}/versions", json=body)
        self.document["version"] = version["number"]
        return version

    def prepare(self, *steps: dict[str, Any], name: str | None = None, version: int | None = None) -> Dataset:
        """Makes another recording of it, step by step: `{"step": "cut", "from_s": 10}`, `{"step": "resample", …}`."""
        body = {"steps": list(steps), "name": name, "version": version}
        return Dataset(self._client, self._client.post(f"{self.path}/prepared", json=body))


class Stream(_Resource):
    """A recording that grows."""

    _path = "/v1/streams"

    def _facts(self) -> list[Any]:
        samples, signals = self.document.get("samples"), self.document.get("signals", [])
        return [f"{samples} samples of {len(signals)} signals"]

    @property
    def id(self) -> str:
        """The name, by which a stream is asked for."""
        return str(self.document["name"])

    def marks(self) -> dict[str, Any]:
        """What of it is marked as bad, with the number of these marks."""
        marks: dict[str, Any] = self._client.get(f"{self.path}/marks")
        return marks

    def mark(
        self, start: str | datetime, end: str | datetime, reason: str, signals: list[str] | None = None
    ) -> dict[str, Any]:
        """Marks a stretch as bad, in addition to what is marked: the new marks, which recordings that are cut out of
        it, windows of monitors and selections then do without. Instants have their zone."""
        stretch = {"from": _frames.instant(start), "to": _frames.instant(end)}
        mark = {**stretch, "reason": reason} | ({"signals": signals} if signals else {})
        newest = self.marks()
        return self.mark_all([*newest["marks"], mark], based_on=newest["number"])

    def mark_all(self, marks: list[dict[str, Any]], based_on: int | None = None) -> dict[str, Any]:
        """Marks just these stretches; none at all with an empty list."""
        body = {"marks": marks, "based_on": based_on}
        marked: dict[str, Any] = self._client.request("PUT", f"{self.path}/marks", json=body).json()
        return marked


class Job(_Resource):
    """A job."""

    _path = "/v1/jobs"

    @property
    def status(self) -> str:
        """Where it stood when it was last asked."""
        return str(self.document["status"])

    def wait(self, timeout_s: float | None = None) -> Job:
        """Returns when the job has ended; raises TimeoutError where that takes too long."""
        end = None if timeout_s is None else time.monotonic() + timeout_s
        while self.document["status"] not in _ENDED:
            if end is not None and time.monotonic() >= end:
                raise TimeoutError(f"{self.id} is still {self.status}")
            left = _WAIT_S if end is None else max(1, min(_WAIT_S, round(end - time.monotonic())))
            self.document = self._client.get(self.path, wait=left)
        return self

    def events(self, after: int = 0) -> Iterator[Event]:
        """The events of the job from the first on, live, until it has ended."""
        return self._client.follow(f"{self.path}/events", after)

    def result(self, timeout_s: float | None = None) -> Result:
        """The result, as soon as there is one; raises a Problem where the job came to none."""
        self.wait(timeout_s)
        return Result(self, self._client.get(f"{self.path}/result"))

    def cancel(self) -> Job:
        """Ends it; it keeps its best estimate so far."""
        self.document = self._client.post(f"{self.path}/cancel")
        return self

    def change(self, **words: Any) -> Job:
        """Changes what it is called: `name`, `labels` and `note`. What is left out stays, and None removes."""
        self.document = self._client.request("PATCH", self.path, json=words).json()
        return self


class Result:
    """What a job came to."""

    def __init__(self, job: Job, document: dict[str, Any]) -> None:
        self._job = job
        self.document = document

    @property
    def parameters(self) -> pd.DataFrame:
        """Estimates, standard errors and intervals, a row for each parameter."""
        return _frames.estimates(self.document["parameters"])

    def __repr__(self) -> str:
        trust, count = self.verdict["trust"], len(self.document["parameters"])
        return f"<Result of {self._job.id}: {count} parameters, trust {trust}>"

    def _repr_html_(self) -> str:
        reasons = "".join(f"<li>{_escaped(reason['detail'])}</li>" for reason in self.verdict["reasons"])
        return f"<p>{_escaped(repr(self))}</p>{self.parameters.to_html()}<ul>{reasons}</ul>"

    @property
    def verdict(self) -> dict[str, Any]:
        """How far to trust them, and why not."""
        verdict: dict[str, Any] = self.document["verdict"]
        return verdict

    @property
    def next_steps(self) -> pd.DataFrame:
        """What may be done about the reasons of the verdict, the gravest first, a row for each step."""
        return _frames.next_steps(self.verdict["reasons"])

    def again(self, patch: Mapping[str, Any], key: str | None = None) -> Job:
        """Submits the job again with a change, such as the `patch` of a next step."""
        client = self._job._client
        document = _patched(client.get(self._job.path)["spec"], patch)
        document.pop("note", None)
        headers = {"Idempotency-Key": key or str(uuid.uuid4())}
        return Job(client, client.post("/v1/jobs", json=document, headers=headers))

    def trajectory(self, experiment: int = 0, max_points: int = 2000) -> pd.DataFrame:
        """Measured and simulated outputs and residuals of an experiment."""
        path = f"{self._job.path}/trajectory"
        return _frames.trajectory(self._job._client.get(path, max_points=max_points))[experiment]

    def disturbance(self, experiment: int = 0, max_points: int = 2000) -> pd.DataFrame:
        """What acted on the plant beside its inputs, with its error; the result has process noise."""
        path = f"{self._job.path}/disturbance"
        return _frames.disturbance(self._job._client.get(path, max_points=max_points))[experiment]

    def plot(self, experiment: int = 0) -> Any:
        """Measured and simulated outputs, and below them what is left, in SI; the axes."""
        import matplotlib.pyplot as plt

        answer = self._job._client.get(f"{self._job.path}/trajectory", max_points=2000)
        frame = _frames.trajectory(answer)[experiment]
        units = {name: output["unit"] for name, output in answer["experiments"][experiment]["outputs"].items()}
        outputs = list(units)
        _, axes = plt.subplots(2 * len(outputs), 1, sharex=True, squeeze=False)
        for place, name in enumerate(outputs):
            above, below = axes[2 * place, 0], axes[2 * place + 1, 0]
            unit = f" [{units[name]}]"
            frame[name][["measured", "simulated"]].plot(ax=above, title=name, ylabel=f"{name}{unit}")
            frame[name]["residual"].plot(ax=below, ylabel=f"residual{unit}")
        axes[-1, 0].set_xlabel("time [s]")
        return axes[:, 0]


class Monitor(_Resource):
    """A stream that is watched."""

    _path = "/v1/monitors"

    def history(self) -> pd.DataFrame:
        """Each parameter over time with its intervals, a row for each window."""
        return _frames.history(list(self._pages("windows")))

    def alarms(self) -> pd.DataFrame:
        """What somebody should look at, the newest first."""
        return pd.DataFrame(list(self._pages("alarms")))

    def events(self, after: int = 0) -> Iterator[Event]:
        """Windows and alarms from the first on, and then as they come."""
        return self._client.follow(f"{self.path}/events", after)

    def plot(self) -> Any:
        """Each parameter over time with its intervals; the axes."""
        import matplotlib.pyplot as plt

        frame = self.history()
        units = {entry["name"]: entry["unit"] for window in self._pages("windows") for entry in window["parameters"]}
        names = list(units)
        _, axes = plt.subplots(max(len(names), 1), 1, sharex=True, squeeze=False)
        for axis, name in zip(axes[:, 0], names):
            known = frame[frame[(name, "estimate")].notna()]
            times, own = known[("window", "from")], known[name]
            axis.plot(times, own["estimate"], marker=".")
            lower, upper = (own[end].astype(float) for end in ("lower", "upper"))
            axis.fill_between(times, lower, upper, alpha=0.3)
            axis.set_ylabel(f"{name} [{units[name]}]")
        return axes[:, 0]

    def _pages(self, what: str) -> Iterator[dict[str, Any]]:
        token = None
        while True:
            params = {"limit": 500} if token is None else {"limit": 500, "page_token": token}
            page = self._client.get(f"{self.path}/{what}", **params)
            yield from page["items"]
            token = page["next_page_token"]
            if token is None:
                return
