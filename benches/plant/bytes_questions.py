"""Every request that shows what stands in a database, and the work that reads what stands there."""

import http.client
import json
import re
import subprocess
import time

from bytes_plant import LINES, METRICS, TEXT, Lag, job, wait_for
from server import Client

# What an answer has that tells of damage; those to agents that write as to InfluxDB have no type.
DAMAGED = ("/problems/damaged-data", "does not read back", "the server's database is damaged")
# Events that have not come to their end within this time are taken for a stream without an end [s].
LONGEST_EVENTS_S = 8
# What rightly differs between two lives of a server on the same database.
OF_ITS_TIME = re.compile(r'"(request_id|uptime_s|instance)": ?("[^"]*"|[0-9.]+),?')


class TextClient(Client):
    """A client that also answers with texts as they come."""

    def __init__(self, server, token):
        super().__init__(server.address, {"authorization": f"Bearer {token}"})
        self.server = server

    def answer_as_text(self, method, path, body=None, headers=None):
        """The status and the text of an answer; of a refusal without what differs between two requests."""
        headers = {**self.headers, **(headers or {})}
        if isinstance(body, dict):
            body, headers["content-type"] = json.dumps(body), "application/json"
        if path.endswith("/events"):
            return self.events(path, headers)
        try:
            if self.connection is None:
                self.connection = http.client.HTTPConnection(*self.address, timeout=20)
            self.connection.request(method, path, body, headers)
            answer = self.connection.getresponse()
            text = answer.read().decode(errors="replace")
        except (OSError, http.client.HTTPException) as error:
            self.close()
            return 0, str(error)
        self.used = time.monotonic()
        return answer.status, OF_ITS_TIME.sub("", text) if answer.status >= 400 else text

    def events(self, path, headers):
        """A stream of events up to its end."""
        connection, text = http.client.HTTPConnection(*self.address, timeout=LONGEST_EVENTS_S), ""
        until = time.monotonic() + LONGEST_EVENTS_S
        try:
            connection.request("GET", path, headers=headers)
            answer = connection.getresponse()
            # A server that waits for another event sends a comment now and then.
            while line := answer.readline():
                text += line.decode(errors="replace")
                if time.monotonic() > until:
                    return 408, "the events did not end"
        except TimeoutError:
            return 408, "the events did not end"
        except (OSError, http.client.HTTPException) as error:
            return 0, str(error)
        finally:
            connection.close()
        return answer.status, OF_ITS_TIME.sub("", text) if answer.status >= 400 else text


