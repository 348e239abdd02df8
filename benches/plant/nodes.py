"""Three servers on one PostgreSQL, and what befalls them."""

import contextlib
import http.client
import random
import signal
import tempfile
import threading
import time

import postgres
from postgres import Postgres, Way
from server import Server, job

NODES = 3
SLICE_S = 0.5
# Beyond this a client gives a connection up and asks another node.
PATIENCE_S = 5
# So many jobs are at work or wait all the time.
UNFINISHED = 6
# A job of some seconds.
GENERATIONS = 4000


class Reader(threading.Thread):
    """Follows a job's events, at another node whenever a connection ends, to the last event."""

    def __init__(self, plant, identifier):
        super().__init__(daemon=True)
        self.plant, self.identifier, self.seen, self.faults, self.has_ended = plant, identifier, 0, 0, False

    def run(self):
        while not (self.has_ended or self.plant.over):
            self.follow(random.choice(self.plant.nodes))

    def follow(self, node):
        client = node.client()
        try:
            connection = client.connection = http.client.HTTPConnection(*client.address, timeout=PATIENCE_S)
            connection.request("GET", f"/v1/jobs/{self.identifier}/events",
                               headers={"last-event-id": str(self.seen)})
            answer = connection.getresponse()
            until = time.monotonic() + random.uniform(0.5, 4)
            while answer.status == 200 and time.monotonic() < until:
                line = answer.readline()
                if not line:
                    break
                if line.startswith(b"id: "):
                    number = int(line[4:])
                    self.faults += number != self.seen + 1
                    self.seen = number
                if line.startswith(b"event: end"):
                    self.has_ended = True
        except Exception:
            time.sleep(0.05)
        finally:
            client.close()


class Plant:
    """Three nodes, jobs that come all the time, each with a key, and a reader for each."""

    def __init__(self, options, ways=None, environments=None, slice_s=SLICE_S, number=NODES, **settings):
        self.options, self.stack = options, contextlib.ExitStack()
        self.database = Postgres(**settings)
        self.ways, self.environments, self.slice_s = ways or (lambda port: [port] * NODES), environments or {}, slice_s
        self.ports = self.ways(self.database.port)
        self.folder = self.stack.enter_context(tempfile.TemporaryDirectory())
        self.nodes = [self.node(place) for place in range(number)]
        self.readers, self.over, self.refused = {}, False, {}
        self.dataset = self.nodes[0].client().store(400)

    def node(self, number):
        port = self.ports[number]
        port = port.port if isinstance(port, Way) else port
        node = Server(self.options, self.folder, "--threads", "1", "--slice-s", str(self.slice_s),
                      url=self.database.url(port=port), environment=self.environments.get(number))
        node.number = number
        assert node.start(), "a node did not start"
        return node

    def submit(self, generations=GENERATIONS):
        """Submits a job with a key to one node after the other until it is acknowledged."""
        key = f"job {len(self.readers)}"
        seed = len(self.readers)
        while True:
            client = random.choice(self.nodes).client()
            status, body, _ = client.ask("POST", "/v1/jobs", job(self.dataset, generations, seed, refine=False),
                                         {"idempotency-key": key}, timeout=PATIENCE_S)
            client.close()
            self.refused[status] = self.refused.get(status, 0) + 1
            if status == 202:
                reader = self.readers[body["id"]] = Reader(self, body["id"])
                reader.start()
                return body["id"]
            time.sleep(0.05)

    def keep_busy(self):
        while sum(not reader.has_ended for reader in self.readers.values()) < UNFINISHED:
            self.submit()

    def wait(self, seconds):
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            self.keep_busy()
            time.sleep(0.1)

    def life(self, node):
        return int(self.database.number(f"select life from nodes where name like '%:{node.process.pid}'"))

    def goes_on(self, limit=60):
        """How long it takes until a slice writes an event [s]."""
        began, before = time.monotonic(), None
        while time.monotonic() - began < limit:
            with contextlib.suppress(AssertionError):
                now = self.database.number("select sum(last_event) from jobs")
                if before is not None and now > before:
                    return time.monotonic() - began
                before = now if before is None else before
            time.sleep(0.05)
        return limit

    def dead(self):
        return int(self.database.number("select count(*) from nodes where state = 'dead'"))

    def renew(self, number):
        """Ends what is left of a node and starts it anew."""
        old = self.nodes[number]
        old.process.wait(60)
        old.process.stdout.close()
        self.nodes[number] = self.node(number)

    def close(self):
        for node in self.nodes:
            node.kill()
        self.database.remove()
        self.stack.close()

    def end(self, what):
        """Waits for all jobs; says what was lost, made twice or told wrongly."""
        began = time.monotonic()
        while any(not reader.has_ended for reader in self.readers.values()) and time.monotonic() - began < 180:
            time.sleep(0.2)
        self.over = True
        there = {row[0]: row[1] for row in self.database.sql("select id, status from jobs")}
        lost = sum(identifier not in there for identifier in self.readers)
        unfinished = sum(there.get(identifier) != "succeeded" for identifier in self.readers)
        results = int(self.database.number("select count(*) from results"))
        untold = sum(not reader.has_ended for reader in self.readers.values())
        faults = sum(reader.faults for reader in self.readers.values())
        self.close()
        twice = len(there) - len(self.readers)
        print(f"{what}; of {len(self.readers)} acknowledged jobs {lost} lost, {unfinished} not succeeded, {twice} "
              f"made twice, {results} results; {faults} gaps or repeats in events, {untold} without an end; "
              f"answers to submissions {self.refused}", flush=True)
        return not (lost or unfinished or twice or faults or untold or 500 in self.refused
                    or results != len(self.readers))


