"""A database with some of every kind of thing, and the questions that show what stands in it."""

import base64
import hashlib
import hmac
import json
import math
import random
import sqlite3
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

from server import Server
from server import job as searched

CSV, TEXT = {"content-type": "text/csv"}, {"content-type": "text/plain"}
SETTINGS = ("--webhook-to", "127.0.0.0/8", "--requests-per-second", "100000", "--threads", "1")
# A recording of more than 1 MiB is stored in several parts.
LARGE_SAMPLES, SMALL_SAMPLES = 75_000, 120
# A job that does not come to its end within this time is taken for one that never does [s].
LONGEST_JOB_S = 60
WINDOW_SAMPLES, SAMPLE_TIME_S, WINDOWS = 100, 0.1, 4
LAG = {
    "name": "lag",
    "inputs": {"u": {"unit": "V"}},
    "parameters": {
        "time": {"symbol": "T", "unit": "s", "default": 1, "lower": 0.1, "upper": 10, "scale": "log", "unknown": True},
        "gain": {"symbol": "K", "unit": "", "default": 1, "lower": 0.1, "upper": 10, "unknown": True},
    },
    "states": {"x": {"unit": "V", "derivative": "(gain*u - x)/time", "initial": 0}},
    "outputs": {"y": {"unit": "V", "expression": "x"}},
}
LAG_START = {"x": {"estimate": {"lower": -5, "upper": 5}}}
METHOD = {"population": 8, "generations": 4, "further_searches": 0, "stagnation_generations": 0, "noise_floor": False}
LINES = "rig,hall=2 position=101.2 1465839830100400200\nrig,hall=2 position=101.3 1465839831100400200\n"
RULES = {"rules": [{"measurement": "rig", "tags": {"hall": "2"}, "stream": "rig-4",
                    "signals": {"position": {"signal": "position", "unit": "mm"}}}]}
DESIGN = {
    "model": "positioning_drive",
    "parameters": {"mass": {"estimate": {}, "prior": {"mean": 95, "std": 10}},
                   "viscous_friction": {"estimate": {}, "prior": {"mean": 200, "std": 50}},
                   "coulomb_friction": {"value": 20, "tolerance": "10 %"}, "offset": {"value": 0}},
    "initial_state": {"position": 0, "velocity": 0},
    "outputs": {"position": {"noise_std": 1e-5}},
    "inputs": {"force": {"lower": -100, "upper": 100, "rate_per_s": 1e4}},
    "sample_time_s": 0.01, "duration_s": 1, "families": ["steps"], "wanted": ["mass"],
}
# These lines of the metrics tell of the database and are the same in each life of a server.
METRICS = ("greybox_stored_bytes", "greybox_jobs{")


def job(dataset, generations=3, seed=1, model=LAG, window=None, **method):
    """A job that is worked in a short time."""
    experiment = {"dataset": dataset, "initial_state": LAG_START, **({"window": window} if window else {})}
    return {"model": model, "experiments": [experiment], "outputs": {"y": {"noise_std": 0.02}}, "seed": seed,
            "process_noise": "none", "method": {**METHOD, "generations": generations, **method}}


def drive(dataset):
    """A job with a model of the catalogue."""
    return {**searched(dataset, 3, further_searches=0), "process_noise": "none"}


def recording(samples):
    """A recording of the plant, as CSV."""
    signals = Lag().window(0, 2.0, samples)["signals"]
    rows = zip(signals["u"]["values"], signals["y"]["values"])
    return "\n".join(["time [s],u [V],y [V]"] + [f"{k * SAMPLE_TIME_S:.1f},{u},{y}" for k, (u, y) in enumerate(rows)])


