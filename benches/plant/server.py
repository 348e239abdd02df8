"""The program as a process on a database of its own, a client that keeps its connection, and a small
plant for it to identify."""

import atexit
import http.client
import json
import os
import resource
import signal
import subprocess
import time

CARRIAGE_STEP_S = 0.02


def carriage(samples):
    """A recording of 2 kg with 3 N·s/m of friction under a square wave, as CSV."""
    position = velocity = 0.0
    lines = ["time [s],force [N],position [m]"]
    for k in range(samples):
        force = 20.0 if (k // 17) % 2 == 0 else -20.0
        lines.append(f"{k * CARRIAGE_STEP_S:.2f},{force},{position:.9g}")
        for _ in range(4):
            velocity += CARRIAGE_STEP_S / 4 * (force - 3.0 * velocity) / 2.0
            position += CARRIAGE_STEP_S / 4 * velocity
    return "\n".join(lines) + "\n"


def job(dataset, generations=5, seed=1, population=8, **method):
    """A job that finds its parameters."""
    return {
        "model": "positioning_drive",
        "experiments": [{"dataset": dataset}],
        "parameters": {
            "mass": {"estimate": {"lower": 0.5, "upper": 10}},
            "viscous_friction": {"estimate": {"lower": 0.1, "upper": 20}},
        },
        "outputs": {"position": {"noise_std": 1e-3}},
        "method": {"population": population, "generations": generations, "stagnation_generations": 0,
                   "noise_floor": False, **method},
        "seed": seed,
    }


class Client:
    """Asks over one connection, a new one where that broke off."""

    def __init__(self, address, headers=None):
        self.address, self.headers, self.connection, self.used = address, headers or {}, None, 0.0
        # The body of the last answer as it came.
        self.text = b""

    def ask(self, method, path, body=None, headers=None, timeout=60):
        """Status, body (JSON where it is that) and headers; status 0 where there is no answer."""
        own = {**self.headers, **(headers or {})}
        if isinstance(body, dict):
            body, own["content-type"] = json.dumps(body), "application/json"
        # The server lets a connection go that was idle for half a minute.
        if time.monotonic() - self.used > 10:
            self.close()
        try:
            if self.connection is None:
                host, port = self.address
                self.connection = http.client.HTTPConnection(host, port, timeout=timeout)
            self.connection.request(method, path, body, own)
            answer = self.connection.getresponse()
            text = self.text = answer.read()
            self.used = time.monotonic()
        except (OSError, http.client.HTTPException):
            self.close()
            return 0, None, {}
        is_json = "json" in answer.headers.get("content-type", "")
        return answer.status, json.loads(text) if is_json else text, answer.headers

    def close(self):
        if self.connection is not None:
            self.connection.close()
            self.connection = None

    def store(self, samples):
        status, body, _ = self.ask("POST", "/v1/datasets", carriage(samples), {"content-type": "text/csv"})
        assert status in (200, 201), body
        return body["id"]

    def submit(self, spec, key=None):
        """The identifier of a job that was acknowledged, or nothing."""
        headers = {"idempotency-key": key} if key else None
        status, body, _ = self.ask("POST", "/v1/jobs", spec, headers)
        return body["id"] if status == 202 else None

    def show(self, identifier):
        status, body, _ = self.ask("GET", f"/v1/jobs/{identifier}")
        return body if status == 200 else None

    def ended(self, identifier):
        while True:
            _, body, _ = self.ask("GET", f"/v1/jobs/{identifier}?wait=20")
            if body and body.get("status") in ("succeeded", "failed", "cancelled"):
                return body


class Server:
    def __init__(self, options, folder, *settings, environment=None, database="jobs.db", url=None):
        self.program, self.folder, self.settings = options.program, folder, list(settings)
        self.path = os.path.join(folder, database)
        self.url = url or f"sqlite://{self.path}"
        self.environment = {**os.environ, **(environment or {})}
        self.process = None
        # The address at which the server listens; with port 0 the system chooses one at each start.
        self.listen = "127.0.0.1:0"
        # Where the process writes why it does not start.
        self.errors = subprocess.DEVNULL
        # A measurement that breaks off leaves no server behind.
        atexit.register(self.cut)

    def cut(self):
        if self.process is not None:
            self.process.kill()

    def start(self):
        """Starts it; says whether it answers."""
        command = [self.program, "serve", "--listen", self.listen, "--log", "error",
                   "--database", self.url, *self.settings]
        # A file that may not grow is to be an error that is answered, not the end of the process.
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=self.errors, text=True,
            restore_signals=False, env=self.environment)
        line = self.process.stdout.readline()
        if not line:
            self.process.wait()
            return False
        host, port = line.split()[-1].removeprefix("http://").split(":")
        self.address = (host, int(port))
        return True

    def client(self, token=None):
        return Client(self.address, {"authorization": f"Bearer {token}"} if token else None)

    def limit_files(self, limit):
        """What a file may have at the most: a full disk."""
        limit = resource.RLIM_INFINITY if limit is None else limit
        resource.prlimit(self.process.pid, resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def terminate(self):
        """Asks it to end; answers how long that took."""
        began = time.monotonic()
        self.process.send_signal(signal.SIGTERM)
        self.process.wait()
        self.process.stdout.close()
        return time.monotonic() - began

    def memory_mib(self):
        with open(f"/proc/{self.process.pid}/status") as status:
            line = next(line for line in status if line.startswith("VmRSS"))
        return int(line.split()[1]) / 1024

    def command(self, *arguments, database=None):
        """A command of the program on the database: its status and what it says."""
        command = [self.program, *arguments, "--database", f"sqlite://{database or self.path}"]
        done = subprocess.run(command, capture_output=True, text=True)
        return done.returncode, (done.stdout + done.stderr).strip()

    def token(self, name, scope="submit", project="default"):
        _, said = self.command("token", "create", "--name", name, "--scope", scope, "--project", project)
        return next(word for word in said.split() if word.startswith("gbx_"))


def percentile(values, share):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(share * len(ordered)))] if ordered else float("nan")
