"""Webhooks and tokens of a server that is killed, and the receiver of what webhooks deliver."""

import base64
import hashlib
import hmac
import http.server
import json
import subprocess
import tempfile
import threading

from acknowledged import Kind, digest
from server import Client

# Webhooks that are there at the most beside the first one, which stays.
MOST_WEBHOOKS = 6
# One of so many deliveries is refused at its first attempt.
REFUSES_ONE_OF = 100
# Tokens that count at a time, and revoked ones that are looked at in each life.
MOST_TOKENS, REVOKED_LOOKED_AT = 5, 3


class Receiver:
    """A web server on this machine that takes deliveries and notes them."""

    def __init__(self, plant):
        self.plant, self.lock = plant, threading.Lock()
        # By the path of a webhook: its secret, its deliveries by their number, and the life of its removal.
        self.secrets, self.taken, self.removed = {}, {}, {}
        receiver = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                body = self.rfile.read(int(self.headers["content-length"]))
                self.send_response(receiver.take(self.path, self.headers, body))
                self.send_header("content-length", "0")
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.server.daemon_threads = True
        self.server.handle_error = lambda *_: None
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def take(self, path, headers, body):
        """Notes a delivery; the status that it is answered with."""
        number, life = headers["webhook-id"], self.plant.life
        with self.lock:
            taken = self.taken.setdefault(path, {})
            before, taken[number] = taken.get(number), digest(body)
            is_first, removed, secret = before is None, self.removed.get(path), self.secrets.get(path)
        if before not in (None, digest(body)):
            self.fault("changed", f"the delivery {number} to {path} came with another body", body)
        # What was on its way at the removal may come in the same life.
        if removed is not None and life > removed + 1:
            self.fault("contradicted", f"{path} was removed in life {removed} and is delivered to in life {life}")
        if secret is not None and not self.is_signed(secret, number, headers, body):
            self.fault("changed", f"the delivery {number} to {path} is not signed with the secret that was told")
        return 500 if is_first and int(digest(number.encode()), 16) % REFUSES_ONE_OF == 0 else 204

    @staticmethod
    def is_signed(secret, number, headers, body):
        text = f"{number}.{headers['webhook-timestamp']}.".encode() + body
        key = base64.b64decode(secret.removeprefix("whsec_"))
        signature = "v1," + base64.b64encode(hmac.new(key, text, hashlib.sha256).digest()).decode()
        return signature in headers["webhook-signature"].split()

    def fault(self, sort, text, shown=""):
        self.plant.ledger.fault(sort, f"deliveries, life {self.plant.life}: {text} {shown}")

    def count(self):
        with self.lock:
            return sum(len(taken) for taken in self.taken.values())


class Webhooks(Kind):
    """Webhooks that are made and deleted, beside one that stays and is told of the end of every job."""

    name = "webhooks"

    def act(self, client):
        draw = self.random.random()
        if len(self.things) < 2 or (draw < 0.4 and len(self.things) < MOST_WEBHOOKS):
            self.number += 1
            self.pending = {"url": f"{self.plant.receiver.url}/hook-{self.number}",
                            "events": [self.random.choice(("job.ended", "monitor.alarm"))]}
            _, answer = self.call(client, "POST", "/v1/webhooks", self.pending, accept=(201,))
            self.plant.receiver.secrets[f"/hook-{self.number}"] = answer["secret"]
            self.note(answer)
        elif draw < 0.6:
            self.look(client, self.some().path)
        else:
            self.remove(client, self.some())

    def note(self, made):
        body, self.pending = self.pending, None
        self.count("made")
        self.keep(f"/v1/webhooks/{made['id']}", shown=(body["url"], body["events"]), url=body["url"])

    def settle(self, client):
        """A creation that was cut off has made one webhook or none."""
        _, listed = self.call(client, "GET", "/v1/webhooks", accept=(200,))
        made = [item for item in listed["items"] if item["url"] == self.pending["url"]]
        if len(made) > 1:
            self.fault("doubled", f"one call made the webhooks {made}")
        if made:
            self.note(made[0])
        self.pending = None

    def stable(self, client, body):
        return body["url"], body["events"]

    def forget(self, thing):
        super().forget(thing)
        self.plant.receiver.removed[thing.url.removeprefix(self.plant.receiver.url)] = self.plant.life


