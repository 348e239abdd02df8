"""kill -9 of a server at random moments while clients make, change and end all kinds of resources."""

import os
import random
import shutil
import tempfile
import threading
import time
import traceback

from acknowledged import Cut, Ledger
from resource_access import Deliveries, Receiver, Tokens, Webhooks
from resource_documents import Lines, Mappings, Models, Recordings
from resource_jobs import Comparisons, Designs, Jobs, Selections, past_job
from resource_monitors import Monitors
from resource_streams import Streams
from server import Server

SEED = 20261127
# The kinds of resources whose calls one client makes in turns.
CLIENTS = ((Jobs,), (Designs, Selections, Comparisons), (Streams,), (Monitors,), (Recordings, Models),
           (Mappings, Lines), (Webhooks, Tokens))
# How long a life lasts [s], and how long one of so many lives, so that more comes to its end.
SHORT_S, LONG_S, LONG_ONE_OF = (0.03, 0.35), (0.8, 1.5), 40
# The share of lives that end while the server starts, and how long they last at the most [s].
KILLED_AT_START, START_S = 0.05, 0.06
# The longest pause of a client between two calls [s].
PAUSE_S = 0.02
# How long deliveries may take when nothing kills the server any more.
PATIENCE_S = 120
# Kills between two lines of progress.
PROGRESS = 250
# How a server refuses to start whose database is held, and for how long it is started again [s].
IN_USE, START_PATIENCE_S = "is in use by another greybox server", 30