class Questions:
    """The requests that show what a sound server has, and the work that is compared."""

    def __init__(self, plant, client):
        self.plant, self.client, self.last_entry, self.until = plant, client, 0, 0.0
        self.paths = [("GET", path, None, {}) for path in self.lists() + self.of_jobs() + self.of_others()]
        self.paths += [("GET", "/v1/jobs?limit=100", None, {"accept": "text/csv"}),
                       ("GET", f"/v1/monitors/{plant.monitor}/windows", None, {"accept": "text/csv"}),
                       ("GET", "/v1/streams/lag", None, {"accept": "text/csv"}),
                       ("GET", "/v1/session", None, {"cookie": plant.cookie, "authorization": ""})]
        self.paths += [("GET", "/v1/session", None, {"authorization": f"Bearer {token}"}) for token in plant.tokens]
        self.paths += plant.keyed
        _, audit, _ = client.ask("GET", "/v1/audit?limit=1")
        self.last_entry = audit["items"][0]["id"]

    def items(self, path):
        status, body, _ = self.client.ask("GET", path)
        assert status == 200, (path, body)
        return [item.get("id") or item.get("name") for item in body["items"]]

    def lists(self):
        listed = ["jobs", "datasets", "streams", "monitors", "comparisons", "audit"]
        filters = ["status=succeeded", "status=paused", "label=site:hall%202", "model=positioning_drive",
                   f"dataset={self.plant.small}", "method=icra_genetic", "trust=high", "text=carriage", "view=summary"]
        return [f"/v1/{name}?limit=100" for name in listed] + ["/v1/models", "/v1/mappings", "/v1/webhooks"] \
            + [f"/v1/jobs?{condition}" for condition in filters]

    def of_jobs(self):
        paths = []
        for identifier in self.items("/v1/jobs?limit=100"):
            parts = ["", "/result", "/generations", "/candidates", "/report", "/trajectory", "/disturbance",
                     "/posterior"]
            is_over = self.client.show(identifier)["status"] != "paused"
            paths += [f"/v1/jobs/{identifier}{part}" for part in parts + ["/events"] * is_over]
        return paths

    def of_others(self):
        paths = []
        for identifier in self.items("/v1/datasets?limit=100"):
            paths += [f"/v1/datasets/{identifier}", f"/v1/datasets/{identifier}/samples?max_points=100000",
                      f"/v1/datasets/{identifier}/samples?max_points=50"]
        for name in self.items("/v1/streams?limit=100"):
            paths += [f"/v1/streams/{name}", f"/v1/streams/{name}?max_points=20",
                      f"/v1/streams/{name}?from=2026-03-02T08:00:05Z&to=2026-03-02T08:00:15Z"]
        for webhook in self.plant.webhooks:
            paths += [f"/v1/webhooks/{webhook}", f"/v1/webhooks/{webhook}/deliveries?limit=100"]
            paths += [f"/v1/deliveries/{delivery}" for delivery in self.items(paths[-1])]
        monitor = f"/v1/monitors/{self.plant.monitor}"
        paths += [monitor, monitor + "/windows", monitor + "/alarms", f"/v1/comparisons/{self.plant.comparison}",
                  f"/v1/models/{self.plant.model}", "/v1/mappings/plant"]
        return paths

    def ask_all(self, client):
        """The status and the content of each answer."""
        answers = {}
        for method, path, body, headers in self.paths:
            status, content = client.answer_as_text(method, path, body, headers)
            if status == 200 and path.startswith("/v1/audit"):
                # What a server refuses in a trial stands in the log, too.
                items = json.loads(content)["items"]
                content = json.dumps([entry for entry in items if entry["id"] <= self.last_entry])
            accepted = "".join(f" as {headers[name][:18]}" for name in ("accept", "authorization") if name in headers)
            again = " again" if headers.get("idempotency-key") else ""
            answers[f"{method} {path}{accepted}{again}"] = status, content
        status, content = client.answer_as_text("GET", "/metrics")
        lines = content.splitlines() if status == 200 else [content]
        lines = sorted(line for line in lines if line.startswith(METRICS) or status != 200)
        answers["GET /metrics"] = status, "\n".join(lines)
        answers["token list"] = self.tokens(client)
        return answers

    def tokens(self, client):
        command = [client.server.program, "token", "list", "--database", client.server.url]
        listed = subprocess.run(command, capture_output=True, text=True, errors="replace")
        # When a token was used for the last time, which stands in the seventh column, differs between trials.
        rows = [line.split("|") for line in listed.stdout.splitlines()]
        lines = ["|".join(row[:7] + row[8:]) for row in rows]
        return (200, "\n".join(lines)) if listed.returncode == 0 else (503, listed.stderr[:200])

    def work(self, client, limit):
        """What comes of the job that was paused, of new jobs, of a batch and of deliveries, within a time [s]."""
        plant, answers = self.plant, {}
        self.until = time.monotonic() + limit
        before = len(plant.receiver.taken)
        status, body, _ = client.ask("POST", f"/v1/jobs/{plant.paused}/resume")
        answers["resume"] = status, plain(body if status >= 400 else "")
        jobs = {"paused job": plant.paused} if status < 400 else {}
        specs = {"job on the small recording": job(plant.small, 2),
                 "job with a stored model": job(plant.lag_part, 2, model=plant.model),
                 "job on the large recording": job(plant.large, 2, window={"from_s": 0, "to_s": 10})}
        for name, spec in specs.items():
            status, body, _ = client.ask("POST", "/v1/jobs", spec)
            answers[f"submit {name}"] = status, plain(body if status >= 400 else "")
            jobs.update({name: body["id"]} if status == 202 else {})
        part = {"from": "2026-03-02T08:00:10Z", "to": "2026-03-02T08:00:20Z"}
        status, body, _ = client.ask("POST", "/v1/streams/lag/recordings", part)
        answers["cut a part"] = status, plain(body if status >= 400 else body["digest"])
        answers.update((name, self.outcome(client, identifier)) for name, identifier in jobs.items())
        answers["append"] = client.answer_as_text("POST", "/write?db=plant", LINES,
                                        {**TEXT, "authorization": f"Bearer {plant.tokens[-1]}"})
        answers["next window"] = self.next_window(client)
        answers["deliveries"] = 200, str(plant.receiver.wait(before, len(jobs), limit=1))
        return answers

    def outcome(self, client, identifier):
        """The parameters that a job finds, or why it has none."""
        while time.monotonic() < self.until:
            status, body, _ = client.ask("GET", f"/v1/jobs/{identifier}?wait=2")
            if status != 200:
                return status, plain(body)
            if body["status"] in ("succeeded", "failed", "cancelled"):
                break
        else:
            return 408, "the job did not end"
        if body["status"] != "succeeded":
            damaged = any(words in json.dumps(body.get("error")) for words in DAMAGED)
            return (503 if damaged else 200), plain([body["status"], body.get("error")])
        status, body, _ = client.ask("GET", f"/v1/jobs/{identifier}/result")
        return status, plain(body["parameters"] if status == 200 else body)

    def next_window(self, client):
        """The estimate of the window that becomes due with a batch."""
        plant = Lag()
        batches = [plant.window(number, 2.0) for number in range(6)]
        status, body, _ = client.ask("POST", "/v1/streams/lag", batches[5])
        if status not in (200, 201):
            return status, plain(body)
        path = f"/v1/monitors/{self.plant.monitor}/windows?limit=100"
        while time.monotonic() < self.until:
            status, body = wait_for(client, path, 4, limit=2)
            if status != 200:
                return status, plain(body)
            rows = {row["number"]: row for row in body["items"]}
            if 3 in rows and rows[3]["status"] not in ("running", "queued"):
                return 200, plain([rows[3]["status"], rows[3]["parameters"]])
        return 408, "the window was not worked"


def plain(content):
    """An answer as a text without what rightly differs between two lives of a server."""
    if isinstance(content, bytes):
        return content.decode(errors="replace")
    return OF_ITS_TIME.sub("", content if isinstance(content, str) else json.dumps(content, sort_keys=True))
