"""The regular users of `soak`: a mix of requests that processes of their own ask at a fixed rate.

A latency counts from the instant at which a request was due, so that a wait of one request counts for those that
were due meanwhile. The processes have a higher priority where the system allows that: users of a plant have
machines of their own, and do not wait for the processor of the server.
"""

import bisect
import collections
import contextlib
import itertools
import json
import math
import os
import random
import threading
import time
from array import array

from server import carriage, job
from wire import Wire, request

# Requests of one process that may be under way at once; each connection has a token of its own.
CONNECTIONS = 16
# How many of a hundred requests are of a kind.
SHARES = {"status": 40, "list": 15, "result": 18, "append": 18, "recordings": 5, "recording": 2, "events": 1.5,
          "submit": 0.5}
EXPECTED = {"append": (200, 201), "recording": (200, 201), "remove": (204,), "submit": (202,)}
# Recordings that a process keeps before it removes the oldest.
KEPT_RECORDINGS = 20
# How long the answers to the requests of a phase are waited for after its end.
LATEST_ANSWER_S = 60
# How long a server may say nothing on an event stream.
SILENCE_S = 40
# A request that could not be sent for so long is given up, so that what has piled up in one phase is not counted in
# the next; and after so much less where the phase is over in which it was due.
PATIENCE_S, PATIENCE_AFTER_PHASE_S = 10, 1
HIGHER_PRIORITY = -5


def small_job(dataset, generations=3, seed=1):
    """A job that takes a few milliseconds."""
    spec = job(dataset, generations, seed, refine=False, further_searches=0)
    spec["parameters"].update(coulomb_friction={"value": 0}, offset={"value": 0})
    spec["process_noise"] = "none"
    return spec


class Mix:
    """What the users of one process ask."""

    def __init__(self, plan, number):
        self.plan, self.number, self.random = plan, number, random.Random(number)
        self.ended, self.submitted = plan["ended"], collections.deque(maxlen=50)
        self.recordings, self.count = collections.deque(), itertools.count(1)
        self.began = time.time()
        self.stream = f"/v1/streams/rig-{number}?keep_s=600&time_unit=s"

    def kind(self):
        kind = self.random.choices(list(SHARES), SHARES.values())[0]
        full = kind == "recording" and len(self.recordings) > KEPT_RECORDINGS
        return "remove" if full else kind

    def text(self, kind, token):
        """A request of a kind."""
        if kind == "status":
            return request("GET", f"/v1/jobs/{self.watched()}", token)
        if kind == "list":
            return request("GET", "/v1/jobs?limit=10", token)
        if kind == "recordings":
            return request("GET", "/v1/datasets?limit=10", token)
        if kind in ("result", "events"):
            return request("GET", f"/v1/jobs/{self.ended}/{kind}", token)
        if kind == "remove":
            return request("DELETE", f"/v1/datasets/{self.recordings.popleft()}", token)
        if kind == "append":
            return request("POST", self.stream, token, self.batch(), "text/csv")
        number = next(self.count)
        if kind == "recording":
            body = carriage(50 + number % 200) + f"9999,{number},{self.number}\n"
            return request("POST", "/v1/datasets", token, body.encode(), "text/csv")
        body = json.dumps(small_job(self.plan["dataset"], seed=number)).encode()
        return request("POST", "/v1/jobs", token, body, "application/json")

    def watched(self):
        """The job whose status is asked for: one that was submitted, or the long one."""
        return self.random.choice(self.submitted) if self.submitted else self.plan["long"]

    def batch(self):
        """Five samples that follow those of the batch before."""
        number = next(self.count)
        instants = (self.began + (5 * number + k) / 1000 for k in range(5))
        rows = (f"{instant:.3f},{number % 7},{number % 11}" for instant in instants)
        return ("time,force [N],position [m]\n" + "\n".join(rows) + "\n").encode()

    def note(self, kind, body):
        """Takes over what an answer tells; answers what is wrong with it, if anything."""
        if kind == "submit":
            self.submitted.append(json.loads(body)["id"])
        elif kind == "recording":
            self.recordings.append(json.loads(body)["id"])
        elif kind == "status" and b'"status":"succeeded"' in body:
            self.ended = json.loads(body)["id"]
        elif kind == "status" and b'"status":"failed"' in body:
            return "a job failed"
        elif kind == "events" and b"event: end" not in body:
            return "events without an end"
        return None


class Tally:
    """Latencies [s] and faults of one phase."""

    def __init__(self):
        self.latencies, self.faults, self.example = array("f"), collections.Counter(), b""

    def fault(self, kind, reason, body=b""):
        self.faults[f"{kind}: {reason}"] += 1
        self.example = self.example or bytes(body[:300])