class Tokens(Kind):
    """Tokens that the command line makes and revokes beside a server that is killed."""

    name = "tokens"

    def __init__(self, plant):
        super().__init__(plant)
        # Secrets by name of those that count, of those that were revoked, and of those that may be either.
        self.live, self.revoked, self.unsure = {}, {}, {}
        self.command = None
        # Names of tokens that a call of the last life touched.
        self.news = {}

    def act(self, client):
        if self.command is not None:
            self.conclude()
        elif len(self.live) < 2 or (len(self.live) < MOST_TOKENS and self.random.random() < 0.5):
            self.number += 1
            self.begin("create", f"token-{self.number}", "--name", f"token-{self.number}", "--scope", "read")
        else:
            name = self.random.choice(list(self.live))
            self.unsure[name] = self.live.pop(name)
            self.begin("revoke", name, name)
        if self.live:
            self.try_token(*self.random.choice(list(self.live.items())), 200)

    def begin(self, word, name, *arguments):
        server, output = self.plant.server, tempfile.TemporaryFile("w+")
        process = subprocess.Popen([server.program, "token", word, *arguments, "--database", server.url],
                                   stdout=output, stderr=subprocess.STDOUT)
        self.command = (word, name, process, output)

    def conclude(self):
        """Notes what a command that has ended came to."""
        word, name, process, output = self.command
        if process.poll() is None:
            return
        output.seek(0)
        text, self.command = output.read(), None
        output.close()
        if process.returncode != 0:
            self.fault("unexpected", f"`greybox token {word}` of {name} ended with {process.returncode}", text)
            return
        self.count("made" if word == "create" else "revoked")
        if word == "create":
            self.live[name] = next(part for part in text.split() if part.startswith("gbx_"))
        else:
            self.revoked[name] = self.unsure.pop(name)
        self.news[name] = True

    def try_token(self, name, secret, wanted):
        """Asks with a token, which is taken or refused."""
        client = Client(self.plant.server.address, {"authorization": f"Bearer {secret}"})
        try:
            status, _ = self.call(client, "GET", "/v1/jobs?view=summary&limit=1", accept=(200, 401))
        finally:
            client.close()
        if status != wanted:
            sort = "lost" if wanted == 200 else "contradicted"
            self.fault(sort, f"{name}, {'made' if wanted == 200 else 'revoked'} by a command that ended well, is "
                       f"answered {status}")

    def try_tokens(self, names):
        for name in names:
            if name in self.live:
                self.try_token(name, self.live[name], 200)
            elif name in self.revoked:
                self.try_token(name, self.revoked[name], 401)

    def check(self, client):
        for name in list(self.news):
            self.try_tokens([name])
            self.news.pop(name, None)
        revoked = list(self.revoked)
        self.try_tokens(self.random.sample(revoked, min(REVOKED_LOOKED_AT, len(revoked))))

    def check_all(self, client):
        if self.command is not None:
            self.command[2].wait()
            self.conclude()
        self.try_tokens([*self.live, *self.revoked])
        _, text = self.plant.server.command("token", "list")
        words = [line.split() for line in text.splitlines()]
        for name in [*self.live, *self.revoked]:
            times = sum(name in line for line in words)
            if times != 1:
                self.fault("doubled" if times else "lost", f"{name} is listed {times} times")


class Deliveries:
    """What the webhook that stays was told of the ends of jobs."""

    def __init__(self, plant, webhook):
        self.plant, self.path = plant, f"/v1/webhooks/{webhook}/deliveries"

    def all(self, client):
        return list(self.plant.listed(client, self.path))

    def check(self, items):
        """Each end of a job is delivered, with one number, and tells the state that was shown."""
        by_job = {}
        for item in items:
            by_job.setdefault(item["payload"]["data"]["job"], []).append(item)
        with self.plant.receiver.lock:
            taken = dict(self.plant.receiver.taken.get("/every-end", {}))
        fault = self.plant.receiver.fault
        for job, status in self.plant.ends.items():
            of_job = by_job.get(job, [])
            if len(of_job) != 1:
                fault("doubled" if of_job else "lost", f"the end of {job} has {len(of_job)} deliveries")
                continue
            item = of_job[0]
            told = item["payload"]["data"]["status"]
            if item["state"] != "delivered" or item["id"] not in taken:
                fault("lost", f"the end of {job} was not delivered: {json.dumps(item)}")
            if told != status:
                fault("changed", f"the end of {job} was shown as {status} and delivered as {told}")
        return len(by_job)