def kills(options):
    """kill -9 of one node after the other."""
    plant, count, waits = Plant(options), options.count or 200, []
    for turn in range(count):
        plant.wait(random.uniform(0.5, 2))
        number = random.randrange(NODES)
        node = plant.nodes[number]
        life = plant.life(node)
        node.process.kill()
        at_work = [row[0] for row in plant.database.sql(f"select id from jobs where at_work_in = {life}")]
        began = time.monotonic()
        plant.renew(number)
        held = " or ".join(f"id = '{own}' and at_work_in = {life} and status = 'running'" for own in at_work)
        while at_work and plant.database.number(f"select count(*) from jobs where {held}"):
            plant.keep_busy()
            time.sleep(0.05)
        waits += [time.monotonic() - began] if at_work else []
    waits.sort()
    longest = waits[-1] if waits else float("nan")
    good = plant.end(f"nodes_kills: {count}, {len(waits)} met a job at work; taken over after a median of "
                     f"{waits[len(waits) // 2]:.1f} s, at the most {longest:.1f} s")
    return good and longest <= 8


def database(options):
    """The database is restarted, fails and stands still."""
    plant, said = Plant(options), []
    for what in ("restarted", "failed", "stood still 10 s"):
        worst = 0.0
        for _ in range(options.count or 3):
            plant.wait(3)
            if what == "stood still 10 s":
                plant.database.signal(signal.SIGSTOP)
                time.sleep(10)
                plant.database.signal(signal.SIGCONT)
            else:
                plant.database.stop(signal.SIGINT if what == "restarted" else signal.SIGKILL)
                time.sleep(0.5)
                plant.database.start()
            worst = max(worst, plant.goes_on())
        said.append((what, worst))
    dead = plant.dead()
    alive = all(node.process.poll() is None for node in plant.nodes)
    figures = ", ".join(f"{what}: slices go on after {worst:.1f} s" for what, worst in said)
    good = plant.end(f"nodes_database: {figures}; {dead} nodes declared dead")
    return good and alive and dead == 0 and all(worst <= 5 for _, worst in said)


def still(options):
    """A node stands still for 15 s and goes on."""
    plant, count, longest = Plant(options), options.count or 5, 0.0
    for turn in range(count):
        plant.wait(2)
        number = turn % NODES
        node = plant.nodes[number]
        node.process.send_signal(signal.SIGSTOP)
        longest = max(longest, plant.goes_on())
        plant.wait(15)
        node.process.send_signal(signal.SIGCONT)
        plant.renew(number)
    dead = plant.dead()
    return plant.end(f"nodes_still: {count} times 15 s, {dead} declared dead; others wrote again after at the most "
                     f"{longest:.1f} s") and dead == count


def cut(options):
    """A node is cut off from the database for 20 s: nothing comes through, nothing breaks off."""
    way, count = [], options.count or 5
    plant = Plant(options, ways=lambda port: way.append(Way(port)) or [way[0], port, port])
    for _ in range(count):
        plant.wait(3)
        way[0].is_open.clear()
        plant.wait(20)
        way[0].is_open.set()
        plant.renew(0)
    dead = plant.dead()
    return plant.end(f"nodes_cut: {count} times 20 s, {dead} declared dead") and dead == count


def failover(options):
    """The database's machine fails and its synchronous standby takes its place."""
    way, count, worst, good = [], options.count or 2, 0.0, True
    for turn in range(count):
        plant = Plant(options, ways=lambda port: way.append(Way(port)) or [way[-1]] * NODES)
        standby = Postgres(of=plant.database)
        plant.database.sql("alter system set synchronous_standby_names = 'standby'", "postgres")
        plant.database.sql("select pg_reload_conf()", "postgres")
        while not plant.database.number("select count(*) from pg_stat_replication where sync_state = 'sync'"):
            time.sleep(0.1)
        plant.wait(4)
        plant.database.stop(signal.SIGKILL)
        standby.run("pg_ctl", "promote", "-D", standby.data)
        standby.sql("alter system set synchronous_standby_names = ''", "postgres")
        standby.sql("select pg_reload_conf()", "postgres")
        way[-1].lead_to(standby.port)
        plant.database.remove()
        plant.database = standby
        worst = max(worst, plant.goes_on())
        plant.wait(3)
        dead = plant.dead()
        good = plant.end(f"nodes_failover {turn + 1}: slices go on after {worst:.1f} s, {dead} declared dead") and good
    return good