class Users:
    """The users of one process, which ask `rate` requests a second, or as many as they can where that is 0."""

    def __init__(self, plan, number, rate, phases):
        self.plan, self.rate, self.phases, self.number = plan, rate, phases, number
        self.mix, self.arrivals = Mix(plan, number), itertools.count()
        self.tallies = [Tally() for _ in phases]
        self.ends = [end for _, end in phases]
        self.offset = number / plan["processes"]

    def due(self, arrival):
        """The instant at which a request is due."""
        if not self.rate:
            return time.monotonic()
        return self.phases[0][0] + (arrival + self.offset) / self.rate

    def place(self, instant):
        """The number of the phase that an instant is in."""
        return min(bisect.bisect_right(self.ends, instant), len(self.ends) - 1)

    def tally(self, instant):
        return self.tallies[self.place(instant)]

    def is_given_up(self, due):
        """Whether a request is too late to be sent; it counts as a fault and with its wait so far."""
        now, place = time.monotonic(), self.place(due)
        patience = PATIENCE_AFTER_PHASE_S if now > self.ends[place] else PATIENCE_S
        if now - due <= patience:
            return False
        self.tallies[place].fault("any", "given up")
        self.tallies[place].latencies.append(now - due)
        return True

    def ask(self, token):
        """Asks one request after the other over one connection."""
        wire, used = Wire(self.plan["address"]), 0.0
        while (due := self.due(next(self.arrivals))) < self.phases[-1][1]:
            time.sleep(max(0.0, due - time.monotonic()))
            if self.is_given_up(due):
                continue
            # The server lets a connection go that was idle for half a minute.
            if time.monotonic() - used > 10:
                wire.close()
            try:
                kind = self.mix.kind()
                status, body = wire.ask(self.mix.text(kind, token))
                used, tally = time.monotonic(), self.tally(due)
                is_expected = status in EXPECTED.get(kind, (200,))
                fault = self.mix.note(kind, body) if is_expected else f"status {status}"
            except Exception as error:  # A fault of any kind counts, and the next request follows.
                used, tally, fault, body = time.monotonic(), self.tally(due), repr(error), b""
            if fault:
                tally.fault(kind, fault, body)
            tally.latencies.append(used - due)
        wire.close()

    def follow(self, token):
        """Reads the events of the long job without an end, and looks whether one is missing."""
        last, wire = 0, Wire(self.plan["address"], timeout=SILENCE_S)
        while time.monotonic() < self.phases[-1][1]:
            try:
                wire.send(request("GET", f"/v1/jobs/{self.plan['long']}/events", token,
                                  headers=[f"last-event-id: {last}"]))
                for text in lines(wire):
                    if text.startswith(b"id: "):
                        if int(text[4:]) != last + 1:
                            self.tally(time.monotonic()).fault("reader", f"event {int(text[4:])} after {last}")
                        last = int(text[4:])
                    if time.monotonic() > self.phases[-1][1]:
                        break
            except (OSError, ValueError) as error:
                self.tally(time.monotonic()).fault("reader", repr(error))
                time.sleep(1)
            wire.close()

    def expected(self, place):
        """Requests that are due in a phase."""
        first = self.phases[0][0]
        begin, end = (max(0, math.ceil((at - first) * self.rate - self.offset)) for at in self.phases[place])
        return end - begin

    def report(self, pipe):
        """Sends the tally of each phase when its requests are answered."""
        for place, ((_, end), tally) in enumerate(zip(self.phases, self.tallies)):
            time.sleep(max(0.0, end - time.monotonic()))
            while len(tally.latencies) < self.expected(place) and time.monotonic() < end + LATEST_ANSWER_S:
                time.sleep(0.05)
            # A number of seconds that is rounded may put one request in the next phase.
            if (missing := self.expected(place) - len(tally.latencies)) > 1:
                tally.faults["no answer in time"] += missing
            pipe.send((place, tally.latencies.tobytes(), dict(tally.faults), tally.example))
            tally.latencies = array("f")


def lines(wire):
    """The lines of an event stream, without its chunks' sizes."""
    rest = b""
    while b"\r\n\r\n" not in wire.buffer:
        wire.receive()
    if not wire.buffer.startswith(b"HTTP/1.1 200"):
        raise ConnectionError(bytes(wire.buffer[:60]).decode(errors="replace"))
    del wire.buffer[:wire.buffer.index(b"\r\n\r\n") + 4]
    while (size := int(wire.line(), 16)) > 0:
        *whole, rest = (rest + wire.exactly(size + 2)[:-2]).split(b"\n")
        yield from whole
    raise ConnectionError("the event stream ended")


def run(plan, number, rate, phases, pipe):
    """The life of one process of users."""
    with contextlib.suppress(PermissionError):
        os.nice(HIGHER_PRIORITY)
    users = Users(plan, number, rate, phases)
    tokens = plan["tokens"][number * CONNECTIONS:(number + 1) * CONNECTIONS]
    threads = [threading.Thread(target=users.ask, args=(token,), daemon=True) for token in tokens]
    if number == 0 and rate:
        threads.append(threading.Thread(target=users.follow, args=(tokens[0],), daemon=True))
    for thread in threads:
        thread.start()
    users.report(pipe)
    os._exit(0)
