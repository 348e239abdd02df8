"""The kinds of a neighbour that asks too much of a server, each in processes of its own with a lower priority.

On a machine of their own these processes would take nothing of the server's processor; where all share one machine,
`os.nice` keeps what they take themselves from being counted against the server.
"""

import contextlib
import itertools
import json
import os
import random
import secrets
import select
import socket
import struct
import threading
import time
from collections import Counter

import hostile
from regular import small_job
from server import carriage, job
from wire import Wire, request

PROCESSES = 2
LOWER_PRIORITY = 10
# The address that the neighbour asks from; guesses come from the address of the regular users.
ADDRESS, ADDRESS_OF_USERS = "127.0.0.2", None
# Samples of a large recording: 12 MB as CSV.
LARGE_SAMPLES = 420_000
# Generations of an ended job whose events are many.
EVENTFUL_GENERATIONS = 5000
# Requests that are sent together on a connection.
TOGETHER = 20
# The share of a phase in which jobs are submitted; then all of them are cancelled.
SUBMITTING_SHARE = 0.6
READERS, SLOW_CLIENTS, STREAMS = 200, 500, 500
RECEIVED_BYTES = 4096
# Few, so that a network of a plant carries thousands of them in a second.
BROKEN_BODY_BYTES = 8000
RESETS = struct.pack("ii", 1, 0)
EXPENSIVE_DESIGN = {
    "model": "positioning_drive",
    "parameters": {"mass": {"estimate": {}, "prior": {"mean": 95, "std": 10}},
                   "viscous_friction": {"estimate": {}, "prior": {"mean": 200, "std": 50}},
                   "coulomb_friction": {"value": 20, "tolerance": "10 %"}, "offset": {"value": 0}},
    "initial_state": {"position": 0, "velocity": 0},
    "outputs": {"position": {"noise_std": 1e-4}},
    "inputs": {"force": {"lower": -100, "upper": 100, "rate_per_s": 2000}},
    "sample_time_s": 0.02, "duration_s": 60, "points": 6,
}


class Neighbour:
    """What one process of the neighbour has: its tokens, what its project keeps, and a count of its answers."""

    def __init__(self, plan, until):
        self.address, self.tokens, self.kept = plan["address"], plan["neighbour_tokens"], plan["kept"]
        self.token, self.began, self.until, self.answers = self.tokens[0], time.monotonic(), until, Counter()

    def goes_on(self):
        return time.monotonic() < self.until

    def count(self, statuses):
        self.answers.update(status or "broken off" for status in statuses)

    def connections(self, count, work):
        """Does the work over so many connections until the time is up."""
        def works(number):
            wire = Wire(self.address, ADDRESS, timeout=30)
            while self.goes_on():
                with contextlib.suppress(OSError):
                    work(wire, number)
            wire.close()

        threads = [threading.Thread(target=works, args=(number,), daemon=True) for number in range(count)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(max(0.0, self.until + 1 - time.monotonic()))

    def post(self, wire, path, document):
        body = json.dumps(document).encode()
        status, answer = wire.ask(request("POST", path, self.token, body, "application/json"))
        self.count([status])
        return status, answer


def reads(neighbour):
    """Floods of status and list reads over many connections."""
    paths = ["/v1/jobs?limit=50", f"/v1/jobs/{neighbour.kept['job']}", "/v1/datasets?limit=50", "/v1/models",
             f"/v1/jobs/{neighbour.kept['job']}/result"]
    texts = [request("GET", path, neighbour.token) for path in paths]

    def work(wire, _):
        neighbour.count(wire.pipelined(random.choices(texts, k=TOGETHER)))

    neighbour.connections(50, work)


def submissions(neighbour):
    """Floods of submissions until the queue of the project is full, and cancels."""
    seeds, submitted = itertools.count(1), []
    until = neighbour.began + SUBMITTING_SHARE * (neighbour.until - neighbour.began)

    def work(wire, number):
        if time.monotonic() < until:
            spec = small_job(neighbour.kept["small"], 300, next(seeds))
            status, answer = neighbour.post(wire, "/v1/jobs", spec)
            if status == 202:
                submitted.append(json.loads(answer)["id"])
            cancelled = submitted.pop() if status == 429 and submitted else None
        elif submitted:
            cancelled = submitted.pop()
        else:
            cancelled = time.sleep(0.1)
        if cancelled:
            # All tokens of the project cancel at the end, so that no job of a phase is left for the next phase.
            token = neighbour.token if time.monotonic() < until else neighbour.tokens[number % len(neighbour.tokens)]
            status, _ = wire.ask(request("POST", f"/v1/jobs/{cancelled}/cancel", token))
            neighbour.count([status])
            if status == 429:
                submitted.append(cancelled)

    neighbour.connections(10, work)


def recordings(neighbour):
    """Large recordings stored and deleted without an end."""
    large, numbers = neighbour.kept["csv"], itertools.count()

    def work(wire, _):
        neighbour.count(["asked"])
        body = large + f"99999,{next(numbers)},{os.getpid()}\n".encode()
        status, answer = wire.ask(request("POST", "/v1/datasets", neighbour.token, body, "text/csv"))
        neighbour.count([status])
        if status in (200, 201):
            status, _ = wire.ask(request("DELETE", f"/v1/datasets/{json.loads(answer)['id']}", neighbour.token))
            neighbour.count([status])

    neighbour.connections(4, work)


def hostile_bodies(neighbour):
    """Bodies that were made to cost much."""
    def work(wire, _):
        neighbour.count([wire.ask(random.choice(neighbour.kept["hostile"]))[0]])

    neighbour.connections(8, work)


def hold(neighbour, count, texts, trickle=None):
    """Holds connections open on each of which a text was sent and a trickle follows; opens those again that ended."""
    poll, held = select.poll(), {}
    while neighbour.goes_on():
        while len(held) < count and neighbour.goes_on():
            with contextlib.suppress(OSError):
                connection = socket.socket()
                connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVED_BYTES)
                connection.bind((ADDRESS, 0))
                connection.connect(neighbour.address)
                connection.send(next(texts))
                neighbour.count(["opened"])
                held[connection.fileno()] = connection
                poll.register(connection, select.POLLRDHUP)
        time.sleep(0.5)
        ended = {number for number, _ in poll.poll(0)}
        for number, connection in held.items():
            try:
                if trickle and number not in ended:
                    connection.send(trickle)
            except OSError:
                ended.add(number)
        for number in ended:
            poll.unregister(number)
            held.pop(number).close()
            neighbour.count(["ended by the server"])
    for connection in held.values():
        connection.close()


