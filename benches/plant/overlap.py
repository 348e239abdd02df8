"""Nodes on one PostgreSQL whose failures overlap, whose connections are lost, and that store large recordings."""

import contextlib
import http.client
import os
import random
import signal
import subprocess
import threading
import time

from nodes import NODES, Plant, needs_postgres
from postgres import Way
from server import Server, job

# A node is found dead after five beats of a second.
LONGEST_TAKEOVER_S = 8
# How long a node stands still or is cut off: longer than until it is found dead.
OUT_S = 12
# A recording of two signals, 8 bytes a sample.
LARGE_SAMPLES = 4_000_000
# Clients that submit jobs beside it.
LARGE_CLIENTS = 64
# An event comes to another node within this time, where the node hears.
PROMPT_S = 0.5


class Takeovers(threading.Thread):
    """Looks after the jobs of nodes that have failed until other nodes have them."""

    def __init__(self, plant):
        super().__init__(daemon=True)
        self.plant, self.failed, self.held, self.took, self.is_over = plant, {}, {}, [], False
        self.start()

    def fails(self, life):
        self.failed[life] = time.monotonic()

    def run(self):
        while not self.is_over:
            with contextlib.suppress(AssertionError):
                self.look()
            time.sleep(0.05)

    def look(self):
        rows = self.plant.database.sql("select id, at_work_in from jobs where status = 'running' and at_work_in > 0")
        at_work = {identifier: int(life) for identifier, life in rows}
        now = time.monotonic()
        for identifier, life in list(self.held.items()):
            if at_work.get(identifier) != life:
                self.took.append(now - self.failed[life])
                del self.held[identifier]
        self.held.update((one, life) for one, life in at_work.items() if life in self.failed)

    def wait(self, limit=60):
        until = time.monotonic() + limit
        while self.held and time.monotonic() < until:
            time.sleep(0.1)
        self.is_over = True
        self.join()
        self.took += [limit] * len(self.held)


def overlap(options):
    """Kills, stops and cuts of nodes that overlap, and restarts of the database between them."""
    ways = []
    plant = Plant(options, ways=lambda port: ways.extend(Way(port) for _ in range(NODES)) or ways)
    takeovers, out, count, done = Takeovers(plant), set(), options.count or 40, {}

    def fail(number, what):
        node = plant.nodes[number]
        with contextlib.suppress(AssertionError, IndexError):
            takeovers.fails(plant.life(node))
        if what == "kill":
            node.process.kill()
        elif what == "still":
            node.process.send_signal(signal.SIGSTOP)
            time.sleep(OUT_S)
            node.process.send_signal(signal.SIGCONT)
        else:
            ways[number].is_open.clear()
            time.sleep(OUT_S)
            ways[number].is_open.set()
        node.process.wait(60)
        while True:
            # It does not start while the database is down; whatever starts it tries again.
            with contextlib.suppress(AssertionError):
                plant.renew(number)
                break
        out.discard(number)

    threads = []
    for _ in range(count):
        plant.wait(random.uniform(0.3, 2.5))
        what = random.choice(("kill", "kill", "still", "cut", "restart"))
        able = [number for number in range(NODES) if number not in out]
        if what == "restart":
            plant.database.stop(signal.SIGINT)
            plant.database.start()
        elif len(able) < 2:
            # Somebody has to see the failures.
            continue
        else:
            number = random.choice(able)
            out.add(number)
            threads.append(threading.Thread(target=fail, args=(number, what)))
            threads[-1].start()
        done[what] = done.get(what, 0) + 1
    for thread in threads:
        thread.join()
    takeovers.wait()
    took = sorted(takeovers.took) or [float("nan")]
    slow = sum(one > LONGEST_TAKEOVER_S for one in took)
    differ = other_bits(options, plant)
    good = plant.end(f"nodes_overlap: {done}; {len(took)} jobs taken over after a median of {took[len(took) // 2]:.1f} s, "
                     f"at the most {took[-1]:.1f} s, {slow} after more than {LONGEST_TAKEOVER_S} s; {differ}")
    return good and not slow and differ.startswith("0 of")


def other_bits(options, plant, at_most=8):
    """Works some of the jobs again on a server alone, and compares."""
    began = time.monotonic()
    while any(not reader.has_ended for reader in plant.readers.values()) and time.monotonic() - began < 180:
        time.sleep(0.2)
    seeds = {identifier: seed for seed, identifier in enumerate(plant.readers)}
    chosen = random.sample(sorted(seeds), min(at_most, len(seeds)))
    client = plant.nodes[0].client()
    results = {one: client.ask("GET", f"/v1/jobs/{one}/result")[1]["parameters"] for one in chosen}
    alone = Server(options, plant.folder, "--threads", "1")
    assert alone.start(), "a server did not start"
    client = alone.client()
    dataset, differ = client.store(400), 0
    for one in chosen:
        again = client.submit(job(dataset, 4000, seeds[one], refine=False))
        while client.show(again)["status"] not in ("succeeded", "failed"):
            time.sleep(0.1)
        differ += client.ask("GET", f"/v1/jobs/{again}/result")[1]["parameters"] != results[one]
    alone.kill()
    return f"{differ} of {len(chosen)} results have other bits than on a server alone"