class Lag:
    """A plant of first order under a square wave, window after window."""

    def __init__(self):
        self.output, self.random = 0.0, random.Random(1)

    def window(self, number, gain, samples=WINDOW_SAMPLES):
        inputs, outputs = [], []
        for k in range(samples):
            inputs.append(2.0 if (k // 18) % 2 == 0 else -2.0)
            outputs.append(self.output + self.random.gauss(0, 0.02))
            decay = math.exp(-SAMPLE_TIME_S / 1.5)
            self.output = gain * inputs[-1] + (self.output - gain * inputs[-1]) * decay
        seconds = int(number * WINDOW_SAMPLES * SAMPLE_TIME_S)
        start = f"2026-03-02T08:{seconds // 60:02}:{seconds % 60:02}Z"
        return {"start": start, "sample_time_s": SAMPLE_TIME_S,
                "signals": {"u": {"unit": "V", "values": inputs}, "y": {"unit": "V", "values": outputs}}}


def history():
    """Twelve windows of a lag of which the input moves in every third."""
    x, lines = 2.0, ["time,u [-],y [-]"]
    for k in range(12 * 60):
        window, second = divmod(k, 60)
        u = 1.5 + 0.1 * window if window % 3 == 1 and second // 15 % 2 == 1 else 1.0
        lines.append(f"2026-03-02T08:{k // 60:02}:{k % 60:02}Z,{u},{round(x + 0.01 * math.sin(k * 7.3), 2)}")
        x = 2 * u + math.exp(-0.2) * (x - 2 * u)
    return "\n".join(lines) + "\n"


class Receiver:
    """Takes deliveries and says whether each is signed with the secret of its webhook."""

    def __init__(self):
        self.secrets, self.taken, self.lock = {}, [], threading.Lock()
        receiver = self

        class Handler(BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["content-length"]))
                receiver.take(self.path, self.headers, body)
                self.send_response(410 if self.path == "/gone" else 204)
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def take(self, path, headers, body):
        secret = self.secrets.get(path)
        signed = None
        if secret:
            content = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
            key = base64.b64decode(secret.removeprefix("whsec_"))
            digest = hmac.new(key, content, hashlib.sha256).digest()
            signed = f"v1,{base64.b64encode(digest).decode()}" in headers["webhook-signature"].split()
        with self.lock:
            self.taken.append((path, json.loads(body).get("type"), signed))

    def wait(self, after, count, limit):
        """The kinds of deliveries after the first so many, once there are enough of them or after the limit."""
        until = time.monotonic() + limit
        while sum(path == "/good" for path, *_ in self.taken[after:]) < count and time.monotonic() < until:
            time.sleep(0.005)
        with self.lock:
            return sorted({delivery for delivery in self.taken[after:] if delivery[0] == "/good"}, key=str)


class Plant:
    """Makes the database of a file and keeps what is needed to ask for everything in it."""

    def __init__(self, options, folder):
        self.receiver, self.streams, self.lag, self.keyed = Receiver(), {}, Lag(), []
        self.server = Server(options, folder, *SETTINGS)
        self.token = self.server.token("driver", "admin")
        append = ("token", "create", "--name", "agent", "--scope", "append", "--streams", "rig-4,lag")
        self.tokens = [self.server.token("reads", "read"), self.server.token("hall", "submit", "hall-2"),
                       self.server.token("gone", "read"), secret_of(self.server.command(*append)[1])]
        self.server.command("token", "revoke", "gone")
        assert self.server.start(), "the server did not start"
        self.client = self.server.client(self.token)
        self.make_recordings()
        self.make_streams()
        self.make_jobs()
        self.make_the_rest()
        self.paused = self.pause()
        self.cookie = self.ask("POST", "/v1/session", {"token": self.token})["cookie"].split(";")[0]
        time.sleep(0.5)
        self.server.terminate()
        self.let_audit_entries_go()

    def ask(self, method, path, body=None, headers=None, expected=(200, 201, 202, 204)):
        status, answer, sent = self.client.ask(method, path, body, headers)
        assert status in expected, (method, path, status, answer)
        return answer if not isinstance(answer, dict) else {**answer, "cookie": sent.get("set-cookie")}

    def ask_with_key(self, method, path, body, headers=None):
        """A request with a key, which each trial sends again."""
        headers = {**(headers or {}), "idempotency-key": f"key {len(self.keyed)}"}
        answer = self.ask(method, path, body, headers)
        self.keyed.append((method, path, body, headers))
        return answer

    def store(self, samples):
        return self.ask("POST", "/v1/datasets", recording(samples), CSV)["id"]

    def make_recordings(self):
        self.drive = self.client.store(SMALL_SAMPLES)
        self.small, self.large = self.store(SMALL_SAMPLES), self.store(LARGE_SAMPLES)
        text = "time [s],force [N],position [m]\n0,1,0\n0.02,1,0.1\n0.05,2,0.2\n0.1,2,0.4\n"
        self.ask("POST", "/v1/datasets?name=four%20samples", text, CSV)

    def make_streams(self):
        for number in range(WINDOWS):
            self.append(number, 2.0 if number < 3 else 4.0)
        self.ask_with_key("POST", "/v1/streams/line?keep_s=1e9", history(), CSV)
        self.part = self.ask("POST", "/v1/streams/line/recordings",
                             {"from": "2026-03-02T08:00:00Z", "to": "2026-03-02T08:06:00Z"})["id"]
        self.lag_part = self.ask("POST", "/v1/streams/lag/recordings",
                                 {"from": "2026-03-02T08:00:00Z", "to": "2026-03-02T08:00:20Z"})["id"]
        self.ask("PUT", "/v1/mappings/plant", RULES)
        self.ask("POST", "/write?db=plant", LINES + "other,hall=3 speed=1.5 1465839831100400200\n", TEXT)

    def append(self, number, gain):
        batch = self.lag.window(number, gain)
        self.ask_with_key("POST", "/v1/streams/lag", batch, None)

    def make_jobs(self):
        self.webhooks = []
        for path in ("/good", "/gone"):
            webhook = self.ask("POST", "/v1/webhooks", {"url": self.receiver.url + path, "events": ["job.ended"]})
            self.receiver.secrets[path] = webhook["secret"]
            self.webhooks.append(webhook["id"])
        self.model = self.ask("POST", "/v1/models", LAG)["name"]
        name = {"name": "carriage", "labels": {"site": "hall 2", "line": "4"}}
        jobs = [self.ask_with_key("POST", "/v1/jobs", {**drive(self.drive), **name})["id"]]
        lag = job(self.lag_part, seed=3, model=self.model)
        posterior = {**lag, "uncertainty": {"intervals": "posterior", "posterior_generations": 500}}
        disturbed = {**lag, "process_noise": [{"acts_on": {"state": "x"}, "kind": "memory", "std": 0.1,
                                               "time_constant_s": 2}]}
        # Two factors that no output tells apart: the job fails.
        failed = {**lag, "model": {**LAG, "parameters": {**LAG["parameters"], "factor": LAG["parameters"]["gain"]},
                                   "states": {"x": {**LAG["states"]["x"], "derivative": "(gain*factor*u - x)/time"}}}}
        failed["model"]["parameters"]["factor"] = {**LAG["parameters"]["gain"], "symbol": "F"}
        jobs += [self.ask("POST", "/v1/jobs", spec)["id"] for spec in (posterior, disturbed, failed)]
        line = {"model": "first_order_dead_time",
                "experiments": [{"dataset": self.part, "initial_state": {"lagged": {"value": 2}}}],
                "parameters": {"gain": {"estimate": {"lower": 1, "upper": 4}}, "time_constant": {"estimate": {}},
                               "dead_time": {"value": 0}, "offset": {"value": 0}},
                "method": {"name": "multistart_lm", "population": 8, "generations": 2, "further_searches": 0},
                "process_noise": "none", "validation": {"fraction": 0}, "seed": 1}
        self.line = self.ask("POST", "/v1/jobs", line)["id"]
        jobs += [self.line]
        cancelled = self.client.submit(job(self.small, 100_000, refine=False))
        self.ask("POST", f"/v1/jobs/{cancelled}/cancel")
        [self.client.ended(identifier) for identifier in [*jobs, cancelled]]

    def make_the_rest(self):
        compared = {"job": {**drive(self.drive), "labels": {"site": "hall 2"}},
                    "methods": ["icra_genetic", "multistart_lm"], "seeds": 1}
        self.comparison = self.ask_with_key("POST", "/v1/comparisons", compared)["id"]
        selection = {"job": self.line, "stream": "line", "window_s": 60, "wanted": ["time_constant"],
                     "budget_samples": 120, "initial_state": {"lagged": {"estimate": {"lower": 0, "upper": 6}}}}
        self.ask_with_key("POST", "/v1/selections", selection)
        self.ask_with_key("POST", "/v1/designs", DESIGN, {"prefer": "respond-async"})
        watched = {"name": "a lag", "stream": "lag", "window": {"length_s": WINDOW_SAMPLES * SAMPLE_TIME_S},
                   "alarms": {"false_alarm_rate": 0.001, "data_stopped_after_s": 0.05},
                   "job": {"model": self.model, "outputs": {"y": {"noise_std": 0.02}}, "method": METHOD,
                           "experiments": [{"initial_state": LAG_START}]}}
        self.monitor = self.ask_with_key("POST", "/v1/monitors", watched)["id"]
        wait_for(self.client, f"/v1/monitors/{self.monitor}/windows?limit=100", WINDOWS - 1)
        wait_for(self.client, f"/v1/monitors/{self.monitor}/alarms", 1)
        for listed in self.ask("GET", "/v1/jobs?limit=100")["items"]:
            self.client.ended(listed["id"])

    def pause(self):
        """A job that is paused in its middle, after a checkpoint."""
        for seed in range(7, 100):
            identifier = self.client.submit(job(self.small, 12_000, seed, refine=False))
            while (shown := self.client.show(identifier))["status"] in ("queued", "running"):
                if ((shown.get("progress") or {}).get("generation") or 0) > 20:
                    self.client.ask("POST", f"/v1/jobs/{identifier}/pause")
                time.sleep(0.002)
            if shown["status"] == "paused":
                return identifier
            # The job has ended before the request came.
            self.ask("DELETE", f"/v1/jobs/{identifier}")
        raise AssertionError("no job could be paused in its middle")

    def let_audit_entries_go(self):
        """Lets the oldest entries of the audit log go by the statements by which a server does."""
        opened = sqlite3.connect(self.server.path)
        trigger, = opened.execute("select sql from sqlite_master where name = 'audit_is_kept'").fetchone()
        opened.execute("drop trigger audit_is_kept")
        opened.execute("insert into audit_anchor (id, entry, chain) select 1, id, chain from audit where id = 3")
        opened.execute("delete from audit where id <= 3")
        opened.execute(trigger)
        opened.commit()
        opened.execute("pragma wal_checkpoint(truncate)")
        opened.close()


def secret_of(text):
    """The secret in what a command tells of a new token."""
    return next(word for word in text.split() if word.startswith("gbx_"))


def wait_for(client, path, count, limit=LONGEST_JOB_S):
    """The answer of a list once it has so many items, or after the limit."""
    until = time.monotonic() + limit
    while True:
        status, body, _ = client.ask("GET", path)
        if status != 200 or len(body["items"]) >= count or time.monotonic() > until:
            return status, body
        time.sleep(0.02)