def readers(neighbour):
    """Readers of a large answer that do not read."""
    path = f"/v1/datasets/{neighbour.kept['large']}/samples"
    text = request("GET", path, neighbour.token, headers=["accept: text/csv"])
    hold(neighbour, READERS // PROCESSES, itertools.repeat(text))


def trickles(neighbour):
    """Slow clients whose heads and bodies come by the byte."""
    head = b"GET /v1/jobs HTTP/1.1\r\nhost: 127.0.0.1\r\nx-a: "
    bodies = [(path, kind, request("POST", path, neighbour.token, b"1" * 60_000, kind)[:-59_999])
              for path, kind in (("/v1/jobs", "application/json"), ("/v1/datasets", "text/csv"))]
    texts = itertools.cycle([head, *(text for *_, text in bodies)])
    hold(neighbour, SLOW_CLIENTS // PROCESSES, texts, b"1")


def streams(neighbour):
    """Event streams opened and not read."""
    paths = [f"/v1/jobs/{neighbour.kept['job']}/events", "/v1/events"]
    texts = itertools.cycle([request("GET", path, neighbour.token) for path in paths])
    hold(neighbour, STREAMS // PROCESSES, texts)


def guesses(neighbour):
    """Wrong tokens and attempts to sign in, from the address of the regular users."""
    def work(wire, number):
        wire.source = ADDRESS_OF_USERS
        tokens = [f"gbx_{secrets.token_hex(32)}" for _ in range(TOGETHER)]
        if number % 2:
            neighbour.count(wire.pipelined([request("GET", "/v1/jobs", token) for token in tokens]))
            return
        for token in tokens:
            body = json.dumps({"token": token}).encode()
            neighbour.count([wire.ask(request("POST", "/v1/session", None, body, "application/json"))[0]])

    neighbour.connections(16, work)


def computations(neighbour):
    """Expensive simulations, designs and checks of jobs without an end."""
    simulation = {"model": "positioning_drive", "dataset": neighbour.kept["large"],
                  "parameters": {"mass": 2, "viscous_friction": 3, "coulomb_friction": 0, "offset": 0},
                  "initial_state": {"position": 0, "velocity": 0}}
    asked = [("/v1/simulations", simulation), ("/v1/designs", EXPENSIVE_DESIGN),
             ("/v1/jobs?validate_only=true", job(neighbour.kept["large"], 1000, 1, 30))]

    def work(wire, number):
        neighbour.count(["asked"])
        neighbour.post(wire, *asked[number % len(asked)])

    neighbour.connections(12, work)


def breaks(neighbour):
    """Connections opened and closed at once, and requests broken off in the middle of the body."""
    body = neighbour.kept["csv"][:BROKEN_BODY_BYTES]
    whole = [request("POST", "/v1/datasets", neighbour.token, body, "text/csv"),
             request("POST", "/v1/jobs", neighbour.token, body, "application/json")]

    def work(wire, number):
        wire.open()
        # A connection that is reset leaves no port in use.
        wire.socket.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESETS)
        if number % 2:
            text = random.choice(whole)
            wire.send(text[:len(text) // 2])
        wire.close()
        neighbour.count(["broken off by the client"])

    neighbour.connections(10, work)


KINDS = {
    "floods of reads": reads,
    "floods of jobs": submissions,
    "large recordings": recordings,
    "hostile bodies": hostile_bodies,
    "unread answers": readers,
    "slow clients": trickles,
    "unread streams": streams,
    "wrong tokens": guesses,
    "computations": computations,
    "broken requests": breaks,
}


def prepare(client, token):
    """Stores what the neighbour asks for."""
    small, large = client.store(60), carriage(LARGE_SAMPLES)
    status, stored, _ = client.ask("POST", "/v1/datasets", large, {"content-type": "text/csv"})
    assert status == 201, stored
    ended = client.submit(small_job(small, EVENTFUL_GENERATIONS))
    assert client.ended(ended)["status"] == "succeeded"
    return {"small": small, "large": stored["id"], "job": ended, "csv": large.encode(),
            "hostile": hostile.requests(token, small)}


def run(plan, kind, until, pipe):
    """The life of one process of the neighbour."""
    os.nice(LOWER_PRIORITY)
    neighbour = Neighbour(plan, until)
    KINDS[kind](neighbour)
    pipe.send(dict(neighbour.answers))
    os._exit(0)