def deaf(options):
    """The connections of a node are lost silently, and for 4 s it can make no other."""
    ways, count, waits = [], options.count or 5, []
    plant = Plant(options, ways=lambda port: ways.append(Way(port)) or [ways[0], port], number=2)
    for turn in range(count):
        plant.nodes[0].client().show("none")
        time.sleep(3)
        ways[0].is_open.clear()
        ways[0].lose()
        time.sleep(4)
        ways[0].is_open.set()
        waits.append(hears_after(plant, turn))
    ready = readiness(plant, ways[0])
    plant.close()
    print(f"nodes_deaf: {count} times 4 s; another node's events come within {PROMPT_S} s again "
          f"{', '.join(f'{wait:.1f}' for wait in waits)} s after; /readyz of a node cut off answers {ready}", flush=True)
    return max(waits) <= 5


def hears_after(plant, turn, limit=90):
    """How long it takes from now until what one node changes comes to the other at once [s]."""
    began = time.monotonic()
    while time.monotonic() - began < limit:
        identifier = plant.nodes[1].client().submit(job(plant.dataset, 300_000, turn))
        came = follow_to_its_end(plant, identifier)
        if came <= PROMPT_S:
            return time.monotonic() - began
    return limit


def follow_to_its_end(plant, identifier, timeout=5):
    """Cancels a job at one node; how long its end takes to the follower at the other [s]."""
    client = plant.nodes[0].client()
    connection = http.client.HTTPConnection(*client.address, timeout=timeout)
    cancelled = None
    try:
        connection.request("GET", f"/v1/jobs/{identifier}/events")
        answer = connection.getresponse()
        line = answer.readline()
        while answer.status == 200 and line and not line.startswith(b"event: end"):
            if line.startswith(b"event: state") and cancelled is None:
                cancelled = time.monotonic()
                plant.nodes[1].client().ask("POST", f"/v1/jobs/{identifier}/cancel")
            line = answer.readline()
        if answer.status == 200 and line and cancelled:
            return time.monotonic() - cancelled
    except OSError:
        pass
    finally:
        connection.close()
    plant.nodes[1].client().ask("POST", f"/v1/jobs/{identifier}/cancel")
    return timeout


def readiness(plant, way):
    """The longest of some answers of a node while nothing comes through to the database."""
    way.is_open.clear()
    worst, statuses = 0.0, set()
    for _ in range(8):
        began = time.monotonic()
        status, _, _ = plant.nodes[0].client().ask("GET", "/readyz", timeout=30)
        worst, statuses = max(worst, time.monotonic() - began), statuses | {status}
        time.sleep(0.3)
    way.is_open.set()
    return f"{sorted(statuses)} in {worst:.2f} s at the most"


def large(options):
    """Clients of one node submit jobs while another node stores recordings of 64 MB."""
    plant, count = Plant(options, number=2), options.count or 4
    recording = os.path.join(plant.folder, "recording.csv")
    with open(recording, "w") as file:
        file.write("time [s],force [N],position [m]\n")
        file.writelines(f"{k / 100},{k % 97},{k % 89}\n" for k in range(LARGE_SAMPLES))
    times = {False: [], True: []}
    for turn in range(2 * count):
        beside = turn % 2 == 1
        if beside:
            # Another recording each time.
            with open(recording, "a") as file:
                file.write(f"{(LARGE_SAMPLES + turn) / 100},1,1\n")
        times[beside] += submissions(plant, recording if beside else None)
    p50, p99 = ({one: sorted(took)[int(share * len(took))] for one, took in times.items()} for share in (0.5, 0.99))
    plant.close()
    print(f"nodes_large: submissions to another node take {1e3 * p50[False]:.1f} ms (median), {1e3 * p99[False]:.0f} ms "
          f"(p99); beside a recording of 64 MB {1e3 * p50[True]:.1f} and {1e3 * p99[True]:.0f} ms, "
          f"{max(times[True]):.2f} s at the most", flush=True)
    return p99[True] <= 1.5 * p99[False]


def submissions(plant, recording, seconds=8):
    """How long submissions take, while a recording is stored where there is one. Another process sends it: a thread
    of this one would hold up those that measure."""
    took, over = [], threading.Event()

    def submit(number):
        client = plant.nodes[1].client()
        while not over.is_set():
            began = time.monotonic()
            status, body, _ = client.ask("POST", "/v1/jobs", job(plant.dataset, 1, number))
            took.append(time.monotonic() - began)
            assert status == 202, status
            client.ask("POST", f"/v1/jobs/{body['id']}/cancel")

    threads = [threading.Thread(target=submit, args=(number,)) for number in range(LARGE_CLIENTS)]
    for thread in threads:
        thread.start()
    if recording is None:
        time.sleep(seconds)
    else:
        host, port = plant.nodes[0].address
        subprocess.run(["curl", "--silent", "--fail", "--output", os.devnull, "--header", "content-type: text/csv",
                        "--data-binary", f"@{recording}", f"http://{host}:{port}/v1/datasets"], check=True)
    over.set()
    for thread in threads:
        thread.join()
    return took


ALL = {f"nodes_{measure.__name__}": needs_postgres(measure) for measure in (overlap, deaf, large)}
