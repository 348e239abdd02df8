"""DataFrames to CSV, and answers of the server to DataFrames."""

from __future__ import annotations

import gzip
import importlib.util
import io
from collections.abc import Mapping
from datetime import datetime
from typing import Any

import pandas as pd

__all__ = ["disturbance", "estimates", "history", "instant", "next_steps", "packed", "timed", "to_csv", "trajectory"]


def timed(frame: pd.DataFrame, units: Mapping[str, str] | None = None, zone: str | None = None) -> pd.DataFrame:
    """The frame as the server takes it: times in the first column, a unit in brackets.

    The index is the time: instants with their zone or those of `zone`, durations, or numbers of seconds. Missing
    samples stay missing. Raises ValueError where instants have no zone, or a unit names no column.
    """
    units = dict(units or {})
    unknown = [name for name in units if name not in frame.columns]
    if unknown:
        raise ValueError(f"units name columns that are not there: {', '.join(map(str, unknown))}")
    index = frame.index
    if isinstance(index, pd.DatetimeIndex):
        if index.tz is None and zone is None:
            raise ValueError("the times have no zone; say it with tz='Europe/Berlin', or frame.tz_localize(...)")
        local = index.tz_localize(zone) if index.tz is None else index
        times, title = pd.Index(local.tz_convert("UTC")), "time"
    elif isinstance(index, pd.TimedeltaIndex):
        times, title = pd.Index(index.total_seconds()), "time [s]"
    elif pd.api.types.is_numeric_dtype(index):
        times, title = pd.Index(index), "time [s]"
    else:
        raise ValueError("the index is the time: instants, durations, or numbers of seconds")
    named = {name: f"{name} [{units[name]}]" if name in units else str(name) for name in frame.columns}
    table = frame.rename(columns=named).reset_index(drop=True)
    table.insert(0, title, times)
    return table


def instant(time: str | datetime) -> str:
    """An instant as the server takes it. Raises ValueError where it has no zone."""
    stamp = pd.Timestamp(time)
    if stamp.tzinfo is None:
        raise ValueError(f"{time} has no zone; write it with one, such as 2026-03-02T08:15:00Z")
    return str(stamp.tz_convert("UTC").isoformat())


def packed(table: pd.DataFrame) -> tuple[bytes, dict[str, str]]:
    """The bytes of a table with its times in the first column, and the headers that say what they are: Parquet where
    pyarrow is installed, else CSV packed by gzip."""
    if importlib.util.find_spec("pyarrow") is not None:
        buffer = io.BytesIO()
        table.to_parquet(buffer, engine="pyarrow", index=False)
        return buffer.getvalue(), {"Content-Type": "application/vnd.apache.parquet"}
    text = to_csv(table).encode()
    return gzip.compress(text, compresslevel=1), {"Content-Type": "text/csv", "Content-Encoding": "gzip"}


def to_csv(table: pd.DataFrame) -> str:
    """A table with its times in the first column as CSV; instants are written in UTC."""
    first = table.columns[0]
    if isinstance(table[first].dtype, pd.DatetimeTZDtype):
        table = table.assign(**{str(first): table[first].map(lambda instant: instant.isoformat())})
    return table.to_csv(index=False, lineterminator="\n")


def next_steps(reasons: list[dict[str, Any]]) -> pd.DataFrame:
    """The next steps of a verdict's reasons, a row for each; results of earlier servers have none."""
    steps = [{"code": reason["code"], **step} for reason in reasons for step in reason.get("next", [])]
    return pd.DataFrame(steps, columns=["code", "label", "why", "patch"])


def estimates(parameters: list[dict[str, Any]]) -> pd.DataFrame:
    """The parameters of a result, a row for each."""
    rows = []
    for known in parameters:
        interval = known.get("confidence_interval") or {}
        total = known.get("total_interval") or {}
        name = known["name"]
        if known.get("experiment") is not None:
            name = f"{name}[{known['experiment']}]"
        rows.append(
            {
                "parameter": name,
                "unit": known["unit"],
                "estimate": known["estimate"],
                "standard_error": known.get("standard_error"),
                "total_standard_error": known.get("total_standard_error"),
                "lower": interval.get("lower"),
                "upper": interval.get("upper"),
                "total_lower": total.get("lower"),
                "total_upper": total.get("upper"),
                "trust": known.get("trust"),
            }
        )
    return pd.DataFrame(rows).set_index("parameter") if rows else pd.DataFrame(rows)


def trajectory(answer: dict[str, Any]) -> dict[int, pd.DataFrame]:
    """Measured and simulated outputs and what is left, a frame for each experiment."""
    frames = {}
    for number, experiment in enumerate(answer["experiments"]):
        columns = {}
        for name, output in experiment["outputs"].items():
            for kind in ("measured", "simulated", "residual"):
                columns[(name, kind)] = output[kind]
        index = pd.Index(experiment["time_s"], name="time_s")
        frames[number] = pd.DataFrame(columns, index=index, dtype=float)
    return frames


def disturbance(answer: dict[str, Any]) -> dict[int, pd.DataFrame]:
    """The disturbances with their errors and t, a frame for each experiment. The columns have the names of the CSV."""
    prefixes = {"parameter": "", "state": "rate_of_", "output": "sensor_of_"}
    frames = {}
    for number, experiment in enumerate(answer["experiments"]):
        columns = {}
        for disturbance in experiment["disturbances"]:
            ((quantity, name),) = disturbance["acts_on"].items()
            for kind in ("value", "deviation", "t"):
                columns[(prefixes[quantity] + name, kind)] = disturbance[kind]
        index = pd.Index(experiment["time_s"], name="time_s")
        frames[number] = pd.DataFrame(columns, index=index, dtype=float)
    return frames


def history(windows: list[dict[str, Any]]) -> pd.DataFrame:
    """The windows of a monitor, a row for each: its beginning, what became of it, and for each
    parameter a column group of its estimate and its intervals."""
    rows = []
    for window in windows:
        row: dict[tuple[str, str], Any] = {
            ("window", "number"): window["number"],
            ("window", "from"): pd.Timestamp(window["from"]),
            ("window", "to"): pd.Timestamp(window["to"]),
            ("window", "status"): window["status"],
            ("window", "trust"): window.get("trust"),
        }
        for known in window.get("parameters", []):
            interval = known.get("confidence_interval") or {}
            row[(known["name"], "estimate")] = known["estimate"]
            row[(known["name"], "standard_error")] = known.get("standard_error")
            row[(known["name"], "lower")] = interval.get("lower")
            row[(known["name"], "upper")] = interval.get("upper")
        rows.append(row)
    frame = pd.DataFrame(rows)
    if rows:
        frame.columns = pd.MultiIndex.from_tuples([tuple(column) for column in frame.columns])
        frame = frame.sort_values(("window", "number")).reset_index(drop=True)
    return frame
