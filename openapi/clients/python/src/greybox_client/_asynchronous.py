"""The client for programs that wait in an event loop: each call runs in a thread of its own."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any, TypeVar

from ._client import Client, Data, Dataset, Event, Job, Result

T = TypeVar("T")


class AsyncClient:
    """A server, as `Client` knows it; what a `Client` returns is awaited here."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.client = Client(*arguments, **options)

    async def __aenter__(self) -> AsyncClient:
        return self

    async def __aexit__(self, *_: object) -> None:
        await asyncio.to_thread(self.client.close)

    async def call(self, method: Callable[..., T], *arguments: Any, **options: Any) -> T:
        """Any method of the client or of what it returned: `await api.call(api.client.get, "/v1/models")`."""
        return await asyncio.to_thread(method, *arguments, **options)

    async def upload(self, data: Data, **options: Any) -> Dataset:
        """Stores a recording, as `Client.upload` does."""
        return await self.call(self.client.upload, data, **options)

    async def append(self, stream: str, data: Data, **options: Any) -> dict[str, Any]:
        """Adds samples to a stream, as `Client.append` does."""
        return await self.call(self.client.append, stream, data, **options)

    async def submit(self, model: Any, recording: Dataset | str, **options: Any) -> AsyncJob:
        """Submits a job, as `Client.submit` does."""
        return AsyncJob(self, await self.call(self.client.submit, model, recording, **options))

    async def job(self, id: str) -> AsyncJob:
        """A job by its identifier."""
        return AsyncJob(self, await self.call(self.client.job, id))


class AsyncJob:
    """A job that is awaited; `job` is the job as the client knows it."""

    def __init__(self, api: AsyncClient, job: Job) -> None:
        self._api = api
        self.job = job

    def __repr__(self) -> str:
        return f"<AsyncJob {self.job.id}: {self.job.status}>"

    async def wait(self, timeout_s: float | None = None) -> AsyncJob:
        """Returns when the job has ended; raises TimeoutError where that takes too long."""
        await self._api.call(self.job.wait, timeout_s)
        return self

    async def result(self, timeout_s: float | None = None) -> Result:
        """The result, as soon as there is one; raises a Problem where the job came to none."""
        return await self._api.call(self.job.result, timeout_s)

    async def cancel(self) -> AsyncJob:
        """Ends it; it keeps its best estimate so far."""
        await self._api.call(self.job.cancel)
        return self

    async def change(self, **words: Any) -> AsyncJob:
        """Changes what it is called: `name`, `labels` and `note`. What is left out stays, and None removes."""
        await self._api.call(self.job.change, **words)
        return self

    def events(self, after: int = 0) -> AsyncIterator[Event]:
        """The events of the job from the first on, live, until it has ended."""
        return _awaited(self.job.events(after))


async def _awaited(events: Iterator[Event]) -> AsyncIterator[Event]:
    """Events that a thread of their own reads; a fault of the thread is raised where they are awaited."""
    loop = asyncio.get_running_loop()
    queue: asyncio.Queue[Event | BaseException | None] = asyncio.Queue()
    left = threading.Event()

    def read() -> None:
        last: BaseException | None = None
        try:
            for event in events:
                if left.is_set():
                    return
                loop.call_soon_threadsafe(queue.put_nowait, event)
        except Exception as fault:
            last = fault
        if not left.is_set():
            loop.call_soon_threadsafe(queue.put_nowait, last)

    threading.Thread(target=read, daemon=True).start()
    try:
        while (item := await queue.get()) is not None:
            if isinstance(item, BaseException):
                raise item
            yield item
    finally:
        left.set()
