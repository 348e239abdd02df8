"""A greybox server from a notebook: DataFrames in, DataFrames and plots out.

>>> from greybox_client import Client
>>> api = Client("http://127.0.0.1:8080")
>>> recording = api.upload(frame, name="rig 4")
>>> job = api.submit("single_rod_servo", recording, estimate={"mass": (20, 120)})
>>> job.result().parameters
"""

from ._asynchronous import AsyncClient, AsyncJob
from ._client import Client, Dataset, Event, Job, Monitor, Problem, Result, Stream

__all__ = ["AsyncClient", "AsyncJob", "Client", "Dataset", "Event", "Job", "Monitor", "Problem", "Result", "Stream"]