class Plant:
    """A server, and what its clients know."""

    def __init__(self, options, folder):
        self.seed, self.ledger, self.life = SEED, Ledger(), 0
        self.random, self.is_killed = random.Random(SEED), threading.Event()
        # The states in which jobs were shown to have ended, and the runs of comparisons that were deleted.
        self.ends, self.runs_gone = {}, []
        self.server = Server(options, folder, "--slice-s", "0.1", "--requests-per-second", "100000",
                             "--webhook-to", "127.0.0.1")
        self.server.errors = open(os.path.join(folder, "errors"), "w+")
        # Starts that were refused because a command on tokens held the database.
        self.refused_starts = 0
        self.token = self.server.token("clients", "admin")
        assert self.server.start(), "the server did not start"
        self.receiver = Receiver(self)
        client = self.client()
        webhook = {"url": f"{self.receiver.url}/every-end", "events": ["job.ended"]}
        status, made, _ = client.ask("POST", "/v1/webhooks", webhook)
        assert status == 201, made
        self.receiver.secrets["/every-end"] = made["secret"]
        self.deliveries = Deliveries(self, made["id"])
        self.webhook = f"/v1/webhooks/{made['id']}"
        self.datasets = [client.store(samples) for samples in (60, 100, 150)]
        self.past_job = past_job(client)
        self.clients = [[kind(self) for kind in kinds] for kinds in CLIENTS]
        self.kinds = [kind for kinds in self.clients for kind in kinds]

    def client(self):
        return self.server.client(self.token)

    def note_end(self, job, status):
        if self.ends.setdefault(job, status) != status:
            self.ledger.fault("contradicted", f"{job} had ended as {self.ends[job]} and is now {status}")

    def note_silence(self, call):
        """A call without an answer is one that a kill cut off."""
        if not self.is_killed.wait(0.5):
            self.ledger.fault("unexpected", f"life {self.life}: {call} has no answer though nothing killed the server")

    def kill(self):
        self.is_killed.set()
        self.server.process.kill()

    def work(self, kinds):
        """Makes the calls of one client until the server is killed."""
        draw = random.Random(f"{SEED} {self.life} {kinds[0].name}")
        client = self.client()
        try:
            for kind in kinds:
                kind.check(client)
            while not self.is_killed.is_set():
                draw.choice(kinds).act(client)
                time.sleep(draw.uniform(0, PAUSE_S))
        except Cut:
            pass
        except Exception:
            self.ledger.fault("unexpected", f"life {self.life}: {traceback.format_exc()}")
        finally:
            client.close()

    def live(self):
        """One life of the server that runs, to its kill."""
        lasts = self.random.uniform(*(LONG_S if self.life % LONG_ONE_OF == 0 else SHORT_S))
        killer = threading.Timer(lasts, self.kill)
        clients = [threading.Thread(target=self.work, args=(kinds,), daemon=True) for kinds in self.clients]
        for thread in (killer, *clients):
            thread.start()
        for thread in (killer, *clients):
            thread.join()
        self.await_end()

    def await_end(self):
        """Waits for the end of the process that was killed."""
        self.server.process.wait()
        self.server.process.stdout.close()

    def start(self):
        """Starts the server; it may be killed meanwhile. How many kills that took."""
        kills = 0
        while self.random.random() < KILLED_AT_START:
            killer = threading.Timer(self.random.uniform(0, START_S), self.kill)
            killer.start()
            is_up = self.server.start()
            killer.join()
            self.server.process.kill()
            if is_up:
                self.await_end()
            kills += 1
        self.begin_life()
        return kills

    def begin_life(self):
        """Starts the server, again where a command on tokens holds the database, as systemd does it."""
        self.life += 1
        self.is_killed.clear()
        until = time.monotonic() + START_PATIENCE_S
        while not self.server.start():
            self.server.errors.seek(0)
            text = self.server.errors.read()
            if IN_USE not in text or self.tokens().command is None:
                self.ledger.fault("unexpected", f"life {self.life}: the server did not start: {text}")
            self.refused_starts += 1
            self.server.errors.seek(0)
            self.server.errors.truncate()
            assert time.monotonic() < until, "the server did not start again"
            time.sleep(0.01)

    def tokens(self):
        return next(kind for kind in self.kinds if kind.name == "tokens")

    def listed(self, client, path):
        """All items of a list."""
        sign, token = "&" if "?" in path else "?", None
        while True:
            status, page, _ = client.ask("GET", f"{path}{sign}limit=500" + (f"&page_token={token}" if token else ""))
            assert status == 200, page
            yield from page["items"]
            token = page.get("next_page_token")
            if not token:
                return

    def expected(self):
        """What each list is to hold, by its path and the name of the identifier, and what it may hold besides."""
        kinds = {kind.name: kind for kind in self.kinds}
        names = {name: {path.rsplit("/", 1)[1] for path in kind.things} for name, kind in kinds.items()}
        runs = {run[0] for thing in kinds["comparisons"].things.values() for run in thing.runs}
        stream, lines = kinds["streams"], kinds["requests of agents"]
        streams = {"line"} | ({stream.path.rsplit("/", 1)[1]} if stream.values is not None else set())
        parts = {path.rsplit("/", 1)[1] for path in lines.streams}
        mapped = {lines.mapping.rsplit("/", 1)[1]}
        return {
            ("/v1/jobs?view=summary", "id"): (names["jobs"] | names["designs"] | names["selections"] | runs
                                              | {self.past_job}, set()),
            ("/v1/comparisons", "id"): (names["comparisons"], set()),
            ("/v1/monitors", "id"): (set(), set()),
            ("/v1/streams", "name"): (streams, parts),
            ("/v1/datasets", "id"): (names["recordings"] | set(self.datasets), {self.past_dataset()}),
            ("/v1/models", "name"): (names["models"], set()),
            ("/v1/mappings", "name"): (names["mappings"], mapped),
            ("/v1/webhooks", "id"): (names["webhooks"] | {self.webhook.rsplit("/", 1)[1]}, set()),
        }

    def past_dataset(self):
        return self.client().show(self.past_job)["spec"]["experiments"][0]["dataset"]

    def check_lists(self, client):
        """The server lists what was acknowledged and nothing else."""
        for (path, name), (expected, possible) in self.expected().items():
            if path in ("/v1/mappings", "/v1/webhooks", "/v1/models"):
                items = client.ask("GET", path)[1]["items"]
                # Models of the program, and that of the monitors, are no documents of a client.
                items = [item for item in items if path != "/v1/models" or item["name"].startswith("stored_lag@")]
            else:
                items = list(self.listed(client, path))
            names = [item[name] for item in items]
            for missing in expected - set(names):
                self.ledger.fault("lost", f"{path} does not list {missing}")
            for more in set(names) - expected - possible:
                self.ledger.fault("doubled", f"{path} lists {more}, which no acknowledged call made")
            if len(names) != len(set(names)):
                self.ledger.fault("doubled", f"{path} lists something twice: {names}")
        for run in self.runs_gone:
            if client.show(run) is not None:
                self.ledger.fault("contradicted", f"the run {run} was deleted and is shown again")

    def end(self):
        """Looks at everything with a server that nobody kills; how many ends of jobs were delivered."""
        self.begin_life()
        client = self.client()
        for kind in self.kinds:
            try:
                kind.check_all(client)
            except Exception:
                self.ledger.fault("unexpected", f"the last look at {kind.name}: {traceback.format_exc()}")
        self.check_lists(client)
        until, items = time.monotonic() + PATIENCE_S, self.deliveries.all(client)
        while any(item["state"] == "waiting" for item in items) and time.monotonic() < until:
            time.sleep(1)
            items = self.deliveries.all(client)
        ends = self.deliveries.check(items)
        self.server.terminate()
        status, text = self.server.command("check")
        if status != 0:
            self.ledger.fault("changed", f"`greybox check` is not content: {text}")
        return ends


def resources(options):
    """Kills one server on one database while all kinds of resources are made, changed and ended."""
    count, kills, began, shown = options.count or 300, 0, time.monotonic(), 0
    folder = tempfile.mkdtemp()
    print(f"resources: the seed is {SEED}; the database is in {folder} and stays there after a fault", flush=True)
    plant = Plant(options, folder)
    while kills < count:
        plant.live()
        kills += 1
        if kills < count:
            kills += plant.start()
        if kills // PROGRESS > shown:
            shown = kills // PROGRESS
            size = os.path.getsize(plant.server.path) / 2**20
            print(f"resources: {kills} kills in {time.monotonic() - began:.0f} s, {size:.0f} MiB; "
                  f"{plant.ledger.line()}", flush=True)
    ends = plant.end()
    print(f"resources: {kills} kills in {time.monotonic() - began:.0f} s; {plant.ledger.line()}; "
          f"{plant.receiver.count()} deliveries taken, {ends} ends of jobs delivered to the webhook that stays; "
          f"{plant.refused_starts} starts refused while a command on tokens held the database", flush=True)
    if plant.ledger.is_good():
        shutil.rmtree(folder)
    return plant.ledger.is_good()
