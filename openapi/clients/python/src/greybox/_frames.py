"""DataFrames to CSV, and answers of the server to DataFrames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

__all__ = ["disturbance", "estimates", "history", "next_steps", "to_csv", "trajectory"]


def to_csv(frame: pd.DataFrame, units: Mapping[str, str] | None = None) -> str:
    """The frame as the server takes it: times in the first column, a unit in brackets.

    The index is the time: instants with their zone, durations, or numbers of seconds. Missing samples
    stay missing. Raises ValueError where instants have no zone, or a unit names no column.
    """
    units = dict(units or {})
    unknown = [name for name in units if name not in frame.columns]
    if unknown:
        raise ValueError(f"units name columns that are not there: {', '.join(map(str, unknown))}")
    index = frame.index
    if isinstance(index, pd.DatetimeIndex):
        if index.tz is None:
            raise ValueError(
                "the times have no zone; say it with frame.tz_localize('Europe/Berlin')"
            )
        times = [instant.isoformat() for instant in index.tz_convert("UTC")]
        title = "time"
    elif isinstance(index, pd.TimedeltaIndex):
        times, title = index.total_seconds().tolist(), "time [s]"
    elif pd.api.types.is_numeric_dtype(index):
        times, title = index.tolist(), "time [s]"
    else:
        raise ValueError("the index is the time: instants, durations, or numbers of seconds")
    named = {name: f"{name} [{units[name]}]" if name in units else str(name) for name in frame.columns}
    text = frame.rename(columns=named).set_axis(pd.Index(times, name=title), axis=0)
    return text.to_csv(lineterminator="\n")


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
        frame.columns = pd.MultiIndex.from_tuples(frame.columns)
        frame = frame.sort_values(("window", "number")).reset_index(drop=True)
    return frame