def clock(options):
    """The clock of one node is a minute ahead, or behind."""
    if not options.faketime:
        print("nodes_clock: NOT MEASURED: --faketime names no libfaketime")
        return True
    rates, good = {}, True
    for shift in ("+0", "-60", "+60"):
        environment = {"LD_PRELOAD": options.faketime, "FAKETIME": shift, "DONT_FAKE_MONOTONIC": "1",
                       "FAKETIME_DONT_FAKE_MONOTONIC": "1"}
        plant = Plant(options, environments={0: environment}, slice_s=0.2)
        plant.wait(3)
        before, began = plant.database.number("select sum(epoch) from jobs"), time.monotonic()
        plant.wait(20)
        slices = plant.database.number("select sum(epoch) from jobs") - before
        rates[shift] = slices / (time.monotonic() - began)
        dead = plant.dead()
        good = plant.end(f"nodes_clock {shift} s: {rates[shift]:.1f} slices a second, {dead} declared dead") and good
    return good and all(abs(rate / rates["+0"] - 1) <= 0.1 for rate in rates.values())


def exhausted(options):
    """Others take all connections of the database."""
    plant = Plant(options)
    plant.wait(3)
    plant.database.sql("alter database greybox connection limit 1", "postgres")
    answers, unsaid = {}, 0
    until = time.monotonic() + 15
    while time.monotonic() < until:
        # Connections that the nodes have break off, and no others are to be had.
        plant.database.sql("select pg_terminate_backend(pid) from pg_stat_activity where datname = 'greybox' "
                           "and pid <> pg_backend_pid()", "postgres")
        for node in plant.nodes:
            for path in ("/v1/jobs?limit=5", "/readyz"):
                client = node.client()
                status, _, headers = client.ask("GET", path, timeout=30)
                answers[status] = answers.get(status, 0) + 1
                unsaid += status == 503 and path != "/readyz" and "retry-after" not in headers
                client.close()
    plant.database.sql("alter database greybox connection limit -1", "postgres")
    back = plant.goes_on()
    plant.wait(2)
    good = plant.end(f"nodes_exhausted: answers while no connection is free {answers}, {unsaid} without Retry-After; "
                     f"slices go on {back:.1f} s after")
    return good and not unsaid and not set(answers) - {200, 503}


def control(options):
    """Jobs are paused, resumed and cancelled through any node, and a node that works one is asked to end."""
    plant, count, worst, away = Plant(options, slice_s=10), options.count or 20, {}, 0.0
    endless = 300_000

    def until(identifier, status):
        client, began = random.choice(plant.nodes).client(), time.monotonic()
        while (client.show(identifier) or {}).get("status") != status:
            time.sleep(0.005)
        return time.monotonic() - began

    def submit(seed):
        identifier = random.choice(plant.nodes).client().submit(job(plant.dataset, endless, seed))
        until(identifier, "running")
        time.sleep(random.uniform(0, 1))
        return identifier

    def worked_in(identifier):
        return plant.database.sql(f"select at_work_in from jobs where id = '{identifier}'")[0][0]

    for turn in range(count):
        identifier = submit(turn)
        for what, status in (("pause", "paused"), ("resume", "running"), ("cancel", "cancelled")):
            began = time.monotonic()
            random.choice(plant.nodes).client().ask("POST", f"/v1/jobs/{identifier}/{what}")
            until(identifier, status)
            worst[what] = max(worst.get(what, 0), time.monotonic() - began)
    for turn in range(count):
        identifier = submit(turn)
        life = worked_in(identifier)
        node = next(node for node in plant.nodes if plant.life(node) == int(life))
        node.process.terminate()
        began = time.monotonic()
        while worked_in(identifier) in ("", life):
            time.sleep(0.005)
        away = max(away, time.monotonic() - began)
        plant.renew(node.number)
        plant.nodes[0].client().ask("POST", f"/v1/jobs/{identifier}/cancel")
    figures = ", ".join(f"{what} {took:.2f} s" for what, took in worst.items())
    plant.close()
    print(f"nodes_control: {count} times {figures} at the most, asked and seen at any node; after SIGTERM at work "
          f"elsewhere in {away:.2f} s at the most", flush=True)
    return max(worst.values()) <= 2 and away <= 1


def needs_postgres(measure):
    def measured(options):
        if postgres.programs() is None:
            print(f"nodes_{measure.__name__}: NOT MEASURED: PostgreSQL is not installed")
            return True
        return measure(options)
    return measured


ALL = {f"nodes_{measure.__name__}": needs_postgres(measure)
       for measure in (kills, database, still, cut, failover, clock, exhausted, control)}
